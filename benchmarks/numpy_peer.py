"""The flying-snake glide model in plain NumPy and SciPy: the peer that jaxglide is timed against.

I. J. Yeaton et al., Nature Physics 16, 974-982 (2020), doi:10.1038/s41567-020-0935-4 (equation numbers are theirs);
force coefficients: D. Holden et al., J. Exp. Biol. 217, 382-394 (2014). Midpoint nodes, trapezoid rule; SI, radians.
Frames: I, inertial (x right, y forward, z up); B, co-moving (x right flank, y forward, z dorsal).

For speed, nodes lie along the last axis; what is integrated or summed alike is stacked for one matrix product; two real
components that turn together are one complex number; 3x3 algebra is done in Python floats.
"""

import cmath
import math
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

ANGLE_LIMIT = math.radians(85.0)
OUTCOMES = "landed", "unstable: yaw", "unstable: pitch", "unstable: roll"
# Measured coefficients times 1e5, (15, 7) each: angle of attack -10, -5, ..., 60 deg by Re 3000, 5000, ..., 15000.
LIFT, DRAG = (
    np.array(
        """
-22675 -41202 -46889 -54330 -45011 -45119 -54118 -28298 -58908 -65507 -78313 -69828 -73020 -92629 -50933 -66243 -69804
-76275 -71451 -74524 -76698 -51737 -53187 -48373 -55708 -48915 -46366 -47324 4247 13458 19880 23990 24323 24669 27402
56881 55304 60312 70459 65080 68263 73989 83848 83108 91241 102776 96539 99228 107329 92120 98066 105762 121100 112271
115238 124631 113018 115955 122699 139943 130234 134523 145209 114460 122730 134801 179514 173560 180036 191365 109770
126810 132193 150009 138071 142236 151284 104975 121980 131015 144548 134351 140294 150492 102167 112453 118085 134688
126836 127007 138877 95800 103505 108048 120607 113650 114238 123793 88767 97602 99975 114078 104725 107043 114229
43486 46409 47499 52687 49011 50208 54158 37349 37154 38539 43595 40435 41815 46085 33250 33696 34938 39917 37505
38733 43753 31892 32235 34590 37964 36553 40662 43803 32600 38289 40988 46106 43600 44391 46885 40892 43359 45770
52281 47954 49743 53203 46275 49317 53012 59040 55208 56553 60831 49986 54059 57099 64719 59826 61209 65836 55810
59711 62550 71002 66035 68131 73402 60098 67866 70442 70741 66079 66094 71938 87052 103343 103499 113054 104045 105944
108919 98144 114088 119927 130150 121728 125929 133044 112651 127981 133685 150217 142195 141345 153178 128611 142883
147262 162623 154021 153506 165131 136197 155138 157948 177548 163220 165856 175309
""".split(),
        float,
    ).reshape(2, 15, 7)
    / 1e5
)


@dataclass
class Settings:
    """One glider and its gait. Angles in rad; the scales multiply lift and drag."""

    nu_theta: float = 1.4
    theta_m: float = math.radians(96.48753)
    psi_m: float = math.radians(20.0)
    d_psi: float = math.radians(10.0)
    d_theta: float = 0.0
    f_theta: float = 1.2  # Hz; 0 freezes the launch shape
    svl: float = 0.70  # m
    mass: float | None = None  # kg; None: from the length (Socha & LaBarbera 2005)
    n_nodes: int = 70
    neck_fraction: float = 0.055 / 0.70
    gravity: float = 9.81  # m/s^2
    air_density: float = 1.165  # kg/m^3
    viscosity: float = 1.568e-5  # m^2/s, kinematic
    polar: str = "published"  # or "smooth"
    lift_scale: float = 1.0
    drag_scale: float = 1.0


