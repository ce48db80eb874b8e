"""One engine held against a manufactured motion in this process, without case folder, records or report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.engines.contract import Effort, Engine, Run
from crosscheck.judging.uncertainty import RungSignal, estimate
from crosscheck.library.case_error import CaseError
from flexmb.run.channels import channels_of, distance, family, magnitude
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class Held(NamedTuple):
    """Of one channel, in its SI unit: the largest distance from the exact answer, and the U of engine and answer."""

    error: float
    doubt: float

    @property
    def agrees(self) -> bool:
        """Whether the engine returned the answer within U."""
        return self.error <= self.doubt


def held(
    engine: Engine, scene: Scene, times: Real, channels: Mapping[str, Real], known: Mapping[str, float],
    efforts: Sequence[Effort] = (),
) -> dict[str, Held]:  # fmt: skip
    """The channels (T,k) at `times` (T,), known to `known`, that the engine offers, by its own ladder or `efforts`.

    CaseError where a run does not finish.
    """
    for_scene = getattr(engine, "efforts_for", lambda scene, duration_s: engine.efforts(scene))
    model, runs = engine.compile(scene), []
    efforts = efforts or for_scene(scene, float(times[-1]))
    for effort in efforts:
        run = model.simulate(Run(times), effort)
        if run.status != "finished":
            raise CaseError(f"{engine.name}, {effort.label}: {run.status}: {run.message}")
        runs.append((effort.value, channels_of(run), run.evaluations))
    finest = runs[-1][1]
    sizes: dict[str, float] = {}
    for name, values in finest.items():
        sizes[family(name)] = max(sizes.get(family(name), 0.0), magnitude(name, values))
    found = {}
    for name in channels.keys() & finest.keys():
        rungs = [RungSignal(value, of[name], evaluations) for value, of, evaluations in runs]
        doubt = estimate(name, efforts[0].kind, rungs, sizes[family(name)], len(scene.bodies)).value
        error = float(np.max(distance(name, finest[name], channels[name])))
        found[name] = Held(error, doubt + known[name])
    return found
