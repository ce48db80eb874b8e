"""Python's objects are read in versions that are tested here, where nobody forbids it, and nowhere else."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable

import numpy as np
import pytest

import flexmb as fm
from flexmb.entry import object_access
from flexmb.entry.object_access import NUMPYS, PYTHONS, SWITCH, is_tested, may_read_objects
from flexmb.system import evaluator as evaluator_module
from tests.benchmarks.rivals import rigid_chain
from tests.repo.project import PYPROJECT

Call = Callable[..., np.ndarray]


@pytest.fixture
def step_by_step(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry for each call that compiled code has left to Python, from now on."""
    calls = list[int]()
    careful = evaluator_module._Careful.__call__

    def noted(self: object, *args: object, **named: object) -> np.ndarray:
        calls.append(1)
        return careful(self, *args, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(evaluator_module._Careful, "__call__", noted)
    return calls


def made() -> tuple[Call, Call, fm.State]:
    """An evaluator, the accelerations that it should find, and a state."""
    system = fm.compile(rigid_chain(3))
    return system.evaluator(), lambda t, q, u: system.evaluate(t, q, u).accelerations, system.initial_state


@pytest.mark.parametrize("version", PYTHONS, ids=lambda version: "{}.{}".format(*version))
def test_objects_of_a_version_are_read(version: tuple[int, int], step_by_step: list[int]) -> None:
    """Numbers and arrays of all kinds and places, new ones at every call, and none of them is kept or let go."""
    if sys.version_info[:2] != version:
        pytest.skip("for the suite under that interpreter")
    assert is_tested() and may_read_objects()
    evaluator, expected, state = made()
    rng = np.random.default_rng(0)
    for _ in range(200):
        t, rows = float(rng.normal()), rng.normal(size=(4, len(state.q)))
        for q, u in ((rows[0], rows[1]), (rows[2].copy(), rows[3:].ravel()), (np.asfortranarray(rows[1]), rows[0])):
            assert np.array_equal(evaluator(t, q, u), expected(t, q, u))
        gc.collect(0)
    t, q, u = 0.123, state.q.copy(), state.u.copy()
    held = [t, q, u, q.dtype, evaluator(t, q, u)]
    before = [sys.getrefcount(each) for each in held]
    for _ in range(1000):
        evaluator(t, q, u)
    assert [sys.getrefcount(each) for each in held] == before
    assert not step_by_step


def test_every_version_that_is_supported_is_decided() -> None:
    """A new one in the metadata needs its test, or evaluators that work step by step, which is decided here."""
    prefix = "Programming Language :: Python :: "
    supported = [each.removeprefix(prefix) for each in PYPROJECT["project"]["classifiers"] if each.startswith(prefix)]
    assert supported == ["{}.{}".format(*version) for version in PYTHONS]


@pytest.mark.parametrize("name, value", [("PYTHONS", ((3, 9),)), ("NUMPYS", (1,))])
def test_other_versions_work_step_by_step(
    name: str, value: tuple[object, ...], monkeypatch: pytest.MonkeyPatch, step_by_step: list[int]
) -> None:
    monkeypatch.setattr(object_access, name, value)
    assert not may_read_objects()
    evaluator, expected, state = made()
    assert np.array_equal(evaluator(0.0, state.q, state.u), expected(0.0, state.q, state.u))
    assert step_by_step


def test_an_interpreter_without_its_lock_is_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(object_access.sysconfig, "get_config_var", lambda name: 1)
    assert not may_read_objects()


def test_the_switch(monkeypatch: pytest.MonkeyPatch, step_by_step: list[int]) -> None:
    monkeypatch.setenv(SWITCH, "off")
    evaluator, expected, state = made()
    assert np.array_equal(evaluator(0.0, state.q, state.u), expected(0.0, state.q, state.u))
    assert step_by_step and not may_read_objects()
    monkeypatch.setenv(SWITCH, "auto")
    assert may_read_objects() == is_tested()
    monkeypatch.setenv(SWITCH, "fast")
    with pytest.raises(ValueError, match=r"""FLEXMB_READ_OBJECTS is 'fast': use "auto", .* or "off\""""):
        fm.compile(rigid_chain(1)).evaluator()


def test_numpy_of_this_process_is_a_tested_one() -> None:
    assert int(np.__version__.split(".")[0]) in NUMPYS
