"""Sampled loops: closed forms, the nonlinear loop over a period, other routes to margins, and what is refused."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm
from typer.testing import CliRunner

import flexmb as fm
from crosscheck.stability.maps.sampled_control import delayed, panel_radius, radius, rigid_radius, with_panel
from flexmb.cli import app
from flexmb.linear.sampled_loop import LiftedLoop
from flexmb.scene.shapes import beam_section
from flexmb.typing import Real
from tests.flexmb.control.scenes import INERTIA, pendulum, rotor
from tests.flexmb.control.test_closed_chains import DAMPING, SAMPLED, STIFFNESS, windows
from tests.flexmb.linear.sampled_period import NonlinearPeriod

EXACT = 1e-12
DIFFERENCES = 1e-7  # of the largest entry of a row: differences of the nonlinear loop
SATELLITE = fm.load_scene(Path(__file__).parents[3] / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
KP, KD, T = 3.0, 4.0, 0.2


def held(kp: float = KP, kd: float = KD, period: float | None = T, delay: float = 0.0, **more: Any) -> fm.Scene:
    """A double integrator under PD control."""
    gains = ((-kp, -kd),)
    return rotor(
        fm.StateSpace(name="law", inputs=("angle", "rate"), D=gains, period_s=period, delay_s=delay, **more)
    )  # fmt: skip


def many(*more: Any) -> fm.SceneBuilder:
    """A satellite on an axis with a panel and a wheel, at rest: controllers of two rates, in series, delayed by more
    than a period, with offsets, beside a continuous one; one reads an acceleration that it changes itself."""
    section = beam_section(E=7e10, G=2.7e10, A=2e-4, Iy=2e-9, Iz=2e-9, rho=2700)
    modes = fm.Modes(count=2, families=("bending_y",), damping_ratio=0.005)
    return (
        fm.SceneBuilder("many")
        .rigid_body("hub", mass=100.0, inertia=(17.0, 17.0, 17.0))
        .beam("panel", length=4.0, elements=8, section=section, modes=modes)
        .revolute("attitude", "ground", "hub", axis=(0, 0, 1), torque=fm.ControlSignal(source="aim"))
        .weld("yoke", "hub", "panel", parent_position=(0.5, 0, 0))
        .wheel("wheel", "hub", axis=(0, 0, 1), mass=5.0, axial_inertia=0.05, transverse_inertia=0.03,
               torque=fm.ControlSignal(source="limit", gain=-1.0))
        .marker("tip", "panel", node="tip")
        .torque("jets", "hub", direction=(0, 0, 1), function=fm.ControlSignal(source="lag"))
        .force("push", "hub", direction=(0, 1, 0), frame="node", function=fm.ControlSignal(source="feel"))
        .sense_coordinate("angle", "attitude").sense_coordinate("rate", "attitude", quantity="rate")
        .sense_coordinate("shape", "panel.modes")
        .sense_marker("acceleration", "tip", "acceleration", frame="marker")
        .state_space("filter", ["rate"], A=[[0.6]], B=[[0.4]], C=[[3.0]], D=[[0.7]], period=0.05, offset=0.02)
        .gain_table("schedule", ["angle", "filter"], points=[-1.0, 2.0], values=[-2.0, -9.0], period=0.05, offset=0.02,
                    delay=0.03)
        .saturation("limit", ["schedule"], lower=-3.0, upper=3.0, period=0.05, offset=0.04)
        .pid("aim", "angle", kp=40.0, ki=9.0, kd=60.0, filter=0.2, lower=-90, upper=90, period=0.1, delay=0.13)
        .state_space("lag", ["shape", "aim"], A=[[-5.0]], B=[[5.0, 2.0, 0.3]], C=[[1.0]])
        .state_space("feel", ["acceleration[1]", "lag"], D=[[-0.3, 0.2]], period=0.1, offset=0.07)
        .add(*more)
    )  # fmt: skip


# ---- Closed forms


@pytest.mark.parametrize(("kp", "kd"), [(KP, KD), (0.5, 0.3), (2.0, 7.9), (1.0, 8.1), (40.0, 1.0)])
def test_a_sampled_pd_on_a_double_integrator_has_its_multipliers(kp: float, kd: float) -> None:
    """z^2 - (2 - a/2 - b) z + 1 + a/2 - b = 0, a = kp T^2 / J, b = kd T / J."""
    model, a, b = fm.linearize_sampled(held(kp, kd)), kp * T**2 / INERTIA, kd * T / INERTIA
    expected = np.roots([1.0, -(2.0 - 0.5 * a - b), 1.0 + 0.5 * a - b])
    assert np.abs(np.sort_complex(model.multipliers) - np.sort_complex(expected)).max() < EXACT
    assert model.stable == (np.abs(expected).max() < 1.0)
    assert model.stability.verdict == ("asymptotically stable" if model.stable else "unstable")
    assert [name for name, _ in model.states] == ["pivot.rotation", "pivot.rotation.rate"]
    assert model.free == model.saturated == ()


def test_its_margins_are_those_of_its_closed_form() -> None:
    """On the circle L = -(a c + 2 i b s) exp(-i w T / 2) / (4 s^2), s and c of w T / 2: it is real only at half the
    frequency of the samples, where it is -b / 2, and 16 s^4 + (a^2 - 4 b^2) s^2 = a^2 where its size is 1."""
    a, b = KP * T**2 / INERTIA, KD * T / INERTIA
    square = np.max(np.roots([16.0, a**2 - 4.0 * b**2, -(a**2)]))
    s, c = np.sqrt(square), np.sqrt(1.0 - square)
    omega = 2.0 * np.arcsin(s) / T
    phase = np.angle((a * c + 2j * b * s) * np.exp(-0.5j * omega * T))
    loop = fm.linearize_sampled(held()).opened("law")
    (crossing,) = loop.gain_crossings
    assert crossing.omega == pytest.approx(omega, rel=EXACT)
    assert loop.phase_margin == pytest.approx(phase, rel=1e-11)
    assert loop.delay_margin == pytest.approx(phase / omega, rel=1e-11)
    assert [each.omega for each in loop.phase_crossings] == [np.pi / T]
    assert loop.gain_margin == pytest.approx(2.0 / b, rel=EXACT)
    assert loop.gain_reduction == 0.0
    at = np.array([0.3, 2.0, 9.0])
    half = 0.5 * at * T
    L = -(a * np.cos(half) + 2j * b * np.sin(half)) * np.exp(-1j * half) / (4.0 * np.sin(half) ** 2)
    assert np.abs(loop(at) - L).max() < 1e-10 * np.abs(L).max()


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.0, 2.7])
@pytest.mark.parametrize("sampling", [0.2, 1.4])
def test_delays_are_those_of_an_independent_model(sampling: float, delay: float) -> None:
    """That of the stability map, after Astrom and Wittenmark."""
    found = np.abs(fm.linearize_sampled(delayed(sampling, delay)).multipliers[0]) - 1.0
    assert found == pytest.approx(float(rigid_radius(np.array(sampling), np.array(delay))), abs=EXACT)


@pytest.mark.parametrize(("rate", "bandwidth"), [(4.0, 0.3), (8.0, 1.0), (20.0, 3.0), (3.5, 2.0)])
def test_a_panel_beside_the_loop_is_that_of_independent_elements(rate: float, bandwidth: float) -> None:
    """What elements and exact integrals differ by: some 1e-6."""
    found = np.abs(fm.linearize_sampled(with_panel(rate, bandwidth)).multipliers[0]) - 1.0
    assert found == pytest.approx(float(panel_radius(np.array(rate), np.array(bandwidth))), abs=5e-6)


def test_a_longer_period_is_a_power() -> None:
    one, three = (fm.linearize_sampled(many().scene(), times * 0.1) for times in (1, 3))
    assert three.period == pytest.approx(0.3)
    power = np.linalg.matrix_power(one.A, 3)
    assert np.abs(three.A - power).max() < EXACT * np.abs(power).max()
    assert np.abs(np.sort(np.abs(three.multipliers)) - np.sort(np.abs(one.multipliers) ** 3)).max() < 1e-9


def test_without_sampled_controllers_it_holds_the_loads() -> None:
    scene = rotor(fm.StateSpace(name="law", inputs=("angle",), A=((-2.0,),), B=((1.0,),), C=((-3.0,),)))
    model, continuous = fm.linearize_sampled(scene, T), fm.linearize(scene)
    assert np.abs(model.A - expm(continuous.A * T)).max() < EXACT
    assert model.B[:2, 0] == pytest.approx([0.5 * T**2 / INERTIA, T / INERTIA], rel=0.1)
    assert model.loop_names == ()
    with pytest.raises(ValueError, match="no loop to draw"):
        model.plot("nowhere.png")


# ---- The nonlinear loop


def differences(scene: fm.Scene, model: fm.SampledModel, **integrals: float) -> Real:
    motion = fm.linearize(fm.open_loop(scene)).motion
    start = model.loop.start(model.period)
    return NonlinearPeriod(scene, model, start, motion, integrals).matrix()


def apart(one: Real, other: Real) -> float:
    """Largest difference, over the largest entry of its row."""
    return float(np.max(np.abs(one - other) / np.abs(one).max(axis=1, keepdims=True)))


@pytest.mark.parametrize("scene", [many().scene(), msgspec.structs.replace(SATELLITE, events=())],
                         ids=["many controllers", "deploy_and_slew"])  # fmt: skip
def test_the_model_is_the_derivative_of_a_period_of_the_nonlinear_loop(scene: fm.Scene) -> None:
    model = fm.linearize_sampled(scene)
    assert apart(model.A, differences(scene, model)) < DIFFERENCES


def test_it_is_where_an_integral_holds_the_loads() -> None:
    """A pendulum held away from where it hangs, with a delay: without the integral's torque A is another one."""
    law = fm.Pid(
        name="law", inputs=("angle",), kp=90.0, ki=60.0, kd=30.0, setpoint=0.4, period_s=0.02, delay_s=0.03
    )  # fmt: skip
    scene = pendulum(law, torque=fm.ControlSignal(source="law")).scene()
    model = fm.linearize_sampled(scene)
    torque = fm.compile(fm.open_loop(scene)).inverse_dynamics(model.state, np.zeros(2))[0]
    right = differences(scene, model, law=float(torque))
    assert apart(model.A, right) < DIFFERENCES
    assert apart(fm.linearize_sampled(scene, state=model.state).A, right) > 1e3 * DIFFERENCES


