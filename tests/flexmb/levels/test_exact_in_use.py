"""Level exact in what stands on the recursion: derivatives by numbers, mass properties, poses, the range, refusals."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.interchange.sid import sid_of
from flexmb.modal.exact import exact_model
from flexmb.modal.strain_field import WHOLE
from flexmb.parameters.parameters import ParameterError
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import SceneError
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.rest_curve import rest_sections
from flexmb.scene.values import changed_at
from flexmb.system.frames import node_pose
from flexmb.system.moved_sections import moved_sections
from flexmb.tables.state import DynamicsError
from tests import trees
from tests.bounds import relative
from tests.flexmb.levels.strain_beams import BEAMS, PLANE, ROUNDING, SPACE, beam, bent, body_of, stations


def test_viscosity():
    """Kelvin and Voigt's material: damping is viscosity times stiffness, on top of modal damping."""
    viscous, modal, both = (
        exact_model(body_of(beam(s.Modes(count=2, families=SPACE, **damping))))
        for damping in ({"viscosity_s": 0.1}, {"damping_ratio": 0.02}, {"viscosity_s": 0.1, "damping_ratio": 0.02})
    )
    np.testing.assert_allclose(viscous.damping, 0.1 * viscous.stiffness, rtol=1e-15)
    np.testing.assert_allclose(both.damping, viscous.damping + modal.damping, rtol=1e-15)


@pytest.mark.parametrize("elimination", ["woodbury", "condensed"])
def test_modes_are_eliminated_explicitly(elimination):
    """Modal masses change with the shape: other forms of the elimination are not for this level."""
    scene = beam(**BEAMS["six strains"]).weld("clamp", "ground", "rod").scene()
    assert list(flexmb.compile(scene, elimination).elimination.values()) == ["explicit"]


def refused(text: str, **more: Any) -> None:
    with pytest.raises(SceneError, match=text):
        beam(**more).weld("clamp", "ground", "rod").scene()


def test_turns_without_a_check_of_the_scene():
    """Positions of an unchecked beam are refused before memory is asked for, and an infinity by the same words."""
    coiled = s.BeamBody(
        name="coil", length_m=1.0, elements=1, level="exact", modes=s.Modes(count=1), stations=tuple(stations(1.0))
    )
    for curvature in (2e4, 9e15, np.inf, np.nan):
        turning = tuple(
            msgspec.structs.replace(station, curvature_1_m=(curvature, 0.0, 0.0)) for station in coiled.stations
        )
        with pytest.raises(ValueError, match=r'"coil" turns at rest by .* rad, but 10000 rad are allowed: correct'):
            rest_sections(msgspec.structs.replace(coiled, stations=turning), np.ones(1))


def test_refusals():
    """What the level does not have, or has too little of, is said before anything runs."""
    four = s.Modes(count=4, families=PLANE)
    refused("boundary conditions", modes=s.Modes(count=4, boundary="free-free"))
    refused("without inertia", modes=s.Modes(count=4, families=PLANE, points=4))
    refused("no strain", modes=s.Modes(count=0))
    refused("consistent", modes=four, mass="lumped")
    refused(
        r"stations\[0\].curvature_1_m .*turns by 9e\+15 rad, and the limit is 10000 rad",
        modes=four, section=stations(1.0, (0.0, 9e15, 0.0)),
    )  # fmt: skip
    refused("straight beams only", modes=four, level="full", section=stations(1.0, (0.0, 0.0, 1.0)))
    refused('leave it out, or make the level "exact"', modes=s.Modes(count=2, pieces=2), level="full")
    refused("give 2000 at most", modes=s.Modes(count=40, pieces=1000))
    unsheared = [_without_shear(station) for station in stations()]
    refused("GAy_N", modes=s.Modes(count=1, polynomials=s.StrainPolynomials(shear_y=1, bending_y=2)), section=unsheared)
    points = inertia_points([1.0, 1.0], np.eye(3)[:2], np.ones((2, 3, 1)))
    raw = SceneBuilder("raw").modal_body("raw", points=points, stiffness=[[1.0]], level="exact")
    with pytest.raises(SceneError, match="strains along a beam"):
        raw.weld("w", "ground", "raw").scene()


