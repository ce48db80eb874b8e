"""How fast a scene goes, against formulas; and default steps, which follow that and the run's duration."""

import numpy as np
import pytest

from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort
from crosscheck.engines.functions_of_time import fastest_change
from crosscheck.engines.pace import Pace, fastest_mode, pace
from crosscheck.engines.registry import engine
from crosscheck.engines.steps import FINE, LEAST, MOST, TURN, VIBRATION, ladder
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene

G, MASS, ARM, OWN = 9.81, 2.0, 0.7, 0.05
ABOUT_PIVOT = OWN + MASS * ARM**2


def _arm(builder: SceneBuilder) -> SceneBuilder:
    return builder.rigid_body("arm", mass=MASS, com=(ARM, 0.0, 0.0), inertia=(OWN, OWN, OWN))


@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, 2.0])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (30.0, -20.0, 5.0)])
def test_a_pendulum_swings_as_fast_wherever_it_begins(angle: float, place: tuple[float, float, float]) -> None:
    scene = _arm(SceneBuilder("pendulum", gravity=(0.0, 0.0, -G)))
    scene = scene.revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0), angle=angle, parent_position=place).scene()
    assert pace(scene, 1.0) == pytest.approx((np.sqrt(MASS * G * ARM / ABOUT_PIVOT), 0.0, 0.0))


def test_a_free_body_has_its_turning_rate_and_no_pendulum() -> None:
    spin = (0.0, 3.0, 4.0)
    scene = _arm(SceneBuilder("thrown", gravity=(0.0, 0.0, -G))).free("loose", "ground", "arm", angular_velocity=spin)
    assert pace(scene.scene(), 1.0) == pytest.approx((5.0, 0.0, 0.0))


def _chained() -> Scene:
    """Two carriages in a row on springs, with masses 1 and 3 kg and stiffnesses 5 and 7 N/m."""
    return (
        SceneBuilder("carriages")
        .rigid_body("first", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("second", mass=3.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("near", "ground", "first", axis=(0.6, 0.0, 0.8), stiffness=5.0)
        .prismatic("far", "first", "second", axis=(0.6, 0.0, 0.8), stiffness=7.0)
        .scene()
    )


def test_springs_in_a_chain_have_its_highest_frequency() -> None:
    M, K = np.array([[4.0, 3.0], [3.0, 3.0]]), np.diag([5.0, 7.0])
    highest = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).max())
    assert pace(_chained(), 1.0).elastic == pytest.approx(highest, rel=1e-9)


def test_the_mass_matrix_is_the_native_one() -> None:
    """By the highest frequency of springs on a ball joint and a hinge that is turned and moved."""
    from crosscheck.engines.native import NativeEngine

    scene = (
        _arm(SceneBuilder("tree", gravity=(0.0, 0.0, -G)))
        .rigid_body("hand", mass=0.7, com=(0.1, 0.2, -0.1), inertia=(0.02, 0.03, 0.04))
        .spherical("shoulder", "ground", "arm", quaternion=(0.8, 0.6, 0.0, 0.0), stiffness=3.0)
        .revolute("wrist", "arm", "hand", axis=(0.0, 0.6, 0.8), angle=0.4, parent_position=(1, 0.1, 0), stiffness=11.0)
        .scene()
    )
    system = NativeEngine().compile(scene)._system
    M = system.mass_matrix(system.initial_state)
    highest = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, np.diag([3.0, 3.0, 3.0, 11.0]))).real.max())
    assert pace(scene, 1.0).elastic == pytest.approx(highest, rel=1e-9)


