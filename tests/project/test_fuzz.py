"""Bad input of every kind, generated: it is refused in one sentence.

One rule everywhere: exit code 1 or 2, or an exception of this package's own making, with one
sentence that says what is wrong; no traceback, no hang, no NaN. The ordinary set draws 66
inputs, the slow one 600.
"""

import contextlib
import shutil
import signal
import traceback
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

import jaxglide
from jaxglide import Gait, Glider, Launch, Polar, Snake, StillAir, simulate
from jaxglide.cli import _parser, main
from jaxglide.ensemble.parts import case_of
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.survey import survey
from jaxglide.ensemble.sweep import sweep
from jaxglide.files.saved import open_dataset
from jaxglide.flights.flights import fly_flights
from jaxglide.measured import flights_dataset, measure_folder
from jaxglide.search.objectives import landing_distance
from jaxglide.search.optimum import optimise
from jaxglide.search.problem import Problem
from jaxglide.tunnel.fall import fall
from jaxglide.tunnel.trim import trim
from made_recordings import swimming, write_tabular

PACKAGE = Path(jaxglide.__file__).parent
LONGEST = 30  # s
often = pytest.mark.parametrize(
    "count", [22, pytest.param(200, marks=pytest.mark.slow)], ids=["some", "many"]
)


def draw(count, strategy, check):
    """Check `count` inputs drawn from a strategy, the same ones in every run."""
    health = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
    options = settings(
        max_examples=count, deadline=None, database=None, suppress_health_check=health
    )
    seed(count)(options(given(strategy)(check)))()


