"""Measured flights flown by the model: against the published simulations, and compared."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from jaxglide.body.sections import discretise
from jaxglide.flight.ends import Outcome
from jaxglide.flight.launch import Cycle
from jaxglide.flights.agreement import at_heights, compare_paths, summary
from jaxglide.flights.flights import SPACING, build_flight, fly_flights, measured_of, node_count
from jaxglide.loads.polar import Polar
from made_flights import dataset, made

UP = 0.5  # m that the starts are raised, to see past the ground


@pytest.fixture(scope="module")
def entries(golden):
    """Published simulations whose measured gaits are given in full."""
    return golden("simulated_flights")


@pytest.fixture(scope="module")
def flown(entries):
    return fly_flights(dataset(entries, UP))


def test_launches_are_the_published_ones(flown, entries):
    for row, entry in enumerate(entries):
        published = entry["simulated"]
        # theirs is where a simplex search stops, 1e-4 wide by default; see the next test
        assert flown.phi_theta.values[row] == pytest.approx(published["phi_theta"], abs=1e-5)
        np.testing.assert_allclose(
            flown.launch_attitude.values[row], published["launch_angles_deg"], atol=2e-4
        )


def test_launches_turn_least(flown, entries):
    """The angular momentum of the shape change is never larger than at the published phase."""
    flights = measured_of(dataset(entries))
    nodes = node_count(np.array([e["svl_m"] for e in entries]))

    def squared(flight, phase):
        glider, _ = build_flight(flight, Polar.published(), nodes)
        return jnp.sum(Cycle.of(glider, discretise(glider.body)).momentum(phase) ** 2)

    both = jax.jit(jax.vmap(squared))
    ours = both(flights, flown.phi_theta.values)
    theirs = both(flights, np.array([e["simulated"]["phi_theta"] for e in entries]))
    assert (ours <= theirs * (1 + 1e-12)).all()
    assert (ours < theirs).any()


def test_ends_are_the_published_ones(flown, entries):
    """The last record of each, at 1e-8, the published polar and nodes 1 cm apart."""
    for row, entry in enumerate(entries):
        published = entry["simulated"]
        if published["stopped_by_angle"]:
            continue
        record = round(published["end_t_s"] / 0.01)
        assert flown.time_simulated.values[record] == pytest.approx(published["end_t_s"])
        end = flown.path.values[row, record] - [0.0, 0.0, UP]
        np.testing.assert_allclose(end, published["end_m"], atol=1e-3, err_msg=entry["trial"])
        angles = flown.attitude.values[row, record]
        np.testing.assert_allclose(angles, published["end_angles_deg"], atol=0.1)


def test_paths_and_stops_are_the_published_ones(flown, entries):
    for row, entry in enumerate(entries):
        published = entry["simulated"]
        ended = flown.outcome.values[row] != Outcome.LANDED
        assert ended == published["stopped_by_angle"]
        records = np.round(np.array(published["t_s"]) / 0.01).astype(int)
        path = flown.path.values[row, records] - [0.0, 0.0, UP]
        seen = np.isfinite(path).all(axis=1)
        assert seen.sum() >= len(seen) - 1
        np.testing.assert_allclose(path[seen], np.array(published["com_m"])[seen], atol=1e-3)


def test_a_path_goes_on_to_its_end(flown):
    """Within the last 10 ms, by the last velocity to within what gravity does."""
    for row in range(flown.sizes["trial"]):
        last = int(np.isfinite(flown.path.values[row, :, 0]).sum()) - 1
        rest = flown.end_time.values[row] - flown.time_simulated.values[last]
        assert 0 <= rest <= 0.01
        there = flown.path.values[row, last] + rest * flown.simulated_velocity.values[row, last]
        np.testing.assert_allclose(flown.end.values[row], there, atol=2 * 9.81 * 0.01**2)
        largest = np.abs(flown.end_attitude.values[row]).max()
        if flown.outcome.values[row] == Outcome.LANDED:
            assert flown.end.values[row, 2] == pytest.approx(0.0, abs=1e-9)
            assert largest < 85.0
        else:
            assert largest == pytest.approx(85.0, abs=1e-6)


def test_lift_does_no_work_and_drag_does(entries):
    """But for what the undulation puts in."""
    data, kept = dataset(entries), {}
    start = data.start_position.values[:, 2], data.start_velocity.values
    for name, scales in {"lift": (1.0, 0.0), "drag": (0.0, 1.0), "none": (0.0, 0.0)}.items():
        alone = fly_flights(data, lift_scale=scales[0], drag_scale=scales[1], tolerance=1e-6)
        state = alone.isel(time_simulated=60)
        ends = state.path.values[:, 2], state.simulated_velocity.values
        before, after = (9.81 * z + 0.5 * np.sum(v**2, axis=1) for z, v in (start, ends))
        kept[name] = after[np.isfinite(after)] / before[np.isfinite(after)]
        assert kept[name].size
    np.testing.assert_allclose(kept["none"], 1.0, rtol=1e-9)
    assert kept["drag"].max() < kept["lift"].min()
    np.testing.assert_allclose(kept["lift"], 1.0, atol=0.05)


def test_nodes_are_those_of_each_animal(entries):
    data = dataset(entries)
    flights = measured_of(data)
    for row, entry in enumerate(entries):
        published = entry["simulated"]
        assert node_count(data.svl.values[row : row + 1]) == published["n_nodes"]
        assert published["node_spacing_m"] == SPACING
        assert flights.neck_fraction[row] == pytest.approx(published["neck_fraction"])


def test_starts_point_as_measured(entries):
    data = dataset(entries[:3])
    flights = measured_of(data)
    for row in range(3):
        up, left = float(flights.elevation[row]), float(flights.heading[row])
        level = np.array([-np.sin(left), np.cos(left)]) * np.cos(up)
        velocity = float(flights.speed[row]) * np.append(level, np.sin(up))
        np.testing.assert_allclose(velocity, data.start_velocity.values[row], rtol=1e-12)


# --- the comparison --------------------------------------------------------------------


def test_paths_are_compared_at_equal_heights_down_to_the_higher_end():
    nan = [np.nan] * 3
    data = made(
        [[1, 0, 8], [1, 3, 5], [1, 7, 1], nan], [[1, 0, 8], [1, 1, 6], [1, 2, 4], [1, 3, 2]]
    )
    found = compare_paths(data).isel(trial=0)
    assert found.end_height == 2.0
    assert found.distance_measured == pytest.approx(6.0)
    assert found.distance_simulated == pytest.approx(3.0)
    # apart by half the height lost, at heights evenly spaced from 8 to 2 m
    lost = np.linspace(0, 6, 100)
    assert found.path_error == pytest.approx(np.sqrt(np.mean((lost / 2) ** 2)))
    assert not found.turned_measured
    assert not found.turned_simulated


def test_a_simulation_counts_to_its_very_end():
    data = made([[0, 0, 8], [0, 7, 1]], [[0, 0, 8], [0, 3, 2]])
    data["end"][:] = [0.0, 3.5, 1.0]
    found = compare_paths(data).isel(trial=0)
    assert found.end_height == 1.0
    assert found.distance_measured == pytest.approx(7.0)
    assert found.distance_simulated == pytest.approx(3.5)


def test_a_flight_that_turns_back_is_told():
    data = made([[0, 0, 8], [0, 3, 5], [0, 7, 1]], [[0, 0, 8], [0, 2, 6], [0, 1, 2]])
    found = compare_paths(data)
    assert found.turned_simulated.values.tolist() == [True]
    assert found.turned_measured.values.tolist() == [False]
    assert "simulated 1 (1)" in summary(found)


def test_a_summary_says_how_far():
    straight = [
        made([[0, 0, 8], [0, far, 2]], [[0, 0, 8], [0, near, 2]])
        for far, near in ((6, 3), (4, 5), (2, 1))
    ]
    three = xr.concat(straight, "trial").assign_coords(trial=["1", "2", "3"])
    compared = compare_paths(three)
    text = summary(compared)
    assert "3 flights" in text
    assert "measured   4.00 +- 2.00 m" in text
    assert "simulated  3.00 +- 2.00 m, 0.75 of it, correlation 0.50, farther in 1" in text
    assert "did not shallow: measured 0, simulated 0" in text
    error = float(compared.path_error.mean())
    assert f"paths apart at equal heights {error:.2f} m" in text
    assert f"(median {float(compared.path_error.median()):.2f} m)" in text


def test_a_climb_is_passed_over():
    path = np.array([[0, 0, 8.0], [0, 1, 8.5], [0, 2, 8.2], [0, 3, 7.0], [0, 4, 6.0]])
    there = at_heights(path, np.array([8.0, 7.0, 6.5]))
    np.testing.assert_allclose(there[1:, 1], [3.0, 3.5])
    assert there[0, 1] == 0.0


# --- bad input -------------------------------------------------------------------------


def test_what_is_missing_is_named(entries):
    data = dataset(entries[:2])
    with pytest.raises(ValueError, match="no variable 'psi_m'"):
        fly_flights(data.drop_vars("psi_m"))
    data["mass"] = data["mass"] * np.nan
    with pytest.raises(ValueError, match="mass = nan"):
        fly_flights(data)
    with pytest.raises(ValueError, match="tolerance = 0"):
        fly_flights(dataset(entries[:2]), tolerance=0.0)
    with pytest.raises(ValueError, match="node_set = 'fine'"):
        fly_flights(dataset(entries[:2]), node_set="fine")
