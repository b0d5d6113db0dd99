"""Shapes from coordinates: serpenoid waves in closed form, and any other waveform."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib.checks import result_of
from .._lib.fields import as_names
from .._lib.numerics import sincos
from .motion import AbstractShape, Bending, in_neck


class Serpenoid(AbstractShape):
    """The serpenoid waves with every coordinate free to vary in time, in closed form.

    Coordinates: theta_m, psi_m [rad], nu_theta, d_psi, d_theta [rad per SVL] and the phase
    [rad], as in `Gait` (eqs 2-3, 6-7, 9-12). With nu_theta changing the wave is sheared.
    """

    @property
    def coordinates(self) -> tuple[str, ...]:
        """theta_m, psi_m, nu_theta, d_psi, d_theta and phase."""
        return ("theta_m", "psi_m", "nu_theta", "d_psi", "d_theta", "phase")

    def bending(self, fraction, neck_fraction, coordinates):
        x, ramp = in_neck(fraction, neck_fraction)
        (A, P, nu, E, D, phase), dq, ddq = coordinates
        dA, dP, dnu, dE, dD, dphase = dq
        ddA, ddP, ddnu, ddE, ddD, ddphase = ddq
        sin_a, cos_a = sincos(2 * jnp.pi * nu * x + phase)
        da = 2 * jnp.pi * dnu * x + dphase
        dda = 2 * jnp.pi * ddnu * x + ddphase

        # theta = A sin u + D x with u = (pi/2) cos a
        u, du = jnp.pi / 2 * cos_a, -jnp.pi / 2 * sin_a * da
        ddu = -jnp.pi / 2 * (cos_a * da**2 + sin_a * dda)
        sin_u, cos_u = sincos(u)
        # psi = -P cos 2a + E x
        sin_2a, cos_2a = 2 * sin_a * cos_a, 2 * cos_a * cos_a - 1
        return Bending(
            theta=ramp * (A * sin_u + D * x),
            theta_dot=ramp * (dA * sin_u + A * cos_u * du + dD * x),
            theta_ddot=ramp
            * (ddA * sin_u + 2 * dA * cos_u * du + A * (cos_u * ddu - sin_u * du**2) + ddD * x),
            psi=ramp * (-P * cos_2a + E * x),
            psi_dot=ramp * (-dP * cos_2a + 2 * P * sin_2a * da + dE * x),
            psi_ddot=ramp
            * (
                -ddP * cos_2a
                + 4 * dP * sin_2a * da
                + P * (4 * cos_2a * da**2 + 2 * sin_2a * dda)
                + ddE * x
            ),
        )


class Function(eqx.Module):
    """A plain function as a module without floats; a module is left as it is."""

    call: Callable[..., Any] = eqx.field(static=True)

    def __call__(self, *arguments):
        return self.call(*arguments)


def as_module(function: Any) -> Any:
    """A callable module, whose floats are traced, or a plain function wrapped as one."""
    if isinstance(function, eqx.Module) or not callable(function):
        return function
    return Function(function)


class Waveform(AbstractShape):
    """A shape from one function; its time derivatives come from JAX.

    Args:
        angles: function of the fractions s/L, (n,), and the coordinates q, (m,), that gives
            the bending angles theta and psi [rad], each (n,): pure and twice differentiable
            in q. If it is a module its floats are the shape's parameters. Give a plain
            function once, not a new one every time: each new one is compiled.
        names: of the m coordinates; `phase` [rad], if there is one, is the last.
        neck: whether the angles ramp to zero in the body's neck, as the published waves do
            (static); otherwise they hold all along.

    Raises:
        TypeError: `angles` is no function.
        ValueError: names that stand twice or in another order, or `angles` gives other shapes.

    Examples:
        >>> import jax.numpy as jnp
        >>> from jaxglide import Driven, Running, Waveform
        >>> def angles(x, q):
        ...     amplitude, waves, phase = q
        ...     theta = amplitude * jnp.sin(2 * jnp.pi * waves * x + phase)
        ...     return theta, jnp.zeros_like(x)
        ...
        >>> shape = Waveform(angles, ("amplitude", "waves", "phase"))
        >>> gait = Driven(shape, Running([1.6, 1.4, 1.2]))  # at 1.2 Hz
        >>> print(gait.shape.names)
        ('amplitude', 'waves', 'phase')
    """

    angles: Callable[..., Any] = eqx.field(converter=as_module)
    names: tuple[str, ...] = eqx.field(static=True, converter=as_names)
    neck: bool = eqx.field(static=True, default=True)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.names

    def _check(self):
        given = self.names
        if not callable(self.angles):
            raise TypeError(f"angles = {self.angles!r} is not a function")
        if not isinstance(given, tuple) or not all(isinstance(name, str) for name in given):
            raise TypeError(f"names = {given!r} are not names")
        if not given or len(set(given)) < len(given):
            raise ValueError(f"names = {given} are none, or name one twice")
        if "phase" in given[:-1]:
            raise ValueError(f"names = {given}: phase must be the last")
        x, q = (jax.ShapeDtypeStruct((size,), float) for size in (5, len(given)))
        what = f"angles of fractions (5,) and coordinates ({len(given)},)"
        found = result_of(what, self.angles, x, q)
        shapes = [getattr(one, "shape", None) for one in jax.tree.leaves(found)]
        if shapes != [(5,), (5,)]:
            raise ValueError(
                f"angles gives arrays of shape {shapes} for 5 nodes: it must give theta and "
                "psi, each (5,)"
            )

    def bending(self, fraction, neck_fraction, coordinates):
        q, q_dot, q_ddot = coordinates
        x, ramp = fraction, jnp.ones_like(fraction)
        if self.neck:
            x, ramp = in_neck(fraction, neck_fraction)

        def at(t):
            theta, psi = self.angles(x, q + t * (q_dot + t / 2 * q_ddot))
            return ramp * theta, ramp * psi

        def first(t):
            return jax.jvp(at, (t,), (jnp.ones_like(t),))

        now, onwards = jnp.zeros((), q.dtype), jnp.ones((), q.dtype)
        (value, rate), (_, second) = jax.jvp(first, (now,), (onwards,))
        return Bending(value[0], rate[0], second[0], value[1], rate[1], second[1])
