"""What closed chains and runs are given: numbers that fit, and scenes."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from tests.flexmb.closure import mechanisms as m

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


@pytest.mark.parametrize("call", [flexmb.compile, lambda what: flexmb.simulate(what, 1.0)])
@pytest.mark.parametrize("what", ["scene.toml", None, {"name": "scene"}])
def test_what_is_no_scene_is_named(call, what):
    with pytest.raises(TypeError, match=f"a Scene is needed, not {type(what).__name__}: load_scene reads one"):
        call(what)
