"""Radau IIA, exponential collocation and generalised-alpha: stability, stiff accuracy, statuses, samples, segments."""

import math

import numpy as np
import pytest
from scipy.integrate import _ivp, solve_ivp

from flexmb.integrate import radau5_stages as tableau
from flexmb.integrate.exponential import exponential
from flexmb.integrate.generalised_alpha import generalised_alpha
from flexmb.integrate.radau5 import radau5
from flexmb.tables.status import MAX_STEPS, NONFINITE, NOT_CONVERGED, NOT_POSITIVE_DEFINITE, OK, STEP_TOO_SMALL
from tests.bounds import UNIT_ROUNDOFF
from tests.flexmb.integrate.stiff_problems import (
    BLOW_UP,
    BREAKDOWN,
    BREAKDOWN_AT,
    CONING,
    DRIVEN,
    KAPS,
    LINEAR,
    OSCILLATOR,
    PROTHERO,
    SPRING,
    SWITCH_OFF,
    SWITCH_ON,
    SWITCHED,
    VAN_DER_POL,
    coning,
    data,
    jacobian,
    rhs,
    solve,
)

ADAPTIVE = pytest.mark.parametrize("run", [radau5, exponential], ids=["radau5", "exponential"])


def alpha(problem, y, times, step, radius, nq, controlled, **options):
    """Generalised-alpha, whose Newton iterations leave next to nothing."""
    settings = {"step": step, "radius": radius, "coordinates": nq}
    return solve(generalised_alpha, problem, y, times, 1e-12, 1e-14, controlled, **settings, **options)


def as_functions(problem):
    """Right-hand side and Jacobian as SciPy takes them."""

    def slope(t, y):
        dy = np.empty(len(y))
        rhs(t, y, dy, *problem)
        return dy

    def matrix(t, y):
        J = np.empty((len(y), len(y)))
        jacobian(t, y, J, *problem)
        return J

    return slope, matrix


@pytest.mark.parametrize("kind", [VAN_DER_POL, KAPS, SPRING, CONING])
def test_jacobians_by_hand_are_right(kind):
    """Complex numbers cannot pass these kernels: central differences of step 1e-6 err by 1e-12 f''' and u/1e-6 f."""
    slope, matrix = as_functions(data(kind, 3.0, 0.4))
    y = np.array([0.3, -0.4, 0.5, 0.7])[: 2 if kind in (VAN_DER_POL, KAPS) else 4]
    columns = [(slope(0.3, y + 1e-6 * e) - slope(0.3, y - 1e-6 * e)) / 2e-6 for e in np.eye(len(y))]
    assert np.allclose(matrix(0.3, y), np.transpose(columns), rtol=0, atol=1e-8)


def test_coefficients_of_radau5_equal_those_in_scipy():
    theirs = _ivp.radau
    for name in ("C", "E", "P"):
        assert np.allclose(getattr(tableau, name), getattr(theirs, name), rtol=0, atol=1e-14)
    assert abs(tableau.REAL - theirs.MU_REAL) < 2e-14
    assert abs(tableau.COMPLEX - np.conj(theirs.MU_COMPLEX)) < 2e-14


def test_radau5_takes_about_the_steps_of_scipy():
    """Same formulas; the controllers differ in when they renew Jacobian and factors: a tenth of the steps."""
    problem, start = data(VAN_DER_POL, 1e6), [2.0, -0.66]
    slope, matrix = as_functions(problem)
    ours = solve(radau5, problem, start, [0.0, 2.0], 1e-6, 1e-6, 2)
    theirs = solve_ivp(slope, (0.0, 2.0), start, method="Radau", rtol=1e-6, atol=1e-6, jac=matrix)
    assert ours.status == OK
    assert ours.accepted == pytest.approx(len(theirs.t) - 1, rel=0.1)
    assert ours.evaluations == pytest.approx(theirs.nfev, rel=0.2)
    published = [1.706167732170483, -0.8928097010247975]  # Hairer, Wanner, test set for stiff problems, at t = 2
    assert np.allclose(ours.last, published, rtol=0, atol=1e-4)


@ADAPTIVE
@pytest.mark.parametrize("rate", [1.0, 1e3, 1e6])
def test_error_follows_the_tolerance_however_stiff(run, rate):
    """Kaps' problem: its solution does not know how stiff it is; errors accumulate over two time constants only."""
    times = np.linspace(0.0, 2.0, 21)
    exact = np.transpose([np.exp(-2 * times), np.exp(-times)])
    steps = []
    for tolerance in (1e-5, 1e-7, 1e-9, 1e-11):
        done = solve(run, data(KAPS, rate), [1.0, 1.0], times, tolerance, tolerance, 2)
        assert done.status == OK
        assert np.abs(done.states - exact).max() < 20 * tolerance
        steps.append(done.accepted)
    assert steps[0] < steps[-1] < 600


