"""The page of validation: it is what its script writes, and what it leans on is there."""

import importlib
import re
import subprocess
import sys

import pytest

from claims import agree, claimed
from places import ROOT

PAGE = (ROOT / "docs" / "validation.md").read_text()
TUMBLES = 0.01  # by how much what tumbles may differ between machines


@pytest.fixture(scope="module")
def validation():
    """The script `experiments/validation.py`."""
    sys.path.insert(0, str(ROOT / "experiments"))
    try:
        return importlib.import_module("validation")
    finally:
        sys.path.pop(0)


def cells(page):
    """Cells of all rows, but for headings."""
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    rows = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines]
    return [row for row in rows if row[0] not in ("quantity", "---")]


def test_it_is_what_the_script_writes(validation):
    """With the numbers of the page; how each agrees follows from it."""
    values = {}
    for row, found in zip(validation.ROWS, cells(PAGE), strict=True):
        ours = found[3].removesuffix(" †")
        assert found[3].endswith("†") == bool(row.page)
        holds = found[4] == "holds"
        values[row.key] = (ours, holds) if row.words else validation._number(ours)
    assert len(values) == len(validation.ROWS)
    assert validation.page(values) == PAGE


def test_what_differs_says_why(validation):
    for row, found in zip(validation.ROWS, cells(PAGE), strict=True):
        if found[4].startswith(("differs", "+", validation.MINUS)) and not row.loose:
            why = found[4].partition(": ")[2]
            off = abs(validation._number(found[4])) if not row.words else 100
            assert why or off < 1.0, found


def test_every_test_that_it_names_is_there(validation):
    for name in {row.test for row in validation.ROWS}:
        path, _, inside = name.partition("::")
        code = (ROOT / "tests" / path).read_text()
        *classes, function = inside.split("::")
        for kind in classes:
            assert f"\nclass {kind}" in code, name
        assert re.search(rf"^ *def {function}\(", code, flags=re.MULTILINE), name


def test_every_source_is_given_and_used(validation):
    used = set(re.findall(r"\[([A-Z])\]", " ".join(row.source for row in validation.ROWS)))
    assert used == set(validation.SOURCES)


def test_what_others_compute_stands_on_their_pages(validation):
    values = validation.stated()
    marked = [row for row in validation.ROWS if row.page]
    assert {row.key for row in marked} == set(values)
    shown = {tuple(found[:3]): found for found in cells(PAGE)}
    for row in marked:
        value = values[row.key]
        found = shown[row.quantity, row.source, row.published]
        assert found[3] == f"{validation.shown(row, value)} †"
        if row.words:
            assert (found[4] == "holds") == value[1]


def test_agreement_is_told_by_digits_spread_and_share(validation):
    def told(published, ours, why="", **more):
        row = validation.Row("s", "q", "[Y]", published, "k", "t", why, **more)
        return validation.agreement(row, validation.shown(row, ours))

    assert told("1.9", 1.94) == "to the last digit"
    assert told("1.9", 1.96, "rounded") == "+3.2 %: rounded"
    assert told("10.14 ± 2.69", 7.6) == "within its spread"
    assert told("10.14 ± 2.69", 5.07, "short") == f"{validation.MINUS}50.0 %: short"
    assert told(f"{validation.MINUS}0.5", -0.45) == "to the last digit"
    assert told("0.5", None) == ""


@pytest.mark.slow
def test_a_run_says_what_the_page_says(validation, tmp_path):
    words = [sys.executable, "-m", "jaxglide.cli", "figure", "validation", "--out", tmp_path]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    new = cells((tmp_path / "validation.md").read_text())
    for row, old, now in zip(validation.ROWS, cells(PAGE), new, strict=True):
        if not row.loose:
            assert now == old
        else:
            values = [(low + high) / 2 for low, high in claimed(now[3])]
            agree(old[3], *values, share=TUMBLES)
            assert old[:3] == now[:3]
            assert not row.words or old[4] == now[4]
