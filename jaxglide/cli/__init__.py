"""The command line (floor 7): one file a command. JAX is set up here, before it loads."""

import sys
from collections.abc import Sequence

from . import (
    compare,
    figure,
    glide,
    gradient,
    measure,
    optimise,
    plot,
    shapes,
    sweep,
    trim,
    view,
    windtunnel,
)
from ._options import Parser, UsageError, check_output, check_ranges
from ._setup import configure

__all__ = ["configure", "main"]

COMMANDS = (
    glide,
    shapes,
    sweep,
    windtunnel,
    trim,
    gradient,
    optimise,
    measure,
    compare,
    plot,
    view,
    figure,
)


def _parser() -> Parser:
    parser = Parser(
        prog="jaxglide",
        description="The flight dynamics of flying snakes, as a differentiable model.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (0 done, 1 failed, 2 wrong input)."""
    try:
        args = _parser().parse_args(argv)
        check_output(args)
        configure()
        check_ranges(args)
        return args.run(args)
    except (UsageError, ValueError, TypeError) as error:
        print(f"jaxglide: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"jaxglide: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("jaxglide: interrupted", file=sys.stderr)
        return 1