@contextlib.contextmanager
def in_time():
    """Fail where something hangs."""

    def hang(*_):
        raise AssertionError(f"still at work after {LONGEST} s")

    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(LONGEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def check_sentence(text):
    """One sentence for people: one line, not too long, and in words."""
    assert text.strip()
    assert "\n" not in text.strip()
    assert len(text) < 600, text
    for foreign in ("Traceback", "NoneType", "Concrete", "Tracer"):
        assert foreign not in text, text


def error_of(act, kinds):
    """What `act` gives, and the exception it raises: one of them is None."""
    with in_time():
        try:
            return act(), None
        except kinds as error:
            return None, error


def check_refused(act, *names):
    """`act` raises what this package says itself, in a sentence with one of `names`."""
    result, error = error_of(act, (ValueError, TypeError, OSError))
    assert error is not None, f"was taken: {result!r}"
    place = traceback.extract_tb(error.__traceback__)[-1].filename
    assert Path(place).is_relative_to(PACKAGE), f"from deep inside: {place}: {error}"
    check_sentence(str(error))
    assert any(name in str(error) for name in names), f"{names}: {error}"


# ---- the command line

_BAD_NUMBERS = [
    "nan",
    "inf",
    "-inf",
    "x",
    "",
    "1e400",
    "0x10",
    "--",
    "1,5",
    "\u22121",
    "1e12",
    "½",
]
_BAD_WHOLE = ["1.5", "-1", "nan", "", "x", "9" * 30, "9" * 5000, "1e3"]
_BAD_PAIRS = [
    *(
        "nu_theta",
        "nu_theta=",
        "=1",
        "nu_theta=nan",
        "nonsense=1",
        "nu_theta=1e9",
        "",
        "=",
        "a=b",
    ),
    *("nu_theta=1:2", "nu_theta=1:2:0", "nu_theta=1:2:1e9", "nu_theta=1,,2", "nu_theta=2:1:x"),
    *("nu_theta=1:2:99999999999999", "nu_theta=inf:1:3", "é=1", "nu_theta==1", "height=-1"),
]
_BAD_VECTORS = [
    "1,2",
    "1,2,3,4",
    "1,x,2",
    "nan,0,0",
    "0,inf,0",
    "",
    ",,",
    "1e9,0,0",
    "1;2;3",
    "½,0,0",
]
_BAD_ENDS = [
    *("tree=1", "ground", "ground=x", "ground=nan", "angle=-1", "angle=", "angle=80:", "=", ""),
    *("angle=80:nod", "angle=80:yaw,yaw", "plane=0,0,0,1", "plane=1,2", "plane=nan,0,0,1"),
    *("time=", "time=-1", "time=none", "time=1e9", "time=inf", "é=1", "ground==1"),
]
_BAD_FILES = [
    "missing",
    "missing/x.nc",
    "x.txt",
    "",
    ".",
    "garbage",
    "empty",
    "é/ü.nc",
    "x" * 300,
]
_PAIRS = {"vary", "fix", "bounds", "guess", "compare", "at"}
_OPEN_TEXT = {"title", "trial", "cluster", "variable", "x", "y", "name"}


def options_of(command):
    """Options of a command that take a value, of those whose bad values are known."""
    actions = command._actions
    return [a for a in actions if a.nargs != 0 and a.dest not in _OPEN_TEXT]


def commands():
    subparsers = next(a for a in _parser()._actions if a.dest == "command")
    return {name: p for name, p in subparsers.choices.items() if name != "figure"}


def bad_value(action):
    """Values that an option can never take."""
    if action.choices is not None:
        return st.sampled_from(["nonsense", "", "Published", "smooth,published"])
    if action.dest in ("log", "store", "plots"):
        return st.sampled_from(["garbage", "garbage/x", ""])
    if action.type is Path:
        return st.sampled_from(_BAD_FILES)
    kind = getattr(action.type, "__name__", "text")
    if kind == "whole":
        return st.sampled_from(_BAD_WHOLE)
    if kind == "a_number":
        return st.sampled_from(_BAD_NUMBERS)
    if kind == "three":
        return st.sampled_from(_BAD_VECTORS)
    if action.dest == "end":
        return st.sampled_from(_BAD_ENDS)
    if action.dest in _PAIRS:
        fine = {"nu_theta=1:2"} if action.dest == "bounds" else set()
        return st.sampled_from(sorted(set(_BAD_PAIRS) - fine))
    return st.sampled_from(
        ["nonsense", "", ",", "nu_theta,,d_psi", "nu_theta,nu_theta", "\u2212"]
    )


@st.composite
def command_lines(draw):
    """A command with one option or file that cannot be taken, and what it needs besides."""
    name, parser = draw(st.sampled_from(sorted(commands().items(), key=lambda item: item[0])))
    action = draw(st.sampled_from(options_of(parser)))
    value = draw(bad_value(action))
    line = [name]
    for needed in parser._actions:  # positional ones
        if not needed.option_strings and needed is not action and needed.nargs != "?":
            line.append("garbage")
    if action.option_strings:
        # as one word: a value may begin with a dash
        line.append(f"{action.option_strings[-1]}={value}")
    else:
        line.insert(1, value)
    if name == "sweep" and action.dest not in ("vary", "file"):
        line.append("--vary=d_psi=0,10")
    return line


@often
def test_no_command_takes_what_it_cannot(count, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "garbage").write_bytes(bytes(range(256)))
    (tmp_path / "empty").write_bytes(b"")

    def check(line):
        with in_time():
            try:
                code = main(line)
            except SystemExit as stop:
                code = stop.code
        said = capsys.readouterr()
        assert code in (1, 2), f"{line}: {said.out}"
        assert "nan" not in said.out.lower().split()
        check_sentence(said.err)
        assert said.err.startswith("jaxglide: ")
        left = {path.name for path in tmp_path.iterdir() if path.suffix != ".lock"}
        assert left == {"garbage", "empty"}

    draw(count, command_lines(), check)


def test_the_drawn_options_are_those_there_are():
    some = {
        "nu_theta",
        "rtol",
        "nodes",
        "phases",
        "starts",
        "playback",
        "vary",
        "polar",
        "file",
        "body",
        "wind",
        "end",
    }
    found = {action.dest for parser in commands().values() for action in options_of(parser)}
    assert found >= some | {"fix", "save", "plot", "log", "store"}


# ---- constructors and functions

GLIDER = Glider(Snake.from_svl(), Gait.from_degrees(), Polar.published())
_NOT_NUMBERS = ["x", "", "1", [], [[1.0]], [1, 2], {}, object(), 1j]
_SCALARS = [*_NOT_NUMBERS, np.nan, np.inf, -np.inf, 1e300]
_COUNTS = ["x", 1.5, -1, 10**12, [3], np.nan, True, {}]
_ARRAYS = [*_SCALARS, [1.0, 2.0, np.nan]]
_CELLS = [*_SCALARS, np.zeros((36, 1, 2, 2, 2)), np.full((72, 6, 2, 2, 2), np.nan)]
_TIMES = ["x", [], [[1.0]], {}, [np.nan], [1.0, 0.5]]
_VALUES = ["x", [], {}, [[1.0]], np.nan, [np.inf], [1e300], [None]]
_PARTS = [None, "x", 1.0, [], {}, object(), Gait, lambda: None]
_BOUNDS = ["x", (1,), (2, 1), (0, np.nan), (0, 99), 3.0, {}]
_FREE = [None, {}, [], "x", 3, ["mass"], {"x": (0, 1)}]
_FREE += [{"nu_theta": ends} for ends in ((2, 1), 1, (1, np.nan), "ab", (0, 1, 2))]

_TABLES = ["x", 1.5, [1], None, {"x": 1}, {"kind": 3}, {3: 3}, {"nodes": "x"}, {"file": 3}]

STUDY_OF_ONE = Study({"nu_theta": [1.2]})


def _gait(**changed):
    return Gait(**({"theta_m": 1.5, "psi_m": 0.3, "nu_theta": 1.4, "f_theta": 1.2} | changed))


def _glider(**changed):
    return Glider(**({"body": GLIDER.body, "gait": GLIDER.gait} | changed))


def _problem(**changed):
    return Problem(
        **({"objective": landing_distance, "free": {"nu_theta": (1.0, 1.5)}} | changed)
    )


def _study(**changed):
    return Study({"nu_theta": [1.2]}, **changed)


def _flown(**changed):
    return simulate(**({"glider": GLIDER} | changed))


def _wind_of(**changed):
    return case_of({"air": {"kind": "uniform", "velocity": [1, 0, 0]} | changed})


def _dropped(**changed):
    return fall(GLIDER, **changed)


# callable, names of its arguments, values that none of them can take
_TABLE = [
    (_gait, "theta_m psi_m nu_theta f_theta d_psi d_theta", _SCALARS),
    (Gait.from_degrees, "psi_m nu_theta f_theta d_psi d_theta theta_m", _SCALARS),
    (Snake.from_svl, "svl mass neck_fraction head_fraction", _SCALARS),
    (Snake.from_svl, "chord head_density body_density", _ARRAYS),
    (Snake.from_svl, "nodes", _COUNTS),
    (Polar.published, "lift_scale drag_scale", _SCALARS),
    (Polar, "cells", _CELLS),
    (StillAir, "air_density kinematic_viscosity", _SCALARS),
    (Launch, "height speed phi_theta elevation heading angles", _SCALARS),
    (_glider, "body gait aerodynamics air", _PARTS),
    (_glider, "gravity", _SCALARS),
    (_flown, "rtol atol max_time", _SCALARS),
    (_flown, "max_steps", _COUNTS),
    (_flown, "times", _TIMES),
    (_flown, "glider", _PARTS),
    (_study, "rtol atol max_time", _SCALARS),
    (_study, "max_steps", _COUNTS),
    (lambda **values: Study(values), "nu_theta svl height", _VALUES),
    (lambda **values: _study(fixed=values), "d_psi svl height", _SCALARS),
    (lambda **values: _study(setup=values), "nodes polar node_set", ["x", 1.5, -1, [], {}]),
    (_problem, "rtol atol max_time", _SCALARS),
    (_problem, "free", _FREE),
    (lambda **k: optimise(_problem(), **k), "starts steps screen polish patience", _COUNTS),
    (lambda **k: trim(GLIDER, **k), "parameter", ["x", None, 1, [], "wings"]),
    (lambda **k: trim(GLIDER, **k), "bounds", _BOUNDS),
    (_dropped, "interval max_time rtol atol angles", _SCALARS),
    (_dropped, "phases", _COUNTS),
    (lambda **k: survey(STUDY_OF_ONE, **k), "phases", _COUNTS),
    (lambda **k: sweep(STUDY_OF_ONE, **k), "width", _COUNTS),
    (sweep, "study", _PARTS),
    (lambda **k: case_of(k), "body gait polar aerodynamics air launch", _TABLES),
    (
        lambda **k: case_of(k),
        "ends",
        [*filter(None, _TABLES), [3], [{}], [{"kind": "x"}], [{"level": 1}]],
    ),
    (_wind_of, "velocity", [*_NOT_NUMBERS, None, [1, 2, np.nan], ["x", 0, 0], [1e9, 0, 0]]),
    (_wind_of, "kind", [None, 3, "", "storm", [], {}]),
]
_WITHIN = {"free": ("nu_theta", "mass", "'x'"), "bounds": ("d_psi",)}  # named instead
ARGUMENTS = [(make, name, bad) for make, names, bad in _TABLE for name in names.split()]


@often
def test_no_constructor_takes_what_it_cannot(count):
    one = st.sampled_from(ARGUMENTS).flatmap(
        lambda entry: st.tuples(st.just(entry[:2]), st.sampled_from(entry[2]))
    )

    def check(drawn):
        (make, name), value = drawn
        check_refused(lambda: make(**{name: value}), name, *_WITHIN.get(name, ()))

    draw(count, one, check)


# ---- files

STUDY = """\
[grid]
nu_theta = { start = 1.0, stop = 1.5, count = 11 }
d_psi = [0, 10, 20]
[fixed]
height = 10
[setup]
polar = "smooth"
[solver]
rtol = 1e-6
"""
_PIECES = st.sampled_from(
    [
        *("nan", "inf", "-1", "[", "]", "{", "}", "=", '"', "1e999", "9" * 400, "true", "[["),
        *("nu_theta", "\n", "\0", "é", "count", "[cases]\n", "1.5", "start", "[" * 2000, "#"),
        "d_psi = 3\n",
    ]
)


@st.composite
def damaged(draw, text):
    """A text with one to three pieces put in the place of some of it."""
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(text)))
        length = draw(st.sampled_from([0, 1, 3, 10, 200]))
        text = text[:at] + draw(_PIECES) + text[at + length :]
    return text


