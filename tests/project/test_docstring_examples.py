"""The examples in docstrings do what they say; what people call first has one."""

import doctest
import inspect
import re
from operator import attrgetter

import pytest

import jaxglide

MAIN = (
    "Actuated",
    "AngleLimit",
    "End",
    "Gait.from_degrees",
    "Glider",
    "Gust",
    "Launch",
    "Polar",
    "Problem",
    "Snake.from_svl",
    "Study",
    "TabulatedBody",
    "TabulatedPolar",
    "Waveform",
    "fall",
    "miss_distance",
    "open",
    "save",
    "simulate",
    "sweep",
    "varied",
)
LONG = (
    *(
        "averaged_glide",
        "Controller",
        "Environment",
        "cache",
        "equilibrium",
        "evaluate_policy",
        "integrate",
        "optimise",
        "optimise_program",
        "reconstruct",
        "retrace",
        "standard_deviation",
        "steady_branch",
        "steady_glide",
        "steady_sweep",
        "Waypoints",
        "survey",
    ),
    "trim",
)


def told():
    """Names that have examples, of everything public and its own methods."""
    for name in jaxglide.__all__:
        thing = getattr(jaxglide, name)
        methods = vars(thing) if inspect.isclass(thing) else {}
        public = [
            f"{name}.{method}"
            for method, value in methods.items()
            if not method.startswith("_")
            and (inspect.isroutine(value) or isinstance(value, property | classmethod))
        ]
        for path in (name, *public):
            if ">>>" in (inspect.getdoc(attrgetter(path)(jaxglide)) or ""):
                yield path


@pytest.mark.parametrize(
    "name", [*MAIN, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]
)
def test_an_example_prints_what_it_says(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    doc = inspect.getdoc(attrgetter(name)(jaxglide))
    assert re.search(r"\nExamples:\n", doc), f"{name} has no example"
    example = doctest.DocTestParser().get_doctest(doc, {}, name, name, 0)
    assert any(one.want for one in example.examples), "it prints nothing"
    said = []
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    doctest.DocTestRunner(optionflags=flags).run(example, out=said.append)
    assert not said, "".join(said)


def test_every_example_is_run():
    assert set(told()) == {*MAIN, *LONG}
