"""What a module's fields remember of their numbers, as a table below its docstring."""

import math

import equinox as eqx
from sphinx.pycode import ModuleAnalyzer

import jaxglide
from jaxglide._lib.fields import parameters_of
from jaxglide.search.objective import Objective

_PUBLIC = {id(getattr(jaxglide, name)) for name in jaxglide.__all__}


def _end(value: float) -> str:
    return f"{value:g}".replace("inf", "∞").replace("-", "−")  # noqa: RUF001


def _range(known) -> str:
    if math.isinf(known.low) and math.isinf(known.high):
        return ""
    left = "(" if known.low_open or math.isinf(known.low) else "["
    right = ")" if known.high_open or math.isinf(known.high) else "]"
    return f"{left}{_end(known.low)}, {_end(known.high)}{right}"


def _row(name, known) -> list[str]:
    default = "" if known.default is None else _end(known.default)
    seen = "" if known.observed is None else " to ".join(map(_end, known.observed))
    cells = [f"``{name}``", known.unit, _range(known), default, seen, known.meaning]
    return [
        f"   {'* ' if first else '  '}- {cell}"
        for first, cell in zip([True] + [False] * 5, cells, strict=True)
    ]


def tabulate(app, what, name, obj, options, lines):
    """Append the table of an Equinox module's parameters."""
    if not (isinstance(obj, type) and issubclass(obj, eqx.Module)):
        return
    known = parameters_of(obj)
    if not known:
        return
    lines += [
        "",
        ".. list-table:: Its numbers, in the units people read",
        "   :header-rows: 1",
        "   :class: parameters",
        "",
    ]
    heads = "name", "unit", "range", "default", "observed", "meaning"
    lines += [f"   {'* ' if n == 0 else '  '}- {head}" for n, head in enumerate(heads)]
    for field, parameter in known.items():
        lines += _row(field, parameter)
    lines.append("")


def objective(app, what, name, obj, options, lines):
    """An objective's own words instead of those of its class."""
    if isinstance(obj, Objective):
        words = ModuleAnalyzer.for_module("jaxglide.search.objectives").find_attr_docs()
        lines[:] = words["", name.rpartition(".")[2]] + [f"Unit: {obj.unit or 'none'}.", ""]


def skip(app, what, name, obj, skipped, options):
    """Leave out fields of named tuples, which the docstring explains, and, of the pages of the
    rooms, what the public pages have."""
    if type(obj).__name__ == "_tuplegetter":
        return True
    return True if what == "module" and id(obj) in _PUBLIC else None


def setup(app):
    app.connect("autodoc-process-docstring", tabulate)
    app.connect("autodoc-process-docstring", objective, priority=400)  # before the citations
    app.connect("autodoc-skip-member", skip)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
