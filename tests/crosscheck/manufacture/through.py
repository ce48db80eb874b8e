"""Two hundred manufactured trees through every engine that takes them: each within U, and a planted fault noticed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from time import process_time

import msgspec
import numpy as np

from crosscheck.engines.contract import Effort
from crosscheck.engines.registry import engine
from crosscheck.library.case_error import CaseError
from crosscheck.manufacture.case import Held, held, sample_times
from crosscheck.manufacture.doubt import answers
from crosscheck.manufacture.drives import manufacture
from flexmb.scene import schema as s
from tests.crosscheck.manufacture import scenes

SLOW_SEEDS = range(200)
FAULT = 1.0 + 1e-4
TIMES = sample_times(1.0)
ENGINES = (
    "native", "native-composite", "native-frisch", "native-radau5", "native-exponential", "native-generalised-alpha",
    "pinocchio", "mujoco", "exudyn", "drake", "dart",
)  # fmt: skip
"""All that take rigid trees with loads at nodes; `kane` has no loads there."""
EFFORTS = {
    "mujoco": tuple(Effort("step", step, "RK4") for step in (4e-3, 2e-3, 1e-3)),
    "native-generalised-alpha": tuple(Effort("step", step, "generalised_alpha") for step in (2**-8, 2**-9, 2**-10)),
    "exudyn": tuple(Effort("step", step, "TrapezoidalIndex2") for step in (2**-9, 2**-10, 2**-11)),
}
"""Their own steps take a minute for a tree with tables. Exudyn's then meet the tolerance of its Newton iterations,
below which nothing converges, so that its U by Richardson's estimate would be too small by 2.5."""


def outside(found: Mapping[str, Held]) -> dict[str, Held]:
    """The channels that are not within U."""
    return {name: each for name, each in found.items() if not each.agrees}


def faulty(scene: s.Scene, seed: int) -> s.Scene:
    """The scene with one number of one element times FAULT: the mass or the mass centre of a rigid body."""
    bodies = [body for body in scene.bodies if isinstance(body, s.RigidBody)]
    body = bodies[seed % len(bodies)]
    worse = {"mass_kg": FAULT * body.mass_kg} if seed % 2 else {"com_m": tuple(FAULT * x for x in body.com_m)}
    changed = msgspec.structs.replace(body, **worse)
    return msgspec.structs.replace(scene, bodies=tuple(changed if each is body else each for each in scene.bodies))


@cache
def rigid(seed: int) -> tuple[s.Scene, dict[str, np.ndarray], dict[str, float]]:
    """A tree of three bodies with its drives, the exact channels at `TIMES`, and what they are known to.

    CaseError where it has no such motion.
    """
    found = manufacture(scenes.rigid(seed), seed)
    return found.scene, *answers(found, TIMES)


@dataclass
class Tally:
    """Of one engine: trees that it took, the largest error over U by seed where that is above 1, seeds whose fault
    it did not notice, trees without such a motion, and processor time of both runs of all trees (s)."""

    tried: int = 0
    wrong: dict[int, float] = field(default_factory=dict)
    blind: list[int] = field(default_factory=list)
    refused: list[tuple[int, str]] = field(default_factory=list)
    seconds: float = 0.0


@cache
def through(name: str, seeds: range) -> Tally:
    """All trees of these seeds through an engine; EngineMissing where it is not installed."""
    code, tally = engine(name), Tally()
    code.version()
    for seed in seeds:
        try:
            scene, channels, known = rigid(seed)
        except CaseError as error:
            tally.refused.append((seed, str(error)))
            continue
        if code.supports(scene).kind != "exact":
            continue
        tally.tried += 1
        start = process_time()
        with warnings.catch_warnings():  # MuJoCo, of gimbals at their zero
            warnings.filterwarnings("ignore", "Inertia matrix is too close to singular")
            true, worse = (
                held(code, each, TIMES, channels, known, EFFORTS.get(name, ())) for each in (scene, faulty(scene, seed))
            )
        tally.seconds += process_time() - start
        if outside(true):
            tally.wrong[seed] = max(each.error / each.doubt for each in true.values())
        if not outside(worse):
            tally.blind.append(seed)
    return tally
