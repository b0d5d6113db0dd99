"""Bodies from tables: what they weigh, where, and how they resist turning."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Gait, Snake, TabulatedBody, discretise
from jaxglide.loads.inertia import inertia_tensor
from jaxglide.shape.gait import waves
from jaxglide.shape.kinematics import backbone

GAUSS = {"nodes": 36, "node_set": "gauss"}
LENGTH, POINTS, MASSES = 0.8, np.array([0.25, 0.7]), np.array([0.03, 0.01])
# density runs straight from 40 to 80 g/m
BAR = {"position": [0.0, LENGTH], "chord": [0.03, 0.05], "density": [0.04, 0.08]}
GAIT = Gait.from_degrees(theta_m=100, psi_m=30, nu_theta=1.2, d_psi=12)


def robot(**fields):
    return TabulatedBody(**{**BAR, "point_position": POINTS, "point_mass": MASSES, **fields})


@eqx.filter_jit
def posed(body, gait, phase=0.4):
    """The body at its nodes and its backbone; no time passes."""
    sections = discretise(body)
    bending = waves(gait, sections.neck_fraction, sections.fraction, phase, 0.0)
    return sections, backbone(sections, bending)


STRAIGHT = Gait(0.0, 0.0, 1.0, 0.0)


def moments_of_the_bar():
    """Mass, centre and second moment about the front end, of the density alone."""
    a, b = 0.04, 0.04 / LENGTH
    return [a * LENGTH ** (k + 1) / (k + 1) + b * LENGTH ** (k + 2) / (k + 2) for k in range(3)]


@pytest.mark.parametrize("fields", [GAUSS, {"nodes": 8}], ids=["gauss", "few"])
def test_mass_length_and_area_follow_from_the_table(fields):
    body = robot(**fields)
    mass = moments_of_the_bar()[0] + MASSES.sum()
    assert float(body.length) == LENGTH
    assert float(body.mass) == pytest.approx(mass, rel=1e-14)
    sections = jax.jit(discretise)(body)
    assert float(sections.total_mass) == pytest.approx(mass, rel=1e-14)
    assert float(jnp.sum(sections.mass)) == pytest.approx(mass, rel=1e-14)
    assert float(jnp.sum(sections.area)) == pytest.approx(0.04 * LENGTH, rel=1e-13)
    # point masses are nodes behind the others, which the air does not see
    np.testing.assert_array_equal(sections.mass[-2:], MASSES)
    np.testing.assert_array_equal(sections.area[-2:], 0)
    np.testing.assert_allclose(sections.fraction[-2:] * LENGTH, POINTS, rtol=1e-15)


def test_the_centre_of_mass_is_where_the_table_says():
    sections, body = posed(robot(**GAUSS), STRAIGHT)
    mass, first, _ = moments_of_the_bar()
    centre = (first + MASSES @ POINTS) / (mass + MASSES.sum())
    along = np.asarray(sections.fraction) * LENGTH
    # straight, it lies along -y from the front end
    np.testing.assert_allclose(body.position[1], centre - along, rtol=0, atol=1e-14)
    np.testing.assert_allclose(sections.mass @ body.position.T, 0, atol=1e-16)


def test_a_straight_body_has_the_inertia_of_a_bar_with_weights():
    """Integral of the density, and the parallel-axis theorem."""
    sections, body = posed(robot(**GAUSS), STRAIGHT)
    mass, first, second = moments_of_the_bar()
    whole = mass + MASSES.sum()
    about_front = second + MASSES @ POINTS**2
    expected = about_front - (first + MASSES @ POINTS) ** 2 / whole
    tensor = np.asarray(inertia_tensor(sections, body))
    np.testing.assert_allclose(tensor, np.diag([expected, 0, expected]), rtol=0, atol=1e-17)


@pytest.mark.parametrize("gyration", [None, 0.3])
def test_point_masses_obey_the_parallel_axis_theorem_on_a_bent_body(gyration):
    """At nodes, where their place is exact."""
    bare = TabulatedBody(**BAR, **GAUSS, gyration=gyration)
    without, body = posed(bare, GAIT)
    nodes = [11, 30]
    points = np.asarray(without.fraction)[nodes] * LENGTH
    with_points, loaded = posed(robot(**GAUSS, point_position=points, gyration=gyration), GAIT)

    r = np.asarray(body.position)
    M, total = float(without.total_mass), float(without.total_mass) + MASSES.sum()
    shift = r[:, nodes] @ MASSES / total
    np.testing.assert_allclose(loaded.position[:, :-2], r - shift[:, None], atol=1e-14)
    np.testing.assert_allclose(loaded.position[:, -2:], loaded.position[:, nodes], atol=1e-14)

    def axis(mass, offset):
        return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))

    expected = np.asarray(inertia_tensor(without, body)) + axis(M, shift)
    for mass, node in zip(MASSES, nodes, strict=True):
        expected = expected + axis(mass, r[:, node] - shift)
        if gyration is not None:
            # and their own, about the body's axis there
            t = np.asarray(body.tangent)[:, node]
            chord = np.interp(without.fraction[node] * LENGTH, BAR["position"], BAR["chord"])
            c = np.asarray(body.chord)[:, node]
            expected = expected + mass * (gyration * chord) ** 2 * (np.eye(3) - np.outer(c, c))
            assert abs(t @ c) < 1e-14
    tensor = np.asarray(inertia_tensor(with_points, loaded))
    np.testing.assert_allclose(tensor, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    assert np.abs(axis(M, shift)).max() > 0.05 * np.abs(expected).max()


def test_between_nodes_a_point_lies_on_the_body():
    """On the curve through a far finer division, to second order in the spacing."""
    fine, body = posed(TabulatedBody(**BAR, nodes=1600), GAIT)
    start = np.asarray(body.position)
    exact = np.stack([np.interp(POINTS / LENGTH, fine.fraction, row) for row in start])
    errors = []
    for nodes in (50, 200):
        _, body = posed(robot(nodes=nodes, point_mass=[1e-12, 1e-12]), GAIT)
        errors.append(np.abs(body.position[:, -2:] - exact).max())
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 8


@pytest.mark.parametrize("at", [0.0, LENGTH])
def test_a_point_may_sit_at_either_end(at):
    _, body = posed(robot(**GAUSS, point_position=[at], point_mass=[0.01]), STRAIGHT)
    mass, first, _ = moments_of_the_bar()
    centre = (first + 0.01 * at) / (mass + 0.01)
    assert float(body.position[1, -1]) == pytest.approx(centre - at, abs=1e-14)


# A snake as a table


SNAKE = Snake.from_svl(nodes=70)


def parabola(x, coefficients):
    h, k, p = np.asarray(coefficients)
    return (x - h) ** 2 / (4 * p) + k


def as_table(snake, step, **fields):
    """Chord and density of a snake at stations so many fractions apart.

    The head's density breaks off: two stations stand there.
    """
    end = float(snake.head_fraction)
    head = np.linspace(0, end, 1 + round(4 * end / step))
    x = np.concatenate([head, np.linspace(end + 1e-9, 1, round(1 / step))])
    density = np.where(
        x <= end, parabola(x, snake.head_density), parabola(x, snake.body_density)
    )
    length = float(snake.length)
    share = density / np.trapezoid(density, x * length)
    return TabulatedBody(
        x * length,
        length * parabola(x, snake.chord),
        float(snake.mass) * share,
        neck_fraction=snake.neck_fraction,
        **fields,
    )


def test_a_snake_as_a_table_agrees_to_the_tables_resolution():
    """To second order: chord, masses, and how it bends."""
    exact, bent = posed(SNAKE, GAIT)
    errors = []
    for step in (0.04, 0.02, 0.01):
        found, like_it = posed(as_table(SNAKE, step), GAIT)
        np.testing.assert_allclose(found.fraction, exact.fraction, rtol=1e-14)
        assert float(found.total_mass) == pytest.approx(float(SNAKE.mass), rel=1e-12)
        pairs = (
            (found.chord, exact.chord),
            (found.mass, exact.mass),
            (like_it.position, bent.position),
        )
        errors.append([np.abs(a - b).max() / np.abs(b).max() for a, b in pairs])
    assert (errors[-1] < np.array([1e-4, 1e-2, 1e-3])).all()
    assert (np.array(errors[2]) < 0.13 * np.array(errors[0])).all()


# Files, and derivatives


def test_a_file_is_the_table(tmp_path):
    path = tmp_path / "robot.csv"
    path.write_text(
        "position,chord,density,point_mass\n0,0.03,0.04,0\n0.25,0.04,0.05,0.03\n0.8,0.05,0.08,0\n"
    )
    body = TabulatedBody.from_csv(path, **GAUSS)
    np.testing.assert_array_equal(body.position, [0, 0.25, 0.8])
    np.testing.assert_array_equal(body.point_position, [0.25])
    np.testing.assert_array_equal(body.point_mass, [0.03])
    assert body.nodes == 36
    path.write_text("position,chord,density\n0,0.03,0.04\n0.8,0.05,0.08\n")
    assert TabulatedBody.from_csv(path).point_mass.shape == (0,)


@pytest.mark.slow
def test_everything_of_the_table_has_a_derivative():
    def yaw_inertia(body):
        sections, bent = posed(body, GAIT)
        return inertia_tensor(sections, bent)[2, 2]

    body = robot(**GAUSS)
    value = jax.jit(yaw_inertia)
    slopes = jax.jit(jax.grad(yaw_inertia))(body)
    for name in ("position", "density", "point_position", "point_mass"):
        start = getattr(body, name)
        h = 1e-6 * float(start[-1])

        def moved(step, name=name, start=start):
            return float(
                value(eqx.tree_at(lambda b: getattr(b, name), body, start.at[-1].add(step)))
            )

        difference = (moved(h) - moved(-h)) / (2 * h)
        assert float(getattr(slopes, name)[-1]) == pytest.approx(difference, rel=1e-5)
        assert abs(difference) > 1e-4


def test_spaces_around_the_names_of_columns_lose_no_mass(tmp_path):
    path = tmp_path / "robot.csv"
    path.write_text("position, chord, density, point_mass\n0, 0.1, 0.1, 0.3\n1, 0.1, 0.1, 0\n")
    assert float(TabulatedBody.from_csv(path).mass) == pytest.approx(0.4)
    path.write_text("position,chord,density, chord\n0,0.1,0.1,0.2\n1,0.1,0.1,0.2\n")
    with pytest.raises(ValueError, match=r"robot.csv: column 'chord' is there 2 times$"):
        TabulatedBody.from_csv(path)
