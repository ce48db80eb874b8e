"""What is DART's own: free joints on turned frames, commands, breaks in time, refusals, warnings, divergence."""

import sys

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import Effort, EngineMissing, Run
from crosscheck.engines.registry import engine
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Function, Pulse, SpinUp
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.random_scenes import random_scene

pytest.importorskip("dartpy")

DART = engine("dart")
FINE = Effort("tolerance", 1e-12, "DOP853")


def pushed(function: Function) -> Scene:
    return (
        SceneBuilder("pushed")
        .rigid_body("body", mass=2.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("rail", "ground", "body", axis=(1, 0, 0))
        .force("push", "body", direction=(1, 0, 0), function=function)
        .marker("body", "body")
        .scene()
    )


@pytest.mark.parametrize("seed", range(3))
def test_runs_agree_with_pinocchios(seed: int) -> None:
    """Free and ball joints on turned frames of turning bodies, where DART's speeds have axes of their own."""
    rng = np.random.default_rng(300 + seed)
    scene = random_scene(rng, ("free", "revolute", "free", "spherical", "prismatic", "universal"), driven=True)
    run = Run(np.linspace(0.0, 1.0, 6))
    theirs, ours = (engine(name).compile(scene).simulate(run, FINE) for name in ("pinocchio", "dart"))
    assert ours.status == "finished", ours.message
    for name, path in theirs.markers.items():
        assert ours.markers[name].position == pytest.approx(path.position, abs=1e-9), name
        assert ours.markers[name].velocity == pytest.approx(path.velocity, abs=1e-8), name
    for name, load in theirs.loads.items():
        assert ours.loads[name] == pytest.approx(load, rel=1e-7, abs=1e-7), name
    for name, drive in theirs.drives.items():
        assert ours.drives[name] == pytest.approx(drive, rel=1e-7, abs=1e-7), name
    assert ours.work == pytest.approx(theirs.work, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("angle", [0.0, 1e-6, 2e-5, 3e-4, 9e-4, 1e-2, 1.0, 3.1])
def test_small_rotations_are_as_exact_as_large_ones(angle: float) -> None:
    """DART's exponential map is off by a sixth of the cube of a small angle: by 5e-12 at 3e-4 rad."""
    axis = np.array([0.6, -0.64, 0.48])
    turned = {"quaternion": [np.cos(angle / 2.0), *(np.sin(angle / 2.0) * axis)], "angular_velocity": (1.0, 2.0, 3.0)}
    builder = SceneBuilder("turned")
    for name in ("free", "ball"):
        builder.rigid_body(name, mass=2.0, com=(0.1, 0.2, -0.3), inertia=(0.1, 0.2, 0.25))
        builder.marker(name, name, offset=(10.0, 10.0, 10.0))
    scene = builder.free("free", "ground", "free", **turned).spherical("ball", "ground", "ball", **turned).scene()
    ours, theirs = (engine(name).compile(scene).evaluate() for name in ("dart", "pinocchio"))
    for name, marker in theirs.markers.items():
        assert ours.markers[name].position == pytest.approx(marker.position, abs=5e-14), name
        assert ours.markers[name].acceleration == pytest.approx(marker.acceleration, abs=1e-11), name


def test_a_pulse_between_samples_costs_no_accuracy() -> None:
    """F/m = 3 for 0.3 <= t < 0.7: v = 1.2, x(1) = 0.5*3*0.4^2 + 1.2*0.3."""
    path = DART.compile(pushed(Pulse(value=6.0, start_s=0.3, duration_s=0.4))).simulate(
        Run(np.array([0.0, 0.5, 1.0])), FINE
    )
    assert path.markers["body"].velocity[:, 3] == pytest.approx([0.0, 0.6, 1.2], abs=1e-12)
    assert path.markers["body"].position[:, 0] == pytest.approx([0.0, 0.06, 0.24 + 0.36], abs=1e-12)


def test_prescribed_spin_up_is_followed_and_its_drive_known() -> None:
    scene = (
        SceneBuilder("spin")
        .rigid_body("arm", mass=1.0, com=(1.0, 0, 0), inertia=(0.1, 0.1, 0.1))
        .revolute("drive", "ground", "arm", prescribed=SpinUp(rate=4.0, duration_s=4.0))
        .marker("tip", "arm", offset=(1, 0, 0))
        .scene()
    )
    path = DART.compile(scene).simulate(Run(np.array([0.0, 2.0, 5.0])), FINE)
    angle = 4.0 / 4.0 * (2.0**2 / 2 - 2 * (4.0 / (2 * np.pi)) ** 2), 4.0 * (5.0 - 2.0)
    exact = np.column_stack([np.cos(angle), np.sin(angle)])
    assert path.markers["tip"].position[1:, :2] == pytest.approx(exact, abs=1e-12)
    assert path.drives["drive"] == pytest.approx(np.array([[0.0], [1.1 * 2.0], [0.0]]), abs=1e-12)


def test_loads_do_not_pile_up() -> None:
    """DART keeps external forces until they are cleared: the second look at a state must be as the first."""
    model = DART.compile(pushed(Constant(value=6.0)))
    assert [model.evaluate().markers["body"].acceleration[3] for _ in range(3)] == [3.0, 3.0, 3.0]


def test_divergence_is_a_status_with_the_good_part_kept() -> None:
    scene = pushed(Constant(value=1.0))
    rail = scene.hinges[0]
    runaway = replace(rail, translation=replace(rail.translation, damping_Ns_m=-2000.0))
    coarse = Effort("tolerance", 1e-4, "DOP853")
    path = DART.compile(replace(scene, hinges=(runaway,))).simulate(Run(np.linspace(0.0, 2.0, 21)), coarse)
    assert path.status == "diverged" and "t = " in path.message
    assert 1 <= len(path.times) < 21


def test_next_to_massless_bodies_bring_no_warnings_to_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    """A universal hinge has a body between its turns, a point mass no inertia, the wheel no mass."""
    scene = (
        SceneBuilder("light")
        .rigid_body("body", mass=1.0, inertia=(0.1, 0.1, 0.2))
        .universal("cross", "ground", "body")
        .point_mass("bead", "body", mass=0.1, directions=[(1, 0, 0)])
        .wheel("wheel", "body", axis=(0, 0, 1), mass=0.0, axial_inertia=0.02, transverse_inertia=0.01)
        .marker("body", "body")
        .scene()
    )
    DART.compile(scene).evaluate()
    out, err = capfd.readouterr()
    assert "arning" not in out + err


def test_what_dart_refuses_is_named() -> None:
    rods = SceneBuilder("loop").rigid_body("rod", mass=1.0, inertia=(1, 1, 1)).revolute("pin", "ground", "rod")
    scene = rods.closure("bolt", "spherical", "ground", "rod").marker("rod", "rod").scene()
    support = DART.supports(scene)
    assert support.kind == "no" and 'closure "bolt": DART closes loops by impulses' in support.reason
    with pytest.raises(ValueError, match="by impulses"):
        DART.compile(scene)


def test_a_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dartpy", None)
    with pytest.raises(EngineMissing, match="pip install dartpy"):
        engine("dart").version()
