"""A restart that is taken up is held to the system as a whole, once, before anything of it is believed."""

from __future__ import annotations

import numpy as np

from flexmb.control.memory import LoopMemory
from flexmb.control.schedule import instants, slack
from flexmb.control.tables import SAMPLE
from flexmb.integrate.control import stretch
from flexmb.integrate.memory import DONE, STRETCH, TIME, Memory
from flexmb.run.restart import Restart
from flexmb.scene.tree import watches_signals
from flexmb.system.tree_system import System
from flexmb.typing import Real

REMEDY = "; to start from its last state instead, give the state `last_state` of its trajectory"
ROUNDING = 1e-9  # of a step, by which the times of equal ones may differ


def fitting(system: System, given: Restart, method: str) -> Restart:
    """A restart of this system and method, all of it copied; ValueError or TypeError for any other."""
    restart = given.examined()
    if restart.method != method:
        raise ValueError(f'the run that is taken up was by method "{restart.method}": give the same{REMEDY}')
    if restart.scene != system.scene:
        raise ValueError(f'the run that is taken up was of scene "{restart.scene.name}" with other contents{REMEDY}')
    motion, known = system.nq + system.nu + 1, restart.controllers
    has_loop = bool(system.scene.controllers) or watches_signals(system.scene)
    if has_loop != (known is not None):
        raise ValueError(f"the restart says {'nothing' if has_loop else 'something'} of controllers: it is damaged")
    if bool(system.scene.events) != (restart.events is not None):
        said = "nothing" if system.scene.events else "something"
        raise ValueError(f"the restart says {said} of events: it is damaged")
    states = 0 if known is None else _refuse_other_controllers(system, restart, known)
    if len(restart.memory.y) != motion + states:
        raise ValueError(
            f"the restart has {len(restart.memory.y)} numbers in y, and the run has {motion + states}: it is damaged"
        )
    return restart


def refuse_other_division(memory: Memory, times: Real, segment_end: float, step: float) -> None:
    """ValueError where a method of equal steps would go on with others than those in the midst of which a run stopped.

    times (T,) s: of the output; segment_end (s): of the first segment; step (s): the longest that is allowed.
    """
    start, t, done = memory.numbers[[STRETCH, TIME, DONE]].tolist()
    sample = times[min(np.searchsorted(times, t, side="right"), len(times) - 1)]
    _, steps, h, _ = stretch.py_func(start, sample, segment_end, step)
    if done >= max(steps, 1) or abs(start + done * h - t) > ROUNDING * h + 4.0 * np.spacing(abs(t)):
        raise ValueError(
            f"the run that is taken up stopped at {t:.17g} s, after {done:.0f} equal steps from {start:.17g} s; with "
            f"this step and these output times the steps from there are others: give those of its own run{REMEDY}"
        )


def _refuse_other_controllers(system: System, restart: Restart, known: LoopMemory) -> int:
    """The number of states of continuous controllers."""
    from flexmb.control.wiring import widest, wired  # few scenes need it

    wiring, scene = wired(system), system.scene
    signals = max((place.stop for place in wiring.names.values()), default=0)
    rows = len(known.held), widest(wiring.controller)
    expected = {"signal": (signals,), "state": wiring.initial.shape, "held": rows}
    for name, shape in expected.items():
        found = getattr(known, name).shape
        if found != shape:
            raise ValueError(f"the restart has {name} of shape {found}, and the controllers {shape}: it is damaged")
    for controller in scene.controllers:
        if not np.isfinite(known.signal[wiring.names[controller.name]]).all():
            raise ValueError(f'the restart has an output of controller "{controller.name}" that is not finite')
    _refuse_other_instants(system, restart, known)
    return len(wiring.continuous)


def _refuse_other_instants(system: System, restart: Restart, known: LoopMemory) -> None:
    """No step leads across an instant: those before it have been, those after its end have not."""
    table, near = instants(system.scene.controllers, restart.since, restart.t, ()), slack(restart.since, restart.t)
    happened = int(known.instants[0])
    fewest = int(np.searchsorted(table["time"], restart.since - near))
    most = int(np.searchsorted(table["time"], restart.t + near, side="right"))
    if not fewest <= happened <= most:
        raise ValueError(
            f"the restart says that controllers have acted {happened} times by {restart.t:g} s, and they do so "
            f"{most} times: it is damaged"
        )
    samples = int(np.sum(table["kind"][:happened] == SAMPLE))
    if len(known.held) < samples:
        raise ValueError(f"the restart holds {len(known.held)} of {samples} samples: it is damaged")
