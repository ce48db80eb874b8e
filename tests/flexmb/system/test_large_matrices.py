"""Matrices over all speeds that would not fit into memory are refused with their size and a remedy before any work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import flexmb as fm
from flexmb.scene import sizes

REFUSED: dict[str, tuple[Callable[[Any, Any], Any], str]] = {
    "mass matrix": (lambda system, state: system.mass_matrix(state), "use `factorise`"),
    "composite bodies": (lambda system, _: system.composite_workspace(), "take fewer .*articulated"),
    "derivatives": (lambda system, state: system.acceleration_derivatives(state), "take a scene of fewer"),
    "evaluator": (lambda system, _: system.derivative_evaluator(), "take fewer .*articulated"),
}


@pytest.mark.parametrize("asked", REFUSED)
def test_a_matrix_that_does_not_fit_is_refused_with_its_size(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    builder = fm.SceneBuilder("two")
    for name in "ab":
        builder.rigid_body(name, mass=1.0, com=(1, 0, 0), inertia=(0.1, 0.1, 0.1))
    scene = builder.revolute("i", "ground", "a", axis=(0, 0, 1)).revolute("j", "a", "b", axis=(0, 0, 1)).scene()
    system = fm.compile(scene)
    call, remedy = REFUSED[asked]
    monkeypatch.setattr(sizes, "MOST_BYTES", 8 * 2**2 - 1)
    with pytest.raises(ValueError, match=f"matrix of 2 x 2 numbers, which take .* GiB are allowed: {remedy}"):
        call(system, system.initial_state)
    monkeypatch.setattr(sizes, "MOST_BYTES", 8 * 2**2)
    call(system, system.initial_state)
