"""What other programs write in place of zeros changes no verdict on their models: noise of 1e-16 of their scale."""

import re

import numpy as np
import pytest

from flexmb.interchange.mjcf import read_mjcf
from flexmb.interchange.sid import imported_sid, read_sid, sid_of, write_sid
from flexmb.interchange.superelement import SuperElementError, reduced, super_element
from flexmb.interchange.urdf import read_urdf
from flexmb.scene.check import check_scene
from tests.flexmb.interchange.made_bodies import beam, free_beam
from tests.flexmb.interchange.made_robots import MJCF, arm, quadruped

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"
POINT = """<robot name="d"><link name="w"/><link name="a"><inertial><origin xyz="0 0 -0.5"/><mass value="1.3"/>
<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="w"/><child link="a"/><axis xyz="0 1 0"/></joint></robot>"""


def _dusty(text, pattern, rng):
    """Numbers of every match of a pattern, whose first group is a list of numbers, with noise of their largest."""
    groups = {}
    for match in re.finditer(pattern, text):
        size = max((abs(float(word.replace("d", "e"))) for word in re.findall(NUMBER, match[2])), default=0.0)
        groups[match[1]] = max(groups.get(match[1], 0.0), size)

    def changed(match):
        words = (
            f"{float(word.replace('d', 'e')) + 1e-16 * (groups[match[1]] or 1.0) * rng.uniform(-1, 1):.17g}"
            for word in re.findall(NUMBER, match[2])
        )
        return match[0].replace(match[2], " ".join(words))

    return re.sub(pattern, changed, text)


@pytest.mark.parametrize("robot", [arm(), quadruped(), POINT], ids=["arm", "quadruped", "point mass"])
@pytest.mark.parametrize("repair", [False, True])
def test_a_robot(robot, repair, tmp_path):
    (tmp_path / "robot.urdf").write_text(_dusty(robot, r'(i[xyz]|xyz|rpy)[xyz]?="([^"]*)"', np.random.default_rng(1)))
    found = read_urdf(tmp_path / "robot.urdf", repair=repair)
    assert check_scene(found.scene) == () and not any("impossible" in note for note in found.notes)


def test_a_blank_line_before_the_declaration_is_taken(tmp_path):
    (tmp_path / "robot.urdf").write_text('\n  \n<?xml version="1.0"?>\n' + POINT)
    assert len(read_urdf(tmp_path / "robot.urdf").scene.bodies) == 2


def test_a_creature(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "a.xml").write_text(MJCF)
    (tmp_path / "b.xml").write_text(_dusty(MJCF, r'(pos|euler|size|axis)="([^"]*)"', np.random.default_rng(2)))
    assert read_mjcf(tmp_path / "b.xml").notes == read_mjcf(tmp_path / "a.xml").notes


@pytest.mark.parametrize("body", [beam(), free_beam(), beam(level="stiffened")], ids=["beam", "free", "stiffened"])
def test_a_flexible_body(body, tmp_path):
    """The zeros that the file leaves out are written, with noise of the block's largest number."""
    sid = sid_of(body)
    write_sid(sid, tmp_path / "a.sid")
    write_sid(_with_noise(sid, np.random.default_rng(3)), tmp_path / "b.sid")
    clean, dusty = (imported_sid(read_sid(tmp_path / name), "body") for name in ("a.sid", "b.sid"))
    assert dusty.notes == clean.notes and dusty.body.boundary == clean.body.boundary
    assert dusty.body.level == clean.body.level
    assert [node.name for node in dusty.body.nodes] == [node.name for node in clean.body.nodes]


