"""Basilisk: spacecraft that it represents agree with Pinocchio, pointwise and over time; what it refuses is named."""

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import Effort, Run, Snapshot
from crosscheck.engines.conventions import quaternion_of
from crosscheck.engines.registry import engine
from flexmb.scene.build import SceneBuilder, angular, linear
from flexmb.scene.functions import Sine
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.random_scenes import inertia, rotation, unit
from tests.crosscheck.engines.randomise import randomise

BASILISK = engine("basilisk")
WAVE = Sine(amplitude=0.7, angular_frequency_rad_s=2.0, phase_rad=0.5)


def spacecraft(seed: int) -> Scene:
    """A hub with two wheels, a tank, fixed masses and loads, and chains on it that turn, slide and turn twice."""
    rng = np.random.default_rng(seed)
    builder = SceneBuilder("spacecraft")

    def body(name: str, mass: float) -> None:
        nodes = {"n": rng.normal(size=3) * 0.4}
        builder.rigid_body(name, mass=mass, com=rng.normal(size=3) * 0.2, inertia=inertia(rng, mass), nodes=nodes)
        builder.marker(name, name, node="n", offset=rng.normal(size=3) * 0.2)

    def placed() -> dict:
        return {
            "parent_node": "n", "parent_position": rng.normal(size=3) * 0.3, "child_position": rng.normal(size=3) * 0.3,
            "parent_quaternion": quaternion_of(rotation(rng)), "child_quaternion": quaternion_of(rotation(rng)),
        }  # fmt: skip

    turn = {"stiffness": 3.0, "rest": 0.2, "damping": 0.3, "torque": WAVE}
    slide = {"stiffness": 8.0, "rest": -0.1, "damping": 0.2, "force": WAVE}
    body("hub", 30.0)
    builder.free("flight", "ground", "hub", **(placed() | {"parent_node": "origin"}))
    for name, mass in {"panel": 3.0, "flap": 1.0, "dish": 2.0, "feed": 0.5, "drawer": 2.0, "box": 1.0}.items():
        body(name, mass)
    builder.revolute("root", "hub", "panel", axis=unit(rng), **turn, **placed())
    builder.revolute("fold", "panel", "flap", axis=unit(rng), **turn, **placed())
    builder.universal("mount", "hub", "dish", first=angular(**turn), second=angular(**turn), **placed())
    builder.weld("bolt", "dish", "feed", **placed())
    builder.prismatic("rail", "hub", "drawer", axis=unit(rng), **slide, **placed())
    builder.weld("clamp", "hub", "box", **placed())
    for name, carrier in (("one", "hub"), ("two", "box")):
        builder.wheel(
            name, carrier, node="n", offset=rng.normal(size=3) * 0.2, axis=unit(rng), mass=1.5, axial_inertia=0.03,
            transverse_inertia=0.02, friction=0.01, torque=WAVE,
        )  # fmt: skip
    springs = [linear(stiffness=15.0, rest=0.05, damping=0.4), linear(stiffness=20.0)]
    builder.point_mass("tank", "hub", node="n", mass=2.0, directions=list(rotation(rng)[:2]), coordinates=springs)
    builder.point_mass("ballast", "flap", mass=0.3, offset=rng.normal(size=3))
    builder.force("push", "hub", node="n", direction=unit(rng), function=WAVE)
    builder.force("thruster", "box", node="n", direction=unit(rng), function=WAVE, frame="node")
    builder.torque("twist", "hub", direction=unit(rng), function=WAVE)
    builder.torque("turning", "hub", node="n", direction=unit(rng), function=WAVE, frame="node")
    return randomise(builder.scene(), rng)


def compare(ours: Snapshot, theirs: Snapshot) -> None:
    for kind in ("position", "velocity", "acceleration"):
        pair = ([getattr(seen.markers[name], kind) for name in ours.markers] for seen in (ours, theirs))
        mine, other = map(np.array, pair)
        assert np.abs(mine - other).max() <= 1e-10 * np.abs(other).max(), kind
    for name, marker in ours.markers.items():
        assert abs(marker.quaternion @ theirs.markers[name].quaternion) == pytest.approx(1.0, abs=1e-12)
    for kind, energy in ours.energy.items():
        assert energy == pytest.approx(theirs.energy[kind], rel=1e-10, abs=1e-10), kind
    assert ours.momentum == pytest.approx(theirs.momentum, rel=1e-10, abs=1e-10 * np.abs(theirs.momentum).max())


@pytest.fixture(scope="module", autouse=True)
def _installed() -> None:
    pytest.importorskip("Basilisk")


