"""What a page claims: commands, code and numbers, and whether a run agrees with them."""

import re
from collections.abc import Iterator
from typing import Any

_NUMBER = r"[−+-]?\d{1,3}(?:,\d{3})+|[−+-]?\d+(?:\.\d+)?"  # noqa: RUF001
_CLAIM = re.compile(rf"(?<![\w.,])({_NUMBER})(?:–({_NUMBER}))?(?![\w]*\d)")  # noqa: RUF001


def section(page: str, title: str) -> str:
    """Text of a section, without its title, up to the next of any level above it."""
    level = re.search(rf"^(#+) {re.escape(title)}$", page, flags=re.MULTILINE)
    assert level, f"no section {title!r}"
    rest = page[level.end() :]
    return re.split(rf"^#{{1,{len(level[1])}}} ", rest, maxsplit=1, flags=re.MULTILINE)[0]


def blocks(page: str, language: str) -> list[str]:
    """Code blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", page, flags=re.DOTALL)


def commands(page: str) -> Iterator[str]:
    """Whole commands, in blocks and in the text, in order; not those with FILE or ADDRESS."""
    for block, span in re.findall(r"```sh\n(.*?)```|`([^`\n]+)`", page, flags=re.DOTALL):
        for line in re.split(r"\n| && ", block or span):
            words = re.sub(r"^\w+=\S+ ", "", line.strip()).split()  # without its environment
            named = len(words) > 1 and words[0] == "jaxglide" and words[1] != "COMMAND"
            if named and not any(word.isupper() for word in words):
                yield " ".join(words)


def table(page: str, first: str) -> list[list[str]]:
    """Rows of the one table whose first heading, or headings, are `first`, cell by cell."""
    lines = page.splitlines()
    heads = [k - 1 for k, line in enumerate(lines) if line.startswith("| ---")]
    begins = [k for k in heads if lines[k].startswith(f"| {first} |")]
    assert len(begins) == 1, f"{len(begins)} tables begin with {first!r}"
    rows = []
    for line in lines[begins[0] + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("| ").split(" | ")])
    return rows


def claimed(text: str) -> list[tuple[float, float]]:
    """Numbers in a text, each as the range that it claims.

    A number claims what rounds to it, a range such as 5.035-5.049 what lies between too.
    """
    found = []
    for low, high in _CLAIM.findall(text):
        ends = [_value(end) for end in (low, high or low)]
        half = 0.5000001 * 10.0 ** -len(low.partition(".")[2])
        found.append((min(ends) - half, max(ends) + half))
    return found


def _value(text: str) -> float:
    return float(text.replace("−", "-").replace(",", ""))  # noqa: RUF001


def agree(text: str, *values: Any, share: float = 0.0) -> None:
    """Assert that `values` are the numbers in `text`, within what their digits claim.

    Args:
        text: of a page; its numbers, in order, are compared.
        values: as many numbers.
        share: of each value, allowed on top: the spread that the page states.
    """
    ranges = claimed(text)
    assert len(ranges) == len(values), f"{text!r} has other numbers than {values}"
    for (low, high), value in zip(ranges, map(float, values), strict=True):
        more = share * abs(value)
        assert low - more <= value <= high + more, f"the page says {text!r}, a run {values}"


def sentence(page: str, pattern: str) -> str:
    """The part of a page that matches a pattern, its groups joined; line breaks are spaces."""
    found = re.search(pattern, " ".join(page.split()))
    assert found, f"the page does not say {pattern!r}"
    return " ; ".join(found.groups() or [found[0]])
