"""Sums of loads of hinges and closures over a run: determined also where single loads are not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from flexmb.run.run_arrays import RunArrays
from flexmb.system.load_axes import held_by
from flexmb.system.system import System
from flexmb.tables.state import State
from flexmb.typing import Real


def total_load(
    run: RunArrays, systems: Iterable[System], joints: Sequence[str], on: str, about: tuple[str, str] | None
) -> Real:
    """The sum (T,6) of `System.total_load` at the outputs of a run, each with the system (T) that it is of.

    At singular positions, where the motion is not determined, it is that of the loads of the run. ValueError as there.
    """
    rows, times = np.zeros((len(run.t), 6)), run.t.tolist()
    for i, system in enumerate(systems):
        state = State(run.q[i], run.u[i], times[i])
        if system.constraints is None:
            rows[i] = system.total_load(state, joints, on, about=about)
        else:
            signs = held_by(system.scene, joints, on)
            rows[i] = system.constraints.total_load_across(state, signs, about or (on, "origin"))
    return rows
