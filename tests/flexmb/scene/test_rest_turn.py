"""Beams that are curved at rest: default points follow the axis, and checks tell what too few of them leave out."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.modal.exact import exact_model
from flexmb.modal.strain_field import strain_field
from flexmb.scene import schema as s
from flexmb.scene.bodies import MOST_POINTS
from flexmb.scene.check import check_scene
from flexmb.scene.rest_turn import follow, turns_of_pieces
from flexmb.scene.strains import REST_LEFT_OUT, points_of_piece
from tests.flexmb.levels.strain_beams import PLANE, SPACE, beam, body_of, stations


def coil(turns, count, points=None, pitch=0.3, families=SPACE, **more):
    """A rod of length 1 that is wound to a helix, or to a circle where the pitch angle (rad) is zero."""
    curvature = 2.0 * pi * turns * np.array([np.sin(pitch), 0.0, np.cos(pitch)])
    modes = s.Modes(count=count, points=points, families=families, **more)
    return beam(modes, section=stations(1.0, curvature, rotary=1e-5))


def first(*args, **more):
    """The lowest frequency (rad/s) of a clamped coil."""
    return float(np.sqrt(np.diag(exact_model(body_of(coil(*args, **more))).stiffness).min()))


def doubts(*args, **more):
    """What the check says of a coil, by the word that waives it."""
    scene = coil(*args, **more).weld("clamp", "ground", "rod").scene()
    return {each.waiver: each for each in check_scene(replace(scene, allow=("wave_speed",)))}


@pytest.mark.parametrize("turn", [0.5, 1.0, 3.0, 2.0 * pi, 20.0, 16.0 * pi, 100.0, 200.0])
def test_points_that_follow_a_turn_put_the_axis_in_its_place(turn):
    """The axis is collocated at so many Gauss points, to 1e-5 of its length."""
    body = body_of(beam(s.Modes(count=1, points=max(2, follow(turn, REST_LEFT_OUT)), families=PLANE),
                        section=stations(1.0, (0.0, 0.0, turn))))  # fmt: skip
    field = strain_field(body, np.linspace(0.1, 1.0, 10))
    assert np.max(np.abs(field.weight @ field.tangent[field.gauss] - field.position)) < 1e-5


def test_default_points_follow_what_is_curved_at_rest():
    """By the 7 points of a straight beam of 4 polynomials the first frequency of a helix was too low, of 6 turns by
    86 %, and of a circle of 8 turns by 81 %."""
    plane = {"pitch": 0.0, "families": ("bending_z",)}
    truth = first(8, 4, 60, **plane)
    assert first(8, 4, 7, **plane) < 0.25 * truth
    assert first(8, 4, **plane) == pytest.approx(truth, rel=1e-6)
    straight = s.Modes(count=4, families=SPACE)
    assert points_of_piece(body_of(beam(straight))) == 7 == points_of_piece(body_of(coil(0.4, 4)))


@pytest.mark.slow
def test_default_points_follow_a_helix():
    truth = first(6, 4, 50)
    assert first(6, 4, 7) < 0.2 * truth
    assert first(6, 4) == pytest.approx(truth, rel=1e-6)


def test_points_of_a_part_between_stations_and_of_pieces():
    """Each interval between stations has points for its own turn; pieces share it."""
    section = [*stations(0.25, (0.0, 0.0, 60.0)), *stations(1.0)]
    section[2] = replace(section[2], x_m=0.25)
    body = body_of(beam(s.Modes(count=3, families=PLANE), section=section))
    field = strain_field(body, np.linspace(0.1, 1.0, 10))
    assert np.max(np.abs(field.weight @ field.tangent[field.gauss] - field.position)) < 1e-5
    parts = turns_of_pieces(body_of(coil(6, 4, pieces=3)))
    assert [(part.piece, round(part.share, 9)) for part in parts] == [(0, 1.0), (1, 1.0), (2, 1.0)]
    assert sum(part.turn for part in parts) == pytest.approx(12.0 * pi)
    assert follow(np.nan, 0.1) == follow(1e300, 0.1) == MOST_POINTS and follow(0.0, 0.1) == 0


@pytest.mark.parametrize("turns", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_polynomials_that_the_check_asks_for_are_enough(turns):
    """Against an independent division of the coil: two pieces a turn, of six polynomials each."""
    said = doubts(turns, 4)
    assert set(said) == {"few_polynomials"} and "body \"rod\"" in said["few_polynomials"].where
    enough = int(said["few_polynomials"].remedy.rpartition("= ")[2])
    assert doubts(turns, enough) == {}
    pieces = first(turns, 6, pieces=2 * turns)
    assert first(turns, enough) == pytest.approx(pieces, rel=2e-3)
    assert first(turns, 4) > 1.005 * pieces


def test_points_that_the_check_asks_for_are_enough():
    said = doubts(2, 13, 14, pitch=0.0)
    assert said == {}
    few = doubts(3, 11, 12)["few_points"]
    enough = int(few.remedy.rpartition("= ")[2])
    assert enough == points_of_piece(body_of(coil(3, 11))) and "few_points" not in doubts(3, 11, enough)
    assert "cut it into more" in doubts(40, 12, 30)["few_polynomials"].remedy


@pytest.mark.parametrize("length", [0.0, -0.0, -1.0, 1e-308])
def test_a_length_that_is_none_is_refused_by_name(length: float) -> None:
    """Before turns and points are estimated for it."""
    scene = coil(2, 6).weld("clamp", "ground", "rod").scene()
    with pytest.raises(fm.SceneError, match=r"length_m|stations cover"):
        check_scene(replace(scene, bodies=(replace(scene.bodies[0], length_m=length),)))