def _without_shear(station: s.BeamStation) -> s.BeamStation:
    return msgspec.structs.replace(station, GAy_N=None, GAz_N=None)


def test_shear_that_undoes_bending_without_inertia_is_refused_by_name():
    """By the check, and by the model for a scene that was never checked."""
    modes = s.Modes(count=2, polynomials=s.StrainPolynomials(shear_y=3, bending_y=2))
    with pytest.raises(SceneError, match=r"shear_y and bending_y can be combined[\s\S]*rotary_z_kg_m"):
        beam(modes, points="line").weld("clamp", "ground", "rod").scene()
    few = msgspec.structs.replace(modes, polynomials=s.StrainPolynomials(shear_y=1, bending_y=2))
    with pytest.raises(ValueError, match="'rod': its shear_y and bending_y can be combined"):
        exact_model(msgspec.structs.replace(body_of(beam(few, points="line")), modes=modes))


def test_frisch_and_regressor_refuse_it():
    """Routes that expand in powers of the deformation say what to use."""
    system = flexmb.compile(beam(s.Modes(count=2, families=PLANE)).weld("clamp", "ground", "rod").scene())
    with pytest.raises(ValueError, match="no finite order"):
        system.accelerations(system.initial_state, algorithm="frisch")
    with pytest.raises(NotImplementedError, match='"exact"'):
        system.inertia_regressor()


NUMBERS = (
    "rod.length_m", "rod.stations.0.EIy_Nm2", "rod.stations.1.GJ_Nm2", "rod.stations.0.mass_per_length_kg_m",
    "rod.stations.1.rotary_z_kg_m", "rod.stations.0.curvature_1_m.1", "rod.stations.1.curvature_1_m.2",
    "rod.tip_masses.0.mass_kg", "rod.tip_masses.0.x_m", "rod.modes.viscosity_s", "rod.nodes.0.x_m",
)  # fmt: skip


def test_derivatives_by_numbers_of_the_beam():
    """Of accelerations, against differences of recompiled systems over a millionth, as far as these round."""
    tensor = trees.matrix(np.diag([2e-2, 1e-2, 2e-2]))
    lump = s.TipMass(x_m=0.6, mass_kg=0.3, com_m=(0.02, 0.1, -0.05), inertia_kg_m2=tensor)
    modes = s.Modes(count=2, families=SPACE, viscosity_s=0.01, cuts=())
    builder = beam(modes, section=stations(1.0, (0.4, -0.5, 0.9)), tip_masses=[lump], nodes={"middle": 0.45})
    builder.rigid_body("hub", mass=1.0, inertia=(0.1, 0.1, 0.1)).revolute("joint", "rod", "hub", parent_node="tip")
    scene = builder.revolute("base", "ground", "rod", axis=(0.0, 0.6, 0.8), child_node="middle").scene()
    system = flexmb.compile(scene)
    model = next(link.model for link in system.links if link.name == "rod")
    state, rng = system.initial_state, np.random.default_rng(0)
    state.q[system.coordinate("rod.modes")] = 0.3 * rng.normal(size=6) / np.sqrt(np.diag(model.stiffness))
    state.u[:] = rng.normal(size=system.nu)
    found = system.parameters(list(NUMBERS)).accelerations(state)
    for name, own in zip(NUMBERS, found.T, strict=True):
        h = 2.0**-20
        moved = [changed_at(scene, name, lambda value, step=step: value + step) for step in (h, -h)]
        ahead, behind = (flexmb.System(each).accelerations(state) for each in moved)
        assert relative(own, (ahead - behind) / (2.0 * h)) <= 1e-6, name


