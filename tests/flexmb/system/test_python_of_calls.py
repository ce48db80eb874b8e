"""How many functions of ours a public call runs around its kernels, which take a few microseconds each.

Held by their number, which is the same on every machine, not by a clock: tests/benchmarks has the times. A call that
derives anew what depends on the system alone shows here by dozens.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import flexmb as fm
from crosscheck.library.find import shipped_folder
from tests.benchmarks.rivals import rigid_chain

OURS = str(Path(fm.__file__).parent)


def functions(call: Callable[[], object]) -> int:
    """How many calls of functions of the package a call makes, once everything is built that is built once."""
    call()
    found = 0

    def count(frame, event: str, _) -> None:
        nonlocal found
        found += event == "call" and frame.f_code.co_filename.startswith(OURS)

    sys.setprofile(count)
    try:
        call()
    finally:
        sys.setprofile(None)
    return found


CALLS: dict[str, Callable[[fm.System], object]] = {
    "acceleration_derivatives": lambda system: system.acceleration_derivatives(system.initial_state),
    "linearize": fm.linearize,
    "simulate": lambda system: fm.simulate(system, 1e-6, samples=2),
}
MOST = {
    "chain of ten": {"acceleration_derivatives": 30, "linearize": 100, "simulate": 190},
    "four-bar": {"acceleration_derivatives": 32, "linearize": 120, "simulate": 300},
}


@pytest.fixture(scope="module")
def systems() -> dict[str, fm.System]:
    loop = fm.load_scene(shipped_folder() / "closed_chains" / "four_bar" / "scene.toml")
    return {"chain of ten": fm.compile(rigid_chain(10)), "four-bar": fm.compile(loop)}


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("scene", MOST)
def test_no_more_than(systems, scene: str, call: str) -> None:
    count = functions(lambda: CALLS[call](systems[scene]))
    assert 0 < count <= MOST[scene][call], (scene, call, count)


def test_what_is_done_twice_is_seen(systems) -> None:
    """A control: two calls in place of one exceed every bound."""
    for scene, most in MOST.items():
        for name, call in CALLS.items():
            assert functions(lambda: [call(systems[scene]) for _ in range(2)]) > most[name]  # noqa: B023
