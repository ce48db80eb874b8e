"""Checks, before a run is resumed, that a restart belongs to the system and to the settings of the run."""

from __future__ import annotations

import numpy as np

from flexmb.control.memory import LoopMemory
from flexmb.control.schedule import instants, slack
from flexmb.control.tables import SAMPLE
from flexmb.integrate.control import stretch
from flexmb.integrate.memory import DONE, STRETCH, TIME, Memory
from flexmb.run.restart import Restart
from flexmb.scene.tree import watches_signals
from flexmb.system.system import System
from flexmb.typing import Real

REMEDY = "; to start from its last state instead, give the state `last_state` of its trajectory"
ROUNDING = 1e-9  # fraction of a step by which the times of equal steps may differ


def fitting(system: System, given: Restart, method: str) -> Restart:
    """A copy of a restart of this system and method; ValueError or TypeError for any other."""
    restart = given.examined()
    if restart.method != method:
        raise ValueError(f'the run to resume was made by method "{restart.method}": give the same{REMEDY}')
    if restart.scene != system.scene:
        raise ValueError(f'the run to resume was of scene "{restart.scene.name}" with other contents{REMEDY}')
    motion, known = system.nq + system.nu + 1, restart.controllers
    has_loop = bool(system.scene.controllers) or watches_signals(system.scene)
    if has_loop != (known is not None):
        raise ValueError(f"the restart has {'no' if has_loop else 'a'} memory of controllers: it is damaged")
    if bool(system.scene.events) != (restart.events is not None):
        said = "no" if system.scene.events else "a"
        raise ValueError(f"the restart has {said} memory of events: it is damaged")
    states = 0 if known is None else _refuse_other_controllers(system, restart, known)
    if len(restart.memory.y) != motion + states:
        raise ValueError(
            f"the restart has {len(restart.memory.y)} numbers in y, but the run has {motion + states}: it is damaged"
        )
    return restart


def refuse_other_division(memory: Memory, times: Real, segment_end: float, step: float) -> None:
    """ValueError if a method of equal steps would continue with other steps than those of the run that stopped.

    times (T,) s: output times; segment_end (s): end of the first segment; step (s): upper bound of the steps.
    """
    start, t, done = memory.numbers[[STRETCH, TIME, DONE]].tolist()
    sample = times[min(np.searchsorted(times, t, side="right"), len(times) - 1)]
    _, steps, h, _ = stretch.py_func(start, sample, segment_end, step)
    if done >= max(steps, 1) or abs(start + done * h - t) > ROUNDING * h + 4.0 * np.spacing(abs(t)):
        raise ValueError(
            f"the run to resume stopped at {t:.17g} s, after {done:.0f} equal steps from {start:.17g} s; this step and "
            f"these output times result in other steps from there: give those of its own run{REMEDY}"
        )


def _refuse_other_controllers(system: System, restart: Restart, known: LoopMemory) -> int:
    """ValueError for a memory of other controllers; returns the number of states of continuous controllers."""
    from flexmb.control.wiring import widest, wired  # imported here because few scenes need it

    wiring, scene = wired(system), system.scene
    signals = max((place.stop for place in wiring.names.values()), default=0)
    rows = len(known.held), widest(wiring.controller)
    expected = {"signal": (signals,), "state": wiring.initial.shape, "held": rows}
    for name, shape in expected.items():
        found = getattr(known, name).shape
        if found != shape:
            raise ValueError(f"the restart has {name} of shape {found}, but the controllers {shape}: it is damaged")
    for controller in scene.controllers:
        if not np.isfinite(known.signal[wiring.names[controller.name]]).all():
            raise ValueError(f'the restart has an output of controller "{controller.name}" that is not finite')
    _refuse_other_instants(system, restart, known)
    return len(wiring.continuous)


def _refuse_other_instants(system: System, restart: Restart, known: LoopMemory) -> None:
    """ValueError if controllers have not acted at all instants before `since`, or have acted after the end `t`."""
    table, near = instants(system.scene.controllers, restart.since, restart.t, ()), slack(restart.since, restart.t)
    happened = int(known.instants[0])
    fewest = int(np.searchsorted(table["time"], restart.since - near))
    most = int(np.searchsorted(table["time"], restart.t + near, side="right"))
    if not fewest <= happened <= most:
        raise ValueError(
            f"the restart says that controllers have acted {happened} times by {restart.t:g} s, but they act "
            f"{most} times: it is damaged"
        )
    samples = int(np.sum(table["kind"][:happened] == SAMPLE))
    if len(known.held) < samples:
        raise ValueError(f"the restart holds {len(known.held)} of {samples} samples: it is damaged")