def test_derivatives_of_a_run_by_numbers_of_the_beam():
    """A pendulum that bends: by differences of runs. A longer beam has its last station further out, too."""
    soft = beam(s.Modes(count=3, families=("bending_z",)), gravity=(0.0, 0.0, -9.81))
    scene = soft.revolute("base", "ground", "rod", axis=(0, 1, 0)).marker("tip", "rod", node="tip").scene()
    found = flexmb.sensitivities(
        scene, 0.5, ["rod.stations.0.EIy_Nm2", "rod.length_m"], ["tip.position.z"], rtol=1e-10, samples=2
    )
    for j, paths in enumerate((["rod.stations.0.EIy_Nm2"], ["rod.length_m", "rod.stations.1.x_m"])):
        heights, h = [], 1e-4
        for step in (h, -h):
            moved = scene
            for path in paths:
                moved = changed_at(moved, path, lambda value, step=step: value + step)
            run = flexmb.simulate(moved, 0.5, rtol=1e-12, atol=1e-14, samples=2)
            heights.append(run.markers["tip"].position[-1, 2])
        assert found.derivatives[-1, 0, j] == pytest.approx((heights[0] - heights[1]) / (2.0 * h), rel=1e-6)


@pytest.mark.parametrize("name", BEAMS)
def test_mass_properties_of_a_bent_beam(name):
    """Mass, mass centre and inertia are those of its points where they are."""
    system = flexmb.compile(beam(**BEAMS[name]).weld("clamp", "ground", "rod").scene())
    model = system.links[0].model
    eta, none = bent(model.field)[0], np.zeros(model.mode_count)
    moved, at = moved_sections(model.field, eta, none, none), model.section
    R, r = moved.R[at], moved.r[at] + np.einsum("nab,nb->na", moved.R[at], model.com_offset)
    centre = model.mass @ r / model.mass.sum()
    arm = cross_matrix(r - centre)
    inertia = np.sum(R @ model.inertia @ np.swapaxes(R, 1, 2) - model.mass[:, None, None] * arm @ arm, axis=0)
    found = system.mass_properties(system.state(eta, none), "rod")
    assert found.mass == pytest.approx(model.mass.sum(), rel=1e-14)
    np.testing.assert_allclose(found.centre, centre, atol=ROUNDING)
    np.testing.assert_allclose(found.inertia, inertia, atol=ROUNDING * np.max(inertia))


def test_out_of_its_plane_a_beam_has_no_derivative():
    """Curvature that would bend a beam of one plane out of it changes what kernels do; the message has the remedy."""
    system = flexmb.compile(beam(s.Modes(count=3, families=PLANE)).weld("clamp", "ground", "rod").scene())
    with pytest.raises(ParameterError, match="out of that plane; give the beam torsion"):
        system.parameters(["rod.stations.0.curvature_1_m.0"])


@pytest.mark.parametrize("name", BEAMS)
def test_poses_of_nodes(name):
    """As markers have them, also of a beam that hangs on its tip."""
    builder = beam(**BEAMS[name], nodes={"a": 0.37})
    builder.revolute("hinge", "ground", "rod", child_node="tip", axis=(0, 0.6, 0.8))
    system = flexmb.compile(builder.marker("a", "rod", node="a").scene())
    state = system.initial_state
    state.q[system.coordinate("rod.modes")] = bent(system.links[0].model.field)[0]
    seen = system.evaluate(0.0, state.q, state.u).markers["a"]
    pose = node_pose(system, system.all_loads(state).motion, "rod", "a")
    np.testing.assert_allclose(pose.position, seen.position, atol=ROUNDING)
    np.testing.assert_allclose(pose.rotation, seen.rotation, atol=ROUNDING)


def test_diverged():
    """A turn of even curvature from each point to the next is the range of the level."""
    rod = beam(s.Modes(count=1, families=PLANE), section=stations(1.0, rotary=1e-6))
    system = flexmb.compile(rod.weld("clamp", "ground", "rod").scene())
    field = system.links[0].model.field
    per_unit = np.abs(field.rows[0, WHOLE, 2, 0]) / field.x[0]
    points = len(field.gauss)
    for turns, is_within in ((0.9 * points, True), (1.1 * points, False)):
        state = system.state([2.0 * np.pi * turns / per_unit], [0.0])
        if is_within:
            assert np.isfinite(system.accelerations(state)).all()
        else:
            with pytest.raises(DynamicsError):
                system.accelerations(state)


def test_standard_input_data_refuses_it():
    """Strains are no modes of that format; the message says what is."""
    with pytest.raises(ValueError, match="stiffened"):
        sid_of(body_of(beam(s.Modes(count=2, families=PLANE))))
