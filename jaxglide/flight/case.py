"""A glider, its launch and its ends as one: what a study, a trim or a search varies."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import numpy as np

from .._lib import paths
from .._lib.checks import check_kind, check_shapes, in_numpy
from .._lib.fields import Parameter, Part
from .dynamics import Glider
from .ends import AbstractEnd, check_ends, default_ends
from .launch import Launch


class Case(Part):
    """A glider, its launch, and what ends the flight.

    Every float in them is a parameter, named by its path, `gait.nu_theta`, `body.mass`,
    `launch.height`, or by its last name where that is unique, `nu_theta`. A part of a user's
    own counts as the package's do.

    Args:
        glider: what flies.
        launch: how; by default from 10 m at the published speed.
        ends: what ends it; by default the ground and 85 degrees of yaw, pitch or roll.
        follow: paths of parameters that follow from others by their own rule as long as they
            are not varied: `gait.theta_m` the published shape line, `body.mass` the length
            (static); by default none does.

    Raises:
        TypeError: a part is of another type.
        ValueError: what is to follow has no rule.
    """

    glider: Glider
    launch: Launch = eqx.field(default_factory=Launch)
    ends: tuple[AbstractEnd, ...] = eqx.field(
        converter=check_ends, default_factory=default_ends
    )
    follow: tuple[str, ...] = eqx.field(static=True, default=(), converter=tuple)

    def _check(self):
        check_kind("glider", self.glider, Glider)
        check_kind("launch", self.launch, Launch)
        for path in self.follow:
            if self.parameter(path).rule is None:
                raise ValueError(f"{path} follows from nothing: give it a value")

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Every parameter by its path."""
        found = paths.parameters(self)
        return {_outside(path): about for path, about in found.items()}

    def path(self, name: str) -> str:
        """The path that a name means; see `Case`.

        Raises:
            ValueError: it means none, or several; the message lists them.
        """
        try:
            return _outside(paths.resolve(self, _inside(self, name)))
        except ValueError as error:
            raise ValueError(str(error).replace("glider.", "")) from None

    def name(self, path: str) -> str:
        """The briefest name that means a path."""
        return _outside(paths.short_name(self, _inside(self, path)))

    def parameter(self, name: str) -> Parameter:
        """What is known of a parameter."""
        return paths.described(self, _inside(self, self.path(name)))

    def value(self, name: str) -> Any:
        """Its value, in the unit that people read, or None where it is left out."""
        path = _inside(self, self.path(name))
        found = paths.get(self, path)
        return None if found is None else in_numpy(found) / paths.described(self, path).factor

    def check(self, values: Mapping[str, Any]) -> None:
        """Raise `ValueError` for an unknown name, a value out of range, or an array's name.

        Args:
            values: by name, numbers or arrays, in the units that people read.
        """
        for name, value in values.items():
            self.parameter(name).check(name, value)
            inside, case = _inside(self, self.path(name)), self
            if paths.get(case, inside) is None:  # left out: is it one number where it is given?
                case = paths.put(self, {inside: 0.0})
                check_shapes(paths.get(case, inside.rpartition(".")[0]))
            shape = np.shape(paths.get(case, inside))
            if shape:
                raise ValueError(
                    f"{name} is an array of shape {shape}: name a number in it, such as "
                    f"{name}[{','.join('0' * len(shape))}]"
                )

    def replace(self, values: Mapping[str, Any]) -> "Case":
        """The case with other values, which may be traced; what follows from them follows.

        Args:
            values: by name, one number each, in the units that people read.
        """
        given = {self.path(name): value for name, value in values.items()}
        case = paths.put(self, {_inside(self, path): v for path, v in given.items()})
        for path in self.follow:
            if path not in given:
                inside = _inside(self, path)
                owner = paths.get(case, inside.rpartition(".")[0])
                known = paths.described(case, inside)
                assert known.rule is not None
                case = paths.put(case, {inside: known.rule(owner) / known.factor})
        return case


def _inside(case: Case, name: str) -> str:
    """A path as seen from the case: the glider's own fields are named without it."""
    if not isinstance(name, str):
        raise TypeError(f"{name!r} is not the name of a parameter")
    first = name.split(".")[0].split("[")[0]
    return f"glider.{name}" if hasattr(case.glider, first) else name


def _outside(path: str) -> str:
    return path.removeprefix("glider.")
