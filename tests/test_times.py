"""The rule that keeps the suite short notices a file that grows, and is not misled by a slow or busy machine."""

from __future__ import annotations

import pytest

from tests.times import EXEMPT, LIMIT_S, WHOLE, excesses

EVEN = {f"tests/test_{i}.py": 2.0 for i in range(400)}


@pytest.mark.parametrize("slower", [1.0, 5.0])
def test_files_are_judged_by_their_share(slower: float) -> None:
    even = {file: slower * seconds for file, seconds in EVEN.items()}
    grown = even | {"tests/test_7.py": slower * 60.0}
    assert excesses(even, WHOLE, shared=True) == []
    (found,) = excesses(grown, WHOLE, shared=True)
    assert found.startswith("tests/test_7.py takes ")
    assert excesses(even | {EXEMPT: slower * 60.0}, WHOLE, shared=True) == []
    assert excesses(grown, WHOLE - 1, shared=False) == []  # a part of the suite


def test_the_whole_is_judged_where_the_machine_was_not_shared() -> None:
    slow = dict.fromkeys(EVEN, 1.01 * LIMIT_S / len(EVEN))
    (found,) = excesses(slow, WHOLE, shared=False)
    assert found.startswith("the suite takes ")
    assert excesses(slow, WHOLE, shared=True) == []
