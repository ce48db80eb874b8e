"""How the modes of 10 beams are eliminated: the forms against each other, the rule, and the composite-body algorithm.

python -m pytest tests/benchmarks/test_elimination.py --benchmark-columns=min,median
"""

import pytest

import flexmb as fm
from tests.benchmarks.rivals import flexible_chain, interleaved, record
from tests.benchmarks.routes import articulated, composite_body

FORMS = ("explicit", "woodbury", "condensed")


@pytest.mark.parametrize("level", ["ruthless", "full"])
@pytest.mark.parametrize("modes", [1, 2, 5, 8, 10, 12, 15, 20, 40])
def test_forms(benchmark, modes, level):
    """The form that the rule chooses against each form forced; rivals' ratios below one mean that the rule is wrong."""
    scene = flexible_chain(10, modes, level)
    routes = [articulated(fm.compile(scene, form)) for form in ("fastest", *FORMS)]
    times = interleaved(*routes)
    record(benchmark, times[0], **dict(zip(FORMS, times[1:], strict=True)))
    benchmark.pedantic(routes[0], rounds=20, iterations=10)


@pytest.mark.parametrize("modes", [1, 2, 5, 10, 20])
def test_composite_bodies(benchmark, modes):
    """Jain & Rodriguez, figure 2: articulated against composite bodies, at level ruthless."""
    system = fm.compile(flexible_chain(10, modes, "ruthless"))
    routes = articulated(system), composite_body(system)
    times = interleaved(*routes)
    record(benchmark, times[0], composite=times[1])
    benchmark.pedantic(routes[0], rounds=20, iterations=10)
