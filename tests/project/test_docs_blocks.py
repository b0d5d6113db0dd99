"""Every block of code on the site is run when it is built, or says why not."""

import re

import pytest

from places import ROOT

DOCS = ROOT / "docs"
PAGES = [
    path
    for path in sorted(DOCS.rglob("*.md"))
    if not any(part.startswith("_") for part in path.relative_to(DOCS).parts)
]
PAGES += [path for name in ("CONTRIBUTING.md",) if (path := ROOT / name).exists()]
WORDS = {"text", "bibtex"}  # a block of these is no code
CODE = re.compile(r"\{(?:code|code-block|sourcecode)\} *(?P<language>\S*)")
FENCE = re.compile(r" *(?P<fence>```+|~~~+) *(?P<kind>[^`]*)$")
WHY_NOT = re.compile(r" *(?:% not run: \w.*|<!-- not run: \w.* -->)$")
FRONT = """\
---
file_format: mystnb
jupytext:
  text_representation:
    extension: .md
    format_name: myst
kernelspec:
  name: python3
  display_name: Python 3
---
"""


def blocks(text):
    """Of every fenced block that holds code: its language, and the last words before it."""
    before, around = "", []  # the fences around a line, and whether they hold code
    for line in text.splitlines():
        found = FENCE.match(line)
        fence, kind = (found["fence"], found["kind"].strip()) if found else ("", "")
        if around and fence == around[-1][0] and not kind:
            around.pop()
        elif found and not (around and around[-1][1]):
            code = CODE.match(kind)
            holds = bool(code) or not kind.startswith("{") or kind.startswith("{code-cell}")
            around.append((fence, holds))
            if holds:
                yield (code["language"] if code else kind), before
        before = line if line.strip() else before


def unexplained(text):
    """Languages of the blocks that nothing runs, and that do not say why not."""
    return [
        language or "no language"
        for language, before in blocks(text)
        if not (language.startswith("{code-cell}") or language in WORDS)
        and not WHY_NOT.match(before)
    ]


def test_blocks_are_found():
    code = "```python\n1\n```\n"
    assert unexplained(code) == ["python"]
    assert unexplained("% not run: takes an hour\n" + code) == []
    assert unexplained("<!-- not run: takes an hour -->\n" + code) == []
    assert unexplained("% not run:\n" + code) == ["python"]
    assert unexplained("% not run: takes an hour\n\n" + code) == []
    assert unexplained("% not run: takes an hour\n" + code + code) == ["python"]
    assert unexplained("```{code-cell} ipython3\n'''\n% not run: a\n```\n" + code) == ["python"]
    assert unexplained("```{code-block} sh\nls\n```") == ["sh"]
    assert unexplained("```{image} a.png\n```\n```text\nwords\n```") == []
    assert unexplained("````{note}\n" + code + "````\n" + code) == ["python", "python"]
    assert unexplained(":::{note}\n" + code + ":::\n") == ["python"]
    assert unexplained("```\nls\n```") == ["no language"]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_block_is_run_or_says_why_not(page):
    """What README holds is run by `test_readme.py`."""
    text = page.read_text()
    assert unexplained(text) == []
    if "{code-cell}" in text:
        assert text.startswith(FRONT), "the page is no notebook"
        assert "```{code-cell} ipython3\n" in text


def test_every_block_of_the_readme_has_a_language_that_is_run():
    """`test_readme.py` runs them, and counts those of each language."""
    found = unexplained((ROOT / "README.md").read_text())
    assert found
    assert set(found) <= {"sh", "python", "toml", "csv"}
