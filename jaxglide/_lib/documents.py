"""Documents from outside: read within bounds, of declared structure.

A reader declares the structure of its document once, as msgspec's `Struct`; whatever does
not fit is told in one sentence that names the file, the entry, its value and what is allowed.
"""

import contextlib
import re
import reprlib
import tomllib
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec

LARGEST = 2**26
"""Most bytes of a document."""

_WORDS = {
    "object": "a table",
    "array": "a list",
    "str": "a text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
}
_PROBLEM = re.compile(r"(?P<said>.*?)(?: - at `\$\.?(?P<path>.*)`)?", re.DOTALL)
_WRONG_TYPE = re.compile(r"Expected `(?P<wanted>[^`]*)`, got `[^`]*`")
_LIMIT = re.compile(r"Expected `(?P<wanted>[^`]*)` (?P<limit>[<>]=? .*)")
_UNKNOWN = re.compile(r"Object contains unknown field `(?P<name>.*)`")
_MISSING = re.compile(r"Object missing required field `(?P<name>.*)`")


def read_text(path: str | Path, errors: str = "strict") -> str:
    """A text file in UTF-8, its size bounded before it is read.

    Args:
        path: the file.
        errors: what becomes of bytes that are not UTF-8, as in `bytes.decode`.

    Raises:
        ValueError: larger than `LARGEST`, or not UTF-8.
        OSError: it cannot be read.
    """
    with Path(path).open("rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise ValueError(f"{path}: larger than {LARGEST >> 20} MiB, which is not allowed")
    try:
        return data.decode("utf-8-sig", errors)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"{path}, line {line}: byte {data[error.start]:#04x} is not UTF-8 text"
        ) from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """The entries of a TOML file, in its order.

    Raises:
        ValueError: too large, or no TOML.
        OSError: it cannot be read.
    """
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"{path}: not a TOML file: it is nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path}: not a TOML file: {error}") from None


def fitted(
    document: Any,
    kind: Any,
    path: str | Path,
    hints: Mapping[str, str] | None = None,
    place: str = "",
) -> Any:
    """A document as what `kind` declares; numbers are not taken from texts or booleans.

    Args:
        document: its entries, or the value of one.
        kind: its structure.
        path: its file, for the message.
        hints: what is allowed, in words, by name of an entry at the top.
        place: the entry whose value it is, such as `grid.nu_theta`.

    Raises:
        ValueError: it is not of that structure.
    """
    try:
        return msgspec.convert(document, kind)
    except msgspec.ValidationError as error:
        said = _in_words(str(error), document, kind, hints or {}, place)
        raise ValueError(f"{path}: {said}") from None


@contextlib.contextmanager
def about(path: str | Path) -> Iterator[None]:
    """Name a file at the head of what is said against its content in the block.

    Raises:
        ValueError: instead of any `ValueError` or `TypeError`.
    """
    try:
        yield
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from None


def shown(value: Any) -> str:
    """A value for a message, cut where it is long."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python does not print whole numbers of thousands of digits
        return f"a number of {value.bit_length()} bits"


def _in_words(
    problem: str, document: Any, kind: Any, hints: Mapping[str, str], place: str
) -> str:
    """What msgspec says, with the value and what is allowed."""
    said, inside = _PROBLEM.fullmatch(problem).groups()  # type: ignore[union-attr]
    inside = inside or ""
    path = place + ("." if place and inside[:1] not in ("", "[") else "") + inside
    hint = hints.get(re.split(r"[.[]", path)[0], "")
    hint = f"; {hint}" if hint else ""
    if unknown := _UNKNOWN.fullmatch(said):
        where, known = f" in {path}" if path else "", ", ".join(_entries(kind, inside))
        return f"there is no entry {unknown['name']!r}{where}: known are {known}"
    if missing := _MISSING.fullmatch(said):
        return f"{missing['name']!r} is missing{f' in {path}' if path else ''}{hint}"
    value = shown(_at(document, inside))
    if wrong := _WRONG_TYPE.fullmatch(said):
        wanted = " or ".join(_WORDS.get(w, w) for w in wrong["wanted"].split(" | "))
        return f"{path} = {value} is not {wanted}{hint}"
    if limit := _LIMIT.fullmatch(said):
        return f"{path} = {value} is not allowed: it must be {limit['limit']}{hint}"
    return f"{path} = {value} is not allowed: {said[0].lower()}{said[1:]}{hint}"


def _entries(kind: Any, path: str) -> tuple[str, ...]:
    """Names of the entries of the table at a path in a structure."""
    for name in ("", *filter(None, path.split("."))):
        if name:
            kind = next(f for f in msgspec.structs.fields(kind) if f.encode_name == name).type
        kinds = [kind, *typing.get_args(kind)]
        kind = next(k for k in kinds if hasattr(k, "__struct_fields__"))
    return kind.__struct_encode_fields__


def _at(document: Any, path: str) -> Any:
    """The value that a path such as `grid.nu_theta[0]` leads to."""
    for name, index in re.findall(r"([^.\[\]]+)(?=[.\[]|$)|\[(\d+)\]", path):
        document = document[name] if name else document[int(index)]
    return document
