"""Glide polar of the whole undulating body, and its steady glide at held attitudes."""

from common import arguments, save_figure, write_table  # first: it sets up JAX

# isort: split
import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxglide import Gait, Glider, Launch, Snake
from jaxglide.ensemble.published import NU_THETA
from jaxglide.plot import glide_polar_figure
from jaxglide.tunnel.fall import fall
from jaxglide.tunnel.glide_polar import body_polar, equilibrium, velocity_polar

ALPHA = np.deg2rad(np.arange(-20.0, 90.5, 0.5))
PITCH = np.arange(-20.0, 17.5, 2.5)  # deg
V_Y, V_Z = np.linspace(0.0, 10.0, 51), np.linspace(-8.0, 0.4, 43)  # m/s


def steady(found) -> tuple[float, ...]:
    """Glide angle [deg], speed and its parts [m/s]."""
    v_y, v_z = map(float, found.velocity)
    return float(np.rad2deg(found.glide_angle)), float(np.hypot(v_y, v_z)), v_y, v_z


def main() -> None:
    options = arguments(__doc__)
    glider = Glider(Snake.from_svl(), Gait.from_degrees())
    level = equilibrium(glider)

    rows = []
    for pitch in PITCH:
        found = equilibrium(glider, np.deg2rad((0.0, pitch, 0.0)))
        rows.append((float(pitch), *steady(found), bool(found.stable)))
    motion = ("glide angle (deg)", "speed (m/s)", "v_y (m/s)", "v_z (m/s)")
    header = ("held pitch (deg)", *motion, "stable in speed")
    write_table(options.out / "glide_polar_pitch", header, rows)

    rows = []
    for nu in NU_THETA:
        gait = Gait.from_degrees(nu_theta=nu)
        other = eqx.tree_at(lambda g: g.gait, glider, gait)
        found = equilibrium(other)
        polar = body_polar(other, steady(found)[1], ALPHA)
        best = int(np.argmax(polar.lift_to_drag))
        most = float(polar.lift_to_drag[best]), float(np.rad2deg(ALPHA[best]))
        rows.append((float(nu), *steady(found), *most))
    header = ("nu_theta", *motion, "best lift to drag", "at (deg)")
    write_table(options.out / "glide_polar_shapes", header, rows)

    polar = body_polar(glider, float(jnp.linalg.norm(level.velocity)), ALPHA)
    field = V_Y, V_Z, np.asarray(velocity_polar(glider, V_Y, V_Z))
    fallen = fall(glider, Launch(75.0, 1.7), max_time=30.0)
    rows = [(h, *end(glider, h)) for h in (10.0, 25.0, 75.0)]
    header = ("height (m)", "time (s)", "forward (m)", "v_y (m/s)", "v_z (m/s)", "path (deg)")
    write_table(options.out / "glide_polar_falls", header, rows)
    figure = glide_polar_figure(polar, field, level, fallen)
    save_figure(figure, options.out / "glide_polar.png")


def end(glider: Glider, height: float) -> tuple[float, ...]:
    """Where and how a held glide from a height meets the ground."""
    fallen = fall(glider, Launch(height, 1.7), max_time=30.0)
    y, _, v_y, v_z = map(float, fallen.state)
    return float(fallen.time), y, v_y, v_z, float(np.rad2deg(np.arctan2(-v_z, v_y)))


if __name__ == "__main__":
    main()
