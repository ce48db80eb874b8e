"""The state of a system at one time, and the error of a state at which its accelerations do not exist."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.arrays import Real


@dataclass(frozen=True, eq=False)
class State:
    """Coordinates q (nq,), speeds u (nu,) and time t (s)."""

    q: Real
    u: Real
    t: float = 0.0


class DynamicsError(ArithmeticError):
    """The accelerations do not exist at this state; the message names the body and the remedy."""


class PrecisionWarning(UserWarning):
    """Rounding leaves few digits of the accelerations at this state; the message says how many, and where they go."""


def pack(state: State) -> Real:
    """y = [q, u, work]."""
    return np.concatenate([state.q, state.u, [0.0]])
