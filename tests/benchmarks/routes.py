"""Forward dynamics as calls of one kernel each, to be counted or timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import flexmb as fm
from flexmb import composite, dynamics
from flexmb.counting import Operations, count
from flexmb.jain.places import matrices


@dataclass(frozen=True)
class Evaluation:
    """Accelerations at a system's initial state: a kernel and its arguments."""

    kernel: Callable[..., int]
    arguments: tuple[Any, ...]

    def __call__(self) -> int:
        return self.kernel(*self.arguments)

    def operations(self) -> Operations:
        """What the kernel executes."""
        return count(self.kernel, *self.arguments).operations


def articulated(system: fm.System) -> Evaluation:
    """By articulated bodies, their modes eliminated as the system says."""
    written = system.recursion_workspace()
    return Evaluation(dynamics.accelerations, (0.0, _start(system), system.recursion_constants, written))


def composite_body(system: fm.System) -> Evaluation:
    """By composite bodies and the factors of the mass matrix."""
    written = system.workspace(), matrices(system.constants)
    return Evaluation(composite.accelerations, (0.0, _start(system), system.constants, *written))


def _start(system: fm.System) -> np.ndarray:
    state = system.initial_state
    return np.concatenate([state.q, state.u, [0.0]])
