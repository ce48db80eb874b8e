"""General kernels do not become dearer to compile unnoticed. Where it is meant: python -m tests.flexmb.jit.code_budget.

An installation spends its minutes on them. Whatever is inlined once more, or compiled for one more set of types, is
seen here: an integrator that had its matrix products inlined at every call took 24 s instead of 6.
"""

from __future__ import annotations

import msgspec
import pytest

from flexmb.jit.installed import installed_directory, is_whole, unfit
from tests.flexmb.jit.code_budget import Codes, added, baselines, grown, measured, renewed

BEFORE = Codes({}, {"a": [1000, 20000], "b": [500]})


def test_no_kernel_has_grown_or_was_added() -> None:
    folder = installed_directory()
    if folder is None or not is_whole():
        pytest.skip(f"not all general kernels of this code came with the installation {unfit()}")
    now, before = measured(folder), baselines()
    assert added(now, before[0]) == []
    assert set(before[0].kernels) <= set(now.kernels), "the baseline names kernels that are no more: write it anew"
    of_this = [codes for codes in before if codes.made == now.made]
    if not of_this:
        pytest.skip(f"bytes were measured on {[codes.made for codes in before]}, and these kernels are of {now.made}")
    assert grown(now, of_this[0]) == []


@pytest.mark.parametrize(
    ("kernels", "said"),
    [
        ({"a": [1000, 21200], "b": [500]}, ["a: 21200 bytes instead of 20000"]),
        ({"a": [1600, 20000], "b": [500]}, ["a: 1600 bytes instead of 1000"]),
        ({"a": [900, 1000, 20000], "b": [500]}, ["a: 3 versions instead of 2"]),
        ({"a": [1000, 20000], "b": [500], "c": [1]}, ["c: 1 versions instead of 0"]),
    ],
)
def test_growth_is_noticed(kernels: dict[str, list[int]], said: list[str]) -> None:
    now = msgspec.structs.replace(BEFORE, kernels=kernels)
    assert added(now, BEFORE) + grown(now, BEFORE) == said


def test_what_shrinks_or_stays_is_in_order() -> None:
    for now in (BEFORE, msgspec.structs.replace(BEFORE, kernels={"a": [20100]})):
        assert added(now, BEFORE) + grown(now, BEFORE) == []


def test_other_processors_keep_what_was_measured_of_the_same_code() -> None:
    other, larger = Codes({"processor": "other"}, BEFORE.kernels), Codes({}, {"a": [1000, 30000], "b": [500]})
    assert renewed(BEFORE, [other]) == renewed(BEFORE, [other, BEFORE]) == [BEFORE, other]
    assert renewed(larger, [BEFORE, other]) == [larger]
    assert renewed(Codes({}, {"a": [1000], "b": [500]}), [other]) == [Codes({}, {"a": [1000], "b": [500]})]
