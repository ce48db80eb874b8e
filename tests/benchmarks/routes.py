"""Forward dynamics as calls of one kernel each, to be counted or timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import flexmb as fm
from flexmb.entry import articulated as entry
from flexmb.entry import composite
from flexmb.jain.places import matrices
from flexmb.jit.counting import Operations, count
from flexmb.jit.kernel import kernel

IN_A_RUN = 100


@dataclass(frozen=True)
class Evaluation:
    """Accelerations at a system's initial state: a kernel, the same kernel called from compiled code, their arguments.

    A call from Python unpacks the arguments each time, which takes longer than a rigid body does; a run does it once.
    """

    kernel: Callable[..., int]
    repeated: Callable[..., int]
    arguments: tuple[Any, ...]

    def __call__(self) -> int:
        return self.kernel(*self.arguments)

    def in_a_run(self) -> int:
        """IN_A_RUN evaluations, as an integrator makes them."""
        return self.repeated(IN_A_RUN, *self.arguments)

    def operations(self) -> Operations:
        """What the kernel executes."""
        return count(self.kernel, *self.arguments).operations


def articulated(system: fm.System) -> Evaluation:
    """By articulated bodies, their modes eliminated as the system says, with the kernels of explicit runs."""
    written = system.recursion_workspace()
    arguments = 0.0, _start(system), system.explicit_constants, written
    return Evaluation(entry.accelerations, _articulated, arguments)


def composite_body(system: fm.System) -> Evaluation:
    """By composite bodies and the factors of the mass matrix."""
    written = system.workspace(), matrices(system.constants)
    arguments = 0.0, _start(system), system.constants, *written
    return Evaluation(composite.accelerations, _composite, arguments)


def _start(system: fm.System) -> np.ndarray:
    state = system.initial_state
    return np.concatenate([state.q, state.u, [0.0]])


@kernel
def _articulated(times, t, y, c, w):
    status = 0
    for _ in range(times):
        status = max(status, entry.accelerations(t, y, c, w))
    return status


@kernel
def _composite(times, t, y, c, w, m):
    status = 0
    for _ in range(times):
        status = max(status, composite.accelerations(t, y, c, w, m))
    return status