def test_a_wrong_hold_and_a_missed_delay_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Negative controls: the effect of what is held by the rule of Euler; a model of other delays."""
    scene = many().scene()
    missed = scene.with_values({"aim.delay_s": 0.125})
    model = fm.linearize_sampled(scene)
    right = differences(scene, model)
    assert apart(fm.linearize_sampled(missed).A, right) > 1e4 * DIFFERENCES
    exact = LiftedLoop.flow

    def of_euler(self: LiftedLoop, h: float) -> tuple[Real, Real]:
        moved, driven = exact(self, h)
        outputs = [i for places in self.held.places.values() for i in places]
        moved[:, outputs] = np.eye(len(moved))[:, outputs] + h * self.held.A[:, outputs]
        return moved, driven

    monkeypatch.setattr(LiftedLoop, "flow", of_euler)
    assert apart(fm.linearize_sampled(scene).A, right) > 1e4 * DIFFERENCES


def test_outputs_after_a_period_are_those_of_a_run() -> None:
    """Of the satellite, with a small rotation at the start: its controller has put out nothing yet."""
    scene, small = msgspec.structs.replace(SATELLITE, events=()), 1e-7
    model = fm.linearize_sampled(scene)
    names, said = [name for name, _ in model.states], [name for name, _ in model.outputs]
    x = np.zeros(len(names))
    x[names.index("orbit.rotation.y")] = small
    q, layout = model.state.q.copy(), fm.compile(scene)
    place = layout.coordinate("orbit")
    q[place.start + 3 : place.start + 7] += 0.5 * small * np.array([0.0, 0.0, 1.0, 0.0])
    still = {"orbit": q[place], "orbit.speeds": np.zeros(6)}
    still |= {f"{name}.speed": 0.0 for name in ("wheel_x", "wheel_y", "wheel_z")}
    run = fm.simulate(scene, 3.0, samples=31, rtol=1e-12, atol=1e-17, state=layout.state(q, model.state.u))
    for gyro in range(3):
        expected, now = [], x
        for _ in run.t:
            expected.append(model.C[said.index(f"gyro[{gyro}]")] @ now)
            now = model.A @ now
        assert np.abs(run.signals["gyro"][:, gyro] - expected).max() < 1e-6 * small


# ---- Margins


@pytest.mark.parametrize("scene", [SATELLITE, many().scene()], ids=["deploy_and_slew", "many"])
def test_every_loop_returns_what_its_opening_changes(scene: fm.Scene) -> None:
    """1 + L(z) is the ratio of the characteristic polynomials of the closed and the opened loop."""
    model, z, seen = fm.linearize_sampled(scene), 1.3 * np.exp(0.7j), 0
    for name in model.loop_names:
        try:
            loop = model.opened(name)
        except ValueError as error:
            assert "times until all controllers repeat" in str(error)
            continue
        seen += 1
        closed, opened = (np.linalg.det(z * np.eye(len(A)) - A) for A in (model.A, loop.A))
        ratio = closed / opened * z ** (len(loop.A) - len(model.A))
        there = loop.C @ np.linalg.solve(z * np.eye(len(loop.A)) - loop.A, loop.B) + loop.D
        assert abs(ratio - 1.0 - there) < 1e-11 * abs(ratio)
    assert seen >= 2


@pytest.mark.parametrize("name", ["attitude[0]", "attitude[2]"])
def test_at_the_gain_margin_a_multiplier_is_on_the_circle(name: str) -> None:
    """Of the satellite whose drive of that axis is multiplied by it; within, it is stable."""
    wheel = "wheel_x" if name.endswith("[0]") else "wheel_z"
    gain = fm.linearize_sampled(SATELLITE).opened(name).gain_margin
    path = f"{wheel}.torque_Nm.gain"
    before = next(each for each in SATELLITE.wheels if each.name == wheel).torque_Nm
    assert isinstance(before, fm.ControlSignal)
    sizes = [
        abs(fm.linearize_sampled(SATELLITE.with_values({path: before.gain * gain * factor})).multipliers[0])
        for factor in (0.99, 1.0, 1.01)
    ]
    assert sizes[0] < 1.0 < sizes[2]
    assert sizes[1] == pytest.approx(1.0, abs=1e-8)


def test_a_delay_of_whole_periods_is_the_delay_margin() -> None:
    """The loop whose delay margin is two periods has a multiplier on the circle with that delay."""
    from scipy.optimize import brentq

    def left(kd: float) -> float:
        return float(fm.linearize_sampled(held(1.0, kd)).opened("law").delay_margin / T - 2.0)

    kd = float(brentq(left, 1.5, 3.0, xtol=1e-12))
    assert abs(fm.linearize_sampled(held(1.0, kd, delay=2.0 * T)).multipliers[0]) == pytest.approx(1.0, abs=1e-9)


def test_a_loop_on_the_border_has_no_margin() -> None:
    """a = 2 b: the multipliers are on the circle."""
    loop = fm.linearize_sampled(held(1.0, 0.5 * T)).opened("law")
    assert loop.phase_margin == pytest.approx(0.0, abs=1e-12)


def test_a_narrow_resonance_is_not_missed() -> None:
    """A panel with a damping ratio of 1e-5 crosses |L| = 1 twice within 1e-4 of its frequency."""
    scene = with_panel(20.0, 1.0).with_values({"panel.modes.damping_ratio": 1e-5})
    loop = fm.linearize_sampled(scene).opened("regulator")
    dense = loop.grid
    for each in loop.gain_crossings:
        assert abs(abs(loop([each.omega])[0]) - 1.0) < 1e-9
        dense = np.concatenate([dense, each.omega + np.linspace(-1e-3, 1e-3, 20_001)])
    size = np.log(np.abs(loop(np.unique(dense[(dense > loop.grid[0]) & (dense < loop.highest)]))))
    assert len(loop.gain_crossings) == np.sum(size[:-1] * size[1:] < 0.0) >= 3


# ---- The state


def test_integrals_hold_the_loads_where_the_loop_rests() -> None:
    """A pendulum that is held away from where it hangs: the integral is the torque, and nothing accelerates."""
    law = fm.Pid(name="law", inputs=("angle",), kp=90.0, ki=60.0, kd=30.0, setpoint=0.4, period_s=0.02)
    scene = pendulum(law, torque=fm.ControlSignal(source="law")).scene()
    model = fm.linearize_sampled(scene)
    assert model.state.q[0] == pytest.approx(0.4, abs=1e-10)
    assert np.abs(model.rates).max() < 1e-9
    about = fm.linearize_sampled(scene, state=model.state)  # with an integral of zero
    assert np.abs(about.rates).max() > 1.0
    assert np.abs(about.A - model.A).max() > 1e-6


@pytest.mark.parametrize("limits", [{}, {"lower": -900.0, "upper": 900.0}], ids=["free", "limited"])
def test_a_continuous_integral_holds_the_loads_too(limits: Any) -> None:
    """As samples get dense, the multipliers are those of the loop whose damper is continuous."""
    period, scene = 1e-4, leaning(**limits)
    model = fm.linearize_sampled(scene.with_values({"law.period_s": period}))
    assert np.abs(model.rates).max() < 1e-9
    assert [name for name, _ in model.states if name.startswith("hold")] == ["hold.state[0]", "hold.state[1]"]
    rates = [mode.rate for mode in model.modes if abs(mode.multiplier) > 0.5]
    continuous = msgspec.structs.replace(
        scene, controllers=tuple(msgspec.structs.replace(each, period_s=None) for each in scene.controllers)
    )
    motion, x = fm.ControlledMotion(continuous), [0.0, 0.0]
    for _ in range(5):
        at = motion.acceleration_derivatives(model.state, x)
        slope = np.vstack([at.of_accelerations.by_states, at.of_rates.by_states])
        x = x - np.linalg.lstsq(slope, np.r_[at.accelerations, at.rates], rcond=None)[0]
    at = motion.acceleration_derivatives(model.state, x)
    a, b, n = at.of_accelerations, at.of_rates, 2
    A = np.block([[np.zeros((n, n)), np.eye(n), np.zeros((n, 2))],
                  [a.by_displacement, a.by_speed, a.by_states],
                  [b.by_displacement, b.by_speed, b.by_states]])  # fmt: skip
    expected = np.linalg.eigvals(A)
    for rate in rates:
        assert np.min(np.abs(expected - rate)) < 5e-3 * max(1.0, abs(rate))


def test_what_drifts_freely_is_named_and_decides_nothing() -> None:
    model = fm.linearize_sampled(many().scene())
    assert model.free == ("wheel.angle", "wheel.speed")
    assert len(model.multipliers) == len(model.states) - 2
    assert all(abs(value - 1.0) > 1e-6 for value in model.multipliers)
    opened = rotor(fm.StateSpace(name="idle", inputs=("angle",), D=((1.0,),), period_s=T))
    assert fm.linearize_sampled(opened).free == ()  # a controller reads it
    assert fm.linearize_sampled(opened).stability.verdict == "neutral"


def test_a_saturated_controller_is_named() -> None:
    law = fm.Saturation(name="law", inputs=("angle",), lower=-0.1, upper=0.1, period_s=T)
    scene = rotor(law, stiffness=2.0)
    model = fm.linearize_sampled(scene, state=fm.compile(scene).initial_state)
    assert model.saturated == ("law",)
    alone = fm.linearize_sampled(rotor(stiffness=2.0), T)
    assert np.abs(model.A - alone.A).max() < EXACT


# ---- Results


def test_python_control_gets_the_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its constructor is called as its documentation has it: matrices, the period, then labels without dots."""
    called: dict[str, Any] = {}

    class Control:
        @staticmethod
        def ss(*matrices: Any, **names: Any) -> str:
            called.update(names, matrices=matrices)
            return "system"

    model = fm.linearize_sampled(held())
    monkeypatch.setitem(sys.modules, "control", Control)
    assert model.to_control() == "system"
    assert called["matrices"][4] == T and len(called["outputs"]) == len(model.C)
    assert not any("." in name for name in (*called["inputs"], *called["outputs"]))
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ImportError, match="pip install control"):
        model.to_control()


