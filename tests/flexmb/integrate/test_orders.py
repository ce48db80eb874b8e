"""Orders of convergence, with closed forms. The quaternion problem is projected after every step.

The error C h^p (1 + c h) of a smooth problem has the slope p + 0.7 c h between steps h and h/2, and round-off that is
a twentieth of an error shifts it by log2(1 + 1/20) = 0.07: the slope of the finest pair above that is taken.
"""

import numpy as np
import pytest

from tests.flexmb.integrate.integration_problems import CONING, HARMONIC, TOP, equations, exact, run_dop853_fixed, solve

ROUND_OFF = 5e-16  # root mean square of a few units in the last place of states of size 1
PROBLEMS = {"harmonic": HARMONIC, "quaternion": CONING, "top": TOP}


def last_slope(errors: list[float]) -> float:
    """Slope of the finest refinement above the round-off floor; errors are of steps halved each time."""
    resolved = [e for e in errors if e > 20 * ROUND_OFF]
    assert len(resolved) >= 3, "the problem does not show its order above round-off"
    return float(np.log2(resolved[-2] / resolved[-1]))


def dop853_errors(kind: int, t_end: float, steps: int, x: float) -> tuple[float, float]:
    """Root mean square error over the run: at the ends of the steps, and of the interpolant at their fraction x."""
    y, h = exact(kind, 0.0), t_end / steps
    ends, dense = np.empty((2, steps, len(y)))
    run_dop853_fixed(equations(kind), y, 0.0, h, steps, x, ends, dense, np.zeros(4, np.int64))
    at_ends = np.array([exact(kind, (j + 1) * h) for j in range(steps)])
    between = np.array([exact(kind, (j + x) * h) for j in range(steps)])
    return np.sqrt(np.mean((ends - at_ends) ** 2)), np.sqrt(np.mean((dense - between) ** 2))


@pytest.mark.parametrize("kind", PROBLEMS.values(), ids=PROBLEMS)
def test_rk4_is_of_order_4(kind):
    ends = [solve(kind, [0.0, 3.0], step=3.0 / 2**j).last for j in range(3, 9)]
    assert last_slope([np.abs(end - exact(kind, 3.0)).max() for end in ends]) == pytest.approx(4, abs=0.1)


@pytest.mark.parametrize("kind", PROBLEMS.values(), ids=PROBLEMS)
def test_dop853_is_of_order_8_and_its_interpolant_of_order_7(kind):
    """The interpolant of order 7 has a local error O(h^8)."""
    errors = [dop853_errors(kind, 6.0, 2**j, 0.4) for j in range(2, 8)]
    assert last_slope([end for end, _ in errors]) == pytest.approx(8, abs=0.1)
    assert last_slope([between for _, between in errors]) == pytest.approx(8, abs=0.1)


def test_quaternions_stay_unit():
    times = np.linspace(0.0, 20.0, 41)
    for result in (solve(CONING, times, rtol=1e-4), solve(CONING, times, step=0.1)):
        assert np.abs(np.linalg.norm(result.states, axis=1) - 1.0).max() < 4 * np.finfo(float).eps
