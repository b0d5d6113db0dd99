"""Examples of parts of one's own: each is imported and run, from a small height."""

import ast
import importlib
import re

import pytest

from places import ROOT

FOLDER = ROOT / "experiments" / "own_parts"
SAYS = {
    "waveform": ["Glide from 0.3 m: landed"] * 2,
    "robot": ["battery at 0.28 m", "landed", "battery at 0.36 m", "landed"],
    "gust": ["Glide from 0.3 m: landed"] * 2,
    "aerodynamics": ["Glide from 0.3 m: landed"] * 2,
    "polar": ["Glide from 0.3 m: landed"] * 2,
    "end": ["Glide from 0.3 m: reached the tree", "Glide from 0.3 m: landed"],
    "law": ["Glide from 0.3 m: landed"] * 2,
    "sweep_trim_gradient": ["growth", "trim at body.point_position[0] = 0.", "by growth: "],
}
LONG = {"robot", "aerodynamics", "polar", "end", "law", "sweep_trim_gradient", "waveform"}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in SAYS]
)
def test_an_example_runs_and_says_how_it_went(name, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(FOLDER))
    importlib.import_module(name).main(0.3)
    printed = capsys.readouterr().out
    place = 0
    for words in SAYS[name]:
        assert words in printed[place:], printed
        place = printed.index(words, place) + len(words)
    # the part does something: no two flights end alike
    ends = re.findall(r"end point .*", printed)
    assert len(set(ends)) == len(ends)
    assert not re.search(r"\bnan\b", printed)


def test_every_example_is_listed_and_run_and_leaves_the_package_alone():
    assert {path.stem for path in FOLDER.glob("*.py")} == set(SAYS)
    page = (ROOT / "docs" / "findings" / "index.md").read_text()
    assert set(re.findall(r"`own_parts/(\w+)\.py` \|", page)) == set(SAYS)
    for path in FOLDER.glob("*.py"):
        code = path.read_text()
        assert ast.get_docstring(ast.parse(code)), path.name
        assert len(code.splitlines()) < 90
        # names come from the facade, or from the example beside it
        assert not re.search(r"(from|import) jaxglide\.", code), path.name
        assert "def main(" in code
