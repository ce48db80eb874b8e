"""What closed chains are asked for: numbers that fit, and what their accelerations are worth, by every route."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.scene import schema as s
from flexmb.state import PrecisionWarning
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.singular import FAMILIES

WRONG = {
    "short": np.zeros(2), "long": np.zeros(10**5), "2-D": np.zeros((1, 7)), "complex": np.zeros(7) + 0j,
    "not finite": np.full(7, np.nan), "None": None,
}  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("method", ["motion", "composite_motion", "gaps", "determined"])
def test_what_does_not_fit_is_refused(method, wrong):
    closures = flexmb.compile(m.four_bar()).closures
    with pytest.raises((ValueError, TypeError), match="y: |q\\["):
        getattr(closures, method)(0.0, WRONG[wrong])


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
def test_few_digits_are_told_by_every_route(algorithm):
    """Of a tree with few digits beside a mechanism that has them all."""
    system = flexmb.compile(_together(m.four_bar(), FAMILIES["one_line"](0, 1e-12)))
    state = system.initial_state
    with pytest.warns(PrecisionWarning, match="about 3 of 16 digits"):
        system.accelerations(state, algorithm)


def _together(a: s.Scene, b: s.Scene) -> s.Scene:
    return msgspec.structs.replace(a, bodies=a.bodies + b.bodies, hinges=a.hinges + b.hinges, loads=a.loads + b.loads)


@pytest.mark.parametrize("call", [flexmb.compile, lambda what: flexmb.simulate(what, 1.0)])
@pytest.mark.parametrize("what", ["scene.toml", None, {"name": "scene"}])
def test_what_is_no_scene_is_named(call, what):
    with pytest.raises(TypeError, match=f"a Scene is needed, not {type(what).__name__}: load_scene reads one"):
        call(what)
