"""Derivatives of whole runs, in runs: the satellite by twelve numbers; one scalar of a chain by two hundred."""

from __future__ import annotations

import numpy as np

import flexmb as fm
from tests.benchmarks.must_hold.row import Measured, Row, measured
from tests.benchmarks.rivals import turns
from tests.repo.project import ROOT

T_END = 100.0
BY = (
    "hub.mass_kg", "hub.inertia_kg_m2.1.1", "left_hinge.rotation.stiffness_Nm_rad",
    "left_hinge.rotation.damping_Nms_rad", "right_hinge.rotation.stiffness_Nm_rad", "slosh.mass_kg",
    "slosh.coordinates.0.stiffness_N_m", "left.stations.*.EIy_Nm2", "left.stations.*.mass_per_length_kg_m",
    "attitude.parameters.3", "attitude.parameters.8", "left latches.level",
)  # fmt: skip
OF = ("left_tip.position.x", "right_tip.position.y", "left_hinge.torque.y", "tracker.quaternion.x", "wheel_y.speed")


def rows() -> list[Row]:
    """Both in one process, in turns, kernels compiled."""
    what = f"derivatives of spacecraft/deploy_and_slew by {len(BY)} numbers, {T_END:g} s, 2 latches, over the run"
    adjoint = (
        f"gradient of a misfit of a chain of {BODIES} bodies by {10 * BODIES} numbers (mass, inertia, centre of mass, "
        f"place and spring of each), {CHAIN_END:g} s, over the run"
    )
    return [
        Row("sensitivity", "Derivatives", what, 8.0, _satellite, "at most"),
        Row("adjoint", "Derivatives", adjoint, 12.0, _chain, "at most"),
    ]

BODIES, CHAIN_END = 20, 100.0
OWN = (
    "{body}.mass_kg", "{body}.inertia_kg_m2.0.0", "{body}.inertia_kg_m2.1.1", "{body}.inertia_kg_m2.2.2",
    "{body}.com_m.0", "{body}.com_m.1", "{body}.com_m.2", "{hinge}.parent_position_m.0",
    "{hinge}.rotation.stiffness_Nm_rad", "{hinge}.rotation.damping_Nms_rad",
)  # fmt: skip


def _satellite() -> Measured:
    scene = fm.load_scene(ROOT / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
    found: list[fm.Sensitivities] = []

    def derivatives() -> None:
        found[:] = [fm.sensitivities(scene, T_END, BY, OF)]

    def run() -> None:
        fm.simulate(scene, T_END)

    seconds = turns(derivatives, run, rounds=7)
    if not (len(found[0].events) == 2 and np.isfinite(found[0].derivatives).all()):
        raise ArithmeticError(f"{len(found[0].events)} latches, and derivatives that are not finite")
    whole, alone = np.median(seconds, axis=0)
    return measured(seconds[:, 0] / seconds[:, 1], (
        f"{whole:.2f} s over {alone:.3f} s, {len(OF)} outputs at 201 times; beams that a call has meshed are kept "
        "for the next"
    ))


def _swinging() -> fm.SceneBuilder:
    """Rigid bodies on hinges with springs and dampers, whose axes alternate, in gravity."""
    builder, parent = fm.SceneBuilder("chain", gravity=(0.0, 0.0, -9.81)), "ground"
    for i in range(BODIES):
        builder.rigid_body(f"b{i}", mass=1.0 + 0.01 * i, inertia=(0.01, 0.1, 0.1), com=(0.3, 0.01, 0.02))
        builder.revolute(
            f"h{i}", parent, f"b{i}", axis=(0, 1, 0) if i % 2 else (0, 0, 1), angle=0.1, stiffness=200.0, damping=1.0,
            parent_position=(0.6, 0.0, 0.0),
        )  # fmt: skip
        parent = f"b{i}"
    return builder.marker("tip", parent, offset=(0.6, 0.0, 0.0))


def _chain() -> Measured:
    """The whole call: compiling the scene with other numbers, and both passes over the run."""
    scene = _swinging().scene()
    by = [name.format(body=f"b{i}", hinge=f"h{i}") for i in range(BODIES) for name in OWN]
    t = np.linspace(0.0, CHAIN_END, 21)[1:]
    of = fm.Misfit({"t": t, "tip.position.z": np.full(len(t), -5.0)})
    found: list[fm.Gradient] = []

    def derivatives() -> None:
        found[:] = [fm.gradient(scene, CHAIN_END, by, of)]

    def run() -> None:
        fm.simulate(scene, CHAIN_END)

    seconds = turns(derivatives, run, rounds=7)
    few = by[::67]
    other = fm.sensitivities(scene, CHAIN_END, few, ["tip.position.z"], samples=np.r_[0.0, t])
    exact = 2.0 * (other.values[1:, 0] + 5.0) @ other.derivatives[1:, 0]
    off = np.max(np.abs([found[0].derivative(name) for name in few] / exact - 1.0))
    if not off < 1e-6:
        raise ArithmeticError(f"the gradient is {off:.1g} from forward sensitivities")
    whole, alone = np.median(seconds, axis=0)
    return measured(
        seconds[:, 0] / seconds[:, 1], f"{whole:.2f} s over {alone:.3f} s, {found[0].steps} steps; "
        f"{off:.0e} from forward sensitivities",
    )  # fmt: skip
