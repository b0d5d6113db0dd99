"""What the command line says of itself: first steps, help, versions, completion, places."""

import inspect
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from command import run
from jaxglide import Problem, __version__, cli, landing_distance
from jaxglide._lib.fields import Parameter
from jaxglide.cli._help import COMMANDS, FIRST_STEPS, span
from jaxglide.cli.optimise import EFFORT
from places import ROOT

NAMES = [name for names in COMMANDS.values() for name in names]


@pytest.fixture(scope="module")
def root():
    return cli._parser()


def help_of(parser):
    return " ".join(parser.format_help().split())


def test_alone_it_shows_what_to_do_first(capsys, root):
    assert run(capsys) == (0, FIRST_STEPS, "")
    steps = re.findall(r"^  (jaxglide .*?)  ", FIRST_STEPS, re.MULTILINE)
    assert len(steps) == 4
    for step in steps:
        args = root.parse_args(shlex.split(step)[1:])
        assert args.command in NAMES


def test_it_says_its_version(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert (ended.value.code, capsys.readouterr().out) == (0, f"jaxglide {__version__}\n")


def test_commands_are_listed_by_purpose(capsys):
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    said = capsys.readouterr().out
    sections = dict(re.findall(r"^(\w[\w ]*):\n((?:  .*\n)+)", said, re.MULTILINE))
    assert list(sections) == [*COMMANDS, "options"]
    for purpose, names in COMMANDS.items():
        assert re.findall(r"^  (\w+)", sections[purpose], re.MULTILINE) == list(names)
    assert len(set(NAMES)) == len(NAMES) == 14


ACTIONS = [f"control {action}" for action in ("fly", "compare", "train")]


@pytest.mark.parametrize("command", [name for name in NAMES if name != "control"] + ACTIONS)
def test_every_option_has_a_purpose_and_every_number_its_range(root, command):
    first, *rest = command.split()
    parser = root.commands.choices[first]
    for action in rest:
        (inner,) = parser._subparsers._group_actions
        parser = inner.choices[action]
    checks = parser.get_default("checks")
    alone = [
        a.dest for g in parser._action_groups if g.title == "options" for a in g._group_actions
    ]
    assert alone == ["help"]
    numbers = 0
    for action in parser._actions:
        if action.metavar in ("X", "N", "X,Y,Z"):
            numbers += 1
            told = " ".join(action.help.split())
            assert re.search(r"\(.*(\d to | to the end|at least|any number|range; )", told), (
                told
            )
            assert "default: " in told
        if action.dest in checks:
            known = checks[action.dest].keywords["known"]
            assert f"{span(known)}; default" in action.help, action.dest
            if action.default is not None:
                assert f"default: {action.default:.4g}" in action.help
        elif action.choices and action.option_strings:
            assert "default: " in action.help
    assert numbers > 0 or command in ("measure", "plot")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"low": 0, "high": 180}, "0 to 180"),
        ({"low": 0, "high": 0.5, "low_open": True, "high_open": True}, "above 0 to below 0.5"),
        ({"low": 1e-5, "high": 1e5}, "1e-05 to 100,000"),
        ({"low": 2}, "at least 2"),
        ({"low": 0, "low_open": True}, "above 0"),
        ({"high": 3}, "at most 3"),
        ({"high": 3, "high_open": True}, "below 3"),
        ({}, "any number"),
    ],
)
def test_ranges_in_words(limits, words):
    assert span(Parameter("", "a number", **limits)) == words


def test_the_efforts_of_a_search_are_those_of_the_library():
    """Their defaults, and their ranges by what is refused just outside and not at the ends."""
    from jaxglide.search import optimum

    defaults = inspect.signature(optimum.optimise).parameters
    problem = Problem(landing_distance, {"d_psi": (0, 10)})
    usual = {"starts": 1, "screen": 0, "steps": 1, "polish": 0}
    rest = {"optimiser": "adam", "rate": None, "patience": None}
    for name, known in EFFORT.items():
        default = defaults[name].default
        assert known.default == (optimum._SCREEN if name == "screen" else default), name
        if name == "seed":
            continue
        for value in (known.low, known.high):
            optimum._options(problem, **{**usual, name: value}, **rest)
        for value in (known.low - 1, known.high + 1):
            with pytest.raises(ValueError, match=f"{name} = {value} is not allowed"):
                optimum._options(problem, **{**usual, name: value}, **rest)


