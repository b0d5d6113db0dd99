"""The theory and the code name each other: equations their functions, citations a label."""

import ast
import importlib
import pathlib
import re

import pytest

import jaxglide

PACKAGE = pathlib.Path(jaxglide.__file__).resolve().parent
PAGES = sorted((PACKAGE.parent / "docs" / "theory").glob("*.md"))
LABEL = re.compile(r"^\$\$.+\$\$ \((?P<label>[\w-]+)\)$", re.MULTILINE)
BLOCK = re.compile(r"^\$\$", re.MULTILINE)
LINK = re.compile(r"\{(?:func|class|meth)\}`~?(?P<path>jaxglide\.[\w.]+)`")
CITED = re.compile(r"\beqs?\.? (?=\d)(?P<list>\d+(?:(?:[-\u2013]|,\s)\d+)*)")
OF_THE_PAPER = {str(number) for number in range(1, 28)}


def cited(text):
    """Numbers of the equations that a text cites, such as 4 and 5 of "eqs 4-5"."""
    numbers = set()
    for match in CITED.finditer(text or ""):
        for part in re.split(r",\s", match["list"]):
            first, *last = re.split(r"[-\u2013]", part)
            numbers |= {str(n) for n in range(int(first), int((last or [first])[0]) + 1)}
    return numbers


def sections(page):
    """A page cut before every heading, but not within fences."""
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    return re.split(r"^(?=##)", text, flags=re.MULTILINE)


def linked(section):
    """What a section links to, by name."""
    return {match["path"]: thing(match["path"]) for match in LINK.finditer(section)}


def thing(path):
    """What a dotted name names; a failure of the test where there is nothing."""
    parts = path.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            found = getattr(found, part, None)
        assert found is not None, f"there is no {path}"
        return found
    raise AssertionError(f"there is no {path}")


def docstrings():
    """Every docstring of the package, by file and name."""
    kinds = ast.Module, ast.ClassDef, ast.FunctionDef
    for file in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, kinds):
                name = f"{file.relative_to(PACKAGE)}: {getattr(node, 'name', '')}"
                yield name, ast.get_docstring(node)


LABELS = [match["label"] for page in PAGES for match in LABEL.finditer(page.read_text("utf-8"))]


def test_every_equation_of_the_paper_has_its_label_once():
    assert {label.removeprefix("eq-") for label in LABELS} >= OF_THE_PAPER
    assert len(LABELS) == len(set(LABELS))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_equation_is_linked_to_what_computes_it(page):
    for section in sections(page):
        labels = [match["label"] for match in LABEL.finditer(section)]
        assert len(labels) == len(BLOCK.findall(section)), f"without a label:\n{section}"
        things = linked(section)
        assert things or not labels, f"{labels} are linked to nothing"
        there = set().union(*(cited(one.__doc__) for one in things.values()))
        missing = {label.removeprefix("eq-") for label in labels} & OF_THE_PAPER - there
        assert not missing, f"none of {sorted(things)} cites eqs {sorted(missing)}"


def test_every_citation_has_a_label():
    known = {label.removeprefix("eq-") for label in LABELS}
    found = {name: cited(text) for name, text in docstrings()}
    assert set().union(*found.values()) == OF_THE_PAPER
    for name, numbers in found.items():
        assert numbers <= known, f"{name} cites eqs {sorted(numbers - known)}"
