"""Numbers in messages print differently where they are different."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.clause import ClauseBroken, equal, within
from crosscheck.conformance.digits import told_apart
from crosscheck.conformance.trial import try_clause
from tests.crosscheck.conformance.test_clauses import Falsified, markers


@pytest.mark.parametrize(
    "first, second, told",
    [
        (1.0, 2.0, ("1", "2")),
        (0.3331, 0.3334, ("0.3331", "0.3334")),
        (1 / 3, np.nextafter(1 / 3, 1.0), ("0.3333333333333333", "0.3333333333333334")),
        (float("nan"), 1.0, ("nan", "1")),
        (float("nan"), float("nan"), ("nan", "nan")),
        (float("inf"), 1e300, ("inf", "1e+300")),
        ([1.0, 0.5], [1.0, 0.50001], ("[1 0.5]", "[1 0.50001]")),
        ([1.0], [1.0, 2.0], ("[1]", "[1 2]")),
        ([], [], ("[]", "[]")),
    ],
)
def test_unequal_numbers_are_told_apart(first: object, second: object, told: tuple[str, str]) -> None:
    assert told_apart(first, second) == told


def test_what_may_differ_need_not_be_told_apart() -> None:
    assert told_apart([1.0, 2.0], [1.0 + 1e-12, 3.0], 1e-9) == ("[1 2]", "[1 3]")


def test_messages_show_what_they_compare() -> None:
    with pytest.raises(ClauseBroken, match=r"must be 0\.333333 and is 0\.333334"):
        equal("it", 0.333334, 0.333333)
    with pytest.raises(ClauseBroken, match=r"off by 0\.002793, where 0\.002791 can"):
        within("it", 0.002793, 0.002791)
    with pytest.raises(ClauseBroken, match="off by nan"):
        within("it", float("nan"), 1.0)


@pytest.mark.parametrize("name", ["inner-hinges-accelerate", "gravity-turns-a-level-arm-down"])
def test_an_engine_that_knows_no_accelerations_does_not_offer_them(name: str) -> None:
    silent = Falsified(markers(acceleration=lambda _: None))
    found = try_clause(silent, CLAUSES[name])
    assert (found.status, found.offer) == ("not offered", "give accelerations of markers in evaluate()")
