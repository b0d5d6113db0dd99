"""What a dataset is, told by its attribute `format`, and what makes it follow CF.

CF: the conventions for climate and forecast metadata, which much software reads.
"""

import xarray as xr

from .version import VERSION as PACKAGE_VERSION

VERSION = 2
"""Of the formats of all results; those of version 1 did not say which they are."""

TITLES = {
    "glide": "A glide of a flying snake or another body",
    "trajectory": "A piece of flight of a flying snake or another body",
    "controller": "What steers a flying snake, and the flight that it is for",
    "controlled flights": "Random flights under control, by the law that steers",
    "steady glide": "A steady glide of a flying snake or another body",
    "glides": "Glides of many cases, of a sweep",
    "shape space": "Glides of the published shape space",
    "steady glides": "Steady glides of many cases, and their stability",
    "held glides": "Moments of bodies that fall at a held attitude",
    "steady branch": "A steady glide followed along a number",
    "optimisation": "History of an optimisation",
    "search log": "Evaluations of an optimisation",
    "measured flights": "Measured flights of snakes, and their gaits",
    "compared flights": "Measured flights of snakes beside their simulations",
    "fit": "Force coefficients fitted to measured flights",
}
"""Kinds of results, and what each is."""

CONVENTIONS = "CF-1.11"
_STANDARD_NAMES = {  # of CF's table, which has none for the others
    "air_density": "air_density",
    "outcome": "status_flag",
    "launch_speed": "platform_speed_wrt_ground",
}


def marked(data: xr.Dataset, kind: str) -> xr.Dataset:
    """The dataset with its format and what CF asks for in its attributes.

    Args:
        data: variables with `units` and `long_name`.
        kind: what it is, one of `TITLES`.
    """
    data = data.copy()
    for name, standard in _STANDARD_NAMES.items():
        known = data[name].attrs if name in data.variables else {}
        if ("flag_values" if standard == "status_flag" else "units") in known:
            known["standard_name"] = standard
    return data.assign_attrs(
        format=f"jaxglide {kind} {VERSION}",
        title=TITLES[kind],
        Conventions=CONVENTIONS,
        history=f"computed by jaxglide {PACKAGE_VERSION}",
    )


def kind_of(data: xr.Dataset) -> str | None:
    """What a dataset is, one of `TITLES`; None for one that does not say.

    Raises:
        ValueError: it is of a version that is not known here.
    """
    said = data.attrs.get("format")
    if said is None:
        return None
    name, _, rest = str(said).partition(" ")
    kind, _, version = rest.rpartition(" ")
    if name != "jaxglide" or kind not in TITLES:
        raise ValueError(f"format = {str(said)[:60]!r} is none of jaxglide's")
    if version != str(VERSION):
        raise ValueError(
            f"format = {said!r} is of version {version}: this jaxglide reads {VERSION}"
        )
    return kind
