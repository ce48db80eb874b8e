"""Friction that sticks, against closed forms and an integration from phase to phase that shares no code with flexmb."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import flexmb as fm
from flexmb.run import frictions
from flexmb.scene.sticking import Sticking

TIGHT = {"rtol": 1e-12, "atol": 1e-14}
BOUND = 1e-8


def block(**rail: Any) -> fm.SceneBuilder:
    """A block on a rail along x."""
    builder = fm.SceneBuilder("block").rigid_body("block", mass=2.0, inertia=(1.0, 1.0, 1.0))
    return builder.prismatic("rail", "ground", "block", axis=(1.0, 0.0, 0.0), **rail)


# (a) decay


STIFFNESS, FRICTION, START = 50.0, 1.3, 1.0


def decaying(smoothing: float = 0.0) -> fm.Scene:
    builder = block(stiffness=STIFFNESS, position=START)
    return builder.linear_friction("dry", "rail", sliding=FRICTION, smoothing=smoothing).scene()


def test_amplitude_falls_by_four_f_over_k_a_cycle_and_ends_in_the_dead_band() -> None:
    run, half = fm.simulate(decaying(), 14.0, **TIGHT), np.pi * np.sqrt(2.0 / STIFFNESS)
    turns = int(np.ceil((START * STIFFNESS / FRICTION - 1.0) / 2.0))
    assert [event.name for event in run.events] == ["dry: reverses"] * (turns - 1) + ["dry: sticks"]
    for n, event in enumerate(run.events, start=1):
        assert event.t == pytest.approx(n * half, rel=BOUND)
        assert event.after.q[0] == pytest.approx((-1.0) ** n * (START - 2.0 * n * FRICTION / STIFFNESS), rel=BOUND)
        assert event.after.u[0] == 0.0 and event.energy_change == 0.0
    rests = run.t > run.events[-1].t
    assert np.ptp(run.q[rests]) == 0.0 and not run.u[rests].any()
    np.testing.assert_allclose(run.hinge_forces["dry"][rests, 0], STIFFNESS * run.q[-1, 0], rtol=BOUND)
    path = sum(2.0 * (START - (2 * n - 1) * FRICTION / STIFFNESS) for n in range(1, turns + 1))
    assert run.work[-1] == pytest.approx(-FRICTION * path, rel=BOUND)
    assert np.abs(run.energy_drift).max() < BOUND * 0.5 * STIFFNESS * START**2


def test_smooth_friction_does_not_hold() -> None:
    """What the bounds of this file tell apart: the same block with smooth friction creeps on."""
    smooth, run = (fm.simulate(decaying(speed), 14.0, **TIGHT) for speed in (1e-3, 0.0))
    assert not smooth.events and abs(smooth.q[-1, 0] - run.q[-1, 0]) > 1e3 * BOUND


# (b) a belt


def belt(speed: float = 0.5, **friction: Any) -> fm.Scene:
    given = {"sliding": 4.0, "static": 6.0, "smoothing": 0.0} | friction
    return (
        fm.SceneBuilder("belt")
        .rigid_body("belt", mass=3.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("block", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("drive", "ground", "belt", axis=(1.0, 0.0, 0.0), prescribed=fm.Ramp(rate=speed))
        .prismatic("slip", "belt", "block", axis=(1.0, 0.0, 0.0))
        .spring_damper(
            "spring", "ground", "block", position_a=(-10.0, 0.0, 0.0), free_length=10.0, stiffness=100.0
        )
        .linear_friction("dry", "slip", **given)
        .scene()
    )  # fmt: skip


def period(static: float) -> float:
    """Of the belt: it sticks over 2 (Fs - Fc)/k and slips back, at w = 10 rad/s."""
    beyond, speed, w = (static - 4.0) / 100.0, 0.5, 10.0
    return 2.0 * beyond / speed + 2.0 / w * float(np.pi - np.arctan2(beyond * w, speed))


def slips(run: fm.Trajectory) -> np.ndarray:
    return np.array([event.t for event in run.events if event.name == "dry: slips"])


def test_stick_slip_on_a_belt_has_its_period() -> None:
    run = fm.simulate(belt(), 8.0, **TIGHT)
    assert len(slips(run)) == 13 and slips(run)[0] == pytest.approx(6.0 / (100.0 * 0.5), rel=BOUND)
    np.testing.assert_allclose(np.diff(slips(run)), period(6.0), rtol=BOUND)
    assert np.abs(run.energy_drift).max() < BOUND * np.abs(run.work).max()
    load = run.hinge_forces["dry"][:, 0]
    assert load.max() <= 6.0 * (1.0 + BOUND) and load.max() > 5.9
    envelope = run.envelope.hinge_forces["dry"]
    assert envelope.greatest[0] == pytest.approx(6.0, rel=1e-6) and envelope.least[0] == pytest.approx(0.0, abs=1e-9)


def test_another_static_friction_has_another_period() -> None:
    """What the bound tells apart: a millionth of static friction."""
    found = np.diff(slips(fm.simulate(belt(static=6.0 * (1.0 + 1e-6)), 3.0, **TIGHT)))
    np.testing.assert_allclose(found, period(6.0 * (1.0 + 1e-6)), rtol=BOUND)
    assert np.min(np.abs(found - period(6.0))) > 2.0 * BOUND * period(6.0)


# (c) a block that is pushed to and fro


def pushed_exactly(m: float, k: float, P: float, w: float, F: float, t_end: float) -> list[tuple[str, float, float]]:
    """(what, time, x) of m x'' + k x = P cos(w t) - friction, from rest at 0, exactly from phase to phase."""
    w0, t, x, s, found = np.sqrt(k / m), 0.0, 0.0, 0, []
    A = P / (k - m * w**2)
    while t < t_end:
        if s == 0:
            grid = np.linspace(t, t_end, 40001)
            over = np.abs(P * np.cos(w * grid) - k * x) - F
            after = np.flatnonzero(over > 0.0)
            if not len(after):
                break
            i = after[0]
            if i:
                t = brentq(lambda at, x=x: abs(P * np.cos(w * at) - k * x) - F, grid[i - 1], grid[i], xtol=1e-15)
                found.append(("slips", t, x))
            s = int(np.sign(P * np.cos(w * t) - k * x))
        a, b = x - A * np.cos(w * t) + s * F / k, A * w * np.sin(w * t) / w0

        def at(time: float, a=a, b=b, t0=t, s=s) -> tuple[float, float]:
            c, d = np.cos(w0 * (time - t0)), np.sin(w0 * (time - t0))
            return (
                a * c + b * d + A * np.cos(w * time) - s * F / k,
                w0 * (b * c - a * d) - A * w * np.sin(w * time),
            )

        grid = np.linspace(t, t + 4.0 * np.pi / w0, 40001)[1:]
        v = s * np.array([at(time)[1] for time in grid])
        i = np.flatnonzero((v[:-1] > 0.0) & (v[1:] <= 0.0))[0]
        t = brentq(lambda time, at=at: at(time)[1], grid[i], grid[i + 1], xtol=1e-15)
        x = at(t)[0]
        load = P * np.cos(w * t) - k * x
        s = 0 if abs(load) <= F else int(np.sign(load))
        found.append(("sticks" if s == 0 else "reverses", t, x))
    return [each for each in found if each[1] < t_end]


def test_a_pushed_block_sticks_and_slips_as_its_exact_solution() -> None:
    k, P, w, F, t_end = 30.0, 8.0, 2.2, 5.0, 20.0
    scene = (
        block(stiffness=k, force=fm.Sine(amplitude=P, angular_frequency_rad_s=w, phase_rad=np.pi / 2))
        .linear_friction("dry", "rail", sliding=F, smoothing=0.0)
        .scene()
    )
    run, exact = fm.simulate(scene, t_end, **TIGHT), pushed_exactly(2.0, k, P, w, F, t_end)
    assert {what for what, _, _ in exact} >= {"sticks", "slips"} and len(exact) > 20
    assert [event.name for event in run.events] == [f"dry: {what}" for what, _, _ in exact]
    np.testing.assert_allclose([event.t for event in run.events], [t for _, t, _ in exact], rtol=BOUND)
    np.testing.assert_allclose([event.after.q[0] for event in run.events], [x for _, _, x in exact], atol=BOUND * 0.1)


# (d) several frictions, against an integration that tries every combination of phases


Mechanics = Callable[[float, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""(M (n,n), forces (n,) without friction) at t, q, u."""


