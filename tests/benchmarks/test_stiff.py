"""Which integrator is fastest on the stiff cases at which accuracy: `pytest tests/benchmarks/test_stiff.py`."""

import pytest

from tests.benchmarks.stiff import CASES, RELEASES, fastest, work_precision


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("case", CASES)
def test_fastest_at_each_accuracy(benchmark, case, release):
    """Reported: milliseconds of the fastest run of each method that errs by less than 1e-4, 1e-6 and 1e-8 m."""
    points = benchmark.pedantic(lambda: work_precision(case, release), rounds=1)
    for error in (1e-4, 1e-6, 1e-8):
        times = {method: round(1e3 * seconds, 2) for method, seconds in fastest(points, error).items()}
        benchmark.extra_info[f"{error:.0e} m, ms"] = times
    assert points["dop853"].size and points["exponential"].size
