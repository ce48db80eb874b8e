"""Restarts: a run that ended can be resumed by another call, or from a file by another process."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from flexmb.control.memory import LoopMemory
from flexmb.integrate.integrator import Method
from flexmb.integrate.memory import TAKEN_UP, TIME, Memory
from flexmb.output.whole import whole_file
from flexmb.run import event_memory, restart_form
from flexmb.run.event_memory import EventMemory
from flexmb.scene.npz import REAL, TEXT, unpacked
from flexmb.scene.reading import Unreadable
from flexmb.scene.schema import Scene

VERSION = 1
"""Version of the file format; files without an entry are of version 1."""
_NUMBERS = ("version", "t", "scene", *Memory._fields, *LoopMemory._fields, *event_memory.NAMES)
_KINDS = {"method": TEXT} | dict.fromkeys(_NUMBERS, REAL)
"""The type of each array in the file, by name."""


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
                **{} if self.controllers is None else self.controllers._asdict(), **event_memory.written(self.events),
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

        `flexmb.run.taking_up` checks whether it belongs to a system.
        """
        self._refuse_other_parts()
        t, memory = restart_form.memory(self.method, self.t, self.memory)
        known = None if self.controllers is None else restart_form.controllers(self.controllers)
        events = None if self.events is None else event_memory.examined(self.events, self.scene)
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
        copy = Memory(*(each.copy() for each in self.memory))
        copy.numbers[TAKEN_UP] = 1.0
        return copy


def _read(path: str | os.PathLike[str]) -> Restart:
    """The contents of a file, not yet validated; KeyError for a missing array, ValueError for one of the wrong form."""
    file = unpacked(path, _KINDS)
    version = file.get("version", np.array(VERSION))
    if version.shape or version != VERSION:
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
    events = event_memory.read(file) if scene.events else None
    return Restart(str(file["method"]), scene, float(file["t"]), memory, known, events)  # type: ignore[arg-type]  # examined