def prepare(settings):
    """The model: constants of one glider, arrays over n nodes. ValueError for a polar or a body it cannot describe."""

    def quadratic(x, h, k, p):
        return (x - h) ** 2 / (4 * p) + k

    p, n = settings, settings.n_nodes
    if p.psi_m + abs(p.d_psi) >= math.pi / 2:
        raise ValueError(
            "psi_m + |d_psi| must stay below 90 degrees: the chord is undefined there"
        )
    ds = p.svl / n
    x = (np.arange(n) + 0.5) / n
    chord = p.svl * quadratic(x, 0.51220022, 0.02895101, -4.88957129)
    share = np.where(
        x <= 0.037,
        quadratic(x, 0.01661771, 1.36099325, -0.00012991),
        quadratic(x, 0.52583598, 1.11461374, -0.10778636),
    )
    share /= share.sum()
    mass = (
        1e-3 * math.exp(-9.94919177 + 3.19831074 * math.log(100 * p.svl))
        if p.mass is None
        else p.mass
    )
    x_wave = np.maximum(
        x, p.neck_fraction
    )  # neck (eqs 9-12): the wave at its end, tapered to zero at the snout
    taper = x / x_wave
    wave = np.exp(2j * np.pi * p.nu_theta * x_wave)
    trapezoid = ds * (
        np.tri(n) - 0.5 * np.eye(n)
    )  # less half of node 0, a shift that the centring removes
    return SimpleNamespace(
        settings=p,
        mass=mass,
        omega=2 * math.pi * p.f_theta,  # kg, rad/s
        launch_speed=0.2409
        * math.sqrt(2 * mass * p.gravity / (chord.sum() * ds) / p.air_density),  # m/s
        wave=wave,
        wave_psi=p.psi_m
        * taper
        * wave**2,  # exp(i a) and psi_m exp(2 i a) at phase and time zero
        amplitude=p.theta_m * taper,
        bias=np.array([p.d_theta * x, p.d_psi * x]),  # rad
        integral=np.ascontiguousarray(
            (trapezoid - share @ trapezoid).T
        ),  # m, tangents @ integral = positions
        node_mass=mass * share,
        pressure=p.air_density * chord * ds / (2 * mass * share),  # kg, 1/m (per node mass)
        table=_polar_table(p),
        to_cell=np.array([np.full(n, 36 / np.pi), chord / p.viscosity / 2000.0]),
    )  # of beta, |V|


def _polar_table(settings):
    """C_D + i C_L on the full circle of beta as polynomials on cells of 5 deg by 2000 in Re: (p, p, 73 * 7).

    Axes: power of beta, power of Re (highest first), cell (from -180 deg, Re 3000). With the fold C_L(180 - beta) =
    -C_L(beta), C_D(180 - beta) = C_D(beta) built in, one force formula serves both polars. A last row (beta = 180 deg)
    and column (Re = 15000) close the grid.
    """
    alpha, at_90 = (
        np.arange(65.0, 91.0, 5.0)[:, None],
        np.linspace(2.0, 2.1, 7),
    )  # extension beyond 60 deg
    slope = (
        1.5 * LIFT[-1] - 2 * LIFT[-2] + 0.5 * LIFT[-3]
    )  # per step of 5 deg, and no linear term below: as published
    rows = np.array(
        [
            [90.0**3, 90.0**2, 90.0, 1.0],
            [60.0**3, 60.0**2, 60.0, 1.0],
            [3 * 60.0**2, 2 * 60.0, 0.0, 0.0],
        ]
    )
    cubic = np.linalg.lstsq(rows, np.array([np.zeros(7), LIFT[-1], slope]), rcond=None)[0]
    lift = np.vstack([LIFT, alpha ** np.arange(3, -1, -1) @ cubic])
    drag = np.vstack([DRAG, at_90 + (DRAG[-1] - at_90) * ((alpha - 90) / 30) ** 2])
    polar = (
        settings.drag_scale * drag + 1j * settings.lift_scale * lift
    )  # (21, 7), -10, ..., 90 deg
    below = np.repeat(polar[:1], 16, axis=0)  # -90, ..., -15 deg: held at the value at -10 deg
    if settings.polar == "smooth":
        below.imag *= np.sin(np.pi / 2 * np.arange(16) / 16)[:, None]
    half = np.vstack([below, polar])  # (37, 7), -90, ..., 90 deg
    fold = half[::-1].conj()  # 90, ..., 270 deg
    circle = np.roll(np.vstack([half[:-1], fold[:-1]]), 18, axis=0)  # (72, 7), from -180 deg
    if settings.polar == "smooth":
        in_re = CubicSpline(np.arange(7), circle, axis=1, bc_type="clamped").c  # (4, 6, 72)
        in_re = np.concatenate([in_re, in_re[..., :1]], axis=2)
        cells = CubicSpline(np.arange(73), in_re, axis=2, bc_type="periodic").c.transpose(
            0, 2, 1, 3
        )  # (4, 4, 72, 6)
    elif (
        settings.polar == "published"
    ):  # bilinear in each half by itself: lift jumps at beta = -90 deg
        rise = np.roll(np.vstack([np.diff(half, axis=0), np.diff(fold, axis=0)]), 18, axis=0)
        cells = np.array(
            [[np.diff(corner, axis=1), corner[:, :-1]] for corner in (rise, circle)]
        )
    else:
        raise ValueError(f"unknown polar {settings.polar!r}: 'published' or 'smooth'")
    last = np.zeros_like(cells[..., :1])
    last[:, -1] = cells[..., -1:].sum(axis=1)
    cells = np.concatenate([cells, last], axis=3)
    return np.concatenate([cells, cells[:, :, :1]], axis=2).reshape(*cells.shape[:2], -1)


