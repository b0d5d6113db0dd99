"""The README's commands and snippets do what it says."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def command(text, folder):
    """Run `jaxglide ...` in a folder with this interpreter."""
    words = shlex.split(text)
    assert words[0] == "jaxglide"
    return subprocess.run(
        [sys.executable, "-m", "jaxglide.cli", *words[1:]],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_python_snippets():
    """In order, in one namespace; the last one asserts on the gradient."""
    snippets = blocks("python")
    assert len(snippets) == 3
    assert [len(s.strip().splitlines()) for s in snippets[:2]] == [5, 3]
    namespace: dict = {}
    for snippet in snippets:
        exec(snippet, namespace)
    assert abs(namespace["gradient"]) > 1e-3


def test_test_command_is_what_ci_runs():
    line = blocks("sh")[1].strip()
    assert line in (ROOT / ".ci" / "run").read_text()


def test_install_line_runs_a_glide(tmp_path):
    line = blocks("sh")[0].strip().split(" && ")[-1]
    done = command(line, tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "glide.png").stat().st_size > 20_000
    assert "landed" in done.stdout
    assert done.stderr == ""


def test_every_named_command_and_option_exists():
    lines = [line for block in blocks("sh") for line in re.split(r"\n| && ", block)]
    texts = re.findall(r"`(jaxglide [a-z]+[^`]*)`", README)
    texts += [line for line in lines if line.startswith("jaxglide ")]
    named = {" ".join(text.split()[:2]) for text in texts}
    assert named >= {"jaxglide glide", "jaxglide shapes", "jaxglide sweep"}
    for name in named:
        done = command(f"{name} --help", ROOT)
        assert done.returncode == 0
        usage = done.stdout.split("\n\n")[0]
        for text in texts:
            if text.startswith(f"{name} "):
                options = set(re.findall(r"--[a-z-]+", text)) - {"--help"}
                assert options <= set(re.findall(r"--[a-z-]+", usage)), text


def test_pictures_exist():
    for path in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("name", re.findall(r"`(jaxglide/[a-z_]+\.py)`", README))
def test_files_exist(name):
    assert (ROOT / name).exists()


def test_json(tmp_path):
    done = command("jaxglide glide --json --height 1", tmp_path)
    result = json.loads(done.stdout)
    keys = "outcome time landing_point path_length height_lost end_angles_deg max_angles_deg"
    assert set(result) == {*keys.split(), "launch", "steps"}
    assert set(result["launch"]) == {"phase", "angles_deg", "speed"}
    assert result["outcome"] == "landed"
    assert result["height_lost"] == pytest.approx(1, abs=1e-9)
