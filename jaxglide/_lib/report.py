"""What a result says of itself: the same lines on a terminal and in a notebook."""

import html
from typing import NamedTuple

_WIDTH = 17  # of the names of rows


class Report(NamedTuple):
    """A title, rows of a name and a text, and sentences below.

    Attributes:
        title: one sentence.
        rows: names and what they say.
        notes: sentences.
    """

    title: str
    rows: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        rows = (f"  {name:{_WIDTH}}{text}".rstrip() for name, text in self.rows)
        return "\n".join([self.title, *rows, *(f"  {note}" for note in self.notes)])

    def html(self) -> str:
        """The report as HTML, everything in it escaped."""
        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
            f"<td style='text-align:left; white-space:pre'>{html.escape(text)}</td></tr>"
            for name, text in self.rows
        )
        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        return f"<p><b>{html.escape(self.title)}</b></p><table>{rows}</table>{notes}"


class Reported:
    """A result with a report, which is what it prints."""

    def report(self) -> Report:
        """What this result says of itself."""
        raise NotImplementedError

    def __str__(self) -> str:
        return str(self.report())

    def _repr_html_(self) -> str:
        return self.report().html()