def test_files_and_pictures_are_written(tmp_path: Path) -> None:
    model = fm.linearize_sampled(held(delay=0.1))
    assert model.plot(tmp_path / "deep" / "loop.png").stat().st_size > 1000
    assert model.plot(tmp_path / "angle.png", "angle").stat().st_size > 1000
    with np.load(model.save(tmp_path / "loop.npz")) as kept:
        assert kept["period"] == T and np.array_equal(kept["A"], model.A)
        assert kept["states"][2] == "law.held[0] []"
    with pytest.raises(ValueError, match=r"\.npz or \.mat"):
        model.save(tmp_path / "loop.txt")


def test_a_map_is_stable_within_the_closed_form(tmp_path: Path) -> None:
    """Stable for b < 2 and a > 0, where a / 2 < b too (Jury)."""
    gains, dampings = np.array([1.0, 30.0, 70.0]), np.array([0.5, 3.0, 7.0, 9.0])
    found = fm.stability_map(held(), {"law.D.0.0": -gains, "law.D.0.1": -dampings})
    a, b = gains[:, None] * T**2 / INERTIA, dampings * T / INERTIA
    assert np.array_equal(found.stable, (b < 2.0) & (0.5 * a < b))
    assert found.stable.any() and not found.stable.all() and not found.refused
    assert found.plot(tmp_path / "map.png").stat().st_size > 1000
    lines = found.to_csv(tmp_path / "map.csv").read_text().splitlines()
    assert lines[0] == "law.D.0.0,law.D.0.1,largest multiplier" and len(lines) == 13
    line = fm.stability_map(held(), {"law.D.0.0": -gains, "law.D.0.1": [-3.0]})
    assert np.array_equal(line.size, found.size[:, 1:2])
    assert line.plot(tmp_path / "line.png").stat().st_size > 1000


