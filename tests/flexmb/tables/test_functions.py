"""Functions of time in kernels: rate and acceleration are the derivatives of the value; joins; published profiles."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from flexmb.jit.kernel import kernel
from flexmb.scene.functions import Constant, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.tables.functions import evaluate, pack
from tests.bounds import gamma
from tests.flexmb import spectral

TIMES = tuple(np.linspace(0.0, 3.0, 10))
SAMPLES = tuple(np.random.default_rng(5).uniform(-1.0, 1.0, len(TIMES)))
TABLE = Table(times_s=TIMES, values=SAMPLES)
STEP = SmoothStep(start_value=-0.4, end_value=1.1, start_s=0.5, duration_s=2.0)
SPIN = SpinUp(rate=4.0, duration_s=2.5)
# with a time at which each is analytic within SPAN
SMOOTH = [
    (Constant(value=2.0), 1.0), (Ramp(value=0.3, rate=1.5, start_s=0.2), 1.0),
    (Sine(amplitude=0.7, angular_frequency_rad_s=3.0, phase_rad=0.4, offset=0.1), 0.9), (STEP, 0.2), (STEP, 1.3),
    (STEP, 2.9), (SPIN, 1.0), (SPIN, 3.0), (TABLE, 0.6), (TABLE, 1.5),
    (Pulse(value=3.0, start_s=1.0, duration_s=1.0), 1.5),
]  # fmt: skip
SPAN = 0.15


@kernel
def value_of(functions, table, f, t):
    row = functions[f]
    return evaluate(row.kind, row.data, row.start, row.stop, table, t)


def jet(function: Function, t: float) -> np.ndarray:
    """(value, rate, acceleration); packed between others, so that the places of tables matter."""
    functions, table = pack([TABLE, Constant(value=9.0), function, TABLE])
    return np.array(value_of(functions, table, 2, t))


@pytest.mark.parametrize(("function", "t"), SMOOTH, ids=lambda x: type(x).__name__)
def test_rate_and_acceleration_are_derivatives(function, t):
    values = spectral.along(lambda h: jet(function, t + h)[0], SPAN)
    first, second = spectral.at_zero(values, SPAN)
    _, rate, acceleration = jet(function, t)
    # polynomials of degree seven or a sine: at most twenty roundings of terms up to a hundred times the value
    digits, size = gamma(20), 100.0 * (1.0 + np.max(np.abs(values)))
    assert abs(rate - first) <= spectral.rounding(SPAN, 1, size, digits)
    assert abs(acceleration - second) <= spectral.rounding(SPAN, 2, size, digits)


@pytest.mark.parametrize("t", [0.0, 0.1, 1.0 / 3.0, 0.7, 1.9, 2.999, 3.0])
def test_a_table_is_scipys_quintic_spline(t):
    spline = make_interp_spline(TIMES, SAMPLES, k=5)
    pieces = spline(t), spline(t, 1), spline(t, 2)
    largest = [np.max(np.abs(spline(np.linspace(0.0, 3.0, 301), n))) for n in range(3)]
    for found, expected, size in zip(jet(TABLE, t), pieces, largest, strict=True):
        # from B-spline to power coefficients: a change of basis over intervals of a third of a second
        assert abs(found - expected) <= gamma(6 * 6) * 3.0**5 * size


def test_a_table_passes_through_its_samples_and_reproduces_quintics():
    quintic = np.polynomial.Polynomial([0.2, -1.0, 0.4, 0.3, -0.1, 0.05])
    table = Table(times_s=TIMES, values=tuple(quintic(np.array(TIMES))))
    # the collocation matrix of a quintic spline on equal spaces has a condition of some thousands
    for t in (*TIMES, 0.123, 1.777, 2.9):
        expected = [quintic(t), quintic.deriv()(t), quintic.deriv(2)(t)]
        assert jet(table, t) == pytest.approx(expected, abs=1e4 * gamma(36) * 9.0)
    for t, value in zip(TIMES, SAMPLES, strict=True):
        assert jet(TABLE, t)[0] == pytest.approx(value, abs=1e4 * gamma(36))


@pytest.mark.parametrize(("end", "value"), [(0.5, -0.4), (2.5, 1.1)])
def test_a_smooth_step_joins_without_jerk(end, value):
    """Value at the ends, and acceleration vanishing as the square of the distance to them."""
    assert jet(STEP, end) == pytest.approx([value, 0.0, 0.0], abs=gamma(10))
    h = 1e-4
    inside, outside = (h, -h) if value < 0.0 else (-h, h)
    assert np.array_equal(jet(STEP, end + outside), [value, 0.0, 0.0])
    # s'' = 420 x^2 - ..., x = h / 2 of the duration, over duration^2: the next term is 4 x times smaller
    leading = 1.5 * 420.0 * (h / 2.0) ** 2 / 4.0
    assert abs(jet(STEP, end + inside)[2]) == pytest.approx(leading, rel=5.0 * h)


def test_a_smooth_step_is_antisymmetric_about_its_middle():
    for x in (0.1, 0.4, 0.9):
        after, before = jet(STEP, 1.5 + x), jet(STEP, 1.5 - x)
        assert after[0] + before[0] == pytest.approx(0.7, abs=gamma(400))
        assert after[1:] == pytest.approx([before[1], -before[2]], abs=gamma(4000))


def test_a_spin_up_joins_smoothly():
    before, after = jet(SPIN, np.nextafter(2.5, 0.0)), jet(SPIN, 2.5)
    assert before == pytest.approx(after, abs=gamma(40))
    assert after == pytest.approx([5.0, 4.0, 0.0], abs=gamma(8))


def test_spin_up_of_simo_and_vu_quoc():
    """psi = (6/15) [t^2/2 + (15/2 pi)^2 (cos(2 pi t/15) - 1)] up to 15 s, then 6 t - 45."""
    spin = SpinUp(rate=6.0, duration_s=15.0)
    for t in (0.0, 3.0, 7.5, 14.0):
        psi = 6.0 / 15.0 * (t**2 / 2.0 + (15.0 / (2.0 * np.pi)) ** 2 * (np.cos(2.0 * np.pi * t / 15.0) - 1.0))
        assert jet(spin, t)[0] == pytest.approx(psi, abs=gamma(20) * 45.0)
    assert jet(spin, 20.0) == pytest.approx([75.0, 6.0, 0.0], abs=gamma(4) * 75.0)


def test_spin_up_of_kane_ryan_and_banerjee():
    """omega(t) = (Omega/T) (t - T/(2 pi) sin(2 pi t/T))."""
    spin = SpinUp(rate=4.0, duration_s=15.0)
    for t in (0.5, 6.766, 10.115, 14.9):
        omega = 4.0 / 15.0 * (t - 15.0 / (2.0 * np.pi) * np.sin(2.0 * np.pi * t / 15.0))
        assert jet(spin, t)[1] == pytest.approx(omega, abs=gamma(20) * 4.0)


def test_a_pulse_is_on_and_off():
    pulse = Pulse(value=3.0, start_s=1.0, duration_s=0.5)
    assert [jet(pulse, t)[0] for t in (np.nextafter(1.0, 0.0), 1.0, 1.49, 1.5)] == [0.0, 3.0, 3.0, 0.0]
