"""Maps that need no mechanics: a circle that is known, cells that fail, a worker that dies."""

import os
import time
from dataclasses import replace

import msgspec
import numpy as np

from crosscheck.engines.contract import EngineMissing
from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap, growth_kinds
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.typing import Real

PROVIDER = "tests.crosscheck.stability.synthetic:maps"
RADIUS = 0.6
CORNER = 0.8


ANY = SceneBuilder("any").rigid_body("body", mass=1.0, inertia=(1.0,) * 3).free("base", "ground", "body").scene()


def scene(x: float, y: float) -> Scene:
    """Any."""
    return ANY


def circle(x: Real, y: Real) -> Real:
    """Positive outside."""
    return np.asarray(np.hypot(x, y) - RADIUS)


def measure(scene: Scene, x: float, y: float) -> Measurement:
    """The circle's own distance."""
    return Measurement(float(circle(np.asarray(x), np.asarray(y))))


def with_bad_corner(scene: Scene, x: float, y: float) -> Measurement:
    """Raises right of `CORNER`, does not finish above it; missing or dead where both are."""
    if x > CORNER and y > CORNER:
        os._exit(3)
    if x > CORNER:
        raise ArithmeticError("no such state")
    return Measurement(status="did not finish", message="too long") if y > CORNER else measure(scene, x, y)


def with_slow_place(scene: Scene, x: float, y: float) -> Measurement:
    """Takes for ever in one corner."""
    if x > CORNER and y > CORNER:
        time.sleep(3600.0)
    return measure(scene, x, y)


def without_end(scene: Scene, x: float, y: float) -> Measurement:
    """Says nowhere anything."""
    return Measurement(status="did not finish", message="too long")


def without_library(scene: Scene, x: float, y: float) -> Measurement:
    """What an engine says that is not installed."""
    raise EngineMissing("pip install it")


CIRCLE = StabilityMap(
    name="circle", title="A circle", quantity="distance", scene=scene, measure=measure,
    x=Axis("x", "m", -1.0, 1.0, 8), y=Axis("y", "m", -1.0, 1.0, 8), thresholds=(0.0,), kinds=growth_kinds(),
    overlay=Overlay("the circle", "Euclid", circle), shows="A circle.", depth=4,
)  # fmt: skip


def shifted(by: float) -> Overlay:
    """A wrong circle."""
    return Overlay("not the circle", "nobody", lambda x, y: circle(x - by, y))


def maps() -> dict[str, StabilityMap]:
    """By name."""
    quarter = Axis("x", "m", 0.0, 1.0, 4)
    across = msgspec.structs.replace(quarter, name="y")
    corner = replace(CIRCLE, name="corner", measure=with_bad_corner, x=quarter, y=across, depth=1)
    found = (
        CIRCLE, corner, replace(corner, name="slow", measure=with_slow_place, depth=0),
        replace(CIRCLE, name="silent", measure=without_end, depth=0, skips=True),
        replace(CIRCLE, name="absent", measure=without_library, depth=1),
        replace(CIRCLE, name="wrong", overlay=shifted(0.05)), replace(CIRCLE, name="close", overlay=shifted(0.015)),
    )  # fmt: skip
    return {what.name: what for what in found}
