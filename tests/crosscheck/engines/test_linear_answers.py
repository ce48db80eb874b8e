"""Answers of the linearised motion that the contract does not allow are refused with their reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.answers import BrokenContract, checked_run
from crosscheck.engines.contract import Trajectory
from crosscheck.engines.linear.coordinates import coordinate_names, obstacle
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Scene

TIMES = np.array([0.0, 0.5, 1.0])


def scene(closed: bool = False) -> Scene:
    tree = SceneBuilder("arm", gravity=(0.0, 0.0, -9.81))
    for name, parent in (("upper", "ground"), ("lower", "upper"), ("tool", "lower")):
        tree.rigid_body(name, mass=1.0, inertia=(0.1, 0.1, 0.1))
        driven = {"prescribed": Constant(value=0.1)} if name == "lower" else {}
        tree.revolute(f"to {name}", parent, name, axis=(0.0, 1.0, 0.0), **driven)
    if closed:
        tree.closure("loop", "spherical", "ground", "tool")
    return tree.marker("tool", "tool").scene()


def answer(**change: Any) -> Trajectory:
    given: dict[str, Any] = {
        "derivatives": {name: np.ones((3, 4)) for name in DERIVATIVES},
        "frequencies": np.tile([0.0, 2.0], (3, 1)),
        "known_to": dict.fromkeys((*DERIVATIVES, FREQUENCIES), np.full(3, 1e-12)),
    }
    return Trajectory("finished", "", TIMES, {}, **(given | change))


def test_a_sound_answer_is_kept_as_it_is() -> None:
    found = checked_run(answer(), TIMES, scene())
    assert all(np.array_equal(found.derivatives[name], np.ones((3, 4))) for name in DERIVATIVES)
    assert coordinate_names(scene()) == ("to upper.rotation", "to tool.rotation")


def test_an_engine_may_say_that_it_does_not_know() -> None:
    unsure = answer().known_to | {"by_speed": np.array([1e-12, np.inf, np.inf])}
    assert np.isinf(checked_run(replace(answer(), known_to=unsure), TIMES, scene()).known_to["by_speed"][1:]).all()


KNOWN = answer().known_to
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "another name": ({"derivatives": {"by_time": np.ones((3, 4))}}, "derivatives has 'by_time'"),
    "another size": ({"derivatives": answer().derivatives | {"by_speed": np.ones((3, 9))}}, "4 belong to the"),
    "a matrix a sample": ({"derivatives": answer().derivatives | {"by_speed": np.ones((3, 2, 2))}}, "has shape"),
    "no number": ({"derivatives": answer().derivatives | {"by_force": np.full((3, 4), np.nan)}}, "is not finite"),
    "no error": ({"known_to": {name: KNOWN[name] for name in DERIVATIVES}}, "see frequencies"),
    "an error of nothing": ({"frequencies": None}, "see frequencies"),
    "a negative error": ({"known_to": KNOWN | {"by_force": np.array([0.0, -1e-9, 0.0])}}, "negative number or none"),
    "an error that is none": ({"known_to": KNOWN | {"by_force": np.array([0.0, np.nan, 0.0])}}, "negative number or"),
    "falling": ({"frequencies": np.tile([2.0, 1.0], (3, 1))}, "do not rise"),
    "negative": ({"frequencies": np.tile([-2.0, 1.0], (3, 1))}, "negative ones"),
    "too many": ({"frequencies": np.tile([0.0, 1.0, 2.0], (3, 1))}, "frequencies has 3 columns"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_refused(wrong: str) -> None:
    change, reason = WRONG[wrong]
    with pytest.raises(BrokenContract) as refused:
        checked_run(answer(**change), TIMES, scene())
    assert reason in str(refused.value)


def test_derivatives_of_a_closed_chain_are_refused_and_its_frequencies_are_not() -> None:
    closed = scene(closed=True)
    assert obstacle(closed) == '"loop": displacements of a closed chain depend on each other'
    with pytest.raises(BrokenContract, match="without shared coordinates"):
        checked_run(answer(), TIMES, closed)
    alone = answer(derivatives={}, frequencies=np.ones((3, 1)), known_to={FREQUENCIES: np.zeros(3)})
    assert checked_run(alone, TIMES, closed).frequencies is not None