# Completion


def completed(script, line):
    """Words that bash offers at the end of a line, by a completion script."""
    words = line.split(" ")
    asked = f"""
{script}
COMP_WORDS=({" ".join(map(shlex.quote, words))})
COMP_CWORD={len(words) - 1}
_jaxglide_complete() {{ local name; name=$(complete -p jaxglide); name=${{name#*-F }}
  ${{name%% *}} jaxglide "${{COMP_WORDS[COMP_CWORD]}}" "${{COMP_WORDS[COMP_CWORD-1]}}"; }}
_jaxglide_complete
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def printed(capsys, shell):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--print-completion", shell])
    assert ended.value.code == 0
    return capsys.readouterr().out


def test_bash_completes_commands_options_and_choices(capsys):
    script = printed(capsys, "bash")
    assert completed(script, "jaxglide s") == ["shapes", "sweep", "steady"]
    assert set(completed(script, "jaxglide ")) >= set(NAMES)
    assert completed(script, "jaxglide glide --gust") == [
        "--gust",
        "--gust-start",
        "--gust-length",
    ]
    assert completed(script, "jaxglide optimise --sc") == ["--screen"]
    assert completed(script, "jaxglide glide --solver d") == ["dopri5", "dopri8"]
    assert "s7" in completed(script, "jaxglide figure ")


def test_bash_completes_files(capsys, tmp_path, monkeypatch):
    script = printed(capsys, "bash")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "four.nc").write_text("")
    assert sorted(completed(script, "jaxglide plot fo")) == ["folder", "four.nc"]
    assert completed(script, "jaxglide sweep --store fo") == ["folder"]


@pytest.mark.parametrize("shell", ["zsh", "tcsh"])
def test_other_shells_know_every_command(capsys, shell):
    script = printed(capsys, shell)
    for name in NAMES:
        assert name in script
    assert "turbulence-length" in script


def test_only_the_chosen_command_is_loaded():
    code = "import sys; from jaxglide import cli; cli._parser(['plot', 'a.nc', '--help'])\n"
    code += "print(*(m for m in sys.modules if m in ('jax', 'shtab', 'jaxglide.cli.glide')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("\n", 0), done.stderr


# Where results go


@pytest.fixture
def started(capsys, monkeypatch):
    """Function of a command line: what it says before its work, at a terminal or not."""

    def start(line, terminal=True):
        class Started(Exception):
            pass

        def stop(*args, **options):
            raise Started

        for name in ("ensemble.sweep.sweep", "ensemble.published.shape_space"):
            monkeypatch.setattr(f"jaxglide.{name}", stop)
        monkeypatch.setattr("jaxglide.search.optimum.optimise", stop)
        monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
        with pytest.raises(Started):
            cli.main(line.split())
        return capsys.readouterr()

    return start


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("sweep --vary d_psi=1 --store a.zarr --save b.nc", "results go to a.zarr, b.nc"),
        (
            "optimise --log a.jsonl --plot b.png",
            "results go to a.jsonl, b.png, b_paths.png, b_glides.png",
        ),
        ("shapes --plot b.png", "results go to b.png"),
        ("shapes", "nothing is kept without --save or --plot"),
        ("sweep --vary d_psi=1", "nothing is kept without --store or --save"),
    ],
)
def test_a_long_run_says_where_results_go(started, line, said):
    assert started(line) == ("", f"jaxglide: {said}\n")
    assert started(line, terminal=False) == ("", "")


def test_a_figure_says_where_results_go(tmp_path):
    code = "import sys; sys.path.insert(0, sys.argv.pop()); import common; "
    code += "sys.argv[0] = 'figure_4.py'; common.arguments('figure')"
    command = sys.executable, "-c", code, str(ROOT / "experiments")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.stderr == f"jaxglide: results go to {Path('results/figure_4')}\n"