def _joined() -> SceneBuilder:
    """The same carriages side by side on rails along x, without springs."""
    return (
        SceneBuilder("carriages")
        .rigid_body("first", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("second", mass=3.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("left", "ground", "first", axis=(1.0, 0.0, 0.0))
        .prismatic("right", "ground", "second", axis=(1.0, 0.0, 0.0), parent_position=(2.0, 0.0, 0.0))
    )


def test_connectors_count_by_what_they_join() -> None:
    """6 N/m and 9 N s/m between masses of 1 and 3 kg: poles of sqrt(6 * 4/3) and 9 * 4/3 rad/s."""
    sprung = _joined().spring_damper("spring", "first", "second", stiffness=6.0).scene()
    assert pace(sprung, 1.0).elastic == pytest.approx(np.sqrt(8.0), rel=1e-9)
    damped = _joined().spring_damper("damper", "first", "second", stiffness=6.0, damping=9.0).scene()
    assert pace(damped, 1.0).elastic == pytest.approx(12.0, rel=1e-9)
    across = _joined().spring_damper("across", "ground", "second", position_a=(2.0, 5.0, 0.0), stiffness=6.0).scene()
    assert pace(across, 1.0).elastic == pytest.approx(0.0, abs=1e-9)
    both = np.diag([5.0, 5.0, 5.0, 6.0, 70.0, 70.0])
    bushed = _joined().bushing("bushing", "first", "second", stiffness=both).scene()
    assert pace(bushed, 1.0).elastic == pytest.approx(np.sqrt(8.0), rel=1e-9)


def test_a_bushing_turns_with_its_frame_about_its_point() -> None:
    """A hinged arm held at its mass centre by stiffness across it alone: k arm² about the pivot, at any angle."""
    stiffness = np.diag([0.0, 0.0, 0.0, 0.0, 0.0, 40.0])
    for angle in (0.0, 0.8):
        held = _arm(SceneBuilder("held")).revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0), angle=angle)
        turned = (np.cos(angle / 2.0), 0.0, np.sin(angle / 2.0), 0.0)
        place = (ARM * np.cos(angle), 0.0, -ARM * np.sin(angle))
        held.bushing(
            "hold", "ground", "arm", stiffness=stiffness, position_a=place, quaternion_a=turned, position_b=(ARM, 0, 0)
        )
        assert pace(held.scene(), 1.0).elastic == pytest.approx(np.sqrt(40.0 * ARM**2 / ABOUT_PIVOT), rel=1e-9)


def test_a_spring_and_a_stop_along_a_hinge() -> None:
    scene = _arm(SceneBuilder("stopped")).revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0))
    law = {"table": (-1.0, 0.0, 1.0), "loads": (-1.0, 0.0, 5.0)}
    scene.angular_spring("stop", "pivot", **law, upper=1.0, stop_stiffness=90.0)
    assert pace(scene.scene(), 1.0).elastic == pytest.approx(np.sqrt(95.0 / ABOUT_PIVOT), rel=1e-9)


def test_a_driven_link_without_mass_has_its_rate_alone() -> None:
    scene = (
        SceneBuilder("massless", gravity=(0.0, 0.0, -G))
        .rigid_body("link", mass=0.0, inertia=(0.0, 0.0, 0.0))
        .revolute("pivot", "ground", "link", axis=(0.0, 1.0, 0.0), prescribed=Ramp(rate=-3.0))
        .scene()
    )
    assert pace(scene, 1.0) == (3.0, 0.0, 0.0)


def test_what_does_not_swing_changes_at_no_frequency() -> None:
    for function in (Constant(value=3.0), Ramp(rate=2.0), Pulse(value=1.0, start_s=0.0, duration_s=1.0)):
        assert fastest_change(function) == 0.0


def test_profiles_change_at_the_frequency_of_a_sine_like_them() -> None:
    times = np.linspace(0.0, 6.0, 200)
    table = Table(times_s=tuple(times), values=tuple(4.0 + 0.1 * np.sin(5.0 * times)))
    assert fastest_change(table) == pytest.approx(5.0, rel=1e-3)
    assert fastest_change(Table(times_s=tuple(times), values=(1.0,) * 200)) == 0.0
    assert fastest_change(Sine(amplitude=9.0, angular_frequency_rad_s=-3.0)) == 3.0
    step = SmoothStep(start_value=0.0, end_value=1.0, start_s=5.0, duration_s=2.0)
    assert (fastest_change(step), fastest_change(step, 4.0)) == (np.pi, 0.0)
    assert fastest_change(SpinUp(rate=1.0, duration_s=2.0)) == np.pi


