"""SID files as other programs write them: two dialects, and blocks that contradict each other.

Bodies are held against kinetic energies of random point masses, which have no formula in common with SID files.
"""

from __future__ import annotations

import re
from dataclasses import fields, replace

import numpy as np
import pytest

import flexmb as fm
from flexmb.interchange.sid import Sid, SidError, Taylor, imported_sid, read_sid, sid_of, with_sid_bodies, write_sid
from flexmb.scene.bodies import ModalBody
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.modal_data import inertia_points, modal_arrays
from tests.bounds import relative
from tests.flexmb.interchange.made_bodies import beam

PARTS = {"Gr": "Cr", "Cr": "Gr", "Ct": "mdCM", "Oe": "J"}
"""Blocks, and for each one that says the same thing."""


def points(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masses (n,) of a random body, positions (n,3) and modes (n,3,m), m = 1 to 4."""
    random, m = np.random.default_rng(seed), 1 + seed % 4
    return random.uniform(0.1, 2.0, 12), random.normal(size=(12, 3)), random.normal(size=(12, 3, m))


def made(mass: np.ndarray, position: np.ndarray, modes: np.ndarray) -> ModalBody:
    m = modes.shape[2]
    node = {
        "name": "tip", "position_m": position[0], "quaternion": (1.0, 0.0, 0.0, 0.0),
        "translation_modes": modes[0].T, "rotation_modes": np.zeros((m, 3)),
    }  # fmt: skip
    given = {
        "name": "made", "points": inertia_points(mass, position, modes), "stiffness": np.diag(1.0 + np.arange(m)),
        "boundary": "free-free", "level": "full", "nodes": [node],
    }  # fmt: skip
    return to_struct(plain(given), ModalBody)


def mass_matrix(mass: np.ndarray, position: np.ndarray, modes: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Of translation, rotation and modes, (6+m, 6+m), at modal coordinates q: sum m V' V over velocities V."""
    total = 0.0
    for m, r, phi in zip(mass, position + modes @ q, modes, strict=True):
        turned = np.array([[0.0, r[2], -r[1]], [-r[2], 0.0, r[0]], [r[1], -r[0], 0.0]])
        V = np.hstack([np.eye(3), turned, phi])
        total = total + m * V.T @ V
    return total


def of_body(body: ModalBody, q: np.ndarray) -> np.ndarray:
    arrays = modal_arrays(body)
    return mass_matrix(arrays.mass, arrays.position, arrays.translation_modes, q)


def blocks(sid: Sid) -> dict[str, Taylor]:
    return {field.name: block for field in fields(sid) if isinstance(block := getattr(sid, field.name), Taylor)}


@pytest.mark.parametrize("seed", range(30))
def test_both_dialects_are_told_apart_and_have_the_same_body(seed, tmp_path):
    given = points(seed)
    sid = sid_of(made(*given))
    for dialect in ("wallrapp", "fembs"):
        write_sid(sid, tmp_path / "made.sid", dialect)
        back = read_sid(tmp_path / "made.sid")
        for name, block in blocks(sid).items():
            other = blocks(back)[name]
            assert np.array_equal(block.zero, other.zero), (dialect, name)
            assert block.first is other.first is None or np.array_equal(block.first, other.first), (dialect, name)
        imported = imported_sid(back, "made")
        assert imported.body.level == "full" and imported.notes == ()
        for q in np.random.default_rng(seed).normal(size=(2, given[2].shape[2])):
            assert relative(of_body(imported.body, q), mass_matrix(*given, q)) < 1e-9


def test_the_dialects_have_the_forms_that_they_are_named_for(tmp_path):
    """J as xx, yy, zz, xy, xz, yz; the first columns of Gr those of the x axis, by mode."""
    sid = sid_of(made(*points(2)))
    write_sid(sid, tmp_path / "made.sid", "fembs")
    text = (tmp_path / "made.sid").read_text()
    assert "new modal = made\n" in text
    J = text[text.index("    J\n") : text.index("    end J")]
    assert "nrow = 6" in J and f"m0(5,1) = {sid.J.zero[0, 2]:.17g}\n" in J
    assert f"m0(6,1) = {sid.J.zero[1, 2]:.17g}\n" in J
    Gr = text[text.index("    Gr\n") : text.index("    end Gr")]
    assert f"m0(1,2) = {sid.Gr.zero[0, 3]:.17g}\n" in Gr  # of the second mode, x


@pytest.mark.parametrize("block", PARTS)
def test_blocks_that_contradict_each_other_are_noted_with_figures(block):
    """One of the mass matrix at rest is taken: that is the body's if the other one is spoiled."""
    given = points(3)
    sid = sid_of(made(*given))
    spoiled = Taylor(1.1 * getattr(sid, block).zero, getattr(sid, block).first)
    found = imported_sid(replace(sid, **{block: spoiled}), "made")
    first = next(
        disagreement for disagreement in found.disagreements if PARTS[block] in disagreement and block in disagreement
    )
    assert "contradict each other, by" in first and first.endswith("is taken")
    at_rest = of_body(found.body, np.zeros(given[2].shape[2]))
    wanted = mass_matrix(*given, np.zeros(given[2].shape[2]))
    if block in ("Ct", "Cr"):
        column = slice(0, 3) if block == "Ct" else slice(3, 6)
        wanted[column, 6:] *= 1.1
        wanted[6:, column] *= 1.1
    assert relative(at_rest, wanted) < 1e-9


def test_a_sid_body_of_a_scene_warns_of_contradictions(tmp_path):
    sid = sid_of(made(*points(3)))
    write_sid(replace(sid, Gr=Taylor(1.1 * sid.Gr.zero, sid.Gr.first)), tmp_path / "made.sid")
    hung = fm.SceneBuilder("hung").sid_body("made", file=str(tmp_path / "made.sid"))
    scene = hung.weld("base", "ground", "made", child_node="tip").scene()
    with pytest.warns(fm.SceneWarning) as told:
        with_sid_bodies(scene)
    assert any(re.search(r"made\.sid: Gr and Cr contradict each other, by .* Cr is taken", str(each)) for each in told)


def test_momentum_beyond_the_modal_mass_is_cut_for_level_ruthless():
    """More than (sum m phi)^2 <= sum m sum m phi^2 allows: modal masses, and thus clamped frequencies, are kept."""
    sid = sid_of(beam())
    too_much = replace(sid, Ct=Taylor(3.0 * sid.Ct.zero, sid.Ct.first))
    found = imported_sid(too_much, "rod")
    assert found.body.level == "ruthless"
    assert any(
        disagreement.startswith("Ct and Me contradict") and "Me is taken" in disagreement
        for disagreement in found.disagreements
    )
    M = of_body(found.body, np.zeros(5))
    assert relative(M[6:, 6:], sid.Me.zero) < 1e-9 and np.min(np.linalg.eigvalsh(M)) > 0.0
    assert relative(M[3:6, 6:], sid.Cr.zero.T) < 1e-9
    with pytest.raises(SidError, match='use level "ruthless"'):
        imported_sid(too_much, "rod", "linear")


@pytest.mark.parametrize("level", ["linear", "full"])
def test_a_level_that_needs_changes_of_inertia_takes_near_masses_where_none_have_them(level):
    """Gr with a slope of which no masses have the second moments: at rest the body is that of the file all the same."""
    given = points(2)
    sid = sid_of(made(*given))

    def spoiled(by: float) -> Sid:
        slope = sid.Gr.first.copy()
        slope[0, 0, 0] += by * np.abs(slope).max()
        return replace(sid, Gr=Taylor(sid.Gr.zero, slope))

    found = imported_sid(spoiled(-1.0), "made", level)
    assert found.body.level == level
    assert any(re.search(r"near masses, which have frequencies that are off by 0\.\d", note) for note in found.notes)
    at_rest = mass_matrix(*given, np.zeros(3))
    assert relative(of_body(found.body, np.zeros(3)), at_rest) < 1e-9
    with pytest.raises(SidError, match='the limit is 0.25: .* level "ruthless"'):
        imported_sid(spoiled(4.0), "made", level)


def planar_points() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    mass, position, modes = points(1)
    position[:, 1:] = 0.0
    modes[:, 2] = 0.0
    return mass, position, modes


def test_a_file_of_a_planar_program_moves_in_its_plane():
    """J and Gr have entries about z only: the mass matrix of x, y, the turn about z and the modes is that of points."""
    given = planar_points()
    sid = sid_of(made(*given))
    only_z = np.diag([0.0, 0.0, 1.0])
    flat = replace(
        sid,
        J=Taylor(only_z * sid.J.zero, sid.J.first * only_z[:, None]),
        Gr=Taylor(np.tile(only_z, len(sid.modes)) * sid.Gr.zero),
        Oe=Taylor(sid.Oe.zero * [0, 0, 1, 0, 0, 0], sid.Oe.first * [0, 0, 1, 0, 0, 0]),
    )
    found = imported_sid(flat, "flat")
    assert found.body.level == "ruthless" and "zz only" in found.notes[0]
    plane = np.ix_([0, 1, 5, 6, 7], [0, 1, 5, 6, 7])
    assert relative(of_body(found.body, np.zeros(2))[plane], mass_matrix(*given, np.zeros(2))[plane]) < 1e-9


def test_an_impossible_inertia_is_refused_or_repaired():
    sid = sid_of(made(*points(3)))
    wrong = replace(sid, J=Taylor(sid.J.zero * np.diag([1.0, 1.0, 9.0]), sid.J.first))
    with pytest.raises(SidError, match="mdCM and J.*flexmb import --repair"):
        imported_sid(wrong, "made")
    found = imported_sid(wrong, "made", repair=True)
    assert any("J was changed by" in disagreement for disagreement in found.disagreements)
    assert imported_sid(sid, "made", repair=True) == imported_sid(sid, "made")  # what is possible stays as it is


def test_a_frame_beside_every_node_is_held_if_modes_have_momentum():
    """The tangent frame of some programs, at none of the nodes that they write."""
    sid = sid_of(beam())
    tip = next(node for node in sid.nodes if node.name == "tip")
    assert imported_sid(replace(sid, nodes=(tip,)), "rod").body.boundary == "clamped-free"
