"""Figures of the body and its waves: what is drawn is the model's, labelled with units."""

import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from jaxglide import Gait, Snake, discretise, plot
from jaxglide.plot.body import DORSAL, VENTRAL
from jaxglide.shape.gait import waves
from jaxglide.shape.kinematics import backbone

GAIT, SNAKE = Gait.from_degrees(), Snake.from_svl(nodes=24)
PHASE = 0.7


def polygons(ax):
    """Corners of the body's polygons, (n - 1, 4, 2), and their colours."""
    (body,) = (c for c in ax.collections if isinstance(c, PolyCollection))
    return np.array([path.vertices[:4] for path in body.get_paths()]), body.get_facecolor()


def placed():
    """Backbone of the body at the phase, in cm, and half chords."""
    sections = discretise(SNAKE)
    body = backbone(sections, waves(GAIT, SNAKE.neck_fraction, sections.fraction, PHASE, 0.0))
    half = 50.0 * np.asarray(sections.chord * body.chord)
    return 100.0 * np.asarray(body.position), half, np.asarray(body.normal)


def texts(figure):
    """All words of a figure, drawn once."""
    FigureCanvasAgg(figure).draw()
    return [t.get_text() for legend in figure.legends for t in legend.get_texts()]


# Waves


def test_lines_are_the_waves_in_degrees():
    phases = [PHASE, PHASE - 1.0]
    ax = plot.bending_waves(GAIT, SNAKE, phases=phases)
    curves = [line for line in ax.lines if len(line.get_xdata()) > 2]
    assert len(curves) == 4
    s = np.asarray(curves[0].get_xdata())
    assert (s[0], s[-1]) == (0.0, 1.0) == ax.get_xlim()
    expected = []
    for name in ("theta", "psi"):
        for phase in phases:
            wave = waves(GAIT, SNAKE.neck_fraction, jnp.asarray(s), phase, 0.0)
            expected.append(np.rad2deg(getattr(wave, name)))
    for line, wanted in zip(curves, expected, strict=True):
        np.testing.assert_allclose(line.get_ydata(), wanted, atol=1e-9)
    assert ax.get_xlabel() == "arc length, $s$ (fraction of SVL)"
    assert ax.get_ylabel() == "bending angle (°)"


