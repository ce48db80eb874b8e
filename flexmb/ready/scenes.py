"""Small scenes that together reach every kernel. General kernels contain all features, whatever the scene contains."""

from __future__ import annotations

import flexmb.scene.schema as s
from flexmb.scene.bodies import Level
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section

SECTION = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=1.7e-10, Iz=1.7e-10, rho=2700.0)


def pendulum() -> SceneBuilder:
    """A rigid body on a revolute hinge with a spring, under gravity."""
    return _bob(-9.81).revolute("pivot", "ground", "bob", stiffness=30.0)


def turning() -> SceneBuilder:
    """The body on a spherical hinge, which has no single axis."""
    return _bob(-9.81).spherical("pivot", "ground", "bob")


def panelled(modes: int, level: Level) -> SceneBuilder:
    """The pendulum with a beam, whose modes are condensed if they are many."""
    builder = pendulum().beam("panel", length=1.0, elements=8, modes=modes, level=level, section=SECTION)
    return builder.weld("root", "bob", "panel").marker("tip", "panel", node="tip")


def spinner() -> SceneBuilder:
    """A scene that has steady spins: without gravity, and without a spring on the spinning hinge."""
    builder = _bob(0.0).revolute("pivot", "ground", "bob")
    builder.beam("panel", length=1.0, elements=4, modes=2, level="full", section=SECTION)
    return builder.weld("root", "bob", "panel").marker("tip", "panel", node="tip")


def looped() -> SceneBuilder:
    """A parallelogram: crank and rocker on the ground, and a coupler, closed at its far end."""
    builder = _bob(-9.81).revolute("pivot", "ground", "bob", angle=1.0)
    for name in ("coupler", "rocker"):
        builder.rigid_body(name, mass=1.0, com=(0.5, 0.0, 0.0), inertia=(1e-2, 1e-1, 1e-1))
    builder.revolute("elbow", "bob", "coupler", angle=-1.0, parent_position=(1.0, 0.0, 0.0))
    builder.revolute("base", "ground", "rocker", angle=1.0, parent_position=(2.0, 0.0, 0.0))
    at = {"position_a": (2.0, 0.0, 0.0), "position_b": (1.0, 0.0, 0.0)}
    return builder.closure("loop", "spherical", "coupler", "rocker", **at)


def looped_at_rest_shape() -> SceneBuilder:
    """The parallelogram with a ruthless beam, whose closures are solved in another way."""
    builder = looped().beam("panel", length=1.0, elements=8, modes=2, level="ruthless", section=SECTION)
    return builder.weld("root", "bob", "panel").marker("tip", "panel", node="tip")


def with_events(builder: SceneBuilder, coordinate: str) -> s.Scene:
    """The scene with events that watch a rate, time and a signal, with an impact and a latch of a coordinate."""
    builder.sense_marker("place", "centre", "position")
    builder.event("strikes", f"{coordinate}.rate", -1e-3, s.Impact(coordinate=coordinate, restitution=0.5))
    builder.event("is held", "time", 5e-4, s.Latch(coordinate=coordinate))
    builder.event("is free", "time", 7e-4, s.Release(coordinate=coordinate))
    return builder.event("rises", "place[1]", 1.0, s.EndRun()).scene()


def with_feedback(builder: SceneBuilder, **sampling: float) -> s.Scene:
    """The scene with a controller of its marker's height, continuous, or sampled with `period` and `delay` (s)."""
    builder.sense_marker("place", "centre", "position")
    builder.pid("servo", "place[1]", kp=1.0, ki=1.0, **sampling)
    signal = s.ControlSignal(source="servo")
    return builder.force("push", "bob", direction=(0.0, 1.0, 0.0), function=signal).scene()


def slewed() -> s.Scene:
    """A free-flying body with the attitude law of flexmb."""
    builder = _bob(0.0).free("flight", "ground", "bob")
    builder.sense_marker("orientation", "centre", "orientation")
    builder.sense_marker("gyro", "centre", "angular_velocity", frame="marker")
    builder.sense_profile("slew", s.SmoothStep(start_value=0.0, end_value=0.1, start_s=0.0, duration_s=1.0))
    numbers = [1.0, 0.0, 0.0, *[1.0] * 3, *[1.0] * 3]
    builder.user_law(
        "attitude", ["orientation", "gyro", "slew"], "flexmb.control.attitude:eigenaxis_slew", outputs=3,
        parameters=numbers, period=4e-4,
    )  # fmt: skip
    return builder.torque(
        "roll", "bob", direction=(1.0, 0.0, 0.0), frame="node", function=s.ControlSignal(source="attitude[0]")
    ).scene()


def _bob(gravity: float) -> SceneBuilder:
    return (
        SceneBuilder("pendulum", gravity=(0.0, gravity, 0.0))
        .rigid_body("bob", mass=1.0, com=(1.0, 0.0, 0.0), inertia=(1e-2, 1e-2, 1e-2))
        .marker("centre", "bob", offset=(1.0, 0.0, 0.0))
    )
