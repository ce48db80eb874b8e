"""Restarts: a run that ended can be resumed by another call, or from a file by another process.

A restart may come from a damaged file or may have been altered, and kernels do not check what they are given: so types,
shapes, finite numbers and ranges of values are checked here, and that it belongs to the system and to the settings of
the run before that is resumed.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from flexmb.control.schedule import LoopMemory, instants, slack
from flexmb.control.tables import SAMPLE
from flexmb.integrate import memory as places
from flexmb.integrate.catalogue import integrator
from flexmb.integrate.control import stretch
from flexmb.integrate.integrator import Method
from flexmb.integrate.memory import DONE, NUMBERS, STRETCH, TAKEN_UP, TIME, Memory
from flexmb.output.files import whole_file
from flexmb.run import event_record
from flexmb.run.event_record import EventMemory
from flexmb.scene.reading import REAL, TEXT, Unreadable, unpacked
from flexmb.scene.schema import Scene
from flexmb.scene.sticking import events_of
from flexmb.scene.tree import watches_signals
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.typing import Real

VERSION = 1
"""Version of the file format; files without an entry are of version 1."""
_NUMBERS = ("version", "t", "scene", *Memory._fields, *LoopMemory._fields, *event_record.NAMES)
_KINDS = {"method": TEXT} | dict.fromkeys(_NUMBERS, REAL)
"""The type of each array in the file, by name."""

SWITCHES = ("TAKEN_UP", "RETRIED", "RENEW", "FRESH")
SIZES = ("STEP", "ERROR_BEFORE", "DONE", "FACTORED", "STEP_BEFORE")


@dataclass(frozen=True, eq=False)
class Restart:
    """The end of a run and the memory of its integrator: `simulate(scene, t_end, method, state=restart)` resumes it.

    By every method the two runs are bit-identical to one uninterrupted run. This requires the same scene, method and
    settings, and for methods of equal steps also the same output times, between which they divide the time. Methods
    that adapt their steps cut the last step short at the end of a run: they resume at `since` (s), where that step
    began. Output times of the second run may begin at any time from `since` to `t` (s), the end of the first run, which
    is the default. Closed chains choose the independent rows of their closures again; the choice is the same unless two
    are equally good. Controllers and events resume too: events from `since` to `t` happen again, bit-identical to those
    of an uninterrupted run, and are reported once.
    """

    method: Method
    scene: Scene
    t: float
    memory: Memory
    controllers: LoopMemory | None = None
    events: EventMemory | None = None

    __repr__ = brief

    @property
    def since(self) -> float:
        """Time (s) from which the run is resumed."""
        return float(self.memory.numbers[TIME])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write to a NumPy file (`.npz`), from which `load` reads the same bits."""
        self._refuse_other_parts()
        with whole_file(Path(path)) as beside, beside.open("wb") as file:
            np.savez(
                file, version=VERSION, method=self.method, t=self.t,
                scene=np.frombuffer(msgspec.json.encode(self.scene), np.uint8),
                numbers=self.memory.numbers, y=self.memory.y, rows=self.memory.rows,
                **{} if self.controllers is None else self.controllers._asdict(), **event_record.written(self.events),
            )  # fmt: skip

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Restart:
        """Read a file written by `save`; ValueError for any other file, OSError if it cannot be read.

        Sizes are bounded before anything is unpacked. `simulate` checks whether the restart belongs to its scene.
        """
        try:
            return _read(path).examined()
        except KeyError as error:
            why = f"there is no {error} in it"
        except Unreadable as error:
            why = error.what
        except (ValueError, TypeError, RecursionError) as error:
            why = str(error)
        raise ValueError(
            f"{os.fspath(path)} holds no restart of a run ({why}): give the restart.npz of a run that was written "
            "completely, or repeat the first run"
        )

    def examined(self) -> Restart:
        """A copy, validated as far as possible without the system; ValueError or TypeError for invalid contents.

        `flexmb.run.restart` checks whether it belongs to a system.
        """
        self._refuse_other_parts()
        t, memory = _memory(self.method, self.t, self.memory)
        known = None if self.controllers is None else _controllers(self.controllers)
        events = None if self.events is None else event_record.examined(self.events, self.scene)
        return replace(self, t=t, memory=memory, controllers=known, events=events)

    def _refuse_other_parts(self) -> None:
        """TypeError for parts of another type than runs leave."""
        kinds = {"scene": Scene, "memory": Memory, "controllers": LoopMemory, "events": EventMemory}
        for name, kind in kinds.items():
            part, is_optional = getattr(self, name), name in ("controllers", "events")
            if not (isinstance(part, kind) or (is_optional and part is None)):
                raise TypeError(f"{name} is a {type(part).__name__}: a restart holds the {kind.__name__} of its run")

    def taken_up(self) -> Memory:
        """A copy of the memory, marked for an integrator that resumes from it."""
        copy = Memory(*(array.copy() for array in self.memory))
        copy.numbers[TAKEN_UP] = 1.0
        return copy


