"""Step control, samples, segments and statuses."""

import math

import numpy as np
import pytest
from scipy.integrate import DOP853, _ivp, solve_ivp
from scipy.integrate._ivp.rk import rk_step

from flexmb.integrate import dop853_tableau as tableau
from flexmb.tables.status import MAX_STEPS, NONFINITE, NOT_POSITIVE_DEFINITE, OK, STEP_TOO_SMALL
from tests.flexmb.integrate.integration_problems import (
    BLOW_UP,
    BREAKDOWN,
    BREAKDOWN_AT,
    CONING,
    HARMONIC,
    KEPLER,
    POWER,
    SWITCH_OFF,
    SWITCH_ON,
    SWITCHED,
    TOP,
    data,
    exact,
    rhs,
    solve,
)


def error(kind: int, times, states) -> float:
    return max(np.abs(y - exact(kind, t)).max() for t, y in zip(times, states, strict=True))


def test_coefficients_equal_those_in_scipy():
    theirs = _ivp.dop853_coefficients
    for name in ("A", "C", "D"):
        assert np.array_equal(getattr(tableau, name), getattr(theirs, name))
    assert np.array_equal(tableau.E3, theirs.E3[:-1])
    assert np.array_equal(tableau.E5, theirs.E5[:-1])
    assert theirs.E3[-1] == theirs.E5[-1] == 0.0


@pytest.mark.parametrize("kind", [HARMONIC, KEPLER, CONING, TOP])
def test_error_is_proportional_to_the_tolerance(kind):
    """The estimate is O(h^8), as is the error at the end: their ratio is a constant of the problem (Kepler's is 30)."""
    times, tolerances = np.linspace(0.0, 6.0, 31), 10.0 ** -np.arange(5, 12)
    errors = [error(kind, times, solve(kind, times, rtol=tol).states) for tol in tolerances]
    slope = np.polyfit(np.log10(tolerances), np.log10(errors), 1)[0]
    assert 0.75 < slope < 1.25
    assert np.all(errors < 100 * tolerances)


class DampedControl(DOP853):
    """SciPy's stages and error estimate; steps as Hairer's code DOP853 chooses them with beta = 0.04."""

    error_before = 1e-4

    def _step_impl(self):
        rejected = False
        while True:
            t_new = min(self.t + self.h_abs, self.t_bound)
            h = t_new - self.t
            y_new, f_new = rk_step(self.fun, self.t, self.y, self.f, h, self.A, self.B, self.C, self.K)
            scale = self.atol + np.maximum(np.abs(self.y), np.abs(y_new)) * self.rtol
            error = self._estimate_error_norm(self.K, h, scale)
            if error < 1.0:
                break
            self.h_abs, rejected = h * max(0.2, 0.9 * error ** (-1 / 8)), True
        h_new = h * 0.9 / (error ** (1 / 8 - 0.2 * 0.04) / self.error_before**0.04)
        self.h_abs = min(h_new, h) if rejected else min(h_new, 10.0 * h)
        self.error_before = max(error, 1e-4)
        self.h_previous, self.y_old = h, self.y
        self.t, self.y, self.f = t_new, y_new, f_new
        return True, None


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_takes_the_steps_of_scipy_with_hairers_control(rtol):
    """Same formula, estimate and controller; SciPy's steps differ where it shortens the last one."""
    constants, workspace = data(KEPLER)

    def slope(t, y):
        dy = np.empty(4)
        rhs(t, y, dy, constants, workspace)
        return dy

    ours = solve(KEPLER, [0.0, 20.0], rtol=rtol)
    theirs = solve_ivp(slope, (0.0, 20.0), exact(KEPLER, 0.0), method=DampedControl, rtol=rtol, atol=rtol)
    assert abs(ours.accepted - (len(theirs.t) - 1)) <= 1
    assert abs(ours.evaluations - theirs.nfev) <= 12 * 3
    assert np.allclose(ours.last, theirs.y[:, -1], rtol=0, atol=1e3 * rtol)


