"""`jaxglide view`."""

import re
import sys
from pathlib import Path

from .._lib.fields import Parameter
from ._case import add_glider, add_number, add_tolerances, case_of, computed, replaced
from ._options import UsageError, a_number, add_force, out_of, pair, refuse, writable

_KINDS = (".html", ".gif", ".mp4", ".png")


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    view = new(
        description="Fly a glide and write a file that plays it: an interactive page (.html), "
        "an animation (.gif, .mp4) or a still (.png).",
        epilog="Example: jaxglide view --compare f_theta=0 --out undulation.html",
    )
    add_glider(view)
    add_tolerances(view)
    _add_output(view)
    view.set_defaults(run=_run, save=None, plot=None, json=False)


def _add_output(view) -> None:
    """What is written, and of what."""
    group = view.add_argument_group("output")
    text = "another glide in the same view, with this parameter changed; may be repeated"
    group.add_argument(
        "--compare", action="append", default=[], metavar="NAME=VALUE", help=text
    )
    text = "file to write: .html, .gif, .mp4 or .png (default: glide.html)"
    group.add_argument("--out", type=Path, metavar="FILE", help=text)
    add_force(group)
    group.add_argument("--title", help="heading (default: from where the glide starts)")
    text = "frames a second: of flight for .html (above 0 to 1,000; default: 60), of the "
    text += "animation for .gif and .mp4 (1 to 50; default: 20)"
    group.add_argument("--frames-per-second", type=a_number, metavar="X", help=text)
    text = "seconds of flight shown in a second of .gif and .mp4"
    add_number(group, "playback", Parameter("", text, low=0, high=10, low_open=True), 0.25)
    text = "time in flight of a .png [s] (0 to the end; default: at 40 %% of the glide)"
    group.add_argument("--at", type=a_number, metavar="X", help=text)


def _changes(args) -> list[tuple[str, float]]:
    """Names and values given with --compare."""
    changes = []
    for text in args.compare:
        changes.append(pair("--compare", text))
        if changes.count(changes[-1]) > 1:
            raise UsageError(f"--compare {text} is given twice")
    return changes


def _words(case, name: str, value: float) -> str:
    """A parameter of a case with a value, in words and with its unit."""
    known = case.parameter(name)
    said = re.split(r",| \(", known.meaning)[0]
    return f"{said} = {value:g} {known.unit}".rstrip()


def _glides(args, changes):
    """The glides to show, and their labels."""
    from ..flight.glide import simulate

    case = case_of(args)
    for name, value in changes:
        case.check({name: value})
    cases = [case, *(replaced(case, {name: value}) for name, value in changes)]
    compared = {name: case.value(name) for name in dict.fromkeys(n for n, _ in changes)}
    stated = [_words(case, n, float(v)) for n, v in compared.items() if v is not None]
    labels = [", ".join(stated) or "as given", *(_words(case, *one) for one in changes)]

    def fly(one):
        options = {"rtol": args.rtol, "atol": args.atol, "dense": True}
        return simulate(one.glider, one.launch, ends=one.ends, **options)

    return [fly(one) for one in cases], labels


def _computed(glides, labels) -> bool:
    """Whether all glides were computed to their ends; those that were not are named."""
    lost = [k for k, glide in enumerate(glides) if not computed(glide.outcome)]
    for k in lost:
        name = "the glide" if len(glides) == 1 else f"the glide with {labels[k]}"
        told = f"{name} {glides[k].ending} at {float(glides[k].time):.6g} s"
        print(f"jaxglide: {told}", file=sys.stderr)
    return not lost


def _run(args) -> int:
    out = out_of(args, Path("glide.html"))
    if out.suffix not in _KINDS:
        raise UsageError(f"--out {out}: the name must end in {' or '.join(_KINDS)}")
    writable(out)
    if out.suffix != ".png":
        refuse(args, ("at",), "it is the time of a still (.png)")
    if out.suffix == ".png":
        refuse(args, ("frames_per_second",), "a still (.png) is one frame")
    if out.suffix not in (".gif", ".mp4"):
        refuse(args, ("playback",), "it is the speed of an animation (.gif or .mp4)")
    changes = _changes(args)

    from .. import view

    if out.suffix == ".mp4":
        view.check_path(out)
    glides, labels = _glides(args, changes)
    labels = labels if changes else ["glide"]
    if not _computed(glides, labels):
        return 1
    named: dict = {"labels": labels, "title": args.title}
    given = args.frames_per_second
    if out.suffix == ".html":
        view.view(glides, out, rate=60.0 if given is None else given, **named)
    elif out.suffix == ".png":
        view.still(glides, out, time=args.at, **named)
    else:
        named |= {"frames_per_second": 20.0 if given is None else given}
        view.animate(glides, out, playback=args.playback, **named)
    for glide, label in zip(glides, labels, strict=True):
        lines = str(glide).splitlines()
        print(lines[0] if not changes else f"{label}: {lines[0]}")
    size = round(out.stat().st_size / 1e6, 2)
    hint = ": open it in a browser" if out.suffix == ".html" else ""
    print(f"wrote {out} ({size:g} MB){hint}")
    return 0
