"""The native engines of stiff scenes: ladders, methods named by an effort, what they refuse."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from flexmb.run.warm_up import pendulum
from flexmb.scene.build import SceneBuilder

METHODS = {
    "native-radau5": ("tolerance", "radau5"),
    "native-exponential": ("tolerance", "exponential"),
    "native-generalised-alpha": ("step", "generalised_alpha"),
}
RUN = Run(np.linspace(0.0, 0.5, 6))


@pytest.mark.parametrize("name", METHODS)
def test_the_finest_effort_of_each_agrees_with_dop853(name):
    scene, (kind, method) = pendulum(), METHODS[name]
    efforts = engine(name).efforts(scene)
    assert len(efforts) >= 3
    assert {(effort.kind, effort.method) for effort in efforts} == {(kind, method)}
    exact = engine("native").compile(scene).simulate(RUN, Effort("tolerance", 1e-12, "dop853"))
    done = engine(name).compile(scene).simulate(RUN, efforts[-1])
    assert done.status == "finished"
    apart = np.abs(done.markers["centre"].position - exact.markers["centre"].position).max()
    assert apart < (1e-9 if kind == "tolerance" else 1e-6)
    # the method is the effort's, whichever engine runs it
    same = engine("native").compile(scene).simulate(RUN, efforts[-1])
    assert np.array_equal(same.markers["centre"].position, done.markers["centre"].position)


def test_every_method_takes_closures():
    loop = (
        SceneBuilder("loop")
        .rigid_body("rod", mass=1.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1), nodes={"far": (1.0, 0.0, 0.0)})
        .spherical("ball", "ground", "rod")
        .closure("ring", "spherical", "ground", "rod", position_a=(1.0, 0.0, 0.0), node_b="far")
        .scene()
    )
    for name in METHODS:
        assert engine(name).supports(loop).kind == "exact"
