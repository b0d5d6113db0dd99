"""The command line: one file a command, which is loaded where it is the one to run."""

import contextlib
import gc
import io
import os
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from importlib import import_module

from .._lib.writing import WriteError
from ._help import COMMANDS, FIRST_STEPS, Root
from ._options import UsageError, check_output, check_ranges
from ._setup import configure

__all__ = ["configure", "main"]


def _parser(words: Sequence[str] | None = None) -> Root:
    """The parser, with the options of the command that `words` name; of all without words."""
    known = {name for names in COMMANDS.values() for name in names}
    named = known if words is None else [word for word in words if word in known][:1]
    root = Root(_parser)
    for names in COMMANDS.values():
        for name, text in names.items():
            if name in named:
                new = partial(root.commands.add_parser, name, help=text)
                import_module(f".{name}", __name__).add(new)
            else:
                root.commands.add_parser(name, help=text)
    return root


@contextlib.contextmanager
def _standard_output() -> Iterator[None]:
    """See that what is printed goes out, before Python does at its exit, where it complains.

    Characters that the terminal cannot show are spelled out instead of raising.
    """
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        yield
    finally:
        try:
            if sys.stdout is not None:
                sys.stdout.flush()
        except BrokenPipeError:
            _drop_output()
            raise
        except OSError as error:
            _drop_output()
            raise WriteError(f"cannot write standard output: {error.strerror}") from error


@contextlib.contextmanager
def _loading() -> Iterator[None]:
    """Load without looking for garbage among a million objects that stay, now or later."""
    looking = gc.isenabled()
    gc.disable()
    try:
        yield
        gc.freeze()
    finally:
        if looking:
            gc.enable()


def _drop_output() -> None:
    """What is left to print goes nowhere; see `BrokenPipeError` at docs.python.org."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())


def _short(said: str) -> str:
    """A sentence that echoes what was given, without the middle of something endless."""
    return said if len(said) <= 500 else f"{said[:300]} … {said[-180:]}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (0 done, 1 failed, 2 wrong input)."""
    try:
        with _standard_output():
            configure()
            words = sys.argv[1:] if argv is None else argv
            if not words:
                print(FIRST_STEPS, end="")
                return 0
            with _loading():
                args = _parser(words).parse_args(words)
            check_output(args)
            check_ranges(args)
            return args.run(args)
    except BrokenPipeError:  # who reads what is printed has seen enough
        return 1
    except (UsageError, ValueError, TypeError) as error:
        print(f"jaxglide: {_short(str(error))}", file=sys.stderr)
        return 2
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        said = f"{where}{error.strerror}" if error.strerror else str(error)
        print(f"jaxglide: {_short(said)}", file=sys.stderr)
        return 1
    except MemoryError as error:
        print(f"jaxglide: not enough memory: {_short(str(error))}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("jaxglide: interrupted", file=sys.stderr)
        return 1
