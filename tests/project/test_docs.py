"""The site builds without a warning, has every public name, and none of its links is dead.

The pages that run code are run when the whole site is built (the README's command, or
`pytest -m slow`); here they are only laid out.
"""

import importlib
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from places import ROOT

pytest.importorskip("sphinx")


def build(folder: Path, *options: str) -> None:
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", *options]
    done = subprocess.run(
        [*command, "docs", str(folder)], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-5000:]


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    build(folder, "-t", "short")
    return folder


class Links(HTMLParser):
    """What a page links to, and what in it can be linked to."""

    def __init__(self, page: Path):
        super().__init__()
        self.targets, self.anchors = [], set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.targets.append(value)
            elif name in ("id", "name") and value:
                self.anchors.add(value)


@pytest.mark.parametrize(
    "module", ["jaxglide", "jaxglide.plot", "jaxglide.view", "jaxglide.measured"]
)
def test_every_public_name_is_in_the_reference(site, module):
    documented = set().union(*(Links(page).anchors for page in site.glob("api/*.html")))
    names = {f"{module}.{name}" for name in importlib.import_module(module).__all__}
    assert names - documented == set()


def test_every_link_inside_the_site_resolves(site):
    pages = {page: Links(page) for page in site.rglob("*.html")}
    assert len(pages) > 30
    dead = []
    for page, links in pages.items():
        for target in links.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            anchor = unquote(parts.fragment)
            here = pages[file].anchors if file in pages else {anchor}
            if not file.exists() or (anchor and anchor not in here):
                dead.append(f"{page.relative_to(site)}: {target}")
    assert dead == []


def test_nothing_is_fetched_from_elsewhere(site):
    """Scripts, styles, fonts and pictures are local: the site is read without a network."""
    for page in site.rglob("*.html"):
        for line in page.read_text(encoding="utf-8").splitlines():
            for tag in ("<script", "<link", "<img", "@import"):
                assert not (tag in line and "://" in line and "canonical" not in line), line


@pytest.mark.slow
def test_the_whole_site_builds_with_its_pages_run(tmp_path):
    build(tmp_path)


def test_what_a_cell_prints_is_not_broken(monkeypatch):
    """A kernel passes on what a command prints by the hundred bytes, whatever the line."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    streams = importlib.import_module("streams")
    printed = ("stdout", "path l"), ("stderr", "no"), ("stdout", "ength\n"), ("stderr", "te\n")
    pieces = [{"output_type": "stream", "name": name, "text": text} for name, text in printed]
    found = streams.joined([pieces[0], {"output_type": "display_data"}, *pieces[1:]])
    assert [output.get("text") for output in found] == ["path length\n", None, "note\n"]
    assert pieces[0]["text"] == "path l"  # the outputs in the cache stay as they are