def phases_by_trying(M: np.ndarray, h: np.ndarray, F: np.ndarray, u: np.ndarray) -> tuple[int, ...]:
    """The phases (n,), 0 where a coordinate sticks, that agree with their own loads: all are tried."""
    fits = []
    for way in itertools.product((-1, 0, 1), repeat=len(u)):
        s = np.array(way)
        if np.any(s[u != 0.0] != np.sign(u[u != 0.0])):
            continue
        free, load = s != 0, h - s * F
        a = np.zeros(len(u))
        a[free] = np.linalg.solve(M[np.ix_(free, free)], load[free]) if free.any() else 0.0
        hold = (M @ a - h)[~free]
        starts = free & (u == 0.0)
        if np.all(np.abs(hold) <= F[~free] * (1.0 + 1e-9)) and np.all(s[starts] * a[starts] > 0.0):
            fits.append((int(np.sum(free)), way))
    return min(fits)[1]


class Phase:
    """The motion with these phases from a time on, and the functions whose zeros end it: the speed of each coordinate
    that slides, and the holding load less F, of either sign, of each that sticks."""

    def __init__(self, mechanics: Mechanics, F: np.ndarray, way: np.ndarray, t: float) -> None:
        self._mechanics, self._F, self._way, self._start, self._free = mechanics, F, way, t, way != 0
        self.slides = np.flatnonzero(self._free).tolist()
        self.holds = [(i, sign) for i in np.flatnonzero(~self._free).tolist() for sign in (-1, 1)]
        self.ends = [self._stop(i) for i in self.slides] + [self._break(*each) for each in self.holds]

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        (M, h), n, free = self._mechanics(t, *np.split(y, 2)), len(y) // 2, self._free
        a = np.zeros(n)
        if free.any():
            a[free] = np.linalg.solve(M[np.ix_(free, free)], (h - self._way * self._F)[free])
        return np.concatenate([y[n:], a])

    def _stop(self, i: int) -> Callable[..., float]:
        def speed(t: float, y: np.ndarray) -> float:
            just_begun = 1e-9 * self._way[i] if t <= self._start + 1e-7 else 0.0
            return float(y[len(y) // 2 + i] + just_begun)

        return ending(speed, -float(self._way[i]))

    def _break(self, i: int, sign: int) -> Callable[..., float]:
        def beyond(t: float, y: np.ndarray) -> float:
            M, h = self._mechanics(t, *np.split(y, 2))
            held = (M @ np.split(self.rates(t, y), 2)[1] - h)[i]
            return float(sign * held - self._F[i] * (1.0 + 1e-13))

        return ending(beyond, 1.0)


def ending(function: Any, direction: float) -> Callable[..., float]:
    """Ends an integration of SciPy's where it crosses zero in this direction."""
    function.terminal, function.direction = True, direction
    found: Callable[..., float] = function
    return found


def from_phase_to_phase(
    mechanics: Mechanics, F: np.ndarray, q: np.ndarray, u: np.ndarray, t_end: float
) -> list[tuple[float, np.ndarray, np.ndarray, tuple[int, ...]]]:
    """(t, q, u, phases from there on) at each change of a phase."""
    t, n, found = 0.0, len(q), []
    released = np.zeros(n, int)
    while True:
        M, h = mechanics(t, q, u)
        way = np.array(phases_by_trying(M, h, F, np.where(u == 0.0, released * 1e-300, u)))
        found.append((t, q.copy(), u.copy(), tuple(way.tolist())))
        phase = Phase(mechanics, F, way, t)
        done = solve_ivp(
            phase.rates, (t, t_end), np.concatenate([q, u]), "DOP853", events=phase.ends, rtol=1e-13, atol=1e-14,
            max_step=0.02,
        )  # fmt: skip
        t, (q, u) = float(done.t[-1]), np.split(done.y[:, -1].copy(), 2)
        if done.status != 1:
            return found
        released = np.zeros(n, int)
        u[way == 0] = 0.0
        for place, times in enumerate(done.t_events):
            if len(times) and place < len(phase.slides):
                u[phase.slides[place]] = 0.0
            elif len(times):
                i, sign = phase.holds[place - len(phase.slides)]
                released[i] = -sign


def agree(run: fm.Trajectory, expected: list[Any], names: tuple[str, ...], order: list[int]) -> None:
    """Instants, states and phases are those of the other route."""
    times = np.unique([event.t for event in run.events])
    np.testing.assert_allclose(times, [t for t, *_ in expected[1:]], rtol=BOUND)
    for t, q, u, _ in expected[1:]:
        event = [event for event in run.events if abs(event.t - t) < 1e-7][-1]
        np.testing.assert_allclose(event.after.q[order], q, rtol=BOUND, atol=BOUND)
        np.testing.assert_allclose(event.after.u[order], u, rtol=BOUND, atol=10 * BOUND)
    ways = [way for *_, way in expected]
    for i, name in enumerate(names):
        sticks = sum(a[i] != 0 and b[i] == 0 for a, b in itertools.pairwise(ways))
        slips = sum(a[i] == 0 and b[i] != 0 for a, b in itertools.pairwise(ways))
        told = [event.name for event in run.events]
        assert (told.count(f"{name}: sticks"), told.count(f"{name}: slips")) == (sticks, slips)
        assert sticks + slips > 0


def test_two_blocks_on_each_other() -> None:
    push = fm.Sine(amplitude=9.0, angular_frequency_rad_s=3.0)
    scene = (
        fm.SceneBuilder("two blocks")
        .rigid_body("lower", mass=2.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("upper", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("floor", "ground", "lower", axis=(1.0, 0.0, 0.0), stiffness=20.0)
        .prismatic("between", "lower", "upper", axis=(1.0, 0.0, 0.0))
        .force("push", "upper", direction=(1.0, 0.0, 0.0), function=push)
        .linear_friction("under", "floor", sliding=2.5, smoothing=0.0)
        .linear_friction("over", "between", sliding=4.0, smoothing=0.0)
        .scene()
    )

    def mechanics(t: float, q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        P = 9.0 * np.sin(3.0 * t)
        return np.array([[3.0, 1.0], [1.0, 1.0]]), np.array([P - 20.0 * q[0], P])

    expected = from_phase_to_phase(mechanics, np.array([2.5, 4.0]), np.zeros(2), np.zeros(2), 6.0)
    run = fm.simulate(scene, 6.0, **TIGHT)
    agree(run, expected, ("under", "over"), [0, 1])
    assert np.abs(run.energy_drift).max() < BOUND * np.abs(run.work).max()


def pendulum() -> fm.SceneBuilder:
    builder = fm.SceneBuilder("double pendulum", gravity=(0.0, 0.0, -9.81))
    for name in ("first", "second"):
        builder = builder.rigid_body(name, mass=1.0, com=(1.0, 0.0, 0.0), inertia=(1e-3, 1e-3, 1e-3))
    return (
        builder.revolute("shoulder", "ground", "first", axis=(0.0, 1.0, 0.0), angle=0.4, rate=0.5)
        .revolute("elbow", "first", "second", axis=(0.0, 1.0, 0.0), angle=-1.2, parent_position=(1.0, 0.0, 0.0))
        .angular_friction("upper", "shoulder", sliding=6.0, smoothing=0.0)
        .angular_friction("lower", "elbow", sliding=2.0, smoothing=0.0)
    )


def swinging(t: float, q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Point masses of 1 kg at 1 m, with 0.001 kg m² of their own; angles about y turn x downwards."""
    c, s, own = np.cos(q[1]), np.sin(q[1]), 1e-3
    M = np.array([[3.0 + 2.0 * c + 2.0 * own, 1.0 + c + own], [1.0 + c + own, 1.0 + own]])
    bias = np.array([-s * (2.0 * u[0] * u[1] + u[1] ** 2), s * u[0] ** 2])
    g1, g2 = 9.81 * np.cos(q[0]), 9.81 * np.cos(q[0] + q[1])
    return M, np.array([2.0 * g1 + g2, g2]) - bias


def test_a_double_pendulum_with_friction_in_both_hinges() -> None:
    start = np.array([0.4, -1.2]), np.array([0.5, 0.0])
    expected = from_phase_to_phase(swinging, np.array([6.0, 2.0]), *start, 8.0)
    run = fm.simulate(pendulum().scene(), 8.0, **TIGHT)
    assert len(expected) > 5
    agree(run, expected, ("upper", "lower"), [0, 1])
    assert np.abs(run.energy_drift).max() < BOUND * 9.81


# The rule of several at rest


def several(static: np.ndarray, sliding: np.ndarray) -> list[Sticking]:
    made = []
    for i, (most, less) in enumerate(zip(static.tolist(), sliding.tolist(), strict=True)):
        law = fm.LinearFriction(name=f"f{i}", hinge=f"h{i}", sliding_N=less, static_N=most, smoothing_m_s=0.0)
        made.append(Sticking(law, f"h{i}.translation", f"h{i}", 0))
    return made


SIGN = {"sticking": 0, "forward": 1, "backward": -1}


@pytest.mark.parametrize("seed", range(60))
def test_the_rule_finds_the_only_phases_that_agree_with_their_loads(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    A = rng.normal(size=(n, n))
    M, F = A @ A.T + 0.1 * np.eye(n), rng.uniform(0.2, 2.0, n)
    h = 2.0 * rng.normal(size=n)
    W = np.linalg.inv(M)
    decided = frictions._decided(several(F, F), W @ h, W, {}, 0.0)
    assert tuple(SIGN[each] for each in decided) == phases_by_trying(M, h, F, np.zeros(n))


def test_a_slip_that_unloads_another_is_looked_at_again() -> None:
    """Alone both are beyond their static friction; once the one further beyond slips, the other holds."""
    M, F = np.array([[1.0, 0.9], [0.9, 1.0]]), np.array([1.0, 1.0])
    h = np.array([2.0, 1.1])
    W = np.linalg.inv(M)
    assert np.all(h > F)
    assert frictions._decided(several(F, F), W @ h, W, {}, 0.0) == ["forward", "sticking"]


def test_what_cannot_be_decided_is_refused() -> None:
    one = np.ones((2, 2))
    with pytest.raises(fm.DynamicsError, match='friction "f0" and "f1" is at rest on coordinates that move together'):
        frictions._decided(several(np.ones(2), np.ones(2)), np.ones(2), one, {}, 0.0)


def test_the_rule_ends_where_no_phases_agree() -> None:
    """With a matrix that is no mechanism's, as of 20000 random ones with static above sliding friction none went so."""
    W = np.array([[1.0, 1.0, 0.4], [-0.6, 1.0, -1.5], [0.6, -0.6, 1.0]])
    with pytest.raises(fm.DynamicsError, match='which of the frictions "f0" and "f1" and "f2" stick and which slip'):
        frictions._decided(several(np.ones(3), np.ones(3)), np.array([1.3, -2.3, 1.6]), W, {}, 0.0)