def test_samples_fall_between_steps_without_costing_any():
    """The interpolant of order 7 is less accurate than the step of order 8, but of the order of the tolerance."""
    few, many = solve(HARMONIC, [0.0, 10.0], rtol=1e-9), np.linspace(0.0, 10.0, 501)
    dense = solve(HARMONIC, many, rtol=1e-9)
    assert (dense.accepted, dense.rejected) == (few.accepted, few.rejected)
    extra = dense.evaluations - few.evaluations
    assert extra % 3 == 0, "three stages for the interpolant of a step, only where it holds a sample"
    assert 0 < extra <= 3 * dense.accepted
    assert np.array_equal(dense.last, few.last)
    assert error(HARMONIC, many, dense.states) < 100 * 1e-9


def test_rk4_hits_the_samples_with_equal_steps():
    result = solve(HARMONIC, [0.0, 0.1, 0.35, 1.0], step=0.1)
    assert result.accepted == 1 + 3 + 7
    assert result.evaluations == 4 * result.accepted


@pytest.mark.parametrize("options", [{"rtol": 1e-10}, {"step": 0.1}])
def test_a_switched_load_is_exact_with_segments(options):
    times = np.linspace(0.0, 2.0, 9)
    result = solve(SWITCHED, times, ends=[SWITCH_ON, SWITCH_OFF, 2.0], **options)
    assert error(SWITCHED, times, result.states) < 20 * np.finfo(float).eps
    assert result.rejected == 0


def test_an_uncontrolled_quadrature_is_as_accurate_as_the_state():
    times, rtol = np.linspace(0.0, 20.0, 41), 1e-9
    with_work, without = solve(POWER, times, rtol=rtol), solve(POWER, times, rtol=rtol, controlled=2)
    scale = exact(POWER, 20.0)[2]
    errors = [abs(y[2] - exact(POWER, t)[2]) for t, y in zip(times, without.states, strict=True)]
    assert max(errors) < 100 * rtol * scale
    assert without.accepted <= with_work.accepted


def test_blow_up_keeps_what_was_reached():
    """y = 1/(1 - t): the step shrinks with the distance to the pole until time stands still."""
    times = np.linspace(0.0, 2.0, 101)
    result = solve(BLOW_UP, times, rtol=1e-9)
    assert result.status in (STEP_TOO_SMALL, NONFINITE)
    assert result.t == pytest.approx(1.0, abs=1e-6)
    reached = times[: len(result.states)]
    assert reached[-1] <= result.t < times[len(reached)]
    before = reached < 0.95
    assert error(BLOW_UP, reached[before], result.states[before]) < 1e-5
    assert math.isfinite(result.last[0])


def test_fixed_steps_stop_at_the_first_state_that_is_not_finite():
    result = solve(BLOW_UP, np.linspace(0.0, 2.0, 101), step=1e-3)
    assert result.status == NONFINITE
    assert math.isfinite(result.last[0])
    assert np.isfinite(result.states).all()


@pytest.mark.parametrize("options", [{"rtol": 1e-9}, {"step": 1e-3}])
def test_a_failing_right_hand_side_is_named_and_approached(options):
    times = np.linspace(0.0, 1.0, 101)
    result = solve(BREAKDOWN, times, **options)
    assert result.status == NOT_POSITIVE_DEFINITE
    assert result.fault == 7
    assert BREAKDOWN_AT - 1e-3 - 1e-9 < result.t <= BREAKDOWN_AT
    assert len(result.states) >= 50
    assert error(BREAKDOWN, times[: len(result.states)], result.states) < 1e-12


@pytest.mark.parametrize("options", [{"rtol": 1e-12}, {"step": 1e-3}])
def test_step_limit(options):
    result = solve(KEPLER, np.linspace(0.0, 6.0, 61), max_steps=10, **options)
    assert result.status == MAX_STEPS
    assert result.accepted + result.rejected == 10
    assert 0.0 < result.t < 6.0


def test_finished_runs_say_so():
    assert solve(KEPLER, [0.0, 1.0], rtol=1e-8).status == OK
