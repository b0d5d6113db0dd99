"""`jaxglide view`."""

import re
import sys
from pathlib import Path

from .._lib.parameters import PARAMETERS
from ._case import add_glider, add_tolerances, build_from, numbers_of, setup_of
from ._options import UsageError, a_number, add_force, out_of, refuse, writable

_KINDS = (".html", ".gif", ".mp4", ".png")


def add(commands) -> None:
    """Add the command to the parser."""
    view = commands.add_parser(
        "view",
        description="Fly a glide and write a file that plays it: an interactive page (.html), "
        "an animation (.gif, .mp4) or a still (.png).",
        epilog="Example: jaxglide view --compare f_theta=0 --out undulation.html",
    )
    add_glider(view)
    add_tolerances(view)
    group = view.add_argument_group("output")
    text = "another glide in the same view, with this parameter changed; may be repeated"
    group.add_argument(
        "--compare", action="append", default=[], metavar="NAME=VALUE", help=text
    )
    text = "file to write: .html, .gif, .mp4 or .png (glide.html)"
    group.add_argument("--out", type=Path, metavar="FILE", help=text)
    add_force(group)
    group.add_argument("--title", help="heading (says from where the glide starts)")
    text = "frames a second: of flight for .html (60), of the animation for .gif and .mp4 (20)"
    group.add_argument("--frames-per-second", type=a_number, metavar="X", help=text)
    text = "seconds of flight shown in a second of .gif and .mp4 (0.25)"
    group.add_argument("--playback", type=a_number, default=0.25, metavar="X", help=text)
    text = "time in flight of a .png [s] (at 40 %% of the glide)"
    group.add_argument("--at", type=a_number, metavar="X", help=text)
    view.set_defaults(run=_run, save=None, plot=None, json=False)


def _changes(args) -> list[tuple[str, float]]:
    """Names and values given with --compare."""
    changes = []
    for text in args.compare:
        name, _, value = text.partition("=")
        if name not in PARAMETERS:
            raise UsageError(
                f"--compare {text!r}: no parameter {name!r}; known are {', '.join(PARAMETERS)}"
            )
        try:
            changes.append((name, float(value)))
        except ValueError:
            raise UsageError(f"--compare {text!r} is not NAME=VALUE") from None
        if changes.count(changes[-1]) > 1:
            raise UsageError(f"--compare {text} is given twice")
    return changes


def _words(case: dict, names) -> str:
    """The named parameters of a case, in words and with their units."""
    said = {name: re.split(r",| \(", PARAMETERS[name].meaning)[0] for name in names}
    return ", ".join(f"{said[n]} = {case[n]:g} {PARAMETERS[n].unit}".rstrip() for n in names)


def _glides(args, changes):
    """The glides to show, and their labels."""
    from ..ensemble.cases import build, check_parameters, check_setup, full_case
    from ..flight.glide import simulate

    given, setup = numbers_of(args), check_setup(setup_of(args))
    cases = [given, *({**given, name: value} for name, value in changes)]
    for case in cases:
        check_parameters(case)
    compared = list(dict.fromkeys(name for name, _ in changes))
    full = full_case(given)
    stated = [name for name in compared if full[name] is not None]
    labels = [_words(full, stated) or "as given"]
    labels += [_words({name: value}, [name]) for name, value in changes]

    def fly(glider, launch):
        return simulate(glider, launch, rtol=args.rtol, atol=args.atol, dense=True)

    glides = [fly(*build_from(args)), *(fly(*build(case, setup)) for case in cases[1:])]
    return glides, labels


def _computed(glides, labels) -> bool:
    """Whether all glides were computed to their ends; those that were not are named."""
    from ..flight.ends import Outcome

    outcomes = [Outcome(int(glide.outcome)) for glide in glides]
    lost = [k for k, outcome in enumerate(outcomes) if outcome > Outcome.UNSTABLE_ROLL]
    for k in lost:
        name = "the glide" if len(glides) == 1 else f"the glide with {labels[k]}"
        print(
            f"jaxglide: {name} {outcomes[k]} at {float(glides[k].time):.6g} s", file=sys.stderr
        )
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
