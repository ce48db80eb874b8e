"""Derivatives of runs with beams of level exact, in a tree and in a closed chain: adjoint, forward, and differences."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from tests.flexmb.sensitivity.test_gradient import OTHER_STEPS
from tests.flexmb.sensitivity.test_sensitivities import agrees
from tests.repo.project import ROOT

FOUR_BAR = ROOT / "cases" / "closed_chains" / "four_bar" / "scene.toml"


def soft_beam(name: str, length: float, family: Sequence[str], **numbers) -> fm.schema.BeamBody:
    """Curved and twisted where it is not loaded, of a material that damps, and soft enough to bend by a radian."""
    root = fm.BeamStation(
        x_m=0.0, EA_N=1e5, EIy_Nm2=2.0, EIz_Nm2=1.0, GJ_Nm2=1.5, mass_per_length_kg_m=0.45, rotary_y_kg_m=1e-3,
        rotary_z_kg_m=2e-3, curvature_1_m=(0.2, 0.1, 0.3),
    )  # fmt: skip
    modes = fm.Modes(count=2, families=tuple(family), viscosity_s=0.02)
    ends = root, replace(root, x_m=length)
    return fm.schema.BeamBody(
        name=name, length_m=length, elements=4, stations=ends, modes=modes, level="exact", **numbers
    )


def driven_strip() -> fm.Scene:
    """A strip on a hinge that turns it, with a mass beside its tip and a force that bends it, in space."""
    lump = fm.TipMass(x_m=1.0, mass_kg=0.2, com_m=(0.0, 0.05, 0.02))
    strip = soft_beam("strip", 1.0, ("torsion", "bending_y", "bending_z"), tip_masses=(lump,))
    turn = fm.SmoothStep(start_value=0.0, end_value=0.6, start_s=0.0, duration_s=0.5)
    pull = fm.SmoothStep(start_value=0.0, end_value=3.0, start_s=0.0, duration_s=0.4)
    scene = (
        fm.SceneBuilder("driven strip", gravity=(0.0, 0.0, -9.81))
        .rigid_body("strip", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("shoulder", "ground", "strip", axis=(0, 0, 1), prescribed=turn)
        .scene()
    )
    force = fm.schema.Load(
        name="pull", body="strip", node="tip", type="force", direction=(0.0, 1.0, 0.0), function=pull
    )
    return replace(
        scene, bodies=(strip,), loads=(force,), markers=(fm.schema.Marker(name="tip", body="strip", node="tip"),)
    )


def four_bar() -> fm.Scene:
    """The four-bar of the cases with a soft curved coupler, which closes a loop in space, from a start that is closed:
    derivatives by numbers leave the corrections of a start that is not as they are."""
    scene = fm.load_scene(FOUR_BAR)
    crank, _, rocker = scene.bodies
    scene = replace(scene, bodies=(crank, soft_beam("coupler", 0.8, ("bending_y", "bending_z")), rocker))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fm.SceneWarning)  # the straight coupler's values are corrected here
        return _closed(_closed(scene))


def _closed(scene: fm.Scene) -> fm.Scene:
    """The scene with the initial values that its run begins with, and its coupler straight."""
    run = fm.simulate(scene, 1e-6, samples=2)
    turns = {f"{name}.angle_rad": each for (name, _), each in zip(run.q_names, run.q[0], strict=True)}
    rates = {f"{name}_rad_s": each for (name, _), each in zip(run.u_names, run.u[0], strict=True)}
    return scene.with_values({k: float(v) for k, v in (turns | rates).items() if not k.startswith("coupler.")})


STRIP = [
    "strip.stations.*.EIz_Nm2", "strip.stations.*.curvature_1_m.2", "strip.modes.viscosity_s",
    "strip.tip_masses.0.com_m.1", "loads.pull.function.end_value",
]  # fmt: skip
LOOP = [
    "coupler.stations.*.EIz_Nm2", "coupler.stations.*.curvature_1_m.2", "coupler.modes.viscosity_s",
    "bodies.crank.nodes.tip.position_m.0", "bodies.rocker.mass_kg",
]  # fmt: skip
SCENES = {
    "tree": (driven_strip, STRIP, ["tip.position.x", "tip.velocity.z", "shoulder.torque.z", "energy.strain"]),
    "closed chain": (four_bar, LOOP, ["drive.rotation", "joint.position.x", "loop.force.x", "energy.strain"]),
}
T_END = 0.2


@pytest.mark.parametrize("which", SCENES)
def test_the_adjoint_agrees_with_forward_sensitivities(which: str) -> None:
    """Of a sum of final values, each weighted by the size of its derivatives so that none is hidden by another."""
    make, by, channels = SCENES[which]
    scene = make()
    other = fm.sensitivities(scene, T_END, by, channels, samples=2)
    rows = other.derivatives[-1] * other.parameter_values  # by relative changes
    weights = (np.arange(1, len(channels) + 1)) / np.max(np.abs(rows), axis=1)
    terms = [fm.FinalValue(name, weight=float(w)) for name, w in zip(channels, weights, strict=True)]
    found = fm.gradient(scene, T_END, by, terms)
    assert found.value == pytest.approx(weights @ other.values[-1], rel=OTHER_STEPS)
    assert np.max(np.abs(found.derivatives * other.parameter_values - weights @ rows)) < OTHER_STEPS
    assert np.all(np.max(np.abs(rows * weights[:, None]), axis=0) > 1e-5)  # no number is without effect


@pytest.mark.filterwarnings("ignore::flexmb.SceneWarning")  # runs with other numbers close their closures anew
@pytest.mark.parametrize("which", SCENES)
def test_forward_sensitivities_agree_with_differences(which: str) -> None:
    make, by, channels = SCENES[which]
    agrees(make(), T_END, by, channels, rtol=1e-12, atol=1e-14)
