"""The README and its page of limits: what they show runs, and does what they say."""

import contextlib
import io
import re
import shlex
import subprocess
import sys

import pytest

from claims import agree, blocks, commands, section, sentence
from places import ROOT

README = (ROOT / "README.md").read_text()
LIMITS = (ROOT / "docs" / "limits.md").read_text()
GLIDE = "jaxglide glide --plot glide.png"


def test_it_is_one_screen():
    assert len(README.splitlines()) < 70


def test_no_code_is_left_out():
    """Every block is run by a test below, or says why not."""
    assert list(commands(README)) == [GLIDE]
    fences = re.findall(r"(.*)\n```(\w+)\n(?:.*\n)*?```", README)
    marked = [language for before, language in fences if before.startswith("<!-- not run: ")]
    assert [language for _, language in fences] == ["sh", "python", "sh", "sh"]
    assert marked == ["sh"]


def test_install_line_runs_a_glide(tmp_path):
    line = blocks(README, "sh")[0].strip().split(" && ")[-1]
    assert line == GLIDE
    done = subprocess.run(
        [sys.executable, "-m", "jaxglide.cli", *shlex.split(line)[1:]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "glide.png").stat().st_size > 20_000
    assert "landed" in done.stdout
    assert done.stderr == ""
    forward = float(re.search(r" y ([\d.]+)", done.stdout)[1])
    agree(sentence(README, r"The snake lands ([\d.]+ m) forward"), forward)
    agree(sentence(LIMITS, r"about half as far as the animal: (\d+ m)"), forward)


def test_five_lines_of_python():
    (code,) = blocks(README, "python")
    assert len(code.strip().splitlines()) == 5
    named = re.findall(r"^from (jaxglide\S*)", code, flags=re.MULTILINE)
    assert named == ["jaxglide"]
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(code, {})
    assert "landed" in printed.getvalue()


def test_test_command_is_what_ci_runs():
    line = blocks(section(README, "Test"), "sh")[0].strip()
    assert line in (ROOT / ".ci" / "run").read_text()


LINKS = re.findall(r"\]\(([^):]+)\)", README)


@pytest.mark.parametrize("path", LINKS)
def test_links_and_pictures_exist(path):
    assert (ROOT / path).exists()