CELL_ORIGIN, CELL_TOP = (
    np.array([[36.0], [-1.5]]),
    np.array([[72.0], [6.0]]),
)  # origin: beta = -180 deg, Re = 3000


def coefficients(table, cell):
    """C_D + i C_L (n,) at (beta, Re) in cell units (2, n); overwrites `cell`."""
    np.clip(cell, 0.0, CELL_TOP, out=cell)
    index = cell.astype(np.intp)
    cell -= index
    value = table.take(index[0] * 7 + index[1], axis=2)
    for x in cell.astype(complex):  # Horner, first in beta, then in Re
        powers, value = value, value[0]
        for coefficient in powers[1:]:
            value = value * x
            value += coefficient
    return value


def tangents(model, angle, rate):
    """Tangent and its first two time derivatives in closed form (eqs 2-3, 6-8), and the chord direction (eqs 13-15).

    angle: phi_theta - 2 pi f t in rad, a float or (P, 1); rate: its time derivative in rad/s. Returns (3, 3, ..., n)
    by derivative and component, then e^(i theta), whose parts are the chord's x and y, sin psi and cos psi, (..., n).
    """
    turn = cmath.exp(1j * angle) if isinstance(angle, float) else np.exp(1j * angle)
    a, b = model.wave * turn, model.wave_psi * (turn * turn)
    u, u_t = (np.pi / 2) * a.real, (-np.pi / 2 * rate) * a.imag
    lean, swing = model.amplitude * np.sin(u), model.amplitude * np.cos(u)
    level = np.array(
        [lean + model.bias[0], model.bias[1] - b.real]
    )  # theta, psi and their rates
    level_t = np.array([swing * u_t, 2 * rate * b.imag])
    level_tt = np.array(
        [(-rate * rate) * u * swing - lean * u_t * u_t, 4 * rate * rate * b.real]
    )
    sin, cos = np.sin(level), np.cos(level)
    s, c = sin[1], cos[1]
    chord = np.empty(a.shape, complex)
    chord.real, chord.imag = cos[0], sin[0]
    # x + i y is a factor times e^(i theta): -i cos psi for the tangent, the rest by differentiation; then z.
    c_t, s_t = c * level_t, s * level_t[1]  # cos psi (theta_t, psi_t), sin psi psi_t
    cross, square = s_t * level_t, c_t * level_t
    curve = c * level_tt - cross
    factor = np.empty((3, *a.shape), complex)
    real, imag = factor.real, factor.imag
    real[0], real[1], real[2] = 0.0, c_t[0], curve[0] - cross[0]
    imag[0], imag[1], imag[2] = -c, s_t, square[0] + square[1] + s * level_tt[1]
    factor *= chord
    out = np.empty((3, 3, *a.shape))
    out[:, 0], out[:, 1] = real, imag
    out[0, 2], out[1, 2], out[2, 2] = s, c_t[1], curve[1]
    return out, chord, s, c


