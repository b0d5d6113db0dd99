"""What ends a flight, and who says so: a frozen body thrown in empty space knows when."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    AbstractEnd,
    AngleLimit,
    End,
    Gait,
    Glider,
    Ground,
    Launch,
    Outcome,
    Plane,
    Polar,
    Snake,
    TimeLimit,
    integrate,
    simulate,
)
from jaxglide.flight.ends import clearance, outcome_codes, outcome_words

GLIDER = Glider(
    Snake.from_svl(nodes=12), Gait.from_degrees(f_theta=0), Polar.published(0.0, 0.0)
)
HEIGHT, SPEED = 2.0, 3.0
FALL = np.sqrt(2 * HEIGHT / 9.81)
FAR = 1e3


class Falling(eqx.Module):
    """Whether the body falls slower than so fast [m/s]."""

    fastest: jax.Array

    def __call__(self, time, state):
        return self.fastest + state[5]


traced = []


class Lower(AbstractEnd):
    """A part of one's own: two of the state's numbers must stay above their least."""

    least: jax.Array
    words = ("went too low", "went too far left")

    def __call__(self, time, state):
        traced.append(time)
        return jnp.stack([state[2], -state[0]]) - self.least


def fly(start=None, *, ground=0.0, limit=3.0, plane=FAR, time=50.0, fastest=FAR, least=-FAR):
    """Thrown forward and level; all ends at once, and one compilation for all of them."""
    if start is None:
        start = np.r_[0, 0, HEIGHT, 0, SPEED, 0, np.zeros(7)]
    ends = (
        Ground(ground),
        AngleLimit(limit, ("yaw", "roll")),
        Plane((0.0, 2.0, 0.0) if plane is FAR else plane[0], FAR if plane is FAR else plane[1]),
        TimeLimit(time),
        End(Falling(jnp.asarray(fastest, float)), "fell too fast"),
        Lower(jnp.asarray([least, -FAR], float)),
    )
    return integrate(GLIDER, start, 0.0, 5.0, ends=ends, rtol=1e-9, atol=1e-9)


ENDS = {
    "landed": ({}, 0, FALL),
    "landed on a roof": ({"ground": 1.5}, 0, np.sqrt(2 * 0.5 / 9.81)),
    "reached the plane": ({"plane": ((0.0, 2.0, 0.0), 2.4)}, 7, 0.4),
    "reached its time": ({"time": 0.3}, 8, 0.3),
    "fell too fast": ({"fastest": 2.0}, 9, 2 / 9.81),
    "went too low": ({"least": 1.6}, 10, np.sqrt(2 * 0.4 / 9.81)),
}


@pytest.mark.parametrize("words", ENDS)
def test_each_end_ends_a_flight_when_it_should(words):
    given, code, time = ENDS[words]
    flown = fly(**given)
    assert flown.ending == words.replace(" on a roof", "")
    assert int(flown.outcome) == code
    assert float(flown.time) == pytest.approx(time, abs=1e-9)
    expected = [0, SPEED * time, HEIGHT - 9.81 / 2 * time**2]
    np.testing.assert_allclose(flown.landing_point, expected, rtol=0, atol=1e-9)


def test_an_angle_ends_a_flight_at_its_limit():
    start = np.r_[0, 0, HEIGHT, 0, SPEED, 0, 0, 0, -4.0, np.zeros(4)]
    flown = fly(start, limit=0.4)
    assert (flown.ending, int(flown.outcome)) == ("unstable in yaw", Outcome.UNSTABLE_YAW)
    assert float(flown.end_angles[0]) == pytest.approx(-0.4, abs=1e-9)
    assert float(flown.max_angles[0]) == pytest.approx(0.4, abs=1e-9)
    # the pitch is free here
    start = np.r_[0, 0, HEIGHT, 0, SPEED, 0, 4.0, 0, 0, np.zeros(4)]
    free = fly(start, limit=0.8)
    assert float(free.max_angles[1]) > 0.8
    assert free.ending == "unstable in roll"


def test_of_several_ends_the_first_counts():
    flown = fly(plane=((0.0, 1.0, 0.0), 1.2), time=0.39, fastest=0.41 * 9.81)
    assert flown.ending == "reached its time"
    flown = fly(plane=((0.0, 1.0, 0.0), 1.2), time=0.41, fastest=0.42 * 9.81)
    assert flown.ending == "reached the plane"


def test_a_plane_that_is_only_grazed_is_seen():
    """Thrown up, its top a tenth of a millimetre beyond: it is there for 9 ms."""
    up = 2.0
    top = up**2 / (2 * 9.81)
    start = np.r_[0, 0, 1.0, 0, 0, up, np.zeros(7)]
    flown = fly(start, plane=((0.0, 0.0, 3.0), 3 * (1 + top - 1e-4)))
    assert flown.ending == "reached the plane"
    rise = (up - np.sqrt(2 * 9.81 * 1e-4)) / 9.81
    assert float(flown.time) == pytest.approx(rise, abs=1e-6)
    assert fly(start, plane=((0.0, 0.0, 3.0), 3 * (1 + top + 1e-4))).ending == "landed"


def test_a_flight_that_starts_beyond_an_end_is_over_at_once():
    flown = fly(least=HEIGHT + 1)
    assert flown.ending == "went too low"
    assert float(flown.time) == 0
    assert float(flown.landing_point[2]) == HEIGHT


def test_the_report_says_which_end_it_was():
    assert str(fly(fastest=2.0)).startswith("Flight from 0.0000 s: fell too fast at 0.2039 s")


def test_other_values_in_ends_trace_nothing_again():
    fly()
    before = len(traced)
    fly(ground=0.1, limit=1.0, plane=((0.0, 1.0, 1.0), 50.0), time=1.0, fastest=9.0, least=0.0)
    assert len(traced) == before > 0


def test_codes_are_those_of_outcomes_and_then_by_order():
    ends = (
        TimeLimit(1.0),
        AngleLimit(1.0, ("roll", "pitch")),
        Plane((1, 0, 0), 2.0),
        Ground(),
        Plane((0, 1, 0), 2.0),
    )
    assert outcome_codes(ends).tolist() == [7, 3, 2, 8, 0, 9]
    words = outcome_words(ends)
    assert (words[7], words[3], words[8]) == (
        "reached its time",
        "unstable in roll",
        "reached the plane",
    )
    assert words[int(Outcome.OUT_OF_STEPS)] == "ran out of steps"
    state = jnp.arange(13.0)
    found = clearance(ends, jnp.asarray(0.25), state)
    np.testing.assert_allclose(found, [0.75, 1 - 11, 1 - 10, 2 - 0, 2, 2 - 1])


def test_a_glide_may_end_otherwise_than_published():
    """One end alone will do; a limit given by its degrees, and by one name."""
    launch = Launch(HEIGHT, SPEED, 0.0, (0.0, 0.0, 0.0))
    glide = simulate(GLIDER, launch, ends=TimeLimit(0.2), step=0.05)
    assert glide.ending == "reached its time"
    assert not bool(glide.stable)
    assert str(glide).startswith("Glide from 2 m: reached its time after 0.2000 s")
    limit = AngleLimit.degrees(30, "roll")
    assert (limit.words, limit.codes) == (("unstable in roll",), (3,))
    assert float(limit.limit) == pytest.approx(np.pi / 6)


class Deep(eqx.Module):
    """A function of one's own that is no number below some height."""

    def __call__(self, time, state):
        return jnp.sqrt(state[2] - 1.0) + 1.0


@pytest.mark.parametrize("height", [0.5, 1.5])
def test_an_end_that_is_no_number_is_not_reached(height):
    """Neither where it starts so nor where it comes to it, which hides the ground as well."""
    start = np.r_[0, 0, height, 0, SPEED, 0, np.zeros(7)]
    flown = integrate(GLIDER, start, 0.0, 0.5, ends=(Ground(), End(Deep(), "went deep")))
    assert flown.ending == "not finite"


def test_states_asked_for_before_a_start_that_is_traced_are_none():
    start = jnp.zeros(13).at[2].set(HEIGHT)
    save = [0.0, 0.1, 0.2]
    kept = jax.jit(lambda t0: integrate(GLIDER, start, t0, 0.3, save=save).states[:, 2])(0.1)
    expected = [np.nan, HEIGHT, HEIGHT - 9.81 / 2 * 0.1**2]
    np.testing.assert_allclose(kept, expected, rtol=0, atol=1e-9)