def test_the_highest_mode_of_points() -> None:
    """The third mode has stiffness and no mass, so it has no frequency."""
    translation, rotation = np.zeros((2, 3, 3)), np.zeros((2, 3, 3))
    translation[0, 1, 0], rotation[1, 2, 1] = 2.0, 1.0  # modal masses 3 * 4 and 0.5
    inertia, mass = np.array([np.eye(3), 0.5 * np.eye(3)]), np.array([3.0, 1.0])
    assert fastest_mode(mass, translation, inertia, rotation, np.diag([12.0, 8.0, 1.0])) == pytest.approx(4.0)


ENGINES = ("native-generalised-alpha", "mujoco", "exudyn")
PER_PERIOD = 20  # steps by which a period is resolved


def pendulum() -> tuple[Scene, float]:
    """With its frequency (Hz), of a point mass on an arm of 1 m."""
    scene = (
        SceneBuilder("pendulum", gravity=(0.0, 0.0, -9.81))
        .rigid_body("bob", mass=1.0, com=(1.0, 0.0, 0.0), inertia=(1e-6, 1e-6, 1e-6))
        .revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0))
    )
    return scene.scene(), np.sqrt(9.81) / (2.0 * np.pi)


def oscillator(hertz: float) -> tuple[Scene, float]:
    scene = (
        SceneBuilder("oscillator")
        .rigid_body("mass", mass=2.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("rail", "ground", "mass", axis=(1.0, 0.0, 0.0), stiffness=2.0 * (2.0 * np.pi * hertz) ** 2)
    )
    return scene.scene(), hertz


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("duration_s", [1e-3, 1.0, 1000.0])
@pytest.mark.parametrize("made", [pendulum(), oscillator(1.0), oscillator(1e4)], ids=["pendulum", "1 Hz", "10 kHz"])
def test_steps_resolve_the_fastest_motion(name: str, duration_s: float, made: tuple[Scene, float]) -> None:
    scene, hertz = made
    steps = [effort.value for effort in CheckedEngine(engine(name), duration_s=duration_s).efforts(scene)]
    assert duration_s / steps[0] >= 200 and duration_s / steps[-1] <= MOST * (1.0 + 1e-12)
    assert np.allclose(np.divide(steps[:-1], steps[1:]), 2.0, rtol=1e-15)
    if hertz * duration_s * PER_PERIOD <= MOST:  # 10 kHz over 1000 s is beyond every default
        assert hertz * steps[-1] <= 1.0 / PER_PERIOD


def test_more_is_taken_where_it_costs_little() -> None:
    """About 10 s of something slow: the fine angle of whatever is fastest, be it a mode."""
    for slow in (Pace(2.0, 0.0), Pace(0.0, 2.0), Pace(0.0, 0.0, 2.0)):
        assert FINE / 5.0 < 2.0 * ladder("rk4", slow, 10.0, 3)[0].value <= FINE


def test_modes_are_stepped_over_where_they_would_cost_too_much() -> None:
    stiff = ladder("rk4", Pace(1.0, 0.0, 1e6), 10.0, 3, usual=5000)
    assert [effort.value for effort in stiff] == [2e-3, 1e-3, 5e-4]


def test_motion_and_springs_are_followed_whatever_it_costs() -> None:
    assert ladder("rk4", Pace(1e3, 0.0), 10.0, 3)[0].value <= TURN / 1e3
    assert ladder("rk4", Pace(0.0, 1e4), 10.0, 3)[0].value <= VIBRATION / 1e4


def test_what_does_not_move_takes_the_least_steps() -> None:
    assert ladder("rk4", Pace(0.0, 0.0), LEAST * 0.5, 3) == tuple(Effort("step", h, "rk4") for h in (0.5, 0.25, 0.125))


class Older:
    """An engine of the first contract: its efforts know no duration."""

    name = "older"

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return tuple(Effort("step", value, "rk4") for value in (4e-3, 2e-3, 1e-3))


def test_an_engine_without_durations_is_asked_as_before() -> None:
    scene, _ = pendulum()
    assert CheckedEngine(Older(), duration_s=1e3).efforts(scene)[0].value == 4e-3  # type: ignore[arg-type]
