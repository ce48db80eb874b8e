"""What a reference is called follows from the routes that are stored, and what its provenance says of them is true."""

import re

import pytest

from crosscheck.library.basis import WITNESS, Basis, basis, contradiction
from crosscheck.library.case import ReferenceKind
from crosscheck.library.find import Case
from crosscheck.library.reference import load_reference
from tests.crosscheck.sessions import shipped

CASES = [case for case in shipped() if case.provenance is not None]
NUMBERS = {"two": 2, "three": 3, "four": 4}
ON_NATIVE_ALONE = 6
"""Closed chains of flexible bodies, welded pieces of level stiffened, controllers and events, which no peer holds
exactly."""


def stored(case: Case) -> Basis:
    return basis(load_reference(case.folder).knowledge.routes)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_label_follows_from_the_routes(case: Case) -> None:
    assert case.provenance is not None
    assert not contradiction(case.provenance.reference, stored(case))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_as_many_codes_are_stored_as_are_spoken_of(case: Case) -> None:
    assert case.provenance is not None
    text = " ".join(case.provenance.uncertainty.split())
    for word in re.findall(r"\b(two|three|four)(?: independent)? codes\b", text):
        assert len(stored(case).codes) == NUMBERS[word], text


def test_few_references_rest_on_native_alone() -> None:
    alone = [case.name for case in CASES if stored(case).alone]
    assert len(alone) <= ON_NATIVE_ALONE, alone


NATIVE = ("native, dop853 rtol=1e-11", "native-composite, rk4 h=0.001")


@pytest.mark.parametrize("routes, kind", [
    (NATIVE, "native, two formulations"),
    ((*NATIVE, f"exudyn, TrapezoidalIndex2 h=0.001, {WITNESS}"), "independent codes"),
    ((*NATIVE, f"equations.py, equations of its own, {WITNESS}"), "independent codes"),
    (("exact.py, a closed form", *NATIVE), "closed form"),
    (("native, dop853 rtol=1e-11", "pinocchio, DOP853 rtol=1e-11"), "independent codes"),
])  # fmt: skip
def test_what_routes_make_a_reference(routes: tuple[str, ...], kind: ReferenceKind) -> None:
    found = basis(routes)
    assert found.kind == kind
    assert not contradiction(kind, found) and not contradiction("published", found)
    others: list[ReferenceKind] = ["closed form", "independent codes", "native, two formulations"]
    assert all(contradiction(other, found) for other in others if other != kind)


def test_witnesses_are_marked() -> None:
    exudyn = f"exudyn, TrapezoidalIndex2 h=0.001, {WITNESS}"
    assert basis((*NATIVE, exudyn)).words == "native, exudyn (witness)"
    assert basis((*NATIVE, f"e.py, equations of its own, {WITNESS}")).words == "equations of its own (witness), native"
    assert basis((*NATIVE, exudyn, "exudyn, DOPRI5 rtol=1e-09")).words == "native, exudyn"


def test_high_precision_is_another_word_for_native_alone() -> None:
    assert not contradiction("high precision", basis(NATIVE))
    assert "pinocchio" in contradiction("high precision", basis((*NATIVE, "pinocchio, DOP853 rtol=1e-11")))
    assert basis(NATIVE).words == "native alone (native, native-composite)"