@pytest.mark.parametrize("wave", ["theta", "psi"])
def test_map_is_the_wave_travelling_to_the_tail(wave):
    ax = plot.wave_map(GAIT, SNAKE, wave=wave, duration=1.0, phi_theta=PHASE)
    (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    grid, values = np.asarray(mesh.get_coordinates()), np.asarray(mesh.get_array())
    time, s = grid[0, :, 0], grid[:, 0, 1]
    assert (time[0], time[-1], s[0], s[-1]) == (0.0, 1.0, 0.0, 1.0)
    column = 100
    phase = PHASE - 2 * np.pi * float(GAIT.f_theta) * time[column]
    now = waves(GAIT, SNAKE.neck_fraction, jnp.asarray(s), phase, 0.0)
    wanted = np.rad2deg(getattr(now, wave))
    np.testing.assert_allclose(values.reshape(s.size, time.size)[:, column], wanted, atol=1e-9)
    low, high = mesh.get_clim()
    assert low == -high  # white is zero
    assert high == pytest.approx(np.abs(values).max())
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time, t (s)", "arc length, $s$ (SVL)")
    (bar,) = (other for other in ax.figure.axes if other is not ax)
    assert bar.get_ylabel().endswith("(°)")


def test_map_shows_two_cycles_and_of_a_frozen_body_a_second():
    assert plot.wave_map(GAIT).get_xlim()[1] == pytest.approx(2 / 1.2)
    assert plot.wave_map(Gait.from_degrees(f_theta=0.0)).get_xlim()[1] == 1.0


def test_both_maps_share_their_axes():
    figure = plot.wave_maps(GAIT, duration=1.5)
    above, below = figure.axes[:2]
    assert above.get_xlim() == below.get_xlim() == (0.0, 1.5)
    assert (above.get_xlabel(), below.get_xlabel()) == ("", "time, t (s)")
    assert len(figure.axes) == 4


# Body


@pytest.mark.parametrize(
    ("view", "rows", "signs", "labels"),
    [
        ("top", (1, 0), (1, 1), ("forward, y (cm)", "right, x (cm)")),
        ("side", (1, 2), (1, 1), ("forward, y (cm)", "up, z (cm)")),
        ("rear", (0, 2), (1, 1), ("right, x (cm)", "up, z (cm)")),
    ],
)
def test_body_is_drawn_where_the_model_has_it(view, rows, signs, labels):
    ax = plot.body_view(GAIT, SNAKE, view=view, phase=PHASE)
    position, half, _ = placed()
    look = np.array(signs)[:, None]
    left, right = (look * (position + s * half)[list(rows)] for s in (-1, 1))
    wanted = np.stack([left[:, :-1], right[:, :-1], right[:, 1:], left[:, 1:]]).transpose(
        2, 0, 1
    )
    drawn, _ = polygons(ax)
    assert drawn.shape == (SNAKE.nodes - 1, 4, 2)
    for one in wanted:  # in any order: the nearest come last
        assert np.isclose(drawn, one, atol=1e-9).all(axis=(1, 2)).sum() == 1
    head = next(line for line in ax.lines if line.get_label() == "head")
    np.testing.assert_allclose(head.get_xydata()[0], look[:, 0] * position[list(rows), 0])
    assert (ax.get_xlabel(), ax.get_ylabel()) == labels
    assert ax.get_aspect() == 1.0
    assert ax.yaxis_inverted() == (view == "top")  # then right is to the right of forward
    low, high = np.transpose([ax.get_xlim(), sorted(ax.get_ylim())])
    assert (drawn > low).all()
    assert (drawn < high).all()


def test_the_back_is_seen_from_above_and_both_sides_of_a_twisted_body_from_the_side():
    back, belly = (np.array(to_rgba(colour)) for colour in (DORSAL, VENTRAL))
    _, colours = polygons(plot.body_view(GAIT, SNAKE, view="top", phase=PHASE))
    assert np.allclose(colours, back)
    drawn, colours = polygons(plot.body_view(GAIT, SNAKE, view="side", phase=PHASE))
    position, _, normal = placed()
    middle = 0.5 * (position[1:, :-1] + position[1:, 1:]).T
    seen = normal[0, :-1] + normal[0, 1:] > 0  # seen from the right, +x
    assert 3 < seen.sum() < seen.size - 3
    at = [np.linalg.norm(middle - centre, axis=1).argmin() for centre in drawn.mean(axis=1)]
    assert np.allclose(colours, np.where(seen[at, None], back, belly))
    near = position[0, :-1] + position[0, 1:]
    assert (np.diff(near[at]) > -1e-9).all()  # the nearest are drawn last


def test_shape_has_waves_and_two_views_at_one_scale():
    figure = plot.body_shape(GAIT, SNAKE, phase=PHASE)
    assert set(texts(figure)) == {"back", "belly", "head"}
    waves, top, side = figure.axes
    assert waves.get_ylabel() == "bending angle (°)"
    scales = [
        size * np.ptp(box) / np.ptp(limits)
        for ax in (top, side)
        for size, box, limits in (
            (90.0, ax.get_position().intervalx, ax.get_xlim()),
            (134.0, ax.get_position().intervaly, ax.get_ylim()),
        )
    ]
    np.testing.assert_allclose(scales, scales[0], rtol=2e-2)
    assert scales[0] > 1.5  # mm per cm
    np.testing.assert_allclose(polygons(top)[0].shape, polygons(side)[0].shape)


def test_bends_raise_the_tail():
    figure = plot.bent_bodies(GAIT, SNAKE, bends=[-20, 0, 20])
    sides = figure.axes[::2]
    assert [ax.texts[0].get_text() for ax in sides] == [
        f"$d_\\psi$ = {bend}°" for bend in ("\N{MINUS SIGN}20", "0", "20")
    ]
    heads = [next(line for line in ax.lines if line.get_label() == "head") for ax in sides]
    heights = [float(head.get_ydata()[0]) for head in heads]
    assert heights[0] > heights[1] > heights[2]  # about the centre of mass
    assert sides[-1].get_xlabel() == "forward, y (cm)"
    assert "up, z (cm)" in [ax.get_ylabel() for ax in sides]


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: plot.body_view(GAIT, view="front"), "view = 'front'"),
        (lambda: plot.body_view(GAIT, phase=np.nan), "phase = nan"),
        (lambda: plot.bent_bodies(GAIT, bends=[]), "give a bend"),
        (lambda: plot.bent_bodies(GAIT, bends=[200.0]), "bends = 200"),
        (lambda: plot.bending_waves(GAIT, phases=[]), "phases has shape"),
        (lambda: plot.wave_map(GAIT, wave="phi"), "wave = 'phi'"),
        (lambda: plot.wave_map(GAIT, duration=-1.0), "duration = -1"),
    ],
)
def test_what_cannot_be_drawn_is_refused(draw, message):
    with pytest.raises(ValueError, match=message):
        draw()


@pytest.mark.parametrize("draw", [plot.body_view, plot.bending_waves, plot.wave_map])
def test_parts_draw_on_given_axes_or_on_new_ones(draw):
    ax = Figure().add_subplot()
    assert draw(GAIT, SNAKE, ax) is ax
    alone = draw(GAIT, SNAKE)
    assert alone.figure.axes[0] is alone
    assert alone.figure.get_size_inches()[0] * 25.4 == pytest.approx(90.0)
