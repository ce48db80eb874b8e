"""A run that ended, ready to be taken up: by another call, or from a file by another process."""

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
"""Of the file; one that says none is of version 1 too."""
_NUMBERS = ("version", "t", "scene", *Memory._fields, *LoopMemory._fields, *event_memory.NAMES)
_KINDS = {"method": TEXT} | dict.fromkeys(_NUMBERS, REAL)
"""By name of an array in the file, what it may hold."""


@dataclass(frozen=True, eq=False)
class Restart:
    """Where a run ended, and what its method knew then: `simulate(scene, t_end, method, state=restart)` takes it up.

    The runs before and after it are, to the last bit, one that had never ended, whatever the method. It asks for the
    same scene, method and settings; of methods that take equal steps also for the same output times, between which
    they divide the time. Methods that adapt their steps cut the last one short where a run ends: they are taken up at
    `since` (s), where that step began, and output times of the second run may begin at any time from there to `t` (s),
    where the run ended and where they begin by default. Closed chains choose the independent rows of their closures
    anew, and are the same unless two choices are equally good. What controllers know goes on too, and what events do:
    those from `since` to `t` happen once more, to the last bit as in a run that had never ended, and are shown once.
    """

    method: Method
    scene: Scene
    t: float
    memory: Memory
    controllers: LoopMemory | None = None
    events: EventMemory | None = None

    @property
    def since(self) -> float:
        """Time (s) from which the run is taken up."""
        return float(self.memory.numbers[TIME])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write to a file of NumPy (`.npz`) that is read back exactly."""
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
        """Read what `save` wrote; ValueError for any other file, OSError where there is none.

        Sizes are bounded before anything is unpacked. Whether it belongs to a scene is seen when it is taken up.
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
            f"{os.fspath(path)} holds no restart of a run ({why}): give the restart.npz that a run has written to its "
            "end, or run the first part again"
        )

    def examined(self) -> Restart:
        """A copy that holds what runs write, as far as that can be told without the system; ValueError or TypeError.

        Whether all of it belongs to a system is for `flexmb.run.taking_up` to ask.
        """
        self._refuse_other_parts()
        t, memory = restart_form.memory(self.method, self.t, self.memory)
        known = None if self.controllers is None else restart_form.controllers(self.controllers)
        events = None if self.events is None else event_memory.examined(self.events, self.scene)
        return replace(self, t=t, memory=memory, controllers=known, events=events)

    def _refuse_other_parts(self) -> None:
        """TypeError for anything else than a run has left."""
        for name, part, kind in (("scene", self.scene, Scene), ("memory", self.memory, Memory)):
            if not isinstance(part, kind):
                raise TypeError(f"{name} is a {type(part).__name__}: a restart holds the {kind.__name__} of its run")
        if not isinstance(self.controllers, LoopMemory | None):
            raise TypeError(f"controllers is a {type(self.controllers).__name__}: a restart holds a LoopMemory")
        if not isinstance(self.events, EventMemory | None):
            raise TypeError(f"events is a {type(self.events).__name__}: a restart holds an EventMemory")

    def taken_up(self) -> Memory:
        """A copy of the memory for an integrator that goes on from it."""
        copy = Memory(*(each.copy() for each in self.memory))
        copy.numbers[TAKEN_UP] = 1.0
        return copy


def _read(path: str | os.PathLike[str]) -> Restart:
    """What a file says; KeyError for what it lacks, ValueError for what is nothing of the kind."""
    file = unpacked(path, _KINDS)
    version = file.get("version", np.array(VERSION))
    if version.shape or version != VERSION:
        raise ValueError(f"it is of version {version} of the format, and this flexmb reads version {VERSION}")
    for name in ("method", "t"):
        if file[name].shape:
            raise ValueError(f'"{name}" has the shape {file[name].shape}, and is one value')
    if file["scene"].dtype != np.uint8:
        raise ValueError(f'"scene" holds numbers of type {file["scene"].dtype}, not bytes')
    scene = msgspec.json.decode(file["scene"].tobytes(), type=Scene)
    memory = Memory(*(file[name] for name in Memory._fields))
    is_controlled = any(name in file for name in LoopMemory._fields)
    known = LoopMemory(*(file[name] for name in LoopMemory._fields)) if is_controlled else None
    events = event_memory.read(file) if scene.events else None
    return Restart(str(file["method"]), scene, float(file["t"]), memory, known, events)  # type: ignore[arg-type]  # examined