def _with_noise(sid, rng):
    from dataclasses import fields, is_dataclass, replace

    from flexmb.interchange.sid.blocks import Taylor

    def noisy(block):
        size = float(np.max(np.abs(block.zero), initial=0.0))
        zero = block.zero + 1e-16 * size * rng.uniform(-1, 1, block.zero.shape)
        if zero.shape[0] == zero.shape[1] and np.array_equal(block.zero, block.zero.T):
            zero = 0.5 * (zero + zero.T)
        return replace(block, zero=zero)

    assert is_dataclass(sid)
    changed = {field.name: noisy(getattr(sid, field.name)) for field in fields(sid)
               if isinstance(getattr(sid, field.name), Taylor) and field.name not in ("AP",)}  # fmt: skip
    nodes = tuple(replace(node, origin=noisy(node.origin), phi=noisy(node.phi), psi=noisy(node.psi))
                  for node in sid.nodes)  # fmt: skip
    return replace(sid, nodes=nodes, **changed)


def _strip():
    """Three beams with lumped masses: as in the manual."""
    EA, EI, GJ, m, L = 7e6, 56.0, 35.0, 0.27, 0.5
    k = np.zeros((12, 12))
    k[np.ix_([0, 6], [0, 6])] = EA / L * np.array([[1, -1], [-1, 1]])
    k[np.ix_([3, 9], [3, 9])] = GJ / L * np.array([[1, -1], [-1, 1]])
    b = EI / L**3 * np.array([[12, 6 * L, -12, 6 * L], [6 * L, 4 * L**2, -6 * L, 2 * L**2],
                              [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L**2, -6 * L, 4 * L**2]])  # fmt: skip
    k[np.ix_([1, 5, 7, 11], [1, 5, 7, 11])] = b
    turned = np.diag([1, -1, 1, -1])
    k[np.ix_([2, 4, 8, 10], [2, 4, 8, 10])] = turned @ b @ turned
    K, M = np.zeros((24, 24)), np.zeros((24, 24))
    for e in range(3):
        at = slice(6 * e, 6 * e + 12)
        K[at, at] += k
        M[at, at] += np.diag(([m * L / 2] * 3 + [1e-5] * 3) * 2)
    return K, M, np.column_stack([np.arange(4) * L, np.zeros((4, 2))])


def _noise(matrix, rng, share):
    found = rng.uniform(-1.0, 1.0, matrix.shape)
    return matrix + share * np.max(np.abs(matrix)) * 0.5 * (found + found.T)


@pytest.mark.parametrize("share", [1e-17, 1e-16])
@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e3])
def test_a_structure_with_dust_is_free(share, unit):
    """As CalculiX and Abaqus write matrices; also with masses and forces in other units."""
    K, M, position = _strip()
    rng = np.random.default_rng(4)
    clean = reduced(super_element(K * unit, M * unit, position), [1, 4], 4)
    dusty = reduced(super_element(_noise(K * unit, rng, share), _noise(M * unit, rng, share), position), [1, 4], 4)
    assert dusty.notes == clean.notes
    np.testing.assert_allclose(dusty.frequencies, clean.frequencies, rtol=1e-6)


def test_two_entries_of_dust_are_no_support():
    K, M, position = _strip()
    K[0, 1] = K[1, 0] = 1e-9
    super_element(K, M, position)


@pytest.mark.parametrize("stiffness", [1.0, 1e3])
def test_a_soft_spring_to_the_ground_is_a_support(stiffness):
    """Across the strip, where it is soft: no more than 1e-7 of its largest stiffness."""
    K, M, position = _strip()
    K[1, 1] += stiffness
    for matrix in (K, _noise(K, np.random.default_rng(5), 1e-16)):
        with pytest.raises(SuperElementError, match="resists the rigid-body"):
            super_element(matrix, M, position)


@pytest.mark.parametrize("share", [0.0, 1e-17, 1e-16])
def test_a_part_that_nothing_holds_is_found_behind_dust(share):
    K, M, position = _strip()
    K[9], K[:, 9] = 0.0, 0.0  # the second node twists freely
    K[3], K[:, 3] = 0.0, 0.0
    K[15, 15] = K[21, 21]
    with pytest.raises(SuperElementError, match="lets a part move without force|resists"):
        reduced(super_element(_noise(K, np.random.default_rng(6), share), M, position), [1, 4], 4)
