"""Scene to scene: modes, spring hinges, initial states."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.testing import assert_allclose

import flexmb as fm
from flexmb.advisor.ladder import highest_frequency, references, rungs
from flexmb.advisor.models import LEVELS, BodyModel, built, fitted_hinge, levels, spring_hinged
from flexmb.modal import flexible_model
from flexmb.surrogate import modal_points
from tests.flexmb.advisor.scenes import beam, loaded, turned


def test_every_rung_of_a_beam_makes_a_scene_that_compiles() -> None:
    scene = turned(1.0, 0.5, planes=("bending_y", "bending_z"))
    for rung in rungs(scene, scene.bodies[0], frozenset({"bending_y"})):
        system = fm.compile(built(scene, (("arm", rung),)))
        assert np.all(np.isfinite(system.accelerations(system.initial_state))), str(rung)
        assert "tip" in system.evaluate(0.0, *_state(system)).markers


def _state(system: fm.System) -> tuple[np.ndarray, np.ndarray]:
    return system.initial_state.q, system.initial_state.u


def test_families_that_nothing_excites_are_left_out_in_some_rungs() -> None:
    scene = turned(1.0, 0.5, planes=("bending_y", "bending_z"))
    every = rungs(scene, scene.bodies[0], frozenset({"bending_y"}))
    assert {rung.families for rung in every} == {(), ("bending_y",)}
    assert {rung.families for rung in rungs(scene, scene.bodies[0], frozenset())} == {()}


def test_other_modes_keep_what_they_can_of_the_initial_state() -> None:
    bent = (0.01, -0.02, 0.005)
    base = beam(fm.SceneBuilder("bent")).revolute("pin", "ground", "arm").marker("tip", "arm", node="tip").scene()
    scene = replace(base, modal_states=(fm.ModalState(body="arm", coordinates=bent, rates=(0.3, 0.0, -0.1)),))
    more = built(scene, (("arm", BodyModel("modes", 5, "full")),)).modal_states[0]
    assert_allclose(more.coordinates, (*bent, 0.0, 0.0), atol=1e-12)
    assert_allclose(more.rates, (0.3, 0.0, -0.1, 0.0, 0.0), atol=1e-12)
    fewer = built(scene, (("arm", BodyModel("modes", 2, "linear")),)).modal_states[0]
    assert_allclose(fewer.coordinates, bent[:2], atol=1e-12)
    assert built(scene, (("arm", BodyModel("rigid")),)).modal_states == ()


def test_damping_listed_by_mode_is_cut_or_continued() -> None:
    scene = turned(1.0, 0.5)
    body = replace(scene.bodies[0], modes=replace(scene.bodies[0].modes, damping_ratio=(0.01, 0.02, 0.03)))
    scene = replace(scene, bodies=(body,))
    ratios = [built(scene, (("arm", BodyModel("modes", n, "full")),)).bodies[0].modes.damping_ratio for n in (2, 5)]
    assert ratios == [(0.01, 0.02), (0.01, 0.02, 0.03, 0.03, 0.03)]


def test_raw_modes_are_cut_to_the_lowest_eigenmodes_they_span() -> None:
    scene = modal_points(turned(1.0, 0.5))
    body = scene.bodies[0]
    rng = np.random.default_rng(5)
    X = rng.normal(size=(3, 3))  # the same three modes, mixed and not normalised

    def mixed(shapes: tuple) -> tuple:
        return tuple(map(tuple, (X.T @ np.array(shapes)).tolist())) if shapes else ()

    points = tuple(
        replace(p, translation_modes=mixed(p.translation_modes), rotation_modes=mixed(p.rotation_modes))
        for p in body.points
    )
    nodes = tuple(
        replace(n, translation_modes=mixed(n.translation_modes), rotation_modes=mixed(n.rotation_modes))
        for n in body.nodes
    )
    K = X.T @ np.array(body.stiffness) @ X
    raw = replace(body, points=points, nodes=nodes, stiffness=tuple(map(tuple, ((K + K.T) / 2.0).tolist())))
    raw = replace(raw, damping=tuple((0.0,) * 3 for _ in range(3)))
    mixed_scene = replace(scene, bodies=(raw,))
    for n in (1, 2, 3):
        cut = highest_frequency(mixed_scene, (("arm", BodyModel("modes", n, "full")),))
        known = np.sqrt(np.array(body.stiffness)[n - 1, n - 1])
        assert cut == pytest.approx(known, rel=1e-9)
    fm.compile(built(mixed_scene, (("arm", BodyModel("modes", 2, "full")),)))


def test_raw_modes_take_their_second_order_field_along() -> None:
    """Cut to the lowest of the beam's own modes they accelerate as the beam with as many."""
    scene = turned(1.0, 0.5)
    stiff = replace(scene, bodies=(replace(scene.bodies[0], level="stiffened"),))
    raw = modal_points(stiff)
    assert levels(raw.bodies[0]) == LEVELS
    assert levels(modal_points(scene).bodies[0]) == LEVELS[:-1]
    rung = (("arm", BodyModel("modes", 2, "stiffened")),)
    one, two = (fm.compile(built(each, rung)) for each in (stiff, raw))
    q, u = one.initial_state.q.copy(), one.initial_state.u.copy()
    q[one.coordinate("arm.modes")], u[one.speed("arm.modes")] = (0.05, -0.01), (0.3, 0.2)
    q[0], u[0] = one.initial_state.q[0], 0.0
    a, b = (system.accelerations(system.state(q, u, 0.2)) for system in (one, two))
    assert_allclose(a, b, rtol=1e-9)


