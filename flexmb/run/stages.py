"""A manoeuvre in stages: consecutive runs, each of which starts where the last one ended, with its own scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Unpack

from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.run.origin import Given, start_time
from flexmb.run.samples import sample_times
from flexmb.run.simulate import RunPart, RunSettings, refuse_unknown, run_stages
from flexmb.run.switching import refuse_times
from flexmb.run.trajectory import Trajectory
from flexmb.scene.schema import Scene
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import compile
from flexmb.system.tree_system import System
from flexmb.tables import arguments


@dataclass(frozen=True)
class RunStage:
    """The duration (s) of a stage, and its differences from the stage before: another scene, other values, or none.

    values: see `Scene.with_values`; they remain in the stages that follow. samples: number of output times, both ends
    included.
    """

    duration_s: float
    values: Mapping[str, Any] = field(default_factory=dict)
    scene: Scene | None = None
    samples: int = 201


def simulate_stages(
    scene: Scene,
    stages: Sequence[RunStage],
    method: Method = "dop853",
    *,
    t_start: float | None = None,
    state: Given = None,
    algorithm: Algorithm = "articulated",
    stabilise: float = 0.0,
    **settings: Unpack[RunSettings],
) -> Trajectory:
    """Simulate stages in sequence and return one trajectory, which ends with the first stage that fails.

    Time continues from stage to stage, also for functions of time. Each stage starts with the coordinates and speeds at
    the end of the last one: scenes must have the same ones, and the same markers and hinges. Controllers are
    initialised in each stage. A motion that is prescribed in a stage must start with the value and rate that the
    coordinate then has, otherwise ValueError is raised.
    All other arguments: see `simulate`. Raises what `simulate` raises, before anything runs for an invalid scene,
    settings or output times of any stage, and ValueError for stages that do not fit each other.
    """
    refuse_unknown("simulate_stages", settings)
    systems = _systems(scene, stages)
    t, parts = start_time(t_start, state), list[RunPart]()
    for stage, system in zip(stages, systems, strict=True):
        start, t = t, t + stage.duration_s
        refuse_times(system, start, t)
        parts.append(RunPart(system, sample_times(stage.samples, t, start)))
    chosen = Settings(method, **settings).checked(max(abs(parts[0].times[0]), abs(t)))
    return run_stages(parts, state, chosen, algorithm, stabilise)


def _systems(scene: Scene, stages: Sequence[RunStage]) -> list[System]:
    """The systems of all stages; a scene that does not change is compiled once. ValueError if they do not fit."""
    if not stages:
        raise ValueError("there are no stages: give at least one")
    found: list[System] = []
    for i, stage in enumerate(stages):
        if arguments.number(f"stages[{i}].duration_s", stage.duration_s) <= 0.0:
            raise ValueError(f"stages[{i}] lasts {stage.duration_s:g} s: give a positive duration")
        if found and found[-1].scene.events:
            raise NotImplementedError(
                f"stages[{i - 1}] has events, which change its scene: use events on time in place of later stages"
            )
        scene = (stage.scene or scene).with_values(stage.values)
        found.append(found[-1] if found and found[-1].scene == scene else compile(scene))
        for what, names in (("coordinates", 0), ("speeds", 1)):
            strange = set(found[i].state_names[names]) ^ set(found[0].state_names[names])
            if strange:
                listed = ", ".join(sorted(name for name, _ in strange))
                raise ValueError(f"stages[{i}] has other {what} than stages[0]: {listed}")
    return found
