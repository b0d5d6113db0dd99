"""Units: their names in files, and conversion of what comes in others.

People read `deg` and `deg/SVL`; a file says `degree`, which both UDUNITS and pint read, and
what an angle is per stands in the long name.
"""

import re
from functools import cache
from typing import Any

_NAME = r"(?:[^\W\d]+|[%°])(?:(?:\*\*|\^)?-?\d)?"
_UNIT = re.compile(rf"(?:(?:1|{_NAME})(?:\s*[*/·.]\s*|\s+))*(?:1|{_NAME})")
_POWER = re.compile(r"([^\W\d_])(-?\d)")


_IN_FILES = {  # name in files, and what the long name adds
    "deg": ("degree", ""),
    "deg/s": ("degree/s", ""),
    "deg/SVL": ("degree", ", per SVL"),
    "1/SVL": ("1", ", per SVL"),
    "of SVL": ("1", ", over SVL"),
    "chords": ("1", ", in chords"),
    "half chords": ("1", ", in half chords"),
    "mixed": ("1", ", in mixed units"),
}


def in_file(unit: str) -> str:
    """A unit that people read as files name it."""
    return _IN_FILES.get(unit, (unit, ""))[0]


def labelled(unit: str, long_name: str) -> dict[str, str]:
    """Attributes of a variable in a file.

    Args:
        unit: as people read it, such as deg/SVL.
        long_name: what the variable is.
    """
    named, more = _IN_FILES.get(unit, (unit, ""))
    return {"units": named, "long_name": long_name + more}


def factor(given: str, wanted: str) -> float:
    """What a number in unit `given` is multiplied by to be in unit `wanted`.

    Angles are a dimension of their own: neither degrees for a plain number nor rad/s for Hz.

    Raises:
        ValueError: `given` is no unit, or one of something else.
    """
    given, wanted = in_file(given.strip().removesuffix("/SVL")), in_file(wanted)
    if {given, wanted} <= {"", "1"} or given == wanted:
        return 1.0
    size, dimension = _root(given)
    whole, needed = _root(wanted)
    if dimension != needed:
        raise ValueError(f"{given!r} cannot be converted to {wanted or '1'!r}")
    return size / whole


@cache
def _registry() -> Any:
    import pint  # a third of a second, for files in other units only

    return pint.UnitRegistry()


def _root(unit: str) -> tuple[float, Any]:
    """Size of a unit, and its dimensions as powers of basic units."""
    try:
        if unit and (len(unit) > 40 or not _UNIT.fullmatch(unit)):
            raise ValueError
        found = _registry().Quantity(1.0, _POWER.sub(r"\1**\2", unit)).to_root_units()
        return float(found.magnitude), found.units
    except Exception:  # pint raises errors of many kinds, of tokens too
        raise ValueError(f"{unit[:40]!r} is not a known unit") from None
