"""The systems that the outputs of a run are of: altered by its events, with drives as its controllers have set them."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy

from flexmb.run.provenance import Making, system_at
from flexmb.run.run_arrays import RunArrays
from flexmb.scene.check.control import named
from flexmb.system.system import System


def systems_at(run: RunArrays, made_by: Making) -> Iterator[System]:
    """One system after the other, for each output of a run; with controllers it is used until the next one is asked
    for."""
    before, system = made_by.system, made_by.system
    for i, t in enumerate(run.t.tolist()):
        now = system_at(made_by, t)
        if now is not before or (now.signals and i == 0):
            before, system = now, _apart(now) if now.signals else now
        for number, signal in system.signals.items():
            at = named(signal.source)
            assert at is not None  # the scene was checked
            system.constants.function["data"][number, 0] = signal.gain * run.signals[at.name][i, at.number or 0]
        yield system


def _apart(system: System) -> System:
    """The same with tables of its own, whose functions of time may be set. No feature of kernels depends on them."""
    own = copy(system)
    own.constants.function.setflags(write=True)
    return own
