"""A name that a result does not have is refused by its place, with the names that it has."""

from __future__ import annotations

import copy
import pickle

import pytest

import flexmb as fm
from tests.flexmb.system.argument_kinds import W


def _results() -> list[tuple[object, str]]:
    run, tree, state = W.run, W.tree, W.state
    found = tree.evaluate(state.t, state.q, state.u), tree.evaluation_derivatives(state)
    kept = run, pickle.loads(pickle.dumps(run)), copy.deepcopy(run), run.then(run)
    return [(each, "elbow") for each in (*found, *kept)]


def test_a_name_that_is_not_there_is_refused_with_the_remedy():
    for result, hinge in _results():
        assert hinge in result.loads and isinstance(result.loads, dict)
        with pytest.raises(KeyError, match=r"loads\[.elbw.\].*did you mean \"elbow\""):
            result.loads["elbw"]
        with pytest.raises(KeyError, match=r"markers\[.nobody.\].*use one of: centre"):
            result.markers["nobody"]
        with pytest.raises(KeyError, match=r"energy\[5\].*use one of: gravity, kinetic"):
            result.energy[5]
        assert result.loads.get("nobody") is None and "nobody" not in result.loads


def test_an_argument_of_the_builder_that_does_not_exist_is_refused_with_the_remedy():
    builder = fm.SceneBuilder("s")
    with pytest.raises(TypeError, match=r"rigid_body\(\) has no argument \"mas\": did you mean \"mass\""):
        builder.rigid_body("a", mas=2.0, inertia=(1.0, 1.0, 1.0))
    with pytest.raises(TypeError, match="agle.*angle"):
        builder.revolute("h", "ground", "a", agle=0.5)
