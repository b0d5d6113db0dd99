"""Parameters by path: names, units, what follows from what, and a user's own parts."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    AbstractAir,
    Case,
    Gait,
    Glider,
    Launch,
    Snake,
    UniformWind,
    mass_from_length,
    shape_line,
)

BASE = Case(Glider(Snake.from_svl(), Gait.from_degrees()), follow=("gait.theta_m", "body.mass"))


class Draught(AbstractAir):
    """A part from outside that describes none of its floats."""

    strength: float = 1.0

    def wind(self, position, time):
        return jnp.zeros_like(position).at[0].set(self.strength)


def test_a_parameter_has_a_path_and_often_a_short_name():
    assert BASE.path("nu_theta") == BASE.path("gait.nu_theta") == "gait.nu_theta"
    assert BASE.path("svl") == "body.length"
    assert BASE.path("height") == "launch.height"
    assert BASE.path("limit") == "ends[1].limit"
    assert BASE.name("body.length") == "svl"
    assert BASE.parameter("d_psi").unit == "deg/SVL"
    assert BASE.value("psi_m") == pytest.approx(20.0, rel=1e-15)
    assert BASE.value("speed") is None


def test_values_are_in_the_units_people_read():
    case = BASE.replace({"d_psi": -5.0, "speed": 3.0, "height": 75.0, "launch.elevation": 10.0})
    assert float(case.glider.gait.d_psi) == np.deg2rad(-5.0)
    assert (float(case.launch.speed), float(case.launch.height)) == (3.0, 75.0)
    assert float(case.launch.elevation) == np.deg2rad(10.0)


def test_what_is_not_varied_follows_by_its_rule():
    case = BASE.replace({"nu_theta": 1.0, "svl": 0.8})
    assert float(case.value("theta_m")) == pytest.approx(shape_line(1.0), rel=1e-14)
    assert float(case.glider.body.mass) == pytest.approx(
        float(mass_from_length(0.8)), rel=1e-14
    )
    case = BASE.replace({"nu_theta": 1.0, "theta_m": 90.0, "mass": 0.1, "svl": 0.8})
    assert float(case.value("theta_m")) == pytest.approx(90.0)
    assert float(case.glider.body.mass) == 0.1
    alone = Case(BASE.glider).replace({"nu_theta": 1.0})
    assert float(alone.value("theta_m")) == float(BASE.value("theta_m"))


def test_a_part_of_ones_own_and_elements_of_arrays_have_names_too():
    case = Case(Glider(Snake.from_svl(), Gait.from_degrees(), air=Draught()))
    assert float(case.replace({"strength": 3.0}).glider.air.strength) == 3.0
    windy = Case(
        Glider(Snake.from_svl(), Gait.from_degrees(), air=UniformWind([1.0, 2.0, 0.0]))
    )
    blown = windy.replace({"velocity[1]": -4.0})
    np.testing.assert_array_equal(blown.glider.air.velocity, [1.0, -4.0, 0.0])
    assert float(windy.value("air.velocity[1]")) == 2.0


def test_values_may_be_traced():
    def mass(svl):
        return BASE.replace({"svl": svl}).glider.body.mass

    slope = jax.jit(jax.grad(mass))(0.7)
    assert float(slope) == pytest.approx(3.19831074 * float(mass_from_length(0.7)) / 0.7)
    found = jax.vmap(mass)(jnp.array([0.6, 0.7]))
    np.testing.assert_allclose(
        found, [mass_from_length(0.6), mass_from_length(0.7)], rtol=1e-12
    )


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nu", r"^there is no parameter 'nu': known are svl, mass"),
        ("launch.mass", r"^there is no parameter 'launch.mass'"),
        ("height[0]", r"^there is no 'height\[0\]': launch.height has shape \(\)$"),
    ],
)
def test_a_name_that_means_nothing_is_refused(name, said):
    with pytest.raises(ValueError, match=said):
        BASE.path(name)


def test_a_name_that_means_several_is_refused():
    inner = eqx.tree_at(
        lambda c: c.glider.air, BASE, UniformWind([0.0, 0.0, 0.0]), is_leaf=lambda x: x is None
    )
    assert inner.path("velocity") == "air.velocity"

    class Shadowing(AbstractAir):
        mass: float = 2.0

        def wind(self, position, time):
            return None

    case = Case(Glider(Snake.from_svl(), Gait.from_degrees(), air=Shadowing()))
    with pytest.raises(
        ValueError, match=r"'mass' may mean body.mass or air.mass: give its path"
    ):
        case.path("mass")
    assert case.name("air.mass") == "air.mass"


def test_values_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"^nu_theta = 11 is not allowed: .* \[0, 10\]$"):
        BASE.check({"nu_theta": [1.0, 11.0]})
    with pytest.raises(ValueError, match=r"^air.air_density follows from nothing"):
        Case(BASE.glider, Launch(), follow=("air.air_density",))


def test_a_last_name_that_another_float_shares_with_a_short_one_is_no_name():
    """A length of one's own beside the snake's, whose short name is svl."""

    class Column(AbstractAir):
        length: float = 2.0

        def wind(self, position, time):
            return None

    case = Case(Glider(Snake.from_svl(), Gait.from_degrees(), air=Column()))
    assert case.name("air.length") == "air.length"
    assert {case.path(case.name(path)) for path in case.parameters} == set(case.parameters)


def test_what_is_compiled_in_is_no_parameter():
    spaced = Case(Glider(Snake.from_svl(spacing=0.01), Gait.from_degrees()))
    assert spaced.parameters.keys() == BASE.parameters.keys()


@pytest.mark.parametrize("name", ["omega", "launch.angles"])
def test_several_numbers_that_are_left_out_are_not_one(name):
    with pytest.raises(ValueError, match=r"^(omega|angles) has shape \(\): it must be \(3,\)$"):
        BASE.check({name: 0.5})