def _read(path: str | os.PathLike[str]) -> Restart:
    """The contents of a file, not yet validated; KeyError for a missing array, ValueError for one of the wrong form."""
    file = unpacked(path, _KINDS)
    version = file.get("version", np.array(VERSION))
    if version.shape:
        raise ValueError(f'"version" has the shape {version.shape}, but must be one value')
    if version != VERSION:
        raise ValueError(f"it is of version {version} of the format, but this flexmb reads version {VERSION}")
    for name in ("method", "t"):
        if file[name].shape:
            raise ValueError(f'"{name}" has the shape {file[name].shape}, but must be one value')
    if file["scene"].dtype != np.uint8:
        raise ValueError(f'"scene" holds numbers of type {file["scene"].dtype}, not bytes')
    scene = msgspec.json.decode(file["scene"].tobytes(), type=Scene)
    memory = Memory(*(file[name] for name in Memory._fields))
    is_controlled = any(name in file for name in LoopMemory._fields)
    known = LoopMemory(*(file[name] for name in LoopMemory._fields)) if is_controlled else None
    events = event_record.read(file) if events_of(scene) else None
    return Restart(str(file["method"]), scene, float(file["t"]), memory, known, events)  # type: ignore[arg-type]  # examined


def _memory(method: Any, t: Any, given: Memory) -> tuple[float, Memory]:
    """Time (s) and memory of a method, copied; ValueError or TypeError for values that no run by it can have left."""
    chosen, t = integrator(method), arguments.number("t", t)
    y = _row("y", given.y)
    rows = len(y) + 3 if chosen.keeps_jacobian else 0
    memory = Memory(
        _finite("numbers", given.numbers, (NUMBERS,)), _finite("y", y, y.shape),
        _finite("rows", given.rows, (rows, len(y))),
    )  # fmt: skip
    _refuse_other_numbers(memory.numbers, t)
    return t, memory


def _controllers(given: LoopMemory) -> LoopMemory:
    """The memory of controllers, copied. Signals may be NaN, because sensors that no controller reads may give NaN."""
    state, held = _row("state", given.state), arguments.array("held", given.held)
    if held.ndim != 2:
        raise ValueError(f"held has the shape {held.shape}, but must have two dimensions, with one row per sample")
    happened = float(_finite("instants", given.instants, (1,))[0])
    if not 0.0 <= happened < event_record.MOST or happened != int(happened):
        raise ValueError(f"instants is {happened:g}, but must be the number of times at which controllers have acted")
    return LoopMemory(
        _row("signal", given.signal).copy(), _finite("state", state, state.shape), _finite("held", held, held.shape),
        np.array([happened]),
    )  # fmt: skip


def _refuse_other_numbers(numbers: Real, t: float) -> None:
    """ValueError for values that no integrator leaves at the end t (s) of a run."""
    by_name = {name: numbers[getattr(places, name)] for name in (*SWITCHES, *SIZES)}
    for name, value in by_name.items():
        if name in SWITCHES and value not in (0.0, 1.0):
            raise ValueError(f"numbers[{name}] is {value:g}, but must be 0 or 1")
        if value < 0.0:
            raise ValueError(f"numbers[{name}] is {value:g}, but must not be negative")
    done = numbers[DONE]
    if done != np.floor(done) or done >= event_record.MOST:
        raise ValueError(f"numbers[DONE] is {done:g}, but must be a number of steps")
    if not numbers[STRETCH] <= numbers[TIME] <= t:
        raise ValueError(
            f"numbers[STRETCH] is {numbers[STRETCH]:.17g} s, numbers[TIME] {numbers[TIME]:.17g} s and t "
            f"{t:.17g} s: these times must be in ascending order"
        )


def _row(name: str, values: Any) -> Real:
    row = arguments.array(name, values)
    if row.ndim != 1:
        raise ValueError(f"{name} has the shape {row.shape}, but must be a row of numbers")
    return row


def _finite(name: str, values: Any, shape: tuple[int, ...]) -> Real:
    """A copy of finite values of this shape; ValueError or TypeError for others."""
    return arguments.finite(name, arguments.shaped(name, values, shape)).copy()


REMEDY = "; to start from its last state instead, give the state `last_state` of its trajectory"
SAME_STEP = 1e-9  # fraction of a step by which the times of equal steps may differ


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
    has_events = bool(events_of(system.scene))
    if has_events != (restart.events is not None):
        said = "no" if has_events else "a"
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
    if done >= max(steps, 1) or abs(start + done * h - t) > SAME_STEP * h + 4.0 * np.spacing(abs(t)):
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
