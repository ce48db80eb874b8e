"""Special kernels compiled beside: when a process is started for them, and what takes them then."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import flexmb as fm
from flexmb.jit.features import GENERAL
from flexmb.run import beside
from flexmb.tables import features
from flexmb.tables.features import BATCHES, RECURSION, asking, contained
from tests.flexmb.tables.test_features import chain, loop

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def started(monkeypatch) -> list[str]:
    """What a process was started for, where nothing forbids it and nobody has chosen kernels."""
    found: list[str] = []
    monkeypatch.setenv("FLEXMB_KERNELS", "auto")
    monkeypatch.setattr(features, "unfit", lambda: "")
    monkeypatch.setattr(features, "is_warm", lambda found: False)
    monkeypatch.setattr(beside, "is_warm", lambda found: False)
    monkeypatch.setattr(beside, "is_off", lambda: False)
    monkeypatch.setattr(beside, "_computed", {})
    monkeypatch.setattr(beside, "_start", lambda scene, what: found.append(f"{scene.name}: {what}"))
    return found


def test_it_is_started_once_for_scenes_of_a_kind_that_have_computed_for_long(started, monkeypatch):
    one, other = fm.compile(chain(2).scene()), fm.compile(chain(5).scene())
    for system in (one, other):
        beside.computed(system, 0.4 * beside.ENOUGH)
    assert started == []
    for _ in range(3):
        beside.computed(one, beside.ENOUGH)
    assert started == [f"chain: {RECURSION}"]
    beside.computed(one, 2.0 * beside.ENOUGH, BATCHES)
    beside.computed(fm.compile(chain(2, stiffness=1.0).scene()), 2.0 * beside.ENOUGH)
    assert started[1:] == [f"chain: {BATCHES}", f"chain: {RECURSION}"]


def test_runs_and_batches_count(started, monkeypatch):
    monkeypatch.setattr(beside, "ENOUGH", 1e-9)
    system = fm.compile(chain().scene())
    fm.simulate(system, 0.01, "radau5", samples=2)
    fm.simulate(system, 0.01, algorithm="composite", samples=2)
    fm.simulate_batch(system, 0.01, "radau5", samples=2)
    assert started == []
    fm.simulate(system, 0.01, samples=2)
    fm.simulate_batch(system, 0.01, samples=2)
    assert started == [f"chain: {RECURSION}", f"chain: {BATCHES}"]


def test_it_is_not_started_for_what_it_does_not_serve_or_nobody_wants(started, monkeypatch):
    mine = "tests.flexmb.control.laws:proportional"
    law = chain().sense_time("clock").user_law("mine", ["clock"], mine, outputs=1).scene()
    for scene, kernels in ((chain().scene(), "general"), (loop(), None), (law, None)):
        beside.computed(fm.compile(scene, kernels=kernels), 2.0 * beside.ENOUGH)
    system = fm.compile(chain().scene())
    for name in ("is_off", "is_warm"):
        with monkeypatch.context() as patch:
            patch.setattr(beside, name, lambda *_: True)
            beside.computed(system, 2.0 * beside.ENOUGH)
    assert started == []


def test_it_is_off_on_one_core_in_ci_in_tests_and_where_nothing_is_kept(monkeypatch):
    assert beside.is_off()
    monkeypatch.delitem(sys.modules, "pytest")
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1}, raising=False)
    monkeypatch.setattr(beside, "cache_directory", lambda: Path("/"))
    assert not beside.is_off()
    for change in (
        lambda patch: patch.setattr(os, "sched_getaffinity", lambda process: {0}),
        lambda patch: patch.setenv("CI", "true"),
        lambda patch: patch.setattr(beside, "cache_directory", lambda: None),
    ):
        with monkeypatch.context() as patch:
            change(patch)
            assert beside.is_off()


def test_such_a_system_and_its_copies_have_special_kernels_for_the_recursion_alone():
    with asking("beside"):
        system = fm.compile(chain().scene())
    for each in (system, copy.copy(system), copy.deepcopy(system), pickle.loads(pickle.dumps(system))):
        assert each.kernels == "special" and each.constants.features() == {GENERAL}
        assert each.explicit_constants.features() == contained(each.constants)
        assert each.batch.constants(0, None).features() == contained(each.constants)


def test_nobody_asks_for_it_by_the_environment(monkeypatch):
    monkeypatch.setenv("FLEXMB_KERNELS", "beside")
    with pytest.raises(ValueError, match="'beside': use one of"):
        fm.compile(chain().scene())


PROGRAM = """
import pickle
from pathlib import Path
import flexmb as fm
from flexmb.jit.folder import cache_directory
from flexmb.run import beside
from tests.flexmb.tables.test_features import chain

beside.is_off, beside.ENOUGH = lambda: False, 1e-6
scene = chain(3).scene()
before = fm.compile(scene)
run = fm.simulate(before, 0.1, samples=3)
fm.simulate_batch(before, 0.1, samples=3)
assert [process.wait() for process in beside._started] == [0, 0]
kernels = set(cache_directory().glob("*.kernel"))
after = fm.compile(scene)
assert (before.kernels, after.kernels) == ("general", "special")
assert pickle.loads(pickle.dumps(before)).kernels == "general"
again = fm.simulate(after, 0.1, samples=3)
state = after.initial_state
after.evaluator()(0.0, state.q, state.u)
after.evaluate(0.0, state.q, state.u)
after.hinge_loads(state)
fm.linearize(after)
fm.simulate(after, 0.01, "radau5", samples=2)
fm.simulate_batch(after, 0.1, samples=3)
fm.simulate_batch([scene] * 3, 0.1, "rk4", step=1e-2, samples=3)
assert set(cache_directory().glob("*.kernel")) == kernels, "it was waited for a compiler"
wanted = fm.simulate(fm.compile(scene, kernels="special"), 0.1, samples=3)
assert again.u.tobytes() == wanted.u.tobytes() and abs(again.u - run.u).max() < 1e-9
print("right")
"""


@pytest.mark.slow
def test_what_is_compiled_beside_is_taken_later_and_is_all_that_is_needed(tmp_path: Path):
    environment = {name: value for name, value in os.environ.items() if name not in ("CI", "FLEXMB_KERNELS")}
    environment |= {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, cwd=ROOT)
    assert done.stdout == "right\n", done.stderr
    assert done.stderr.count("special kernels are compiled beside") == 2