def finite(data):
    """Whether what was read holds no NaN where a number is needed."""
    return all(np.isfinite(v).all() for v in data.values())


def check_file(act, path, judge):
    """`act` reads a file that may be damaged: refused with its name, or sound."""
    found, error = error_of(act, (ValueError, OSError))
    if error is None:
        assert judge(found)
        return
    check_sentence(str(error))
    assert path.name in str(error) or str(path.parent) in str(error), str(error)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A folder with a recording, the dataset of its flight, and a small store."""
    folder = tmp_path_factory.mktemp("sound")
    write_tabular(folder, swimming()[80:160])
    data = flights_dataset(measure_folder(folder))
    study = Study({"nu_theta": [1.2, 1.3]}, fixed={"height": 0.05}, rtol=1e-4, atol=1e-4)
    sweep(study, folder / "s.zarr", progress=False)
    return folder, data


_CHANGES = {
    "missing": lambda d, name: d.drop_vars(name),
    "not a number": lambda d, name: d.assign({name: d[name] * np.nan}),
    "endless": lambda d, name: d.assign({name: d[name] * 1e300}),
    "text": lambda d, name: d.assign({name: d[name].astype(str)}),
    "scalar": lambda d, name: d.assign({name: ((), 1.0)}),
    "negative": lambda d, name: d.assign({name: -abs(d[name])}),
    "unit": lambda d, name: d.assign({name: d[name].assign_attrs(units="furlong")}),
    "unit of rubbish": lambda d, name: d.assign({name: d[name].assign_attrs(units="}{")}),
    "longer": lambda d, name: d.assign({name: xr.concat([d[name]] * 2, "again")}),
}
_READ = "nu_theta theta_m psi_m f_theta svl mass start_position start_velocity time position"


@st.composite
def bad_files(draw):
    """A kind of file and the damage done to it."""
    kind = draw(st.sampled_from(["study", "body", "markers", "flights", "store"]))
    if kind == "study":
        return kind, draw(damaged(STUDY))
    if kind == "flights":
        return kind, (
            draw(st.sampled_from(sorted(_CHANGES))),
            draw(st.sampled_from(_READ.split())),
        )
    if kind == "store":
        return kind, (draw(st.integers(0, 10**6)), draw(st.integers(1, 255)))
    return kind, (
        draw(st.integers(0, 10**6)),
        draw(_PIECES),
        draw(st.sampled_from([0, 1, 9, 99])),
    )


def put(source, target, damage):
    """Copy a text with a piece of it replaced."""
    text = source.read_text()
    place, piece, length = damage
    place %= len(text)
    target.write_text(text[:place] + piece + text[place + length :])


@often
def test_no_file_is_taken_for_what_it_is_not(count, tmp_path, recordings):
    sound, data = recordings

    def check(drawn):
        kind, damage = drawn
        folder = tmp_path / "try"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        if kind == "study":
            path = folder / "study.toml"
            path.write_text(damage)
            check_file(lambda: Study.from_file(path).varied, path, finite)
        elif kind == "flights":
            change, name = damage
            changed = _CHANGES[change](data, name)
            if changed.identical(data):
                return
            check_refused(lambda: fly_flights(changed), name, "trial")
        elif kind == "store":
            _damage_store(sound / "s.zarr", folder / "s.zarr", *damage)
            path = folder / "s.zarr"
            check_file(lambda: open_dataset(path), path, lambda d: d.identical(whole))
        else:
            for name in ("one.csv", "one.toml"):
                shutil.copy(sound / name, folder)
            path = folder / ("one.toml" if kind == "body" else "one.csv")
            put(sound / path.name, path, damage)
            check_file(
                lambda: measure_folder(folder)[0], path, lambda f: np.isfinite(f.nu_theta)
            )

    whole = open_dataset(sound / "s.zarr")
    draw(count, bad_files(), check)


def _damage_store(source, target, place, flip):
    """Copy a store with one byte of one of its files changed."""
    shutil.copytree(source, target)
    files = [
        path for path in sorted(target.rglob("*")) if path.is_file() and path.stat().st_size
    ]
    path = files[place % len(files)]
    content = bytearray(path.read_bytes())
    content[place % len(content)] ^= flip
    path.write_bytes(content)