def test_a_map_has_gaps_where_there_is_no_linear_model() -> None:
    """A limit that is exactly where the loop rests; where all pairs are gaps, the reason is raised."""
    scene = rotor(
        fm.Pid(name="law", inputs=("angle",), kp=3.0, kd=4.0, filter_s=0.1, lower=-1.0, upper=1.0, period_s=0.1)
    )  # fmt: skip
    found = fm.stability_map(scene, {"law.kp": [2.0, 3.0], "law.upper": [0.0, 1.0]})
    assert set(found.refused) == {(0, 0), (1, 0)} and "exactly at a limit" in found.refused[0, 0]
    assert np.isnan(found.size[:, 0]).all() and not found.stable[:, 0].any()
    assert found.size[1, 1] == abs(fm.linearize_sampled(scene).multipliers[0])
    with pytest.raises(fm.NotDifferentiableError, match="exactly at a limit"):
        fm.stability_map(scene, {"law.kp": [2.0, 3.0], "law.upper": [0.0]})


# ---- Refusals


def corner() -> fm.Scene:
    return rotor(fm.Saturation(name="law", inputs=("angle",), lower=-1.0, upper=0.3, period_s=T), stiffness=2.0)


def leaning(**hold_more: Any) -> fm.Scene:
    """A pendulum that a continuous integral holds, beside a sampled damper."""
    damper = fm.StateSpace(name="law", inputs=("rate",), D=((-30.0,),), period_s=0.02)
    hold = fm.Pid(name="hold", inputs=("angle",), kp=90.0, ki=60.0, setpoint=0.4, **hold_more)
    drive = fm.StateSpace(name="both", inputs=("law", "hold"), D=((1.0, 1.0),))
    return pendulum(damper, hold, drive, torque=fm.ControlSignal(source="both")).scene()


