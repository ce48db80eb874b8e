"""General kernels do not become dearer to compile unnoticed. Where it is meant: python -m tests.flexmb.jit.code_budget.

An installation spends its minutes on them. Whatever is inlined once more, or compiled for one more set of types, is
seen here: an integrator that had its matrix products inlined at every call took 24 s instead of 6.
"""

from __future__ import annotations

import msgspec
import pytest

from flexmb.jit.installed import installed_directory, is_whole, unfit
from tests.flexmb.jit.code_budget import Codes, baseline, grown, measured

BEFORE = Codes({}, {"a": [1000, 20000], "b": [500]})


def test_no_kernel_has_grown() -> None:
    folder = installed_directory()
    if folder is None or not is_whole():
        pytest.skip(f"not all general kernels of this code came with the installation {unfit()}")
    now, before = measured(folder), baseline()
    if now.made != before.made:
        pytest.skip(f"the baseline is of {before.made}, these kernels are of {now.made}")
    assert grown(now, before) == []
    assert set(before.kernels) <= set(now.kernels), "the baseline names kernels that are no more: write it anew"


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
    assert grown(msgspec.structs.replace(BEFORE, kernels=kernels), BEFORE) == said


def test_what_shrinks_or_stays_is_in_order() -> None:
    assert grown(BEFORE, BEFORE) == []
    assert grown(msgspec.structs.replace(BEFORE, kernels={"a": [20100]}), BEFORE) == []
