"""The gallery: its page shows what its commands make."""

import re
import shlex
import subprocess
import sys

import pytest

from claims import commands
from jaxglide import cli
from places import ROOT

PAGE = (ROOT / "docs" / "gallery.md").read_text()
PICTURES = ROOT / "experiments" / "figures" / "gallery"


@pytest.fixture(scope="module")
def gallery():
    """The script `experiments/gallery.py`."""
    sys.path.insert(0, str(ROOT / "experiments"))
    try:
        import gallery
    finally:
        sys.path.pop(0)
    return gallery


def test_the_page_shows_each_picture_with_its_command(gallery):
    made = {*gallery.DATA, *gallery.PICTURES.values(), "jaxglide figure gallery"}
    assert set(commands(PAGE)) == made
    cells = re.findall(
        r"!\[[^]]*\]\(\.\./experiments/figures/gallery/(\w+)\.png\)[^|`]*`([^`]+)`", PAGE
    )
    assert dict(cells) == gallery.PICTURES
    assert {path.stem for path in PICTURES.iterdir()} == set(gallery.PICTURES)
    written = [re.search(r"(\w+\.png)", text) for text in gallery.PICTURES.values()]
    names = [found[1] for found in written if found]
    assert len(set(names)) == len(names) == len(gallery.PICTURES) - 1  # s7 names a folder


def test_commands_draw_what_earlier_ones_make(gallery):
    made = set()
    for text in (*gallery.DATA, *gallery.PICTURES.values()):
        args = cli._parser().parse_args(shlex.split(text)[1:])
        made.add(str(args.save))
        if args.command == "plot":
            assert str(args.file) in made


def test_pictures_of_a_glide(gallery, tmp_path, monkeypatch):
    """Those that one glide makes."""
    monkeypatch.chdir(tmp_path)
    drawn = [text for text in gallery.PICTURES.values() if "plot glide.nc" in text]
    assert len(drawn) == 5
    for text in ("jaxglide glide --save glide.nc", *drawn):
        assert cli.main(shlex.split(text)[1:]) == 0, text
    assert len(list(tmp_path.glob("*.png"))) == 5


@pytest.mark.slow
def test_all_pictures(tmp_path):
    words = [sys.executable, "-m", "jaxglide.cli", "figure", "gallery", "--out", "pictures"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    shown = {path.name for path in PICTURES.iterdir()}
    assert {path.name for path in (tmp_path / "pictures").iterdir()} == shown