def watched(level: float) -> fm.Scene:
    return msgspec.structs.replace(
        held(), events=(fm.SceneEvent(name="alarm", watch="law", level=level, actions=(fm.EndRun(),)),)
    )


def by_user(function: str, **more: Any) -> fm.Scene:
    address = f"tests.flexmb.control.laws:{function}"
    return rotor(fm.UserLaw(name="law", inputs=("angle",), function=address, period_s=T, **more), stiffness=2.0)


def kinked() -> fm.Scene:
    """With the kink where it starts."""
    return by_user("kinked", parameters=(0.3,))


@pytest.mark.parametrize(("ask", "kind", "reason"), [
    (lambda: fm.linearize_sampled(held(period=None)), ValueError, "no controller of the scene is sampled: give"),
    (lambda: fm.linearize_sampled(held(), 0.3), ValueError, "no multiple of 0.2 s.*leave it out"),
    (lambda: fm.linearize_sampled(held(), -0.2), ValueError, "no period: give a positive one"),
    (lambda: fm.linearize_sampled(corner(), state=fm.compile(corner()).initial_state), fm.NotDifferentiableError,
     "exactly at a limit.*move the state"),
    (lambda: fm.linearize_sampled(watched(0.0)), fm.NotDifferentiableError, "alarm.*at its level.*events=()"),
    (lambda: fm.linearize_sampled(by_user("counting", initial=(0.0,), outputs=1)), NotImplementedError,
     "user with states.*a state"),
    (lambda: fm.linearize_sampled(leaning(upper=900.0, tracking_s=1.0)), NotImplementedError,
     '"hold" is continuous, and may rest at a limit.*leave its limits out'),
    (lambda: fm.linearize_sampled(kinked(), state=fm.compile(kinked()).initial_state), fm.NotDifferentiableError,
     '"law" has no derivative.*no smooth function'),
    (lambda: fm.linearize_sampled(5), TypeError, "a System or a Scene"),
    (lambda: fm.linearize_sampled(held()).opened("nobody"), KeyError, "no loop goes through.*law, angle"),
    (lambda: fm.linearize_sampled(many().scene()).opened("filter"), ValueError, '"filter": it is sampled 2 times'),
    (lambda: fm.stability_map(held(), {"law.delay_s": [0.0]}), ValueError, "over two numbers, not 1"),
    (lambda: fm.stability_map(held(), {"law.delay_s": [0.0], "law.nothing": [1.0]}), ValueError, "nothing"),
    (lambda: fm.stability_map(held(), {"law.delay_s": [], "law.period_s": [1.0]}), ValueError, "at least one"),
    (lambda: fm.linearize(held()), NotImplementedError, r"linearize_sampled\(scene\)"),
])  # fmt: skip
def test_what_cannot_be_is_refused_with_a_remedy(ask: Any, kind: type[Exception], reason: str) -> None:
    with pytest.raises(kind, match=reason):
        ask()


