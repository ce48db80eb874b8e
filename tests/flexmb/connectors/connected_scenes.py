"""Scenes with connectors of every kind: between rigid bodies, deforming nodes and the ground, and along hinges."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

import flexmb as fm
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section


def positive(seed: int, size: float) -> np.ndarray:
    """A symmetric, positive definite matrix (6,6)."""
    A = np.random.default_rng(seed).normal(size=(6, 6))
    return size * (A @ A.T + np.eye(6))


def bodies(*, grounded: bool, level: s.Level = "full", spin: float = 1.0) -> SceneBuilder:
    """A free hub with a flexible boom on a revolute hinge, a slider with a wheel on the hub, all of them moving."""
    section = beam_section(E=2e9, G=8e8, A=6e-4, Iy=8e-8, Iz=5e-8, rho=1500.0)
    builder = SceneBuilder("connected", gravity=(0.3, 0.1, -2.0) if grounded else (0, 0, 0))
    corner = {"corner": (0.3, 0.2, 0.1)}
    builder.rigid_body("hub", mass=3.0, com=(0.02, 0.0, 0.01), inertia=(0.2, 0.25, 0.3), nodes=corner)
    builder.beam("boom", length=1.2, elements=6, section=section, modes=3, level=level, nodes={"middle": 0.7})
    builder.rigid_body("slider", mass=0.8, com=(0.0, 0.01, 0.0), inertia=(0.02, 0.03, 0.025))
    builder.free(
        "flight", "ground", "hub", position=(0.1, -0.2, 0.3), quaternion=(0.8, 0.36, -0.48, 0.0),
        angular_velocity=spin * np.array([0.4, -0.7, 0.5]), velocity=(0.2, 0.1, -0.1),
    )  # fmt: skip
    builder.revolute("elbow", "hub", "boom", axis=(0.0, 0.6, 0.8), angle=0.4, rate=0.8, parent_node="corner")
    builder.prismatic("rail", "hub", "slider", axis=(0, 0, 1), position=0.25, rate=-0.4, parent_position=(-0.2, 0, 0.1))
    builder.wheel("wheel", "slider", axis=(0, 1, 0), mass=0.3, axial_inertia=2e-3, transverse_inertia=1.2e-3, speed=8.0)
    if level != "rigid":
        builder.modal_state("boom", coordinates=(0.03, -0.02, 0.01), rates=(0.2, 0.1, -0.3))
    return builder.marker("tip", "boom", node="tip").marker("hub", "hub", offset=(0.1, 0, 0))


def between_bodies(builder: SceneBuilder) -> SceneBuilder:
    """Everything conservative between nodes of bodies: lines, a cable, a buffer, a table, and a bushing."""
    return (
        builder
        .spring_damper("spring", "hub", "boom", node_b="tip", free_length=0.9, preload=2.0, stiffness=30.0,
                       stiffening=(4.0, -3.0, 2.0, 5.0), position_a=(0.1, 0.0, -0.1))
        .spring_damper("inside", "boom", "boom", node_a="middle", node_b="tip", position_a=(0, 0.1, 0),
                       free_length=0.4, stiffness=200.0)
        .spring_damper("cable", "slider", "boom", node_b="middle", free_length=0.3, preload=1.0, stiffness=50.0,
                       acts="tension")
        .spring_damper("slack", "slider", "boom", node_b="tip", free_length=9.0, stiffness=50.0, acts="tension")
        .spring_damper("buffer", "slider", "boom", node_b="tip", free_length=2.5, stiffness=20.0, acts="compression")
        .spring_damper("curve", "hub", "slider", free_length=0.2, table=(-0.2, 0.0, 0.05, 0.1, 0.3),
                       loads=(-3.0, -1.0, 0.5, 2.0, 9.0), position_b=(0.2, 0.1, 0.0))
        .bushing("mount", "boom", "slider", node_a="middle", position_a=(0.05, 0.02, -0.03),
                 quaternion_a=(0.6, 0.0, 0.8, 0.0), position_b=(0.1, 0.0, 0.2), quaternion_b=(0.48, 0.36, 0.8, 0.0),
                 stiffness=positive(1, 3.0))
    )  # fmt: skip


def losses(builder: SceneBuilder) -> SceneBuilder:
    """Dampers and an actuator between nodes, springs with losses, stops and friction along hinges."""
    return (
        builder
        .spring_damper("ram", "hub", "boom", node_b="middle", damping=3.0,
                       force=s.Sine(amplitude=4.0, angular_frequency_rad_s=3.0, phase_rad=0.5, offset=1.0))
        .spring_damper("brake", "slider", "boom", node_b="middle", free_length=0.1, stiffness=5.0, damping=2.0,
                       acts="tension")
        .bushing("soft", "hub", "boom", node_b="tip", stiffness=positive(2, 0.5), damping=positive(3, 0.3))
        .angular_spring("coil", "elbow", rest=0.1, stiffness=3.0, stiffening=(0.0, 8.0), damping=0.2, lower=-0.2,
                        upper=0.3, stop_stiffness=400.0, stop_dissipation=0.02,
                        torque=s.Sine(amplitude=0.7, angular_frequency_rad_s=5.0, phase_rad=0.3))
        .angular_spring("second motor", "elbow", torque=s.Constant(value=-0.4))
        .linear_spring("rubber", "rail", table=(-0.1, 0.0, 0.2, 0.5), loads=(-4.0, 0.0, 3.0, 20.0), damping=0.5,
                       force=s.Constant(value=0.9))
        .angular_friction("bearing", "wheel", sliding=0.02, smoothing=0.05)
        .angular_friction("hinge friction", "elbow", sliding=0.3, static=0.5, stribeck=0.2, smoothing=0.01)
        .linear_friction("rail friction", "rail", sliding=0.4, smoothing=0.01)
    )  # fmt: skip


def to_ground(builder: SceneBuilder) -> SceneBuilder:
    """A spring and a bushing whose first, or second, end is on the ground."""
    return builder.spring_damper(
        "tether", "ground", "hub", position_a=(1.0, 0.5, 2.0), node_b="corner", free_length=1.0, stiffness=12.0,
        damping=0.7,
    ).bushing(
        "foot", "slider", "ground", stiffness=positive(4, 2.0), damping=positive(5, 0.2), position_b=(0.2, 0.1, 0.0),
        quaternion_b=(0.96, 0.0, 0.28, 0.0),
    )  # fmt: skip


def everything(level: s.Level = "full") -> s.Scene:
    """All of it, on the ground."""
    return waived(to_ground(losses(between_bodies(bodies(grounded=True, level=level)))).scene())


def free_flying(*, lossy: bool = False) -> s.Scene:
    """Connectors among the bodies only."""
    builder = between_bodies(bodies(grounded=False))
    return waived((losses(builder) if lossy else builder).scene())


def waived(scene: s.Scene) -> s.Scene:
    """The scene, whose boom has no mode of torsion for what its connectors carry: that is not what it is for."""
    return replace(scene, allow=("few_modes",))


def started(scene: s.Scene) -> tuple[fm.System, fm.State]:
    """The system of a scene, and its initial state."""
    system = fm.compile(scene)
    return system, system.initial_state
