"""What rounding does to the results of an engine: runs of scenes whose numbers are moved by units in the last place.

Where the mass matrix is badly conditioned, or a motion is chaotic, rounding errors count for more than they do in one
evaluation or one step. A backward-stable method gives the exact result of a scene whose numbers are off by a few units
in the last place (Higham, Accuracy and Stability of Numerical Algorithms, 1.5), so that such scenes show by how much:
the condition of all that lies between the numbers of the scene and a channel. The scenes are the same for all engines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

from crosscheck.engines.contract import Effort, Engine, Run
from crosscheck.running.job import Job
from crosscheck.running.rung import determined
from flexmb.run.channels import distance
from flexmb.scene.check import check_scene
from flexmb.scene.schema import Scene
from flexmb.typing import Real

ULP = 2
RERUNS = 2
DRAWS = 16  # of signs, until a scene is accepted


def moved_scene(scene: Scene, drawn: np.random.Generator) -> Scene:
    """The scene with all numbers but zeros and whole ones moved, each up or down by chance.

    Whole numbers are counts or exact, as the components of a unit vector along an axis are. Signs that are refused
    together are drawn again; ValueError if none of `DRAWS` are accepted.
    """
    plain = msgspec.to_builtins(scene)
    why: Exception | None = None
    for _ in range(DRAWS):
        moved = msgspec.convert(_moved(plain, drawn), Scene)
        try:
            check_scene(moved)
        except (ValueError, NotImplementedError) as error:
            why = error
        else:
            return moved
    raise ValueError(f"no scene with numbers moved by {ULP} ulp is accepted: {why}")


def _moved(node: Any, drawn: np.random.Generator) -> Any:
    match node:
        case float() if math.isfinite(node) and not node.is_integer():
            return node + float(drawn.choice([-1.0, 1.0])) * ULP * math.ulp(node)
        case dict():
            return {key: _moved(value, drawn) for key, value in node.items()}
        case list() | tuple():
            return [_moved(value, drawn) for value in node]
    return node


def rounding(engine: Engine, job: Job, scene: Scene, effort: Effort, nominal: Mapping[str, Real]) -> dict[str, float]:
    """By channel the largest distance (SI) of `RERUNS` runs of moved scenes from the `nominal` one, per unit of `ULP`.

    ArithmeticError if one of them does not finish or lacks a channel, ValueError if there is no such scene.
    """
    drawn = np.random.default_rng(0)
    apart = dict.fromkeys(nominal, 0.0)
    for _ in range(RERUNS):
        run = engine.compile(moved_scene(scene, drawn)).simulate(Run(job.times, job.linear), effort)
        if run.status != "finished":
            raise ArithmeticError(f"the run with numbers moved by {ULP} ulp {run.status}: {run.message}")
        found = determined(run)
        if missing := sorted(nominal.keys() - found.keys()):
            raise ArithmeticError(f"the run with numbers moved by {ULP} ulp does not offer {missing[0]}")
        for name, values in nominal.items():
            far = distance(name, np.nan_to_num(found[name]), np.nan_to_num(values))
            apart[name] = max(apart[name], float(np.max(far)) / ULP)
    return apart
