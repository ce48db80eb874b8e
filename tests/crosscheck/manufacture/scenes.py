"""Small scenes of every kind whose motion is manufactured. Same seed, same scene."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from flexmb.scene import schema as s
from tests import trees

_SMALL = {"bodies": 2, "wheels": 1, "point_masses": 1, "conservative": True, "prescribed": False}
_EVERY = (*trees.KINDS, *trees.LATER_KINDS)
RECIPES = (
    replace(trees.RIGID, **_SMALL, hinges=_EVERY),
    replace(trees.FULL, **_SMALL, carriers=("beam", "rigid"), hinges=_EVERY),
    replace(trees.RIGID, **_SMALL | {"conservative": False, "prescribed": True}, armatures=True, hinges=_EVERY),
    replace(trees.RIGID, **_SMALL, hinges=_EVERY, grounded=False),
    replace(trees.LINEAR, **_SMALL, carriers=("beam", "rigid"), hinges=_EVERY),
    replace(trees.RIGID, **_SMALL | {"wheels": 2}, hinges=_EVERY),
    replace(trees.STIFFENED, **_SMALL, carriers=("modal", "rigid"), hinges=_EVERY),
    replace(trees.RUTHLESS, **_SMALL, carriers=("beam", "rigid"), hinges=_EVERY),
)


def scene(seed: int) -> s.Scene:
    """A tree of two bodies by one of `RECIPES`; forces and prescribed motions are sines, which are smooth."""
    return smooth(trees.random_scene(seed, RECIPES[seed % len(RECIPES)]))


def rigid(seed: int) -> s.Scene:
    """A tree of three rigid bodies that every code takes."""
    small = _SMALL | {"bodies": 3, "wheels": 0, "point_masses": 0}
    return trees.random_scene(seed, replace(trees.RIGID, **small, hinges=_EVERY))


def smooth(scene: s.Scene) -> s.Scene:
    """The scene with a sine for every table, whose splines have knots, and for every function with a last moment."""
    rng = np.random.default_rng(7)

    def sine() -> s.Sine:
        return s.Sine(amplitude=0.5, angular_frequency_rad_s=float(rng.uniform(1.0, 3.0)))

    paths = {f"loads.{load.name}.function": sine() for load in scene.loads}
    for collection in ("hinges", "point_masses"):
        for item in getattr(scene, collection):
            for key, value in msgspec.structs.asdict(item).items():
                values = value if isinstance(value, tuple) else (value,)
                for n, each in enumerate(values):
                    if getattr(each, "prescribed", None) is not None:
                        place = f".{n}" if isinstance(value, tuple) else ""
                        paths[f"{collection}.{item.name}.{key}{place}.{each.KEYS.prescribed}"] = sine()
    paths |= {f"wheels.{w.name}.prescribed_rad": sine() for w in scene.wheels if w.prescribed_rad is not None}
    return scene.with_values(paths)
