"""A run that ended, ready to be taken up: by another call, or from a file by another process."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from flexmb.control.memory import LoopMemory
from flexmb.integrate.catalogue import integrator
from flexmb.integrate.integrator import Method
from flexmb.integrate.memory import NUMBERS, TAKEN_UP, TIME, Memory
from flexmb.output.whole import whole_file
from flexmb.scene.schema import Scene


@dataclass(frozen=True, eq=False)
class Restart:
    """Where a run ended, and what its method knew then: `simulate(scene, t_end, method, state=restart)` takes it up.

    The runs before and after it are, to the last bit, one that had never ended, whatever the method. It asks for the
    same scene, method and settings; of methods that take equal steps also for the same output times, between which
    they divide the time. Methods that adapt their steps cut the last one short where a run ends: they are taken up at
    `since` (s), where that step began, and output times of the second run may begin at any time from there to `t` (s),
    where the run ended and where they begin by default. Closed chains choose the independent rows of their closures
    anew, and are the same unless two choices are equally good. What controllers know goes on too.
    """

    method: Method
    scene: Scene
    t: float
    memory: Memory
    controllers: LoopMemory | None = None

    @property
    def since(self) -> float:
        """Time (s) from which the run is taken up."""
        return float(self.memory.numbers[TIME])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write to a file of NumPy (`.npz`) that is read back exactly."""
        with whole_file(Path(path)) as beside, beside.open("wb") as file:
            np.savez(
                file, method=self.method, t=self.t, scene=np.frombuffer(msgspec.json.encode(self.scene), np.uint8),
                numbers=self.memory.numbers, y=self.memory.y, rows=self.memory.rows,
                **{} if self.controllers is None else self.controllers._asdict(),
            )  # fmt: skip

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Restart:
        """Read what `save` wrote; ValueError for any other file, OSError where there is none."""
        try:
            with np.load(Path(path), allow_pickle=False) as file:
                method, t = str(file["method"]), float(file["t"])
                scene = msgspec.json.decode(file["scene"].tobytes(), type=Scene)
                memory = Memory(*(np.array(file[name], float) for name in Memory._fields))
                known = [np.array(file[name], float) for name in LoopMemory._fields if name in file]
        except (KeyError, ValueError, EOFError, TypeError):  # what NumPy says of other files is no help
            raise ValueError(f"{path} holds no restart of a run: give the restart.npz of one") from None
        like = integrator(method).memory(len(memory.y))
        if [each.shape for each in memory] != [each.shape for each in like] or len(memory.numbers) != NUMBERS:
            raise ValueError(f"{path} holds a restart of another version: run the first part again")
        controllers = LoopMemory(*known) if known else None
        return Restart(method, scene, t, memory, controllers)  # type: ignore[arg-type]  # one that there is

    def taken_up(self) -> Memory:
        """A copy of the memory for an integrator that goes on from it."""
        copy = Memory(*(each.copy() for each in self.memory))
        copy.numbers[TAKEN_UP] = 1.0
        return copy