@pytest.mark.parametrize(("run", "order"), [(radau5, 5), (exponential, 6)], ids=["radau5", "exponential"])
def test_orders_where_nothing_is_stiff(run, order):
    """Error against the number of steps, of which a tolerance is but a way to change it.

    Steps of one run stay in proportion to another's; errors scatter by a factor 1.5 about the power, as the last steps
    are cut, which over a fourfold number of steps is 0.3 in the slope.
    """
    exact, steps, errors = np.exp([-4.0, -2.0]), [], []
    tolerances = 10.0 ** -np.arange(7.0, 9.6, 0.5) if order == 5 else 10.0 ** -np.arange(9.5, 12.1, 0.5)
    for tolerance in tolerances:
        done = solve(run, data(KAPS, 1.0), [1.0, 1.0], [0.0, 2.0], tolerance, tolerance, 2)
        steps.append(done.accepted)
        errors.append(np.abs(done.last - exact).max())
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.4)


@ADAPTIVE
def test_prothero_and_robinson_cost_no_more_the_stiffer_they_are(run):
    """Explicit methods would need 3e8 steps for the rate 1e8."""
    costs = []
    for rate in (1e2, 1e5, 1e8):
        done = solve(run, data(PROTHERO, -rate), [0.0], [0.0, 3.0], 1e-8, 1e-8, 1)
        assert abs(done.last[0] - math.sin(3.0)) < 1e-8
        costs.append(done.evaluations)
    assert costs[2] <= 1.2 * costs[0]
    assert max(costs) < 600


@pytest.mark.parametrize("z", [-1.0, -10.0, -1e3, -1e9, 3j, -5 + 40j, 1e6j])
def test_radau5_has_its_stability_function(z):
    """One step of unit length on y' = z y: R(z) = (1 + 2z/5 + z^2/20) / (1 - 3z/5 + 3z^2/20 - z^3/60), L-stable.

    A loose tolerance lets any step pass; Newton's method is exact after one iteration.
    """
    R = (1 + 0.4 * z + 0.05 * z**2) / (1 - 0.6 * z + 0.15 * z**2 - z**3 / 60)
    assert abs(R) <= 1.0
    problem = data(LINEAR, np.real(z), np.imag(z))
    # Steps that are certain to be one: what is asked for after a first tiny step grows eightfold at most.
    ends = np.r_[1e-12 * 8.0 ** np.arange(14), 1.0]
    done = solve(radau5, problem, [1.0, 0.0], [0.0, ends[-2], 1.0], 0.5, 1e6, 2, ends=ends)
    before, after = done.states[1] @ [1, 1j], done.states[2] @ [1, 1j]
    step = 1.0 - ends[-2]
    z = z * step
    R = (1 + 0.4 * z + 0.05 * z**2) / (1 - 0.6 * z + 0.15 * z**2 - z**3 / 60)
    assert done.accepted == len(ends)
    assert after / before == pytest.approx(R, abs=1e-12)


@pytest.mark.parametrize("damping", [0.0, -0.3])
def test_exponential_is_exact_for_linear_problems_at_any_step(damping):
    """Frequency 1e4 and steps of seconds: only the rounding of the phase is left, 1e4 u a second."""
    times = np.array([0.0, 0.37, 1.1, 4.0, 10.0])
    done = solve(exponential, data(LINEAR, damping, 1e4), [1.0, 0.0], times, 1e-6, 1e-6, 2)
    assert done.status == OK
    assert done.accepted < 12
    exact = np.exp((damping + 1e4j) * times)
    assert np.all(np.abs(done.states @ [1, 1j] - exact) < 10 * UNIT_ROUNDOFF * 1e4 * (1 + times))


def test_a_stiff_mode_stays_bounded_for_1000_periods_of_which_a_step_passes_many():
    """A pendulum on a spring that rings: amplitudes 1e-5 of the length at 1000 rad/s, swinging by 1 rad.

    The ringing's energy over its frequency is an adiabatic invariant; the frequency changes by the spin's square, 1e-6.
    """
    frequency, amplitude = 1e3, 1e-5
    problem, t_end = data(SPRING, frequency, 1.0), 1000 * 2 * np.pi / 1e3
    times = np.linspace(0.0, t_end, 401)
    start = [math.cos(1.0) / frequency**2 + amplitude, 1.0, 0.0, 0.0]
    done = solve(exponential, problem, start, times, 1e-4, 1e-6, 4)
    assert done.status == OK
    assert t_end / done.accepted * frequency / (2 * np.pi) > 10, "periods in a step"
    stretch, angle, rate, turning = done.states.T
    rest = ((1.0 + stretch) * turning**2 + np.cos(angle)) / frequency**2
    ringing = np.hypot(stretch - rest, rate / frequency)
    assert np.all(np.abs(ringing / amplitude - 1.0) < 0.2)