# Algebra for floats and arrays alike. mx, my, mz: sums over the body of m x q, m y q, m z q, where q holds position
# (0-2), velocity (3-5), acceleration (6-8), force per node mass (9-11). Symmetric tensors are xx, yy, zz, xy, xz, yz.
def _rotation(sy, cy, sp, cp, sr, cr):
    """C = C2(roll) C1(pitch) C3(yaw), from I to B, row by row, from the angles' sines and cosines."""
    return (
        cr * cy - sr * sp * sy,
        cr * sy + sr * sp * cy,
        -sr * cp,
        -cp * sy,
        cp * cy,
        sp,
        sr * cy + cr * sp * sy,
        sr * sy - cr * sp * cy,
        cr * cp,
    )


def _angle_rates(wx, wy, wz, sp, cp, sr, cr):
    """Rates of yaw, pitch and roll from the angular velocity in B (eq. 22)."""
    yaw_t = (cr * wz - sr * wx) / cp
    return yaw_t, cr * wx + sr * wz, wy - sp * yaw_t


def _axial(mx, my, mz, k):
    """Sum of m r x q for the vector q that starts at entry k."""
    return my[k + 2] - mz[k + 1], mz[k] - mx[k + 2], mx[k + 1] - my[k]


def _inertia(mx, my, mz, k):
    """Inertia tensor (k = 0) or half of its rate (k = 3): tr(J) 1 - J, J the symmetric part of sum m r q^T."""
    xx, yy, zz = mx[k], my[k + 1], mz[k + 2]
    return (
        yy + zz,
        xx + zz,
        xx + yy,
        -0.5 * (mx[k + 1] + my[k]),
        -0.5 * (mx[k + 2] + mz[k]),
        -0.5 * (my[k + 2] + mz[k + 1]),
    )


def _times(tensor, x, y, z):
    xx, yy, zz, xy, xz, yz = tensor
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


def _solve(tensor, x, y, z):
    xx, yy, zz, xy, xz, yz = tensor
    adjugate = (
        yy * zz - yz * yz,
        xx * zz - xz * xz,
        xx * yy - xy * xy,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xy * xz - yz * xx,
    )
    det = xx * adjugate[0] + xy * adjugate[3] + xz * adjugate[4]
    return [part / det for part in _times(adjugate, x, y, z)]


