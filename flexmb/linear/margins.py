"""The transfer function of a loop that is opened at one signal, and how much gain, phase and delay it stands.

With the negative feedback L(z) the loop is closed by 1 + L(z) = 0. On the unit circle, z = exp(i omega T), the margins
are where L is negative real (gain) and where |L| = 1 (phase; as a delay, phase over frequency). Between the frequencies
of a grid that is dense about all poles and zeros of L, crossings are found by bisection of the sine of its phase and of
the logarithm of its size (Franklin, Powell, Workman, Digital Control of Dynamic Systems, 1998, 7.4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigvals, schur
from scipy.optimize import brentq

from flexmb.kept import kept
from flexmb.linear.linear_model import Complex
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.typing import Real

GRID = 2000  # frequencies, besides those about poles and zeros
LOWEST = 1e-4  # of them over the highest, unless the closed loop is slower
TO_SLOWEST = 0.03  # of the slowest motion of the closed loop
AROUND = np.r_[0.0, 2.0 ** np.arange(-3.0, 11.0)]  # distances from a pole or zero, over its distance from the circle
HALFWAY = 1e-9  # relative distance from half the frequency of the samples, where L is real
CROSSED = 1e-6  # of the phase (rad) or the logarithm of the size: where more is left after bisection, there is a pole


class LoopCrossing(NamedTuple):
    """omega (rad/s) where L is negative real: `value` is the gain that would make it -1; or where |L| = 1: `value` is
    the phase (rad) by which it may lag until it is -1, negative if it must lead."""

    omega: float
    value: float


@dataclass(frozen=True, eq=False)
class LoopTransfer:
    """L(z) = C (z - A)^-1 B + D of negative feedback, opened at `signal`, with the period (s) of its samples.

    A (n,n), B (n,), C (n,), D. closed: the multipliers of the closed loop.
    """

    signal: str
    period: float
    A: Real
    B: Real
    C: Real
    D: float
    closed: Complex

    __repr__ = brief

    def __call__(self, omega: ArrayLike) -> Complex:
        """L(exp(i omega T)) (W,) at frequencies (W,) in rad/s; infinite at an undamped resonance. ValueError or
        TypeError for what is no frequency."""
        frequencies = arguments.finite("omega", np.atleast_1d(arguments.array("omega", omega)))
        if frequencies.ndim != 1:
            raise ValueError(f"omega: give frequencies in a row, not an array of shape {frequencies.shape}")
        return self._at(np.exp(1j * frequencies * self.period))

    @property
    def highest(self) -> float:
        """Half the frequency (rad/s) of the samples."""
        return np.pi / self.period

    @kept
    def phase_crossings(self) -> tuple[LoopCrossing, ...]:
        """Where L is negative real, by frequency; half the frequency of the samples is one if L is negative there."""
        found, last = list[LoopCrossing](), self._one(self.highest)
        for omega in self._roots(_sine):
            there = self._one(omega)
            if omega < (1.0 - HALFWAY) * self.highest and there.real < 0.0 and abs(_sine(there)) < CROSSED:
                found.append(LoopCrossing(omega, 1.0 / abs(there)))
        if np.isfinite(last) and last.real < 0.0:
            found.append(LoopCrossing(self.highest, 1.0 / abs(last)))
        return tuple(found)

    @kept
    def gain_crossings(self) -> tuple[LoopCrossing, ...]:
        """Where |L| = 1, by frequency."""
        return tuple(
            LoopCrossing(omega, float(np.angle(-self._one(omega))))
            for omega in self._roots(_size)
            if abs(_size(self._one(omega))) < CROSSED
        )

    @property
    def gain_margin(self) -> float:
        """The least gain above 1 by which L may be multiplied until a multiplier is on the unit circle; infinite where
        there is none."""
        return min((each.value for each in self.phase_crossings if each.value > 1.0), default=np.inf)

    @property
    def gain_reduction(self) -> float:
        """The largest gain below 1 with which a multiplier is on the unit circle; 0 where there is none."""
        return max((each.value for each in self.phase_crossings if each.value < 1.0), default=0.0)

    @property
    def phase_margin(self) -> float:
        """The least phase (rad), lag or lead, that puts a multiplier on the unit circle; infinite where |L| is never 1.
        """
        return min((abs(each.value) for each in self.gain_crossings), default=np.inf)

    @property
    def delay_margin(self) -> float:
        """The least delay (s) that turns L to -1 where |L| = 1; infinite where |L| is never 1.

        It is exact for whole periods. In between, a sampled controller with `delay_s` also changes the size of L: a
        stability map over `delay_s` is exact for these.
        """
        return min((each.value % (2.0 * np.pi) / each.omega for each in self.gain_crossings), default=np.inf)

    @kept
    def grid(self) -> Real:
        """Frequencies (rad/s), in order, that show everything: dense about poles, zeros and the closed loop's poles."""
        zeros = eigvals(
            np.block([[self.A, self.B[:, None]], [self.C[None], np.array([[self.D]])]]),
            np.diag([1.0] * len(self.A) + [0.0]),
        )
        special = np.concatenate([np.linalg.eigvals(self.A), zeros[np.isfinite(zeros)], self.closed])
        special = special[(np.abs(special) > 0.1) & (np.abs(special) < 10.0)]
        slowest = np.min(np.abs(np.log(self.closed[np.abs(self.closed) > 0.1])), initial=1.0)
        low = np.pi * min(LOWEST, max(TO_SLOWEST * slowest / np.pi, 1e-7))
        width = np.maximum(np.abs(1.0 - np.abs(special)), 1e-6)
        about = np.abs(np.angle(special))[:, None] + width[:, None] * np.r_[-AROUND[::-1], AROUND]
        every = np.concatenate([np.geomspace(low, np.pi, GRID), about.ravel()])
        return np.unique(every[(every >= low) & (every <= np.pi)]) / self.period

    @kept
    def _values(self) -> Complex:
        return self(self.grid)

    @kept
    def _triangular(self) -> tuple[Complex, Complex, Complex]:
        """T, and B and C by the basis of Schur's decomposition A = Z T Z*."""
        T, Z = schur(self.A.astype(complex), output="complex")
        return T, Z.conj().T @ self.B, self.C @ Z

    def _at(self, z: Complex) -> Complex:
        T, b, c = self._triangular
        x = np.zeros((len(T), len(z)), complex)
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in range(len(T) - 1, -1, -1):
                x[i] = (b[i] + T[i, i + 1 :] @ x[i + 1 :]) / (z - T[i, i])
            found = c @ x + self.D
        return np.where(np.isfinite(found), found, np.inf)

    def _one(self, omega: float) -> complex:
        return complex(self._at(np.exp(1j * np.array([omega * self.period])))[0])

    def _roots(self, of: Callable[[complex], float]) -> list[float]:
        """Frequencies below the highest where `of` L changes its sign."""
        grid, values = self.grid, np.array([of(value) for value in self._values])
        found = [float(omega) for omega in grid[values == 0.0]]

        def at(omega: float) -> float:
            return of(self._one(omega))

        for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0):
            ends = float(grid[i]), float(grid[i + 1])
            if at(ends[0]) * at(ends[1]) < 0.0:
                found.append(float(brentq(at, *ends, xtol=1e-300, rtol=1e-14)))
            else:  # rounding decides on which side an end is
                found.append(min(ends, key=lambda omega: abs(at(omega))))
        return sorted(found)


def _sine(L: complex) -> float:
    """Of its phase; 0 where it is exactly -1 or at a pole."""
    return L.imag / abs(L) if np.isfinite(L) and L else 0.0


def _size(L: complex) -> float:
    return float(np.log(abs(L))) if np.isfinite(L) and L else np.inf if L else -np.inf