def test_a_spring_hinge_swings_at_the_first_frequency_and_keeps_the_names() -> None:
    scene = loaded(fm.Constant(value=0.0), (0.0, 1.0, 0.0))
    sprung = spring_hinged(scene, "arm")
    system = fm.compile(sprung)
    stiffness = sprung.hinges[1].rotation.stiffness_Nm_rad
    M = system.mass_matrix(system.initial_state)
    first = np.sqrt(flexible_model(scene.bodies[0]).stiffness[0, 0])
    assert np.sqrt(stiffness / M[0, 0]) == pytest.approx(first, rel=1e-9)
    # a uniform cantilever turns about a point 0.132 of its length from the clamp
    assert fitted_hinge(scene, "arm").hinge.point[0] == pytest.approx(0.132, abs=5e-4)
    seen = system.evaluate(0.0, *_state(system))
    assert set(seen.loads) == {"mount", "arm.spring"} and set(seen.markers) == {"tip"}
    assert_allclose(seen.markers["tip"].position, [1.0, 0.0, 0.0], atol=1e-12)


def test_a_spring_hinge_is_refused_where_it_makes_no_sense() -> None:
    scene = loaded(fm.Constant(value=0.0), (0.0, 1.0, 0.0))
    bent = replace(scene, modal_states=(fm.ModalState(body="arm", coordinates=(0.1, 0.0, 0.0)),))
    with pytest.raises(ValueError, match="starts deformed"):
        spring_hinged(bent, "arm")
    with pytest.raises(ValueError, match="no flexible body"):
        spring_hinged(scene, "leg")


def test_references_get_finer_and_pieces_come_last() -> None:
    scene = turned(1.0, 0.5)
    names = [name for name, _ in references(scene)]
    assert names == ["modes", *(f"{n} pieces" for n in (2, 4, 8, 16, 32, 64))]
    bent = replace(scene, modal_states=(fm.ModalState(body="arm", coordinates=(0.1, 0.0, 0.0)),))
    assert [name for name, _ in references(bent)] == ["modes", "still more modes"]
    shapes = replace(scene.bodies[0], modes=fm.Modes(count=3, static=True, families=("bending_y",)))
    static = replace(bent, bodies=(shapes,))
    assert [name for name, _ in references(static)] == ["modes", "more modes", "still more modes"]
    assert len(references(modal_points(scene))) == 1