def vector_field(t, y, model, phase):
    """Time derivative of the state at t (s) for phase phi_theta (rad), eqs 4-5 and 16-26.

    y: position_I (m), velocity_I (m/s), omega_B (rad/s), yaw, pitch, roll (rad) and, if 13 long, horizontal path (m).
    """
    _, _, _, vx, vy, vz, wx, wy, wz, yaw, pitch, roll, *path = y.tolist()
    sp, cp, sr, cr = math.sin(pitch), math.cos(pitch), math.sin(roll), math.cos(roll)
    cxx, cxy, cxz, cyx, cyy, cyz, czx, czy, czz = _rotation(
        math.sin(yaw), math.cos(yaw), sp, cp, sr, cr
    )
    n = model.amplitude.size
    rows = np.empty(
        (13, n)
    )  # 1, position, velocity, acceleration in B (eq. 8), force per node mass
    rows[0] = 1.0
    tangent, chord, s, c = tangents(model, phase - model.omega * t, -model.omega)
    np.matmul(tangent.reshape(9, n), model.integral, out=rows[1:10])
    # V = C v_I + omega x r + [r_t] (eq. 23); (x, -y) as a complex number times e^(i theta) gives v_c - i v_b.
    v = (
        np.array(
            [
                [cxx * vx + cxy * vy + cxz * vz, 0.0, -wz, wy, 1.0, 0.0, 0.0],
                [-cyx * vx - cyy * vy - cyz * vz, -wz, 0.0, wx, 0.0, -1.0, 0.0],
                [czx * vx + czy * vy + czz * vz, -wy, wx, 0.0, 0.0, 0.0, 1.0],
            ]
        )
        @ rows[:7]
    )
    normal = np.empty(n, complex)
    normal.real, normal.imag = v[0], v[1]
    normal *= chord
    normal.imag = s * normal.imag - c * v[2]
    cell = np.empty((2, n))
    np.arctan2(normal.imag, normal.real, out=cell[0])
    np.sqrt(np.einsum("ij,ij->j", v, v), out=cell[1])
    cell *= model.to_cell
    cell += CELL_ORIGIN
    # F_c - i F_b = -rho/2 U c ds (C_D + i C_L) (v_c - i v_b) (eqs 24-26), here per node mass and without the minus.
    force = coefficients(model.table, cell)
    force *= normal
    force *= np.abs(normal) * model.pressure
    np.multiply(c, force.imag, out=rows[12])
    np.negative(force.real, out=force.real)
    force.imag *= s
    force *= chord
    rows[10], rows[11] = force.real, force.imag
    total, mx, my, mz = ((rows[:4] * model.node_mass) @ rows[1:].T).tolist()
    inertia, half_rate = _inertia(mx, my, mz, 0), _inertia(mx, my, mz, 3)
    hx, hy, hz = (
        x + y for x, y in zip(_times(inertia, wx, wy, wz), _axial(mx, my, mz, 3))
    )  # I omega + h
    terms = zip(
        _axial(mx, my, mz, 9),
        _axial(mx, my, mz, 6),
        _times(half_rate, 2 * wx, 2 * wy, 2 * wz),
        (wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx),
    )
    torque = [moment - h_t - rate - turn for moment, h_t, rate, turn in terms]  # I omega_t
    fx, fy, fz = (f / model.mass for f in total[9:])
    dy = [
        vx,
        vy,
        vz,
        cxx * fx + cyx * fy + czx * fz,
        cxy * fx + cyy * fy + czy * fz,
        cxz * fx + cyz * fy + czz * fz - model.settings.gravity,
        *_solve(inertia, *torque),
        *_angle_rates(wx, wy, wz, sp, cp, sr, cr),
    ]
    return np.array([*dy, math.hypot(vx, vy)] if path else dy)


def _moments(model, phases):
    """mx, my, mz (9, P) at phases (P,), derivatives taken with respect to the phase."""
    tangent, *_ = tangents(model, phases[:, None], 1.0)
    q = (
        (tangent.reshape(-1, model.amplitude.size) @ model.integral)
        .reshape(9, len(phases), -1)
        .transpose(1, 0, 2)
    )
    return ((q[:, :3] * model.node_mass) @ q.transpose(0, 2, 1)).transpose(1, 2, 0)


def launch_phase(model):
    """Phase phi_theta (rad) of the first minimum of |h| downhill from zero (eq. 27), to 1e-9."""

    def slope(phases):  # of |h|^2 / 2, h per unit of -2 pi f
        moments = _moments(model, np.atleast_1d(phases))
        return sum(h * h_phase for h, h_phase in zip(_axial(*moments, 3), _axial(*moments, 6)))

    step = -0.02 if slope(0.0)[0] >= 0 else 0.02
    for start in range(0, 320, 16):  # batches of 16 steps, once around
        phases = step * np.arange(start, start + 17)
        uphill = np.flatnonzero(slope(phases)[1:] * step >= 0)
        if uphill.size:
            return brentq(
                lambda phase: slope(phase)[0], *phases[uphill[0] : uphill[0] + 2], xtol=1e-12
            )
    raise RuntimeError("no launch phase: |h| has no minimum")


