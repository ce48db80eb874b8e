"""Second-order jets: the value of an array and its first and second time derivatives along a motion.

Products follow Leibniz' rule, functions the chain rule. Rotations are matrix-valued jets, which contain the angular
velocity and acceleration. Leading axes are shared: (B, K, ...), K points along B motions from one configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from types import EllipsisType
from typing import assert_never

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike, NDArray

from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.typing import Real

TERMS = 24  # of the power series below: exact to round-off for |x| <= 2 pi
# Series in x^2, because sin(x)/x has no derivative by the rotation vector that could be evaluated at x = 0.
SERIES = np.zeros((TERMS, 2, 3))
"""sin(x)/x and (1 - cos(x))/x^2 as power series in x^2, and their first and second derivatives by x^2."""
for _i in range(2):
    _series = Polynomial([(-1.0) ** k / factorial(2 * k + 1 + _i) for k in range(TERMS)])
    for _order in range(3):
        SERIES[: TERMS - _order, _i, _order] = _series.deriv(_order).coef


@dataclass(frozen=True)
class Jet:
    """x, dx/dt, d2x/dt2; their shapes broadcast. `still`: both derivatives are zero, and products leave them out."""

    value: Real
    rate: Real
    acceleration: Real
    still: bool = False

    def __add__(self, other: Jet) -> Jet:
        rate, acceleration = self.rate + other.rate, self.acceleration + other.acceleration
        return Jet(self.value + other.value, rate, acceleration, self.still and other.still)

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.rate, -self.acceleration, self.still)

    def __matmul__(self, other: Jet) -> Jet:
        return product(np.matmul, self, other)

    def __getitem__(self, key: tuple[slice | EllipsisType | None | int | NDArray[np.intp], ...] | int) -> Jet:
        return self.map(lambda x: x[key])

    def map(self, linear: Callable[[Real], Real]) -> Jet:
        """The jet of a constant linear function of x."""
        return Jet(linear(self.value), linear(self.rate), linear(self.acceleration), self.still)

    @property
    def transpose(self) -> Jet:
        return self.map(lambda x: np.swapaxes(x, -1, -2))


@dataclass(frozen=True)
class MovingFrame:
    """Frames that move: origins (B,K,3) and rotations (B,K,3,3), in the axes of the frame they are seen from."""

    position: Jet
    rotation: Jet

    def carry(self, inner: MovingFrame) -> MovingFrame:
        """`inner`, given relative to this frame, relative to the frame that this one is given in."""
        return MovingFrame(self.position + turn(self.rotation, inner.position), self.rotation @ inner.rotation)

    def inverse(self) -> MovingFrame:
        """The frame that this one is given in, relative to this one."""
        back = self.rotation.transpose
        return MovingFrame(-turn(back, self.position), back)

    @property
    def first(self) -> MovingFrame:
        """The frames along the first of B motions."""
        return MovingFrame(self.position[0], self.rotation[0])

    def chosen(self, which: NDArray[np.intp]) -> MovingFrame:
        """The frames with these numbers among the K."""
        return MovingFrame(self.position[:, which], self.rotation[:, which])

    def angular_velocity(self) -> Real:
        """w (...,3) with dR/dt = w~ R."""
        return vector(self.rotation.rate @ np.swapaxes(self.rotation.value, -1, -2))

    def angular_acceleration(self) -> Real:
        """alpha = dw/dt (...,3): the skew part of d2R/dt2 R', whose symmetric part is -dR/dt dR'/dt."""
        return vector(self.rotation.acceleration @ np.swapaxes(self.rotation.value, -1, -2))


def constant(value: ArrayLike) -> Jet:
    """A jet with zero derivatives."""
    array = np.asarray(value)
    array = array.astype(np.result_type(array, float))  # complex numbers stay complex, for complex steps
    zero = np.zeros(array.shape, array.dtype)
    return Jet(array, zero, zero, True)


ONE = constant(np.eye(3))


def join(jets: list[Jet], motions: int) -> Jet:
    """Jets of the points of several bodies, (1 or B, K, ...), concatenated along K."""

    def along(parts: list[Real]) -> Real:
        return np.concatenate([np.broadcast_to(x, (motions, *x.shape[1:])) for x in parts], axis=1)

    return Jet(along([j.value for j in jets]), along([j.rate for j in jets]), along([j.acceleration for j in jets]))


def product(operation: Callable[[Real, Real], Real], a: Jet, b: Jet) -> Jet:
    """The jet of a bilinear operation, by Leibniz' rule. Most frames are fixed in a body, so that terms with the
    derivatives of constants would be most of the work."""
    value = operation(a.value, b.value)
    if a.still and b.still:
        return constant(value)
    if b.still:
        return Jet(value, operation(a.rate, b.value), operation(a.acceleration, b.value))
    if a.still:
        return Jet(value, operation(a.value, b.rate), operation(a.value, b.acceleration))
    return Jet(
        value,
        operation(a.rate, b.value) + operation(a.value, b.rate),
        operation(a.acceleration, b.value) + 2.0 * operation(a.rate, b.rate) + operation(a.value, b.acceleration),
    )


def turn(rotation: Jet, x: Jet) -> Jet:
    """R x for vectors (...,3)."""
    return product(_turned, rotation, x)


def _turned(R: Real, v: Real) -> Real:
    return np.asarray((R @ v[..., None])[..., 0])


def scale(factor: Jet, matrix: Jet) -> Jet:
    """Scalars (...) times matrices (...,3,3)."""
    return product(lambda s, A: s[..., None, None] * A, factor, matrix)


def quadratic(G: Real, x: Jet) -> Jet:
    """1/2 x' G x for vectors x (...,m): G (...,m,m), symmetric."""
    return product(lambda a, b: 0.5 * np.einsum("...m,...mn,...n->...", a, G, b), x, x)


