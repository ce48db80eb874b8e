"""Kernels do not grow unnoticed: no clock, so no noise. If growth is meant: python -m tests.flexmb.jit.kernel_budget.

Every scene is compiled anew in a process of its own, all four in a minute of processor time.
"""

from __future__ import annotations

import msgspec
import pytest

from flexmb.jit import hooks
from flexmb.jit.kernel import helper, kernel
from tests.flexmb.jit.kernel_budget import (
    SCENES,
    Budget,
    baseline,
    calls,
    compiled_helpers,
    compiler,
    grown,
    measured_apart,
)

SMALL = Budget({"additions": 10, "multiplications": 20}, calls=1, helpers=5)
QUICK = ("full",)  # it has all that a rigid chain has


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SCENES]
)
def test_no_kernel_has_grown(name: str) -> None:
    """Operations by any compiler; calls and helpers by the one that the baseline is of."""
    stored, now = baseline(), measured_apart(name)
    before = stored.scenes[name]
    if stored.compiler != compiler():
        now = msgspec.structs.replace(now, calls=before.calls, helpers=before.helpers)
    print(name, now.figures, "baseline", before.figures)
    assert grown(now, before) == []


def test_every_scene_has_a_baseline() -> None:
    assert set(baseline().scenes) == set(SCENES)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"operations": {"additions": 11, "multiplications": 20}}, "operations: 31 instead of 30"),
        ({"calls": 2}, "calls: 2 instead of 1"),
        ({"helpers": 6}, "helpers: 6 instead of 5"),
    ],
)
def test_growth_is_noticed(changed: dict, said: str) -> None:
    assert grown(msgspec.structs.replace(SMALL, **changed), SMALL) == [said]


def test_what_shrinks_or_stays_is_in_order() -> None:
    assert grown(msgspec.structs.replace(SMALL, calls=0), SMALL) == []
    assert grown(SMALL, SMALL) == []


@helper
def _doubled(x):
    return 2.0 * x


def test_helpers_are_counted_as_they_are_compiled(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(hooks, "cache_directory", lambda: tmp_path)  # where nobody has compiled it

    @kernel
    def fresh(x):
        return _doubled(x) + 1.0

    assert compiled_helpers(lambda: fresh(1.0)) == 1
    assert compiled_helpers(lambda: fresh(1.0)) == 0  # nothing is left to compile


MODULE = """
declare double @sin(double)
declare double @llvm.fabs.f64(double)
define linkonce_odr double @part(double %x) noinline {
  %y = call double @sin(double %x)
  ret double %y
}
define double @entry(double %x, ptr %f) {
  %a = call double @part(double %x)
  %b = call double @part(double %a)
  %c = call double @llvm.fabs.f64(double %b)
  %d = call double %f(double %c)
  ret double %d
}
define double @wrapper(double %x, ptr %f) {
  %a = call double @entry(double %x, ptr %f)
  ret double %a
}
"""


def test_calls_are_those_that_the_entry_reaches() -> None:
    """Not sines and intrinsics, and not what wraps the entry for Python."""
    found = calls(MODULE, "entry")
    assert found.pop("part") == 2
    assert found.total() == 1  # by address
    assert calls(MODULE, "part").total() == 0
