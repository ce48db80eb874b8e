"""Sampled controllers with memory, from their first instant on, against a simulation of their own in plain Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flexmb as fm

PERIOD, END = 0.1, 1.2
SLOPE, HEIGHT = 1.7, 0.4


def measured(t: float) -> float:
    return HEIGHT + SLOPE * t


class Pid:
    """As the page of the scene says it, with limits and a filter, from the first instant on."""

    def __init__(self, kp: float, ki: float, kd: float, filter_s: float, limit: float, tracking: float) -> None:
        self.gains, self.filter, self.limit, self.tracking = (kp, ki, kd), filter_s, limit, tracking
        self.integral, self.before = 0.0, None

    def __call__(self, y: float) -> float:
        kp, ki, kd = self.gains
        e = -y
        before = e if self.before is None else self.before
        slope = (e - before) / (self.filter or PERIOD)
        asked = kp * e + self.integral + kd * slope
        given = min(max(asked, -self.limit), self.limit)
        self.integral += PERIOD * (ki * e + (given - asked) / self.tracking)
        left = np.exp(-PERIOD / self.filter) if self.filter else 0.0
        self.before = e + left * (before - e)
        return given


class Linear:
    """x+ = A x + B y, output C x + D y."""

    def __init__(self, law: fm.StateSpace) -> None:
        self.matrices = [np.array(each, float) for each in (law.A, law.B, law.C, law.D)]
        self.x = np.array(law.initial or [0.0] * len(law.A))

    def __call__(self, y: float) -> float:
        A, B, C, D = self.matrices
        out = float((C @ self.x)[0] + (D[0, 0] * y if D.size else 0.0))
        self.x = A @ self.x + B[:, 0] * y
        return out


def pid(**how: Any) -> fm.Pid:
    return fm.Pid(name="law", inputs=("ramp[0]",), period_s=PERIOD, **how)


def linear(**how: Any) -> fm.StateSpace:
    return fm.StateSpace(name="law", inputs=("ramp[0]",), period_s=PERIOD, **how)


DELAYED = linear(A=((0, 0, 0), (1, 0, 0), (0, 1, 0)), B=((1,), (0,), (0,)), C=((0, 0, 1),))
SMOOTH = linear(A=((0.8,),), B=((0.2,),), C=((1.0,),), D=((0.5,),), initial=(0.3,))
INFINITE = np.inf
LAWS: dict[str, tuple[Any, Callable[[], Any]]] = {
    "derivative": (pid(kp=0.0, kd=1.0), lambda: Pid(0.0, 0.0, 1.0, 0.0, INFINITE, INFINITE)),
    "filtered": (pid(kp=2.0, kd=1.0, filter_s=0.25), lambda: Pid(2.0, 0.0, 1.0, 0.25, INFINITE, INFINITE)),
    "integral": (pid(kp=1.0, ki=3.0), lambda: Pid(1.0, 3.0, 0.0, 0.0, INFINITE, INFINITE)),
    "limited": (
        pid(kp=1.0, ki=3.0, kd=0.2, lower=-1.5, upper=1.5, tracking_s=0.4), lambda: Pid(1.0, 3.0, 0.2, 0.0, 1.5, 0.4)
    ),
    "smoothing": (SMOOTH, lambda: Linear(SMOOTH)),
    "delay line": (DELAYED, lambda: Linear(DELAYED)),
}  # fmt: skip
TIMES = {"none": (0.0, 0.0), "offset": (0.35, 0.0), "delay": (0.0, 0.04), "long delay": (0.05, 0.25)}


def scene(law: Any, offset: float, delay: float) -> fm.Scene:
    """A mass that moves at constant speed, watched by a controller that does not act on it."""
    built = fm.SceneBuilder("cart").rigid_body("cart", mass=2.0, inertia=(1.0, 1.0, 1.0))
    built.prismatic("rail", "ground", "cart", position=HEIGHT, rate=SLOPE)
    built.sense_profile("ramp", fm.Ramp(value=HEIGHT, rate=SLOPE))
    keys = {"offset_s": offset, "delay_s": delay}
    return built.add(type(law)(**{name: getattr(law, name) for name in law.__struct_fields__} | keys)).scene()


def expected(make: Callable[[], Any], offset: float, delay: float, t_start: float, times: Any) -> list[float]:
    """What is heard at these times: after the instant where one is an instant."""
    law, heard = make(), list[tuple[float, float]]()
    for k in range(40):
        t = offset + k * PERIOD
        if t_start - 1e-9 <= t <= times[-1] + 1e-9:
            heard.append((t + delay, law(measured(t))))
    return [next((out for since, out in reversed(heard) if since <= t + 1e-9), 0.0) for t in times]


@pytest.mark.parametrize("method", [("dop853", {}), ("rk4", {"step": 0.02})], ids=lambda each: each[0])
@pytest.mark.parametrize("when", TIMES)
@pytest.mark.parametrize("name", LAWS)
def test_from_the_first_instant_on(name: str, when: str, method: tuple[Any, Any]) -> None:
    """With and without offset, delay, another start, a restart before the first instant, on it, after it, at a later
    one and where an output waits."""
    (law, make), (offset, delay), (how, options) = LAWS[name], TIMES[when], method
    system = fm.compile(scene(law, offset, delay))
    for t_start in (0.0, 0.22, -0.3):
        k = max(0.0, np.ceil((t_start - offset) / PERIOD - 1e-9))
        first, later = offset + PERIOD * k, offset + PERIOD * (k + 3.0)  # as instants are counted, to the last bit
        cuts = [cut for cut in (first - 0.01, first, first + 0.02, later, later + 0.5 * delay) if cut > t_start + 1e-9]
        others = [t for t in np.linspace(t_start, END, 16) if np.min(np.abs(np.array(cuts) - t)) > 1e-9]
        times = np.unique([*others, *cuts])
        whole = fm.simulate(system, END, how, t_start=t_start, samples=times, **options)
        heard = expected(make, offset, delay, t_start, times)
        assert whole.signals["law"][:, 0] == pytest.approx(heard, abs=1e-9)
        for cut in cuts:
            one = fm.simulate(system, cut, how, t_start=t_start, samples=times[times <= cut], **options)
            other = fm.simulate(system, END, how, state=one.restart, samples=times[times >= cut], **options)
            assert np.array_equal(one.signals["law"], whole.signals["law"][times <= cut])
            assert np.array_equal(other.signals["law"], whole.signals["law"][times >= cut])
            assert np.array_equal(other.q, whole.q[times >= cut])


def test_a_derivative_with_an_offset_does_not_kick() -> None:
    law = fm.Pid(name="law", inputs=("place",), kp=0.0, kd=1.0, period_s=0.01, offset_s=1.0)
    built = fm.SceneBuilder("cart").rigid_body("cart", mass=2.0, inertia=(1.0, 1.0, 1.0))
    built.prismatic("rail", "ground", "cart", rate=1.0).sense_coordinate("place", "rail").add(law)
    run = fm.simulate(built.scene(), 1.03, samples=[0.0, 0.5, 1.0, 1.01, 1.02, 1.03])
    assert run.signals["law"][:, 0] == pytest.approx([0.0, 0.0, 0.0, -1.0, -1.0, -1.0], abs=1e-9)


@pytest.mark.parametrize("period", [None, 0.1])
def test_a_continuous_derivative_starts_at_what_those_before_it_say(period: float | None) -> None:
    """Behind a filter that does not stand at zero, or a sampled gain that speaks from the start: no kick."""
    before = fm.StateSpace(
        name="before", inputs=("ramp[0]",), D=((3.0,),), period_s=period
    ) if period else fm.StateSpace(
        name="before", inputs=("ramp[0]",), A=((-1.0,),), B=((0.0,),), C=((2.0,),), initial=(5.0,)
    )  # fmt: skip
    behind = fm.Pid(name="behind", inputs=("before",), kp=0.0, kd=1.0, filter_s=0.05)
    built = fm.SceneBuilder("cart").rigid_body("cart", mass=2.0, inertia=(1.0, 1.0, 1.0))
    built.prismatic("rail", "ground", "cart").add(before, behind)
    built.sense_profile("ramp", fm.Ramp(value=HEIGHT, rate=SLOPE))
    for t_start in (0.0, 0.3):
        run = fm.simulate(built.scene(), t_start + 0.05, t_start=t_start, samples=3)
        assert run.signals["behind"][0, 0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("method", ["dop853", "rk4", "radau5", "exponential", "generalised_alpha"])
def test_the_last_row_on_an_instant_is_the_value_after_it(method: Any) -> None:
    """As every other row; loads and powers see it too. Events in the scene change nothing of that."""
    law = fm.StateSpace(name="law", inputs=("clock",), D=((1.0,),), period_s=0.25)
    built = fm.SceneBuilder("cart").rigid_body("cart", mass=2.0, inertia=(1.0, 1.0, 1.0))
    built.prismatic("rail", "ground", "cart", force=fm.ControlSignal(source="law"), rate=1.0)
    built.add(fm.TimeSensor(name="clock"), law)
    options = {"step": 0.05} if method in ("rk4", "generalised_alpha") else {}
    never = fm.SceneEvent(name="never", watch="rail.translation", level=50.0, actions=(fm.EndRun(),))
    for scene in (built.scene(), built.add(never).scene()):
        long, short = (fm.simulate(scene, end, method, samples=np.arange(0.0, end + 0.1, 0.25), **options)
                       for end in (1.0, 0.75))  # fmt: skip
        assert long.signals["law"][:, 0].tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
        assert short.signals["law"][:, 0].tolist() == [0.0, 0.25, 0.5, 0.75]
        assert short.power["law"][-1, 0] == pytest.approx(0.75 * short.u[-1, 0], rel=1e-14)
        taken_up = fm.simulate(scene, 1.0, method, state=short.restart, samples=[0.75, 1.0], **options)
        assert np.array_equal(taken_up.q, long.q[3:])
        assert np.array_equal(taken_up.signals["law"], long.signals["law"][3:])