@pytest.mark.parametrize("seed", range(4))
def test_a_spacecraft_with_everything_accelerates_as_pinocchios(seed: int) -> None:
    scene = spacecraft(seed)
    assert BASILISK.supports(scene).kind == "exact", BASILISK.supports(scene).reason
    compare(BASILISK.compile(scene).evaluate(), engine("pinocchio").compile(scene).evaluate())


def test_a_run_agrees_with_pinocchios_and_balances_its_work() -> None:
    scene = spacecraft(7)
    run = Run(np.linspace(0.0, 2.0, 11))
    effort = Effort("tolerance", 1e-11, "DOP853")
    ours, theirs = (engine(name).compile(scene).simulate(run, effort) for name in ("basilisk", "pinocchio"))
    assert ours.status == "finished", ours.message
    for name, path in theirs.markers.items():
        assert ours.markers[name].position == pytest.approx(path.position, abs=1e-9), name
        assert ours.markers[name].velocity == pytest.approx(path.velocity, abs=1e-8), name
    total = sum(ours.energy.values())
    assert ours.work is not None and np.ptp(total) > 0.1
    assert total - ours.work == pytest.approx(np.full(11, total[0]), abs=1e-8 * np.abs(total).max())


def test_it_turns_through_the_attitudes_at_which_its_parameters_are_singular() -> None:
    """A sphere turns seven times about an oblique axis; Rodrigues parameters are infinite after one turn."""
    w = np.array([3.0, 6.0, -2.0])
    scene = (
        SceneBuilder("ball")
        .rigid_body("body", mass=1.0, inertia=(0.2, 0.2, 0.2))
        .free("flight", "ground", "body", angular_velocity=w)
        .marker("tip", "body", offset=(0.0, 0.3, 1.0))
        .scene()
    )
    run = Run(np.linspace(0.0, 2.0 * np.pi, 29))
    path = BASILISK.compile(scene).simulate(run, BASILISK.efforts(scene)[-1])
    half = np.linalg.norm(w) * run.times / 2.0
    expected = np.column_stack([np.cos(half), np.outer(np.sin(half), w / np.linalg.norm(w))])
    same = np.abs(np.sum(expected * path.markers["tip"].quaternion, axis=1))
    assert same == pytest.approx(np.ones(29), abs=1e-11)


def hub() -> SceneBuilder:
    flying = SceneBuilder("hub").rigid_body("hub", mass=5.0, inertia=(1, 1, 1)).free("flight", "ground", "hub")
    return flying.marker("hub", "hub").rigid_body("arm", mass=1.0, inertia=(0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (hub().revolute("shaft", "hub", "arm", prescribed=WAVE), '"shaft" is prescribed'),
        (hub().spherical("ball", "hub", "arm"), '"ball": on Basilisk\'s hub parts turn or slide'),
        (hub().cylindrical("sleeve", "hub", "arm", axis=(0, 0, 1)), "a chain both turns and slides"),
        (hub().free("second", "ground", "arm"), '"second" hangs on nothing'),
        (
            hub().revolute("shaft", "hub", "arm").force("tug", "arm", direction=(1, 0, 0), function=WAVE),
            'load "tug" does not act on the hub',
        ),
        (
            hub().revolute("shaft", "hub", "arm").wheel(
                "spin", "arm", axis=(0, 0, 1), mass=0.1, axial_inertia=0.01, transverse_inertia=0.01
            ),
            'wheel "spin" is not in the hub',
        ),
    ],
)  # fmt: skip
def test_what_basilisk_refuses_is_named(scene: SceneBuilder, reason: str) -> None:
    support = BASILISK.supports(scene.scene())
    assert support.kind == "no" and reason in support.reason
    with pytest.raises(ValueError, match="scene"):
        BASILISK.compile(scene.scene())


def test_gravity_a_fixed_hub_and_branches_are_refused() -> None:
    flying = hub().revolute("shaft", "hub", "arm").scene()
    assert BASILISK.supports(flying).kind == "exact"
    assert "planets" in BASILISK.supports(replace(flying, gravity_m_s2=(0.0, 0.0, -9.81))).reason
    on_ground = SceneBuilder("rotor").rigid_body("arm", mass=1.0, inertia=(1, 1, 1)).revolute("shaft", "ground", "arm")
    assert '"shaft" is not a free hinge' in BASILISK.supports(on_ground.scene()).reason
    fork = hub().revolute("shaft", "hub", "arm")
    for name in ("left", "right"):
        fork.rigid_body(name, mass=1.0, inertia=(0.1, 0.1, 0.1)).revolute(f"to {name}", "arm", name)
    assert "carries two others" in BASILISK.supports(fork.scene()).reason
