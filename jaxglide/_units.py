"""Units: their names in files, and conversion of what comes in others (floor 0).

People read `deg` and `deg/SVL`; a file says `degree`, which both UDUNITS and pint read, and
what an angle is per stands in the long name.
"""

import re
from functools import cache
from typing import Any

_NAME = r"(?:[^\W\d]+|[%°])(?:(?:\*\*|\^)?-?\d)?"
_UNIT = re.compile(rf"(?:(?:1|{_NAME})(?:\s*[*/·.]\s*|\s+))*(?:1|{_NAME})")
_POWER = re.compile(r"([^\W\d_])(-?\d)")


def in_file(unit: str) -> str:
    """A unit that people read as files name it."""
    return re.sub(r"\bdeg\b", "degree", unit).removesuffix("/SVL")


def labelled(unit: str, long_name: str) -> dict[str, str]:
    """Attributes of a variable in a file.

    Args:
        unit: as people read it, such as deg/SVL.
        long_name: what the variable is.
    """
    per = ", per SVL" if unit.endswith("/SVL") else ""
    return {"units": in_file(unit), "long_name": long_name + per}


def factor(given: str, wanted: str) -> float:
    """What a number in unit `given` is multiplied by to be in unit `wanted`.

    Angles are a dimension of their own: neither degrees for a plain number nor rad/s for Hz.

    Raises:
        ValueError: `given` is no unit, or one of something else.
    """
    given, wanted = in_file(given.strip()), in_file(wanted)
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
