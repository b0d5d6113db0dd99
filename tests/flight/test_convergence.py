"""How fast the glide converges with the number of nodes and with the size of the steps.

Run with `-s` to see the figures measured.
"""

import numpy as np
import pytest

from jaxglide import Gait, Glider, Launch, Outcome, Polar, Snake, simulate

# nu_theta, psi_m, d_psi [deg]; launch phase [rad], angles [deg] (those of 70 midpoints)
GLIDES = [
    (1.4, 20, 10, -0.027816, (-0.22388, -4.55923, -4.52628)),
    (1.25, 10, 20, -0.954891, (-5.5, 2.0, 3.0)),
    (1.3, 20, 10, 0.05, (1.0, -3.0, 2.0)),
]


def glider_and_launch(index, polar=Polar.smooth, **nodes):
    nu_theta, psi_m, d_psi, phase, angles = GLIDES[index]
    gait = Gait.from_degrees(nu_theta=nu_theta, psi_m=psi_m, d_psi=d_psi)
    launch = Launch(10.0, 1.7534, phase, np.deg2rad(angles))
    return Glider(Snake.from_svl(**nodes), gait, polar()), launch


GAUSS = {"node_set": "gauss", "nodes": 60}
NODES = {"published 70": {}, "gauss 60": GAUSS, "gauss 200": {**GAUSS, "nodes": 200}}


def landing(glider, launch, **options):
    glide = simulate(glider, launch, **options)
    assert int(glide.outcome) == Outcome.LANDED
    return np.asarray(glide.landing_point)


@pytest.fixture(scope="module")
def by_nodes():
    """Landing points [m] by node set, (3 glides, 3)."""
    tight = {"rtol": 1e-8, "atol": 1e-8}
    return {
        name: np.stack(
            [landing(*glider_and_launch(i, **nodes), **tight) for i in range(len(GLIDES))]
        )
        for name, nodes in NODES.items()
    }


def test_sixty_gauss_nodes_land_within_two_millimetres_of_the_limit(by_nodes):
    error = {
        name: 1e3 * np.linalg.norm(points - by_nodes["gauss 200"], axis=1)
        for name, points in by_nodes.items()
    }
    print("\nlanding point against 200 Gauss nodes [mm]:", error)
    assert error["gauss 60"].max() < 2
    # the published grid is good to centimetres only
    assert (error["published 70"] > 5 * error["gauss 60"]).all()
    assert 5 < error["published 70"].max() < 300


@pytest.fixture(scope="module")
def pitched_launch():
    """Fast and nose up: no element's normal speed falls below 1.7 m/s on the whole glide."""
    return Launch(height=2.0, speed=6.0, phi_theta=-0.0278, angles=[0.0, 0.8, 0.0])


def mean_order(glider, launch):
    """Mean order over three halvings of a fixed step, of landing point and of whole state."""
    exact = simulate(glider, launch, rtol=1e-11, atol=1e-11)
    coarse, fine = (simulate(glider, launch, step=step) for step in (0.01, 0.00125))
    assert int(exact.outcome) == int(coarse.outcome) == int(fine.outcome) == Outcome.LANDED
    error = [
        [np.abs((end.state - exact.state)[part]).max() for part in (slice(0, 2), slice(0, 13))]
        for end in (coarse, fine)
    ]
    order = np.log2(np.divide(*error)) / 3
    print("\nfixed steps of 10 and 1.25 ms: errors", error, "mean order", order)
    return order, error[1][1]


def test_order_of_fixed_steps_on_the_smooth_polar(smooth_glider, pitched_launch):
    order, error = mean_order(smooth_glider, pitched_launch)
    assert order.min() >= 3.5
    assert error < 1e-8


def test_order_of_fixed_steps_from_the_published_launch(smooth_glider, fixed_launch):
    """Lower, whatever the polar: the force is quadratic in the normal velocity, and its second
    derivative jumps where that passes through zero, as along parts of the body at take-off."""
    order, error = mean_order(smooth_glider, fixed_launch)
    assert order.min() >= 3.0
    assert error < 1e-6


def test_smooth_polar_needs_far_fewer_adaptive_steps():
    tight = {"rtol": 1e-9, "atol": 1e-9}
    steps = {}
    for polar in (Polar.smooth, Polar.published):
        glides = [
            simulate(*glider_and_launch(i, polar, **GAUSS), **tight) for i in range(len(GLIDES))
        ]
        steps[polar.__name__] = np.array([int(g.accepted + g.rejected) for g in glides])
    ratio = steps["published"] / steps["smooth"]
    print("\nsteps at 1e-9:", steps, "ratio:", ratio)
    assert steps["published"].sum() > 4 * steps["smooth"].sum()
