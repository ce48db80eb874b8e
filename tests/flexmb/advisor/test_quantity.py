"""What the user cares about: words, scales, distances."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.advisor.quantity import Quantity, error, measured, quantities, scales
from tests.flexmb.advisor.scenes import turned


@pytest.fixture(scope="module")
def run() -> fm.Trajectory:
    return fm.simulate(turned(1.0, 0.5), 0.6, rtol=1e-6, samples=21)


def test_words_become_quantities() -> None:
    assert Quantity.parse("load:hub.torque@50") == Quantity("load:hub.torque", 50.0)
    assert Quantity.parse("energy") == Quantity("energy")
    assert str(Quantity.parse("drive:hub@2.5")) == "drive:hub@2.5"


@pytest.mark.parametrize("word", ["energy@", "energy@-1", "energy@much", "energy@nan", "energy@0"])
def test_a_scale_is_a_positive_number(word: str) -> None:
    with pytest.raises(ValueError, match="after @"):
        Quantity.parse(word)


def test_the_default_is_where_the_markers_are() -> None:
    scene = turned(1.0, 0.5)
    assert quantities(None, scene) == (Quantity("marker:*.position"),)
    bare = fm.SceneBuilder("bare").rigid_body("a", mass=1.0, inertia=(1.0, 1.0, 1.0)).free("f", "ground", "a").scene()
    with pytest.raises(ValueError, match="no markers"):
        quantities(None, bare)


def test_a_quantity_that_is_not_there_is_refused_with_those_that_are(run: fm.Trajectory) -> None:
    with pytest.raises(ValueError, match=r"no quantity 'marker:tp.position'.*marker:tip.position"):
        measured((Quantity("marker:tp.position"),), run)


def test_scales_are_given_or_the_range(run: fm.Trajectory) -> None:
    wanted = (Quantity("marker:tip.position"), Quantity("load:hub.torque", 50.0))
    signals = measured(wanted, run)
    positions = run.markers["tip"].position
    farthest = np.linalg.norm(positions - positions[0], axis=1).max()
    assert scales(wanted, signals) == {"marker:tip.position": pytest.approx(farthest), "load:hub.torque": 50.0}


def test_what_stands_still_needs_a_scale_unless_others_of_its_kind_move(run: fm.Trajectory) -> None:
    constant = {"marker:a.position": np.zeros((3, 3))}
    with pytest.raises(ValueError, match="does not change"):
        scales((Quantity("marker:a.position"),), constant)
    both = constant | {"marker:b.position": np.diag([0.0, 2.0, 0.0])}
    assert scales((Quantity("marker"),), both) == {"marker:a.position": 2.0, "marker:b.position": 2.0}


def test_the_error_is_the_largest_distance_over_the_scale() -> None:
    a = {"drive:hub": np.array([[0.0], [1.0], [2.0]]), "energy.total": np.zeros((3, 1))}
    b = {"drive:hub": np.array([[0.0], [1.5], [1.8]]), "energy.total": np.full((3, 1), 3.0)}
    assert error(a, b, {"drive:hub": 2.0}) == pytest.approx(0.25)
    assert error(a, b, {"drive:hub": 2.0, "energy.total": 6.0}) == pytest.approx(0.5)
    assert error(a, {"drive:hub": np.zeros((2, 1))}, {"drive:hub": 2.0}) == np.inf
