"""Picture of what becomes of small changes: multipliers beside the unit circle."""

from collections.abc import Iterable, Sequence
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from ..steady import Mode, SteadyGlide
from ._labels import plain
from ._style import COLUMN_WIDTH, INK, PITCH, ROLL, YAW, new_figure, place, style
from .steady import check_found

_COLOURS = (YAW, PITCH, ROLL, "#CC79A7", "#56B4E9", "#E69F00", INK)
_MARKS = ("o", "s", "^", "D", "v", "P", "X")
_LEFT, _BOTTOM, _SIDE, _TOP = 11.0, 9.0, 39.0, 2.5  # of the axes [mm]
_LINE = 3.6  # of a legend [mm]
_INDENT = 12 * " "  # as wide as a multiplier
_WIDEST = 18  # characters of a name in a line
_WORDS = {
    "v_right": "sideslip",
    "v_forward": "forward speed",
    "v_up": "sinking",
    "omega_x": "rate of pitch",
    "omega_y": "rate of roll",
    "omega_z": "rate of yaw",
}


@style()
def spectrum(
    glides: SteadyGlide | Sequence[SteadyGlide],
    ax: Axes | None = None,
    *,
    labels: Sequence[str] | None = None,
) -> Axes:
    """Multipliers of steady glides in the complex plane, with the unit circle.

    A change of the kind of a multiplier inside the circle dies out, outside it grows. Of one
    glide every mode is named, with the factor by which it changes in a cycle (of a frozen
    body, in a second); of several every one has a mark.

    Args:
        glides: a steady glide that was found, or several.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        labels: what to call several glides, one each.

    Raises:
        ValueError: there is none, one was not found or is a batch, or not one label a glide.
    """
    several = [glides] if isinstance(glides, SteadyGlide) else list(glides)
    if not several:
        raise ValueError("glides is empty: pass a steady glide or several")
    for glide in several:
        check_found(glide)
    names = [f"{k + 1}" for k in range(len(several))] if labels is None else list(labels)
    if len(names) != len(several):
        raise ValueError(f"labels has {len(names)} for {len(several)} glides: one a glide")
    rows = _modes(several[0]) if len(several) == 1 else _glides(several, names)
    ax = _axes([name for name, _ in rows]) if ax is None else ax
    most = max(1.0, *(float(glide.spectral_radius) for glide in several))
    _plane(ax, 1.12 * most, {glide.frozen for glide in several})
    for k, (name, values) in enumerate(rows):
        colour, mark = _COLOURS[k % 7], _MARKS[(k + k // 7) % 7]
        look = {"color": colour, "marker": mark, "ls": "", "ms": 3.4, "mew": 0}
        ax.plot(np.real(values), np.imag(values), label=name, zorder=4, clip_on=False, **look)
    ax.legend(loc="center left", bbox_to_anchor=(1.03, 0.5), borderaxespad=0, handlelength=1.0)
    return ax


def _modes(glide: SteadyGlide) -> list[tuple[str, np.ndarray]]:
    """What is said of every mode, and its multipliers."""
    return [(_said(mode), _with_conjugate(mode.multiplier)) for mode in glide.modes]


def _with_conjugate(value: complex) -> np.ndarray:
    return np.array([value, value.conjugate()] if value.imag else [value])


def _said(mode: Mode) -> str:
    leading = max(mode.shares, key=lambda name: mode.shares[name])
    name = mode.name or f"mostly {_WORDS.get(leading, leading)}"
    size = abs(mode.multiplier)
    said = f"{size:.{3 if size < 1 else 2}f}" if size >= 1e-3 else "<0.001"
    return f"{said}   " + f"\n{_INDENT}".join(wrap(name, _WIDEST))


def _glides(
    glides: Sequence[SteadyGlide], names: Sequence[str]
) -> list[tuple[str, np.ndarray]]:
    """What every glide is called, and its multipliers."""
    named = zip(names, glides, strict=True)
    return [(plain(name), np.asarray(glide.multipliers)) for name, glide in named]


def _axes(rows: Iterable[str]) -> Axes:
    """Axes beside room for as many lines of a legend."""
    room = max(_SIDE, _LINE * sum(1 + name.count("\n") for name in rows))
    figure = new_figure(COLUMN_WIDTH, _BOTTOM + room + _TOP)
    ax = figure.add_axes((0, 0, 1, 1))
    place(figure, ax, _LEFT, _BOTTOM + (room - _SIDE) / 2, _SIDE, _SIDE)
    return ax


def _plane(ax: Axes, half: float, frozen: set[bool]) -> None:
    """The complex plane up to `half`, the unit disc in it."""
    ax.add_patch(Circle((0, 0), 1.0, fc="0.94", ec=INK, lw=0.7, zorder=1))
    for line in (ax.axhline, ax.axvline):
        line(0.0, color="0.8", lw=0.5, zorder=2)
    ax.set_xlim(-half, half)
    ax.set_ylim(-half, half)
    ax.set_aspect("equal")
    every = " or ".join({False: "cycle", True: "second"}[one] for one in sorted(frozen))
    ax.set_xlabel(rf"real part of $\mu$, per {every}")
    ax.set_ylabel(r"imaginary part of $\mu$")
