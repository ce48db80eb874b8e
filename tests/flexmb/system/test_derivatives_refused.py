"""What has no derivative, and what is refused."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

import flexmb as fm


def with_stop(angle: float) -> fm.System:
    scene = fm.SceneBuilder("stopped", gravity=(0.0, -9.81, 0.0))
    scene.rigid_body("arm", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    scene.revolute("pivot", "ground", "arm", angle=angle)
    scene.angular_spring("stop", "pivot", upper=0.5, stop_stiffness=100.0)
    return fm.compile(scene.scene())


def with_cable(length: float) -> fm.System:
    scene = fm.SceneBuilder("tethered", gravity=(0.0, 0.0, 0.0))
    scene.rigid_body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1))
    scene.prismatic("slide", "ground", "bob", axis=(1.0, 0.0, 0.0), position=length)
    scene.spring_damper("cable", "ground", "bob", free_length=0.4, stiffness=50.0, acts="tension")
    return fm.compile(scene.scene())


BY_MASS = {
    "accelerations": lambda by, state: by.accelerations(state),
    "slopes": lambda by, state: by.slopes(0.0, state.y, np.zeros((3, 1))),
    "evaluate": lambda by, state: by.evaluate(state),
    "inverse_dynamics": lambda by, state: by.inverse_dynamics(state, np.zeros(1)),
}


@pytest.mark.parametrize("door", BY_MASS)
@pytest.mark.parametrize(("make", "at"), [(with_stop, 0.5), (with_cable, 0.4)])
def test_derivatives_by_parameters_refuse_a_corner(door, make, at) -> None:
    """Just at the stop or just slack; a millionth beside it derivatives exist. Of all public calls: test_corners."""
    system = make(at)
    by = system.parameters([f"{system.body_names[0]}.mass_kg"])
    with pytest.raises(fm.NotDifferentiableError, match='connector "(stop|cable)" has no derivative'):
        BY_MASS[door](by, system.initial_state)
    beside = make(at + 1e-6)
    BY_MASS[door](beside.parameters([f"{beside.body_names[0]}.mass_kg"]), beside.initial_state)


def test_derivatives_differ_beside_a_corner() -> None:
    """On either side of them derivatives exist, and differ."""
    for make, at, step, slope in ((with_stop, 0.5, 0.1, -100.0 / 0.35), (with_cable, 0.4, 0.1, -50.0)):
        before, after = (make(at + side * step) for side in (-1, 1))
        one, other = (each.acceleration_derivatives(each.initial_state).by_displacement for each in (before, after))
        gravity = 9.81 * 0.5 / 0.35 if make is with_stop else 0.0
        np.testing.assert_allclose(one, gravity * np.sin(at - step), atol=1e-9)
        np.testing.assert_allclose(other, gravity * np.sin(at + step) + slope, rtol=1e-6)


def test_friction_at_rest_is_smooth() -> None:
    """Its derivative is finite there: -level / smoothing / I."""
    scene = fm.SceneBuilder("rubbing")
    scene.rigid_body("disc", mass=1.0, inertia=(0.1, 0.1, 0.1)).revolute("pivot", "ground", "disc")
    scene.angular_friction("bearing", "pivot", sliding=0.3, smoothing=0.02)
    system = fm.compile(scene.scene())
    d = system.acceleration_derivatives(system.initial_state)
    np.testing.assert_allclose(d.by_speed, -0.3 / 0.02 / 0.1, rtol=1e-12)


def test_controllers_are_refused_with_the_remedy() -> None:
    from tests.flexmb.system.test_copies import controlled

    system = fm.compile(controlled())
    state = system.initial_state
    evaluator = lambda _: system.derivative_evaluator()  # noqa: E731
    for ask in (system.acceleration_derivatives, system.evaluation_derivatives, evaluator):
        with pytest.raises(NotImplementedError, match=r"has controllers.*open_loop.*ControlledMotion"):
            ask(state)
    opened = fm.compile(fm.open_loop(controlled()))
    assert np.isfinite(opened.acceleration_derivatives(opened.initial_state).by_displacement).all()


def test_a_scene_without_freedom() -> None:
    scene = fm.SceneBuilder("still").rigid_body("block", mass=1.0, inertia=(0.1, 0.1, 0.1)).weld("w", "ground", "block")
    system = fm.compile(scene.scene())
    d = system.evaluation_derivatives(system.initial_state)
    assert d.loads["w"].by_speed.shape == (6, 0) and not d.loads["w"].by_time.any()
    rates = system.acceleration_derivatives(system.initial_state)
    assert {getattr(rates, field.name).size for field in fields(rates)} == {0}
