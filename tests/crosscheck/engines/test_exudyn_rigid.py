"""Exudyn's rigid trees: what the contract test of all engines does not ask."""

import builtins
import sys
from importlib.metadata import PackageNotFoundError

import numpy as np
import pytest

pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install flexmb[peers]")

from crosscheck.engines.contract import Effort, EngineMissing, Run
from crosscheck.engines.exudyn import ExudynBeamEngine, ExudynEngine, library, solve
from crosscheck.engines.native import NativeEngine
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Ramp

G = 9.81
TENSOR = ((0.3, 0.02, 0.01), (0.02, 0.5, 0.03), (0.01, 0.03, 0.6))
OFFSET = {
    "parent_position_m": (0.2, -0.1, 0.3), "parent_quaternion": (0.5, 0.5, 0.5, 0.5),
    "child_position_m": (-0.1, 0.2, 0.1), "child_quaternion": (0.8, 0.0, 0.6, 0.0),
}  # fmt: skip


def rigid(name: str) -> s.RigidBody:
    return s.RigidBody(name=name, mass_kg=2.0, com_m=(0.3, 0.1, -0.05), inertia_kg_m2=TENSOR)


def angle(**more) -> s.AngularCoordinate:
    return s.AngularCoordinate(angle_rad=0.4, rate_rad_s=0.7, stiffness_Nm_rad=3.0, rest_rad=0.1, **more)


def shift(**more) -> s.LinearCoordinate:
    return s.LinearCoordinate(position_m=0.1, rate_m_s=0.3, stiffness_N_m=40.0, rest_m=0.05, **more)


def hinge(kind: str, name: str, parent: str, child: str) -> s.Hinge:
    ends = {"name": name, "parent": parent, "child": child, **OFFSET}
    slanted = (0.0, 0.6, 0.8)
    return {
        "revolute": lambda: s.Revolute(axis=slanted, rotation=angle(), **ends),
        "prismatic": lambda: s.Prismatic(axis=slanted, translation=shift(), **ends),
        "cylindrical": lambda: s.Cylindrical(axis=slanted, rotation=angle(), translation=shift(), **ends),
        "universal": lambda: s.Universal(first=angle(), second=angle(), **ends),
        "gimbal": lambda: s.Gimbal(sequence="zxy", rotations=(angle(), angle(), angle()), **ends),
        "spherical": lambda: s.Spherical(
            quaternion=(0.8, 0.36, 0.48, 0.0), angular_velocity_rad_s=(0.3, 0.4, -0.5), stiffness_Nm_rad=2.0, **ends
        ),
        "planar": lambda: s.Planar(x=shift(), y=shift(), rotation=angle(), **ends),
    }[kind]()


def tree(kind: str) -> s.Scene:
    """A free body with a wheel, a second one on a sprung hinge, and a sprung point mass on that."""
    floating = s.Free(name="free", parent="ground", child="a", angular_velocity_rad_s=(0.3, 0.4, -0.5))
    wheel = s.Wheel(
        name="wheel", body="a", axis=(0.0, 0.0, 1.0), mass_kg=0.5, axial_inertia_kg_m2=0.02,
        transverse_inertia_kg_m2=0.012, speed_rad_s=10.0,
    )  # fmt: skip
    bob = s.PointMass(
        name="bob", body="b", offset_m=(0.1, 0.0, 0.2), mass_kg=0.3, directions=((1, 0, 0), (0, 0, 1)),
        coordinates=(shift(), shift()),
    )  # fmt: skip
    return s.Scene(
        name=kind, bodies=(rigid("a"), rigid("b")), hinges=(floating, hinge(kind, "joint", "a", "b")), wheels=(wheel,),
        point_masses=(bob,), markers=(s.Marker(name="end", body="b", offset_m=(0.5, 0.0, 0.0)),),
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "cylindrical", "universal", "gimbal", "spherical", "planar"])
def test_energy_momentum_and_order_across_every_hinge(kind):
    """No gravity: energy is kept to second order in the step and momentum is kept, with springs on every freedom."""
    model = ExudynEngine().compile(tree(kind))
    times = np.linspace(0.0, 0.32, 33)
    runs = [model.simulate(Run(times), Effort("step", h, "TrapezoidalIndex2")) for h in (0.005, 0.0025, 0.00125)]
    assert [run.status for run in runs] == ["finished"] * 3
    ends = [run.markers["end"].position for run in runs]
    coarse, fine = np.abs(ends[0] - ends[1]).max(), np.abs(ends[1] - ends[2]).max()
    assert coarse / fine == pytest.approx(4.0, rel=0.05)
    drift = [np.ptp(sum(run.energy.values())) for run in runs]
    scale = runs[0].energy["kinetic"].max()
    # second order, down to the tolerance of Newton's method
    assert drift[2] < max(drift[0] / 10.0, 1e-7 * scale) and drift[2] < 1e-5 * scale
    momentum = runs[2].momentum
    assert np.ptp(momentum, axis=0).max() < 1e-5 * np.abs(momentum).max()


