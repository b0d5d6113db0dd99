"""What the command line says of itself: commands, first steps, ranges, completion."""

import argparse
import math
from collections.abc import Callable, Iterator
from typing import Any

from .._lib.version import VERSION
from ._options import Parser

COMMANDS = {
    "fly": {
        "glide": "fly one glide",
        "shapes": "fly the published shape space",
        "sweep": "fly any study: a grid or a list of cases, resumable",
    },
    "balance": {
        "windtunnel": "hold the attitude, let the snake fall, read the moments",
        "steady": "where a gait settles, and whether it stays there",
        "trim": "find the bend, or another gait parameter, without pitch moment",
    },
    "improve": {
        "gradient": "the gradient of an objective, with its check",
        "optimise": "search for the best gait by gradients",
    },
    "steer": {
        "control": "fly a snake that steers itself, and compare what steers it",
    },
    "measured flights": {
        "measure": "from motion capture to gait",
        "compare": "measured flights beside their simulations",
    },
    "look": {
        "plot": "draw a saved result",
        "view": "look at a glide in 3D",
        "figure": "make a published figure with its table",
    },
}
"""What each command does, by purpose and name."""

FIRST_STEPS = f"""\
jaxglide {VERSION}: the flight dynamics of flying snakes, as a differentiable model.

  jaxglide glide --plot glide.png       fly one glide, and draw it
  jaxglide view                         see it in 3D: glide.html, for any browser
  jaxglide shapes --plot shapes.png     which of the published body shapes glide stably?
  jaxglide sweep --vary d_psi=0:20:11   what does one number change?

jaxglide --help lists all commands, jaxglide COMMAND --help the options of one.
"""
"""What is printed where nothing is asked for."""


class Root(Parser):
    """The parser of the first word, which lists the commands by purpose.

    Args:
        whole: makes the same with the options of all commands.
    """

    def __init__(self, whole: Callable[[], "Root"]):
        super().__init__(
            prog="jaxglide",
            description="The flight dynamics of flying snakes, as a differentiable model.",
            epilog="jaxglide COMMAND --help lists the options of a command.",
        )
        self.whole = whole
        version, about = f"jaxglide {VERSION}", "print the version"
        self.add_argument("--version", action="version", version=version, help=about)
        self.add_argument(
            "--print-completion",
            action=_Completion,
            choices=("bash", "zsh", "tcsh"),
            help="print what makes this shell complete commands and options",
        )
        self.commands = self.add_subparsers(
            dest="command", required=True, metavar="COMMAND", parser_class=Parser
        )

    def format_help(self) -> str:
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        listed = {action.dest: action for action in self.commands._choices_actions}
        for purpose, names in COMMANDS.items():
            formatter.start_section(purpose)
            formatter.add_arguments([listed[name] for name in names])
            formatter.end_section()
        formatter.start_section("options")
        formatter.add_arguments(self._get_optional_actions())
        formatter.end_section()
        formatter.add_text(self.epilog)
        return formatter.format_help()


class _Completion(argparse.Action):
    """Print the completion of a shell, made from the options of all commands, and end."""

    def __call__(self, parser, namespace, values, option_string=None):
        import shtab

        assert isinstance(parser, Root)
        root = parser.whole()
        places = {"FILE": shtab.FILE, "FOLDER": shtab.DIRECTORY, "DATA": shtab.FILE}
        for one in _parsers(root):
            for action in one._actions:
                if action.metavar in places:
                    action.complete = places[action.metavar]  # type: ignore[attr-defined]
        print(shtab.complete(root, str(values)))
        parser.exit()


def _parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """A parser and those of its words."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from _parsers(inner)


def _brief(end: float) -> str:
    whole = float(end).is_integer() and abs(end) < 1e9
    return f"{end:,.0f}" if whole else f"{end:.4g}"


def span(known: Any) -> str:
    """The range of a `Parameter` in words."""
    low, high = map(_brief, (known.low, known.high))
    least = f"above {low}" if known.low_open else low
    most = f"below {high}" if known.high_open else high
    if math.isinf(known.low) and math.isinf(known.high):
        return "any number"
    if math.isinf(known.high):
        return least if known.low_open else f"at least {low}"
    if math.isinf(known.low):
        return most if known.high_open else f"at most {high}"
    return f"{least} to {most}"


def number_help(known: Any, told: str | float | None, each: bool = False) -> str:
    """The help of an option for a number: meaning, unit, range, and default if there is one.

    Args:
        known: a `Parameter`.
        told: the default, or words for it.
        each: whether the range is that of each of several numbers.
    """
    unit = f" [{known.unit}]" if known.unit else ""
    usual = told if told is None or isinstance(told, str) else f"{told:.4g}"
    default = "" if usual is None else f"; default: {usual}"
    return f"{known.meaning}{unit} ({'each ' if each else ''}{span(known)}{default})"