def test_an_event_elsewhere_is_no_obstacle() -> None:
    assert fm.linearize_sampled(watched(5.0)).stable


def test_periods_that_never_repeat_are_refused() -> None:
    other = fm.StateSpace(name="other", inputs=("angle",), D=((1.0,),), period_s=T * np.sqrt(2.0))
    scene = held()
    scene = msgspec.structs.replace(scene, controllers=(*scene.controllers, other))
    with pytest.raises(ValueError, match='"law" and "other".*never repeat together.*whole numbers'):
        fm.linearize_sampled(scene)


def test_a_closed_chain_is_its_equation_of_one_coordinate() -> None:
    """A four-bar whose uprights stay parallel, with a delayed PD controller at one foot, where both hold its weight."""
    model = fm.linearize_sampled(windows(1, SAMPLED))
    angle = model.state.q[fm.compile(windows(1, SAMPLED)).coordinate("foot 0").start]
    inertia, weight = 2.0 / 3.0 + 1.0, -9.81 * 2.0
    assert weight * np.cos(angle) == pytest.approx(STIFFNESS * angle, rel=1e-9)
    A, B = np.array([[0.0, 1.0], [-weight * np.sin(angle) / inertia, 0.0]]), np.array([[0.0], [1.0 / inertia]])
    expected = radius(A, B, np.array([[STIFFNESS, DAMPING]]), np.array(0.05), np.array(0.4))
    assert abs(model.multipliers[0]) == pytest.approx(float(expected), rel=1e-9)