def test_errors_on_light_links_fall_with_the_step(monkeypatch):
    """A leg of links of tens of grams: what Newton's method leaves at its tolerance adds up over the steps, so that at
    1e-8 errors stopped falling, and no U from steps contained them."""
    leg = SceneBuilder("leg", gravity=(0.0, 0.0, -G))
    leg.rigid_body("thigh", mass=0.162, com=(0.0, 0.0, -0.08), inertia=(4.7e-4, 4.7e-4, 1e-6))
    leg.rigid_body("shank", mass=0.021, com=(0.0, 0.0, -0.076), inertia=(8.8e-5, 8.8e-5, 1e-6))
    leg.rigid_body("foot", mass=0.01, inertia=np.zeros((3, 3)))
    leg.revolute("hip", "ground", "thigh", axis=(1.0, 0.0, 0.0), rate=0.5)
    leg.revolute("knee", "thigh", "shank", parent_position=(0.0, 0.0, -0.16), axis=(1.0, 0.0, 0.0), rate=0.5)
    leg.weld("ankle", "shank", "foot", parent_position=(0.0, 0.0, -0.16))
    scene, run = leg.marker("foot", "foot").scene(), Run(np.linspace(0.0, 0.5, 26))
    exact = NativeEngine().compile(scene).simulate(run, Effort("tolerance", 1e-11, "dop853")).markers["foot"].velocity

    def falls() -> list[float]:
        found = []
        for h in (5e-4, 2.5e-4, 1.25e-4):
            done = ExudynEngine().compile(scene).simulate(run, Effort("step", h, "TrapezoidalIndex2"))
            found.append(np.abs(done.markers["foot"].velocity - exact).max())
        return [coarse / fine for coarse, fine in zip(found, found[1:], strict=False)]

    assert falls() == pytest.approx([4.0, 4.0], rel=0.05)
    monkeypatch.setattr(solve, "NEWTON_SETTINGS", ((1e-8, True),))
    assert min(falls()) < 2.5


def test_prescribed_wheel_passes_many_turns():
    """A driven wheel at 40 rad/s for 2 s: the bearing keeps its angle beyond half a turn, its host counter-rotates."""
    wheel = s.Wheel(
        name="wheel", body="hub", axis=(0.0, 0.0, 1.0), mass_kg=1.0, axial_inertia_kg_m2=0.02,
        transverse_inertia_kg_m2=0.01, prescribed_rad=Ramp(rate=40.0),
    )  # fmt: skip
    hub = s.RigidBody(name="hub", mass_kg=3.0, inertia_kg_m2=((0.1, 0, 0), (0, 0.2, 0), (0, 0, 0.3)))
    scene = s.Scene(
        name="wheel", bodies=(hub,), hinges=(s.Free(name="free", parent="ground", child="hub"),), wheels=(wheel,),
        markers=(s.Marker(name="hub", body="hub"),),
    )  # fmt: skip
    run = ExudynEngine().compile(scene).simulate(
        Run(np.linspace(0.0, 2.0, 101)), Effort("step", 0.005, "TrapezoidalIndex2")
    )
    assert run.status == "finished"
    assert run.momentum[:, 2] == pytest.approx(np.full(101, 0.02 * 40.0), rel=1e-9)
    assert np.abs(run.drives["wheel"]).max() < 1e-6


def test_samples_must_be_uniform():
    scene = s.Scene(name="p", bodies=(rigid("b"),), hinges=(s.Revolute(name="h", parent="ground", child="b"),))
    with pytest.raises(ValueError, match="uniform"):
        ExudynEngine().compile(scene).simulate(Run(np.array([0.0, 0.1, 0.3])), Effort("step", 0.01, "GeneralizedAlpha"))


def test_a_missing_library_is_named_with_its_remedy(monkeypatch):
    real = builtins.__import__

    def without_exudyn(name, *rest, **more):
        if name == "exudyn" or name.startswith("exudyn."):
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without_exudyn)
    monkeypatch.delitem(sys.modules, "exudyn")
    library.load.cache_clear()
    with pytest.raises(EngineMissing, match="pip install exudyn$"):
        library.load()
    monkeypatch.setattr("crosscheck.engines.peer.version", _not_installed)
    for engine in (ExudynEngine(), ExudynBeamEngine()):
        with pytest.raises(EngineMissing, match="pip install exudyn$"):
            engine.version()


def _not_installed(name: str) -> str:
    raise PackageNotFoundError(name)
