"""Whole runs of a rigid chain of ten bodies at equal error, against rivals with and without Python in their loop.

The error is that of the last state, of its largest component, against a run of native's at `CONVERGED`. Three rivals
evaluate the same equations: Pinocchio's articulated-body algorithm in a compiled loop of Boost's odeint, MuJoCo's RK4
by one call for all steps, and SciPy's integrators around `pin.aba`, where most of the time is SciPy's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from itertools import starmap

import numpy as np

import flexmb as fm
from tests.benchmarks import peers
from tests.benchmarks.must_hold.row import Measured, RivalsDiffer, Row
from tests.benchmarks.must_hold.runs import BODIES, T_END, scipy_over_aba
from tests.benchmarks.must_hold.tuning import Setting, equal_error, up_to
from tests.benchmarks.rivals import rigid_chain

GROUP = "Whole runs at equal error, 10 bodies, 1 s"
LEVELS = (1e-6, 1e-10)
CONVERGED = 1e-13
CODES_AGREE = 1e-9  # of two codes at their tightest tolerance; what they differ by is below 1e-11 here
TOLERANCES = tuple(10.0**-k for k in range(3, 14))
STEPS = tuple(round(2.0 ** (0.5 * k)) for k in range(8, 31))  # numbers of equal steps, by the root of two
SEARCHED = (
    "native: `dop853`; odeint: `runge_kutta_dopri5` and `runge_kutta_fehlberg78`; SciPy: `DOP853`, `RK45` and `LSODA`; "
    "all of these at relative and absolute tolerances of 1e-3 to 1e-13 by tenths. MuJoCo's RK4, and native's `rk4`: "
    f"{STEPS[0]} to {STEPS[-1]} steps by the root of two."
)


def rows() -> list[Row]:
    """The goals are those of the rows of evaluations, of equal steps and of equal tolerances with the same rival."""
    rivals: tuple[tuple[str, str, float, Callable[[], Sequence[Setting]]], ...] = (
        ("cpp", "Pinocchio in C++ with Boost's odeint", 3.0, _odeint),
        ("mujoco", "mj_step, RK4, one call for all steps", 2.5, _mujoco),
        ("scipy", "SciPy's integrators over pin.aba", 8.0, _scipy),
    )
    return [
        Row(
            f"equal_error_{name}_{level:g}", GROUP, f"{what}, error {level:g}", goal, partial(_row, settings, level),
            searched=SEARCHED,
        )
        for name, what, goal, settings in rivals
        for level in LEVELS
    ]  # fmt: skip


def _row(settings: Callable[[], Sequence[Setting]], level: float) -> Measured:
    return equal_error(_native(), settings(), level)


@cache
def _system() -> fm.System:
    return fm.compile(rigid_chain(BODIES))


@cache
def _exact() -> np.ndarray:
    return _run("dop853", rtol=CONVERGED, atol=CONVERGED)


def _run(method: fm.Method, **settings: float) -> np.ndarray:
    done = fm.simulate(_system(), T_END, method, samples=2, **settings)
    return np.concatenate([done.q[-1], done.u[-1]])


def _tried(run: Callable[..., np.ndarray], labelled: Iterable[tuple[str, tuple]]) -> list[Setting]:
    def setting(label: str, arguments: tuple) -> Setting:
        call = partial(run, *arguments)
        error = float(np.max(np.abs(call() - _exact())) / np.max(np.abs(_exact())))
        return Setting(call, label, error if np.isfinite(error) else np.inf)

    return list(up_to(LEVELS[-1], starmap(setting, labelled)))


def _by_tolerance(run: Callable[[str, float], np.ndarray], method: str) -> list[Setting]:
    return _tried(run, ((f"{method}, rtol {rtol:g}", (method, rtol)) for rtol in TOLERANCES))


def _by_steps(run: Callable[[int], np.ndarray], method: str) -> list[Setting]:
    return _tried(run, ((f"{method}, {steps} steps", (steps,)) for steps in STEPS))


@cache
def _native() -> list[Setting]:
    return _by_tolerance(lambda method, rtol: _run(method, rtol=rtol, atol=rtol), "dop853") + _by_steps(
        lambda steps: _run("rk4", step=T_END / steps), "rk4"
    )


@cache
def _odeint() -> list[Setting]:
    from tests.benchmarks.compiled.pinocchio import runs

    run = runs(rigid_chain(BODIES), T_END)
    _must_agree(run("fehlberg78", CONVERGED))
    return _by_tolerance(run, "dopri5") + _by_tolerance(run, "fehlberg78")


@cache
def _mujoco() -> list[Setting]:
    return _by_steps(peers.mujoco_runs(rigid_chain(BODIES), T_END), "RK4")


@cache
def _scipy() -> list[Setting]:
    solved = scipy_over_aba(rigid_chain(BODIES))

    def run(method: str, rtol: float) -> np.ndarray:
        return solved(method, rtol).y[:, -1]

    _must_agree(run("DOP853", CONVERGED))
    return [each for method in ("DOP853", "RK45", "LSODA") for each in _by_tolerance(run, method)]


def _must_agree(state: np.ndarray) -> None:
    """The converged answer of a rival is native's, or its error would be that of another model."""
    apart = float(np.max(np.abs(state - _exact())) / np.max(np.abs(_exact())))
    if not apart <= CODES_AGREE:
        raise RivalsDiffer(f"the converged states are {apart:.1e} apart, of the largest component")