@pytest.mark.parametrize("radius", [0.0, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("frequency", [0.3, 3.0, 30.0, 1e4])
def test_generalised_alpha_follows_its_amplification_matrix(radius, frequency):
    """Free vibration by powers of the 3 x 3 matrix of (q, h u, h^2 a) of Chung and Hulbert: damping and overshoot."""
    h, start, steps = 0.1, np.array([1.0, 0.3]), 12
    A = amplification(radius, frequency * h)
    x = np.array([start[0], h * start[1], -((h * frequency) ** 2) * start[0]])
    times = h * np.arange(steps + 1)
    done = alpha(data(OSCILLATOR, frequency), start, times, h, radius, 1, 2)
    assert done.status == OK
    size = np.abs(x).max()
    for state in done.states[1:]:
        x = A @ x
        size = max(size, np.abs(x).max())
        assert np.abs(state - [x[0], x[1] / h])[0] < 1e-11 * size
        assert abs(state[1] * h - x[1]) < 1e-11 * size
    spectral = np.abs(np.linalg.eigvals(A)).max()
    assert spectral <= 1.0 + 1e-12
    if frequency == 1e4:
        assert spectral == pytest.approx(radius, abs=0.02)


def amplification(radius: float, z: float) -> np.ndarray:
    """Of generalised-alpha for q'' = -z^2 q at unit step; optimal parameters (Chung, Hulbert, eqs. 17, 18, 25)."""
    m, f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    beta, gamma = (1 - m + f) ** 2 / 4, 0.5 - m + f
    left = np.array([[1, 0, -beta], [0, 1, -gamma], [(1 - f) * z * z, 0, 1 - m]])
    right = np.array([[1, 1, 0.5 - beta], [0, 1, 1 - gamma], [-f * z * z, 0, -m]])
    return np.linalg.solve(left, right)


@ADAPTIVE
def test_a_quadrature_neither_sets_the_step_nor_loses_accuracy(run):
    """The drive's work on an oscillator that follows sin t: only the state is controlled."""
    frequency, times = 30.0, np.linspace(0.0, 3.0, 13)
    amplitude = frequency**2 / (frequency**2 - 1.0)  # y = amplitude sin t, without its free vibration
    exact = frequency**2 * amplitude * np.sin(times) ** 2 / 2
    done = solve(run, data(DRIVEN, frequency), [0.0, amplitude, 0.0], times, 1e-9, 1e-9, 2)
    both = solve(run, data(DRIVEN, frequency), [0.0, amplitude, 0.0], times, 1e-9, 1e-9, 3)
    assert np.abs(done.states[:, 2] - exact).max() < 1e-6 * exact.max()
    assert done.accepted <= both.accepted


@ADAPTIVE
def test_quaternions_and_samples(run):
    """The projected samples inside steps are as good as the steps: within the tolerance, and cost no evaluation."""
    times = np.linspace(0.0, 6.0, 241)
    exact = np.array([coning(t) for t in times])
    for tolerance in (1e-5, 1e-8):
        few = solve(run, data(CONING), coning(0.0), [0.0, 6.0], tolerance, tolerance, 4)
        many = solve(run, data(CONING), coning(0.0), times, tolerance, tolerance, 4)
        assert (many.evaluations, many.accepted) == (few.evaluations, few.accepted)
        assert np.abs(many.states - exact).max() < 100 * tolerance
        assert np.abs(np.linalg.norm(many.states, axis=1) - 1.0).max() < 4 * np.finfo(float).eps


@ADAPTIVE
def test_segments(run):
    """A right-hand side that jumps is integrated exactly where no step crosses the jump."""
    times = np.linspace(0.0, 2.0, 9)
    done = solve(run, data(SWITCHED), [0.0], times, 1e-8, 1e-8, 1, ends=[SWITCH_ON, SWITCH_OFF, 2.0])
    exact = np.clip(times - SWITCH_ON, 0.0, SWITCH_OFF - SWITCH_ON)
    assert np.abs(done.states[:, 0] - exact).max() < 1e-13
    assert done.rejected == 0


@ADAPTIVE
def test_statuses(run):
    broken = solve(run, data(BREAKDOWN), [0.0], np.linspace(0, 1, 101), 1e-9, 1e-9, 1)
    assert (broken.status, broken.fault) == (NOT_POSITIVE_DEFINITE, 7)
    assert broken.t == pytest.approx(BREAKDOWN_AT, abs=1e-3)
    assert len(broken.states) >= 50
    limited = solve(run, data(VAN_DER_POL, 1e3), [2.0, -0.66], [0.0, 2.0], 1e-9, 1e-9, 2, max_steps=10)
    assert limited.status == MAX_STEPS
    assert limited.accepted + limited.rejected == 10
    diverged = solve(run, data(BLOW_UP), [1.0], np.linspace(0, 2, 101), 1e-8, 1e-8, 1)
    assert diverged.status in (STEP_TOO_SMALL, NONFINITE)
    assert diverged.t == pytest.approx(1.0, abs=1e-6)
    assert np.isfinite(diverged.states).all()


def test_statuses_of_fixed_steps():
    """y'' = y'^2 from 1, BLOW_UP as a speed, has no solution of a step of 2: Newton's method says so."""
    done = alpha(data(BLOW_UP), [1.0], [0.0, 8.0], 2.0, 0.8, 0, 1)
    assert done.status == NOT_CONVERGED
    assert done.t < 8.0
    limited = alpha(data(OSCILLATOR, 1.0), [1.0, 0.0], [0.0, 8.0], 0.1, 0.8, 1, 2, max_steps=10)
    assert (limited.status, limited.accepted) == (MAX_STEPS, 10)
