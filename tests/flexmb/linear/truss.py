"""The truss of von Mises: two springs that lean against each other, and snap through under a load."""

from __future__ import annotations

import numpy as np

import flexmb as fm

HIGH, STIFF = 3.0, 50.0


def truss(high: float = HIGH) -> fm.SceneBuilder:
    """A load (its number `loads.push.function.value`, N downwards) on two springs that lean against each other."""
    made = fm.SceneBuilder("truss").rigid_body("mass", mass=1.0, inertia=(1.0, 1.0, 1.0))
    for side, x in (("left", -1.0), ("right", 1.0)):
        made.spring_damper(side, "ground", "mass", position_a=(x, 0.0, 0.0), stiffness=STIFF,
                           free_length=float(np.hypot(1.0, high)))  # fmt: skip
    return made.force("push", "mass", direction=(0, 0, -1), function=fm.Constant(value=0.0))


def guided(height: float = HIGH, high: float = HIGH) -> fm.Scene:
    """The truss, `high` without load, with a mass that moves up and down only, at a height."""
    return truss(high).prismatic("up", "ground", "mass", axis=(0, 0, 1), position=height).scene()
