"""The published snake as a case: what is varied where nothing else is given."""

from collections.abc import Mapping
from typing import Any

from .._lib.checks import check_choice, check_integer
from .._lib.defaults import CHOICES, NODES, NODES_RANGE
from ..body.snake import Snake
from ..flight.case import Case
from ..flight.dynamics import Glider
from ..loads.polar import Polar
from ..shape.gait import Gait

FOLLOW = ("gait.theta_m", "body.mass")
"""What follows in the published snake: the amplitude the shape line, the mass the length."""


def check_setup(setup: Mapping[str, Any]) -> dict[str, Any]:
    """The setup with defaults filled in: polar, node_set, nodes.

    Raises:
        ValueError: an unknown name or value.
    """
    unknown = set(setup) - {*CHOICES, "nodes"}
    if unknown:
        raise ValueError(f"there is no setting {sorted(unknown)[0]!r}")
    full = {name: setup.get(name, choices[0]) for name, choices in CHOICES.items()}
    for name, choices in CHOICES.items():
        check_choice(name, full[name], choices)
    nodes = setup.get("nodes")
    nodes = NODES[full["node_set"]] if nodes is None else nodes
    check_integer("nodes", nodes, *NODES_RANGE)
    # NumPy's own kinds of text and number are not JSON's
    return {name: str(choice) for name, choice in full.items()} | {"nodes": int(nodes)}


def published_case(setup: Mapping[str, Any] | None = None) -> Case:
    """The published snake, its gait and its launch from 10 m.

    Args:
        setup: "polar", "node_set" and "nodes" (see `check_setup`).

    Raises:
        ValueError: an unknown setting or value.
    """
    chosen = check_setup(setup or {})
    snake = Snake.from_svl(nodes=chosen["nodes"], node_set=chosen["node_set"])
    glider = Glider(snake, Gait.from_degrees(), Polar.from_name(chosen["polar"]))
    return Case(glider, follow=FOLLOW)
