"""Connectors in other codes: at the first instant to rounding, over time to the error of their steps, or refused."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

import flexmb as fm
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Run, Support
from crosscheck.engines.registry import engine
from flexmb.scene.build import angular, linear
from flexmb.scene.connectors import AngularFriction, Connector
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Load, Scene
from flexmb.scene.shapes import beam_section
from flexmb.surrogate import modal_points
from tests.crosscheck.engines.peers import off

CASES = Path(__file__).parents[3] / "cases"
CASE, ANDREWS = (CASES / case / "scene.toml" for case in ("connectors/sprung_platform", "closed_chains/andrews"))
WITHIN = {
    "native-composite": 1e-12, "pinocchio": 1e-12, "mujoco": 1e-11, "drake": 1e-11, "exudyn": 1e-10, "opensim": 1e-12,
}  # fmt: skip
LIBRARY = {"native-composite": "flexmb", "drake": "pydrake"}


def only(scene: Scene, *kinds: type[Connector]) -> Scene:
    return msgspec.structs.replace(scene, connectors=tuple(x for x in scene.connectors if isinstance(x, kinds)))


@pytest.mark.parametrize("name", WITHIN)
def test_first_instant(name):
    pytest.importorskip(LIBRARY.get(name, name))
    scene = load_scene(CASE)
    assert CheckedEngine(engine(name)).supports(scene).kind == "exact"
    ours, theirs = (engine(each).compile(scene).evaluate() for each in ("native", name))
    accelerations = [{marker: at.acceleration for marker, at in each.markers.items()} for each in (ours, theirs)]
    assert off(*accelerations) <= WITHIN[name]
    for output in ("loads", "connectors", "hinge_forces"):
        assert off(getattr(ours, output), getattr(theirs, output)) <= WITHIN[name]
    assert all(abs(ours.energy[kind] - theirs.energy[kind]) <= 1e-11 for kind in ours.energy)
    assert abs(ours.energy["spring"]) > 1.0


def test_connectors_of_exudyn_over_time():
    """Of second order: a quarter of the error at half the step; a spring 1 % too stiff would be off by far more."""
    pytest.importorskip("exudyn")
    scene, run = load_scene(CASE), Run(np.linspace(0.0, 0.1, 6))
    ours = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-10, "dop853"))
    errors = []
    for step in (2e-3, 1e-3):
        theirs = engine("exudyn").compile(scene).simulate(run, Effort("step", step, "TrapezoidalIndex2"))
        assert theirs.status == "finished"
        errors.append(np.max(np.abs(ours.markers["top"].position - theirs.markers["top"].position)))
    assert errors[0] < 1e-4 and 3.5 < errors[0] / errors[1] < 4.5
    assert off(ours.hinge_forces, theirs.hinge_forces) < 2e-4 and off(ours.connectors, theirs.connectors) < 2e-4


def wheel_and_slug() -> Scene:
    """Friction in a wheel's bearing and springs with stops along two coordinates of a hinge and along a point mass."""
    return (
        fm.SceneBuilder("wheel and slug")
        .rigid_body("hub", mass=5.0, inertia=(1.0, 1.2, 1.5))
        .rigid_body("arm", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.01, 0.04, 0.04))
        .free("flight", "ground", "hub", angular_velocity=(0.3, -0.2, 0.5))
        .universal(
            "elbow", "hub", "arm", parent_position=(0.5, 0.0, 0.1),
            first=angular(angle=0.3, rate=-0.8), second=angular(angle=0.6, rate=0.7),
        )
        .wheel("wheel", "hub", axis=(0.0, 0.6, 0.8), mass=0.5, axial_inertia=0.04, transverse_inertia=0.025, speed=10.0)
        .point_mass("slug", "arm", mass=0.4, directions=[(0.0, 1.0, 0.0)], coordinates=[linear(position=0.1)])
        .angular_friction("bearing", "wheel", sliding=0.3, smoothing=0.01)
        .angular_spring("inner", "elbow", coordinate="first", stiffness=3.0, stiffening=(0.0, 20.0),
                        torque=fm.Constant(value=0.6))
        .angular_spring("outer", "elbow", coordinate="second", upper=0.5, stop_stiffness=40.0, stop_dissipation=0.4)
        .angular_friction("rub", "elbow", coordinate="second", sliding=0.2, smoothing=0.1)
        .linear_spring("tank", "slug", table=(-0.2, 0.0, 0.2), loads=(-9.0, 0.0, 5.0), lower=-0.1, upper=0.05,
                       stop_stiffness=300.0, force=fm.Constant(value=-2.0))
        .marker("tip", "arm", offset=(0.6, 0.0, 0.0))
        .scene()
    )  # fmt: skip


@pytest.mark.parametrize("name", [name for name in WITHIN if name != "native-composite"])
def test_bearings_of_wheels_coordinates_of_hinges_and_point_masses(name):
    """The first instant against the native code."""
    pytest.importorskip(LIBRARY.get(name, name))
    ours, theirs = (engine(each).compile(wheel_and_slug()).evaluate() for each in ("native", name))
    assert off({"tip": ours.markers["tip"].acceleration}, {"tip": theirs.markers["tip"].acceleration}) <= WITHIN[name]
    assert off(ours.hinge_forces, theirs.hinge_forces) <= WITHIN[name]
    assert off(ours.wheel_loads, theirs.wheel_loads) <= WITHIN[name]
    hinges = [{hinge: at.loads[hinge] for hinge in ("flight", "elbow")} for at in (ours, theirs)]
    assert off(*hinges) <= WITHIN[name]
    assert all(ours.energy[kind] == pytest.approx(theirs.energy[kind], abs=1e-11) for kind in ours.energy)