def test_a_load_that_stays_open_may_be_there_but_not_be_read() -> None:
    """Of two windows in a row, of which redundant closures leave loads undetermined."""
    scene = windows(2, SAMPLED)
    rest = fm.linearize_sampled(scene).state
    load = fm.LoadSensor(name="load", hinge=scene.constraints[0].name)
    more = msgspec.structs.replace(scene, sensors=(*scene.sensors, load))
    model = fm.linearize_sampled(more, state=rest)
    assert np.isnan(model.C).any(axis=1).sum() >= 1
    assert np.abs(model.A - fm.linearize_sampled(scene, state=rest).A).max() < 1e-11
    law = msgspec.structs.replace(SAMPLED, inputs=("angle", "load[0]"), D=((-STIFFNESS, -0.01),))
    with pytest.raises(fm.NotDifferentiableError, match='"law" puts out no number.*redundant.*read another one'):
        fm.linearize_sampled(msgspec.structs.replace(more, controllers=(law,)), state=rest)


def test_the_command_prints_multipliers_and_margins(tmp_path: Path) -> None:
    scene = fm.save_scene(held(delay=0.1), tmp_path / "loop.toml") or tmp_path / "loop.toml"
    files = ["--picture", str(tmp_path / "loop.png"), "--loop", "angle", "--export", str(tmp_path / "loop.npz")]
    done = CliRunner().invoke(app, ["linearize", str(scene), "--sampled", *files])
    assert done.exit_code == 0, done.output
    assert "asymptotically stable" in done.output and "Margins" in done.output and "pivot.rotation" in done.output
    assert (tmp_path / "loop.png").exists() and (tmp_path / "loop.npz").exists()
    plain = CliRunner().invoke(app, ["linearize", str(scene), "--picture", "x.png"])
    assert plain.exit_code == 2 and "add --sampled" in plain.output
