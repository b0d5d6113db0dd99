"""Evaluations of an optimisation, kept as they come (floor 5)."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from .problem import Evaluation


class Journal:
    """Evaluations kept as lines of JSON, so that a killed run goes on where it was.

    What happens between evaluations is cheap and exact, and is simply done again.
    """

    def __init__(self, path: str | Path | None, header: dict[str, Any]):
        self.path = None if path is None else Path(path)
        self.kept: list[dict] = []
        self.recalled = 0
        if self.path is None:
            return
        first = json.dumps({"jaxglide": "optimise", **header}, sort_keys=True)
        if not self.path.exists():
            self.path.write_text(first + "\n")
            return
        lines = self.path.read_text().split("\n")
        if lines[0] != first:
            raise ValueError(f"{self.path} is the log of another optimisation")
        for line in lines[1:-1]:  # what follows the last end of line was cut short
            try:
                self.kept.append(json.loads(line))
            except ValueError:
                raise ValueError(f"{self.path} is damaged: {line[:40]!r}") from None
        self.path.write_text("\n".join(lines[: 1 + len(self.kept)]) + "\n")

    def recall(self, index: np.ndarray) -> Evaluation | None:
        """The next evaluation, of the starts `index`, if it was kept."""
        if self.recalled >= len(self.kept):
            return None
        line = self.kept[self.recalled]
        if line["starts"] != index.tolist():
            raise ValueError(
                f"{self.path} is damaged: other starts in line {self.recalled + 2}"
            )
        self.recalled += 1
        return Evaluation(np.array(line["values"]), np.array(line["gradients"]))

    def keep(self, index: np.ndarray, found: Evaluation) -> None:
        """Append an evaluation and see that it reaches the disk."""
        if self.path is None:
            return
        line = {"starts": index.tolist(), "values": found.values.tolist()}
        line["gradients"] = found.gradients.tolist()
        with self.path.open("a") as file:
            file.write(json.dumps(line) + "\n")
            file.flush()
            os.fsync(file.fileno())