def sprung_beam(kind: str) -> Scene:
    """A bent beam on a hinge, with a bushing or a spring from its tip to the ground, at frames beside the node."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=6e-10, rho=2700.0)
    stiffness = np.diag([4.0, 5.0, 3.0, 400.0, 500.0, 600.0])
    beam = (
        fm.SceneBuilder("beam on a spring", gravity=(0.0, 0.0, -9.81))
        .beam("rod", length=1.0, elements=4, section=section, modes=4, points="section")
        .revolute("pivot", "ground", "rod", axis=(0.0, 1.0, 0.0), angle=0.1, rate=0.5)
        .modal_state("rod", coordinates=[0.01, -0.005, 0.002, 0.001])
        .marker("tip", "rod", node="tip")
    )
    if kind == "line":
        return beam.spring_damper(
            "mount", "rod", "ground", node_a="tip", position_a=(0.02, 0.01, 0.0), position_b=(1.2, 0.3, -0.4),
            free_length=0.3, stiffness=300.0, damping=2.0,
        ).scene()  # fmt: skip
    return beam.bushing(
        "mount", "rod", "ground", node_a="tip", position_a=(0.02, 0.01, 0.0), position_b=(0.98, 0.0, -0.05),
        quaternion_a=(0.8, 0.0, 0.6, 0.0), quaternion_b=(0.8, 0.0, 0.6, 0.0), stiffness=stiffness,
        damping=0.01 * stiffness,
    ).scene()  # fmt: skip


def test_connectors_and_loads_beside_closures_in_pinocchio():
    """Andrews' mechanism with a force on its lever and dry friction at its crank: the first instant, and a run."""
    pytest.importorskip("pinocchio")
    scene = load_scene(ANDREWS)
    push = Load(name="push", type="force", body="K3", direction=(0.6, 0.8, 0.0), function=Constant(value=20.0))
    rub = AngularFriction(name="rub", hinge=scene.hinges[0].name, sliding_Nm=0.004, smoothing_rad_s=10.0)
    scene = msgspec.structs.replace(scene, loads=(push,), connectors=(*scene.connectors, rub))
    models = [engine(each).compile(scene) for each in ("native", "pinocchio")]
    ours, theirs = (model.evaluate() for model in models)
    assert off(ours.loads, theirs.loads) <= 1e-12 and off(ours.connectors, theirs.connectors) <= 1e-12
    run = Run(np.linspace(0.0, 0.005, 6))
    efforts = Effort("tolerance", 1e-11, "dop853"), Effort("tolerance", 1e-11, "DOP853")
    ours, theirs = (model.simulate(run, effort) for model, effort in zip(models, efforts, strict=True))
    paths = [{name: path.position for name, path in each.markers.items()} for each in (ours, theirs)]
    assert off(*paths) <= 1e-10 and off(ours.loads, theirs.loads) <= 1e-8
    assert off(ours.hinge_forces, theirs.hinge_forces) <= 1e-8
    assert np.max(np.abs(ours.work - theirs.work)) <= 1e-9 * np.max(np.abs(ours.work))


@pytest.mark.parametrize("kind", ["bushing", "line"])
def test_connectors_at_bending_nodes_in_exudyn(kind):
    """At the first instant to rounding; over time of second order."""
    pytest.importorskip("exudyn")
    scene = modal_points(sprung_beam(kind))
    assert CheckedEngine(engine("exudyn")).supports(scene).kind == "exact"
    models = [engine(each).compile(scene) for each in ("native", "exudyn")]
    ours, theirs = (model.evaluate() for model in models)
    assert off(ours.connectors, theirs.connectors) <= 1e-12
    assert off({"tip": ours.markers["tip"].acceleration}, {"tip": theirs.markers["tip"].acceleration}) <= 1e-9
    run, errors = Run(np.linspace(0.0, 0.008, 3)), []
    path = models[0].simulate(run, Effort("tolerance", 1e-10, "dop853")).markers["tip"].position
    for step in (2.5e-4, 1.25e-4):
        found = models[1].simulate(run, Effort("step", step, "TrapezoidalIndex2")).markers["tip"].position
        errors.append(np.max(np.abs(path - found)))
    assert errors[0] < 1e-4 and 3.5 < errors[0] / errors[1] < 4.5


def test_what_an_adapter_does_not_have_it_refuses():
    support = CheckedEngine(engine("dart")).supports(only(load_scene(CASE), AngularFriction))
    assert support.kind == "no" and "bearing" in support.reason


class Unaware:
    """An engine of somebody else, from before there were connectors, that takes any scene."""

    name = "unaware"

    def supports(self, scene: Scene) -> Support:
        return Support("exact")


def test_an_engine_that_knows_of_none_is_not_asked_to_leave_them_out():
    support = CheckedEngine(Unaware()).supports(load_scene(CASE))
    assert support.kind == "no" and support.reason == '"spring a": the adapter of engine unaware knows no connectors'
    assert CheckedEngine(Unaware()).supports(only(load_scene(CASE))).kind == "exact"
