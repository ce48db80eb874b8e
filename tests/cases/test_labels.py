"""What a reference is called follows from the routes that are stored, and what its provenance says of them is true."""

import re

import pytest

from crosscheck.library.basis import WITNESS, Basis, basis, contradiction
from crosscheck.library.case import ReferenceKind
from crosscheck.library.find import Case
from crosscheck.library.reference import KNOWLEDGE, load_reference
from crosscheck.references.files import NO_WORK
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


RESTING = {f"linearised/{name}" for name in
           ("bend_twist", "cantilever", "hanging_pendulum", "sagging_arm", "spring_chains")}  # fmt: skip


def test_every_reference_of_a_motion_counts_the_work_of_each_effort_and_the_others_say_why_not() -> None:
    """That a run which rests has no counts, though its engine makes some, is tested in test_regenerate.py."""
    known = {case.name: load_reference(case.folder).knowledge for case in CASES}
    assert {name for name, each in known.items() if not each.work} == RESTING
    for case in CASES:
        assert (NO_WORK in (case.folder / KNOWLEDGE).read_text(encoding="utf-8")) == (case.name in RESTING)
        for route in known[case.name].routes if case.name not in RESTING else ():
            name, *efforts = (part for part in route.split(", ") if part != WITNESS)
            if not name.endswith(".py"):
                counted = {run.partition(" (")[0] + run.rpartition(")")[2] for run in known[case.name].work}
                assert {f"{name}, {effort}" for effort in efforts} <= counted, case.name


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