@cache
def _cycle_quadrature(n=48, samples=200):
    """Gauss-Legendre nodes (n,) on one cycle, tau in [0, 2 pi); weights of the values there that give the integrals
    from 0 to the nodes, (n, n), and the mean of the integral over equally spaced times, (n,)."""
    x, w = legendre.leggauss(n)
    series = (np.arange(n)[:, None] + 0.5) * legendre.legvander(x, n - 1).T * w
    primitive = np.pi * legendre.legint(series, lbnd=-1)
    sampled = legendre.legvander(2 * np.arange(samples) / samples - 1, n) @ primitive
    return np.pi * (x + 1), legendre.legvander(x, n) @ primitive, sampled.mean(axis=0)


def launch(model):
    """Launch phase (rad) and yaw, pitch, roll (3,) in rad: minus their means over one cycle without air and gravity.

    Angular momentum is conserved there, so omega = I^-1 (C h(0) - h): three equations in the phase of the cycle, free
    of the frequency, solved by Picard iteration on collocation nodes.
    """
    phase = launch_phase(model)
    tau, integral, mean = _cycle_quadrature()
    mx, my, mz = _moments(model, phase - np.append(tau, 0.0))
    h = -np.array(_axial(mx, my, mz, 3))
    inertia = [j[:-1] for j in _inertia(mx, my, mz, 0)]
    angles = np.zeros((3, tau.size))
    for _ in range(100):
        (sy, sp, sr), (cy, cp, cr) = np.sin(angles), np.cos(angles)
        c = np.reshape(_rotation(sy, cy, sp, cp, sr, cr), (3, 3, -1))
        momentum = np.einsum("ijn,j->in", c, h[:, -1]) - h[:, :-1]
        rates = np.array(_angle_rates(*_solve(inertia, *momentum), sp, cp, sr, cr))
        previous, angles = angles, rates @ integral.T
        if np.abs(angles - previous).max() < 1e-12:
            return phase, -rates @ mean
    raise RuntimeError("the launch attitude did not converge")


def simulate(
    model,
    height=10.0,
    speed=None,
    rtol=1e-6,
    atol=1e-6,
    method="RK45",
    start=None,
    dense_output=False,
):
    """Glide from `height` (m) at `speed` (m/s; None: the model's) to the ground or to 85 deg of yaw, pitch or roll.

    start: (phase, angles) from `launch`; None computes them. Returns a dict: t (k,) in s and y (13, k) at the solver's
    steps, the last at the end event; outcome (one of OUTCOMES or "time limit", 120 s), path_length (m), phase, angles,
    n_evaluations, sol (dense output or None). RuntimeError if the solver fails.
    """

    def margin(t, y, *_):  # the glide ends where it falls through zero
        return min(y[2], ANGLE_LIMIT - max(map(abs, y[9:12].tolist())))

    margin.terminal, margin.direction = True, -1
    phase, angles = launch(model) if start is None else start
    y0 = np.zeros(13)
    y0[2], y0[4], y0[9:12] = height, model.launch_speed if speed is None else speed, angles
    solution = solve_ivp(
        vector_field,
        (0.0, 120.0),
        y0,
        method=method,
        rtol=rtol,
        atol=atol,
        events=margin,
        args=(model, phase),
        dense_output=dense_output,
    )
    if solution.status < 0:
        raise RuntimeError(solution.message)
    end = solution.y[:, -1]
    nearest = np.argmin([end[2], *(ANGLE_LIMIT - np.abs(end[9:12]))])
    outcome = OUTCOMES[nearest] if solution.status == 1 else "time limit"
    return {
        "t": solution.t,
        "y": solution.y,
        "outcome": outcome,
        "path_length": end[12],
        "phase": phase,
        "angles": angles,
        "n_evaluations": solution.nfev,
        "sol": solution.sol,
    }