def chain(f: Real, df: Real, d2f: Real, x: Jet) -> Jet:
    """f(x) from f, f' and f'' at x.value."""
    return Jet(f, df * x.rate, d2f * x.rate**2 + df * x.acceleration)


def polynomial(p: Polynomial, x: Jet) -> Jet:
    """p(x)."""
    return chain(p(x.value), p.deriv()(x.value), p.deriv(2)(x.value), x)


def skew(v: Real) -> Real:
    """v~ with v~ a = v x a, (...,3) -> (...,3,3)."""
    A = np.zeros((*v.shape, 3), v.dtype)
    A[..., 2, 1], A[..., 0, 2], A[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    A[..., 1, 2], A[..., 2, 0], A[..., 0, 1] = -v[..., 0], -v[..., 1], -v[..., 2]
    return A


def vector(A: Real) -> Real:
    """v with v~ the skew part of A, (...,3,3) -> (...,3)."""
    return 0.5 * np.stack(
        [A[..., 2, 1] - A[..., 1, 2], A[..., 0, 2] - A[..., 2, 0], A[..., 1, 0] - A[..., 0, 1]], axis=-1
    )


def rotation_exponential(theta: Jet) -> Jet:
    """exp(theta~) of rotation vectors (...,3): Rodrigues, 1 + sin(x)/x theta~ + (1 - cos(x))/x^2 theta~^2."""
    squared = product(lambda a, b: np.einsum("...i,...i->...", a, b), theta, theta)
    cross = theta.map(skew)
    sine, versine = (chain(f, df, d2f, squared) for f, df, d2f in polyval(squared.value, SERIES))
    return ONE + scale(sine, cross) + scale(versine, cross @ cross)


def rotation_about(axis: ArrayLike, angle: Jet) -> Jet:
    """Rotation by a scalar angle about a unit vector: 1 + sin(angle) axis~ + (1 - cos(angle)) axis~^2."""
    cross = skew(np.asarray(axis, dtype=float))
    s, c = np.sin(angle.value), np.cos(angle.value)  # not the series: the angle may count many turns
    sine, versine = chain(s, c, -s, angle), chain(1.0 - c, s, c, angle)
    return ONE + scale(sine, constant(cross)) + scale(versine, constant(cross @ cross))


SEPTIC = Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])


def profile(function: Function, t: float) -> Jet:
    """The function and its first two derivatives at time t, scalars."""
    time = Jet(np.array(t), np.array(1.0), np.array(0.0))
    match function:
        case Constant(value=value):
            return constant(value)
        case Ramp(value=value, rate=rate, start_s=start):
            return polynomial(Polynomial([value - rate * start, rate]), time)
        case Sine(amplitude=a, angular_frequency_rad_s=w, phase_rad=phase, offset=offset):
            s, c = np.sin(w * t + phase), np.cos(w * t + phase)
            return constant(offset) + chain(a * s, a * w * c, -a * w**2 * s, time)
        case SmoothStep(start_value=a, end_value=b, start_s=start, duration_s=duration):
            if not start < t < start + duration:
                return constant(a if t <= start else b)
            x = polynomial(Polynomial([-start / duration, 1.0 / duration]), time)
            return polynomial(a + (b - a) * SEPTIC, x)
        case SpinUp(rate=rate, duration_s=duration):
            if t >= duration:
                return polynomial(Polynomial([-0.5 * rate * duration, rate]), time)
            k = 2.0 * np.pi / duration
            swing = chain(np.cos(k * t) / k**2, -np.sin(k * t) / k, -np.cos(k * t), time)
            growth = polynomial(Polynomial([-1.0 / k**2, 0.0, 0.5]), time)
            return (growth + swing).map(lambda x: rate / duration * x)
        case Pulse(value=value, start_s=start, duration_s=duration):
            return constant(value if start <= t < start + duration else 0.0)
        case ControlSignal():
            return constant(0.0)  # a single evaluation has no controllers
        case Table(times_s=times, values=values):
            from scipy.interpolate import make_interp_spline  # slow to import, and few scenes have tables

            spline = make_interp_spline(times, values, k=5)
            return Jet(spline(t), spline(t, 1), spline(t, 2))
        case _:
            assert_never(function)
