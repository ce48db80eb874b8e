"""Engines that are bad on purpose: each takes a sound engine's run and spoils it in one respect.

`WRONG` are those whose answer is wrong, or that say what is not true; `HARMLESS` only look so. `BESIDE_OPEN` are wrong
where redundant closures leave some components of a load open. `FATAL` end or block their process, and need one of their
own.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from crosscheck.engines.contract import Effort, Engine, Run, Support, Trajectory
from crosscheck.engines.native import NativeEngine, composite
from flexmb.scene.schema import Scene
from flexmb.typing import Real
from tests.crosscheck.fake_engines import STEPS, Fake

EFFORTS = tuple(Effort("tolerance", 10.0**-n, "dop853") for n in (6, 8, 10))
PARTS = ("torque", "force")
Spoil = Callable[[Trajectory, int], Any]
"""(sound run, number of the effort from coarse to fine) -> answer. Number 1 is one of the last three in all ladders,
0 not in that of the pendulum."""
GROUPS = ("loads", "drives", "energy", "wheel_loads", "connectors", "hinge_forces")
_calls = count()


def paths(part: str, change: Callable[[Real], Real]) -> Spoil:
    """A part of all markers changed."""
    return lambda run, n: replace(
        run, markers={name: replace(p, **{part: change(getattr(p, part))}) for name, p in run.markers.items()}
    )


def named(group: str, change: Callable[[Real], Real]) -> Spoil:
    """All outputs of a group changed."""
    return lambda run, n: replace(run, **{group: {name: change(x) for name, x in getattr(run, group).items()}})


def all_of(run: Trajectory, change: Callable[[Real], Real]) -> Trajectory:
    """All outputs changed but quaternions."""
    run = named("loads", change)(named("energy", change)(run, 0), 0)
    run = paths("velocity", change)(paths("position", change)(run, 0), 0)
    return replace(run, momentum=change(run.momentum))


def columns(first: int, last: int, factor: float) -> Callable[[Real], Real]:
    def change(x: Real) -> Real:
        x = x.copy()
        x[:, first:last] *= factor
        return x

    return change


def at(sample: slice | int, value: float) -> Callable[[Real], Real]:
    def change(x: Real) -> Real:
        x = x.copy()
        x[sample] += value
        return x

    return change


def cut(run: Trajectory, count: int, times: bool = True) -> Trajectory:
    """Only the first samples."""
    run = all_of(run, lambda x: x[:count])
    run = paths("quaternion", lambda x: x[:count])(run, 0)
    return replace(run, times=run.times[:count] if times else run.times)


def claiming(*, all_channels: bool = True, void: bool = False, efforts: tuple[int, ...] = (0, 1, 2, 3)) -> Spoil:
    def spoil(run: Trajectory, n: int) -> Trajectory:
        if n not in efforts:
            return run
        names = [f"load:{name}.{part}" for name in run.loads for part in PARTS]
        named_ = tuple(names if all_channels else names[-1:])
        loads = {name: np.full_like(load, np.nan) for name, load in run.loads.items()} if void else run.loads
        return replace(run, loads=loads, undetermined=named_)

    return spoil


def raising(error: Callable[[], BaseException], effort: int | None = None) -> Spoil:
    def spoil(run: Trajectory, n: int) -> Trajectory:
        if effort is None or n == effort:
            raise error()
        return run

    return spoil


def noisy(run: Trajectory, n: int) -> Trajectory:
    return all_of(run, lambda x: x * (1.0 + 1e-9 * next(_calls)))


def renamed(group: str) -> Spoil:
    return lambda run, n: replace(run, **{group: {f"{name}_": x for name, x in getattr(run, group).items()}})


def more(group: str, name: str) -> Spoil:
    return lambda run, n: replace(
        run, **{group: {**getattr(run, group), name: next(iter(getattr(run, group).values()))}}
    )


def lasting(change: Callable[[Real], Real]) -> Spoil:
    return lambda run, n: all_of(run, change)


WRONG: dict[str, Spoil] = {
    # what it says of its loads
    "claims-all": claiming(),
    "claims-all-void": claiming(void=True),
    "claims-one": claiming(all_channels=False),
    "claims-when-coarse": claiming(efforts=(1,)),
    "claims-when-fine": claiming(efforts=(2, 3)),
    "claims-a-list": lambda run, n: replace(run, undetermined=["load:drive.force"]),
    "claims-energy": lambda run, n: replace(run, undetermined=("energy.kinetic",)),
    "claims-numbers": lambda run, n: replace(run, undetermined=(3,)),
    # values that are none
    "nan-later": paths("position", at(slice(10, None), np.nan)),
    "nan-once": paths("velocity", at(7, np.nan)),
    "nan-all": lasting(lambda x: np.full_like(x, np.nan)),
    "inf": paths("position", at(5, np.inf)),
    "minus-inf-last": lambda run, n: replace(run, momentum=at(-1, -np.inf)(run.momentum)),
    "nan-energy": named("energy", lambda x: np.full_like(x, np.nan)),
    "nan-when-coarse": lambda run, n: paths("position", at(3, np.nan))(run, n) if n == 1 else run,
    "huge": lasting(lambda x: x + 1e300),
    # outputs that are missing, too many or misnamed
    "no-loads": lambda run, n: replace(run, loads={}),
    "no-momentum": lambda run, n: replace(run, momentum=None),
    "no-markers": lambda run, n: replace(run, markers={}),
    "nothing": lambda run, n: replace(run, markers={}, loads={}, energy={}, momentum=None),
    "no-loads-when-coarse": lambda run, n: replace(run, loads={}) if n == 1 else run,
    "few-samples": lambda run, n: cut(run, 5),
    "one-sample": lambda run, n: cut(run, 1),
    "no-samples": lambda run, n: cut(run, 0),
    "short-arrays": lambda run, n: cut(run, 5, times=False),
    "misnamed-loads": renamed("loads"),
    "misnamed-markers": renamed("markers"),
    "more-loads": more("loads", "nowhere"),
    "more-energy": more("energy", "dark"),
    "flat-arrays": named("loads", np.ravel),
    "integers": paths("position", lambda x: np.asarray(x).astype(int)),
    "complex": paths("position", lambda x: x + 0j),
    "objects": paths("position", lambda x: x.astype(object)),
    "masked": paths("position", lambda x: np.ma.masked_array(x)),
    # wrong values
    "constant": lasting(lambda x: np.repeat(x[:1], len(x), axis=0)),
    "zero": lasting(np.zeros_like),
    "a-sample-late": lasting(lambda x: np.concatenate([x[:1], x[:-1]])),
    "other-times": lambda run, n: replace(run, times=run.times * (1.0 + 1e-3)),
    "reversed-times": lambda run, n: replace(run, times=run.times[::-1].copy()),
    "backwards": lasting(lambda x: x[::-1].copy()),
    "swapped-axes": paths("position", lambda x: x[:, [1, 0, 2]]),
    "millimetres": paths("position", lambda x: 1e3 * x),
    "a-per-cent": lasting(lambda x: 1.01 * x),
    "a-spike": paths("position", at(11, 1e-2)),
    "a-spike-at-last": paths("position", at(-1, 1e-2)),
    "off": paths("position", at(slice(None), 1e-2)),
    "no-unit-quaternions": paths("quaternion", lambda x: 1.1 * x),
    "minus-position": paths("position", np.negative),
    "minus-angular-velocity": paths("velocity", columns(0, 3, -1.0)),
    "minus-velocity": paths("velocity", columns(3, 6, -1.0)),
    "conjugate": paths("quaternion", columns(1, 4, -1.0)),
    "minus-force": named("loads", columns(3, 6, -1.0)),
    "minus-kinetic": lambda run, n: replace(run, energy={**run.energy, "kinetic": -run.energy["kinetic"]}),
    "minus-gravity": lambda run, n: replace(run, energy={**run.energy, "gravity": -run.energy["gravity"]}),
    "minus-momentum": lambda run, n: replace(run, momentum=-run.momentum),
    # what efforts say of the error
    "boastful": lasting(lambda x: 1.001 * x),  # with the convergence of a sound engine
    "modest": lambda run, n: all_of(run, lambda x: x * (1.0 + 0.3 * (-1) ** n)),
    "diverging-efforts": lambda run, n: all_of(run, lambda x: x * (1.0 + 1e-4 * 10.0**n)),
    "not-reproducible": noisy,
    # how it ends
    "done": lambda run, n: replace(run, status="done"),
    "diverged": lambda run, n: replace(cut(run, 6), status="diverged", message="the step fell below 1e-12 s"),
    "diverged-silently": lambda run, n: replace(cut(run, 6), status="diverged", message=""),
    "none": lambda run, n: None,
    "a-dict": lambda run, n: vars(run),
    "negative-count": lambda run, n: replace(run, evaluations=-1),
    "nan-seconds": lambda run, n: replace(run, wall_s=np.nan),
    "raises": raising(lambda: RuntimeError("the solver gave up")),
    "raises-when-fine": raising(lambda: ValueError("\ud800"), effort=2),
    "exits": raising(lambda: SystemExit(0)),
    "exits-when-coarse": raising(lambda: SystemExit(3), effort=1),
    "raises-when-coarsest": raising(lambda: RuntimeError("the solver gave up"), effort=0),
    "nan-when-coarsest": lambda run, n: paths("position", at(3, np.nan))(run, n) if n == 0 else run,
    "nothing-when-coarsest": lambda run, n: None if n == 0 else run,
}
HARMLESS: dict[str, Spoil] = {
    "sound": lambda run, n: run,
    "minus-quaternion": paths("quaternion", np.negative),  # the same orientation
    "any-open-loads": lambda run, n: replace(
        run, loads={name: np.where(np.isnan(x), 7.0 + n, x) for name, x in run.loads.items()}, undetermined=()
    ),
}


def _crash(run: Trajectory, n: int) -> Trajectory:
    if n == 1:
        os._exit(139)
    return run


def _hang(run: Trajectory, n: int) -> Trajectory:
    time.sleep(600.0 if n == 1 else 0.0)
    return run


def _crash_at_first(run: Trajectory, n: int) -> Trajectory:
    return run if n else os._exit(0)


def _beside_open(change: Callable[[Real, Real], Real]) -> Spoil:
    """Of every torque and force with components that are NaN, the others changed: (values (T,3), flags) -> values."""

    def spoil(run: Trajectory, n: int) -> Trajectory:
        loads = {name: load.copy() for name, load in run.loads.items()}
        for load in loads.values():
            for part in (load[:, :3], load[:, 3:]):
                is_open = np.isnan(part).any(axis=0)
                if is_open.any() and not is_open.all():
                    part[:] = np.where(is_open, part, change(part, is_open))
        return replace(run, loads=loads)

    return spoil


BESIDE_OPEN: dict[str, Spoil] = {
    "wrong-beside-open": _beside_open(lambda part, is_open: 1.01 * part),
    "nan-beside-open": _beside_open(lambda part, is_open: np.full_like(part, np.nan)),
    "claims-beside-open": lambda run, n: replace(
        run, undetermined=tuple(dict.fromkeys(name.partition("[")[0] for name in run.undetermined))
    ),
}
"""Wrong in determined components of loads that are partly open, and in nothing else."""
FATAL: dict[str, Spoil] = {"crashes": _crash, "hangs": _hang, "crashes-when-coarsest": _crash_at_first}
ALL = WRONG | HARMLESS | BESIDE_OPEN | FATAL


@dataclass(frozen=True)
class SpoiltModel:
    sound: Any
    spoil: Spoil
    ladder: tuple[Effort, ...]

    def warm_up(self) -> None:
        self.sound.warm_up()

    def evaluate(self) -> Any:
        return self.sound.evaluate()

    def simulate(self, run: Run, effort: Effort) -> Any:
        return self.spoil(self.sound.simulate(run, effort), self.ladder.index(effort))


@dataclass(frozen=True)
class Spoilt:
    """An engine whose runs are spoilt."""

    name: str
    sound: Engine
    ladder: tuple[Effort, ...]

    @property
    def takes(self) -> tuple[str, ...]:
        return getattr(self.sound, "takes", ())

    def version(self) -> str:
        return "1.0"

    def supports(self, scene: Scene) -> Support:
        return Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return self.ladder

    def compile(self, scene: Scene) -> SpoiltModel:
        return SpoiltModel(self.sound.compile(scene), ALL[self.name], self.ladder)


def of_pendulum() -> dict[str, Engine]:
    """Two sound engines of the pendulum, and all bad ones."""
    found: dict[str, Engine] = {"one": Fake("one"), "two": Fake("two", STEPS)}
    return found | {name: Spoilt(name, Fake(name), Fake(name).ladder) for name in ALL}


def of_chain() -> dict[str, Engine]:
    """Two sound engines of closed chains, and all bad ones."""
    found: dict[str, Engine] = {"native": NativeEngine(), "native-composite": composite()}
    return found | {name: Spoilt(name, NativeEngine(), EFFORTS) for name in ALL}
