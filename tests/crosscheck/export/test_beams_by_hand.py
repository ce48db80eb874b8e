"""The page of keys says how a beam becomes points and modes: a body made from that text alone is the exported one.

Its elements are splines: piecewise polynomials of degree 4 that are continuous, and of degree 5 with a continuous
slope, which are the fields of points 1 and 2 of that page in other functions.
"""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from scipy.interpolate import BSpline

from crosscheck.export.rebuild import compare
from crosscheck.library.find import load_case, shipped_folder
from flexmb.scene.schema import BeamBody
from flexmb.scene.strains import families
from flexmb.typing import Real
from tests.crosscheck.export.exported import change, export_cases

CASE, BODY = "wheel_gyrostat/flexible_appendage", "panel"
PLANES = {"bending_y": (1, 5, 1.0), "bending_z": (2, 4, -1.0)}  # rows of displacement and rotation, and its sign


def beam() -> BeamBody:
    case = load_case(shipped_folder() / CASE)
    scene = case.scene(case.run.variants[0])
    found = next(body for body in scene.bodies if body.name == BODY)
    assert isinstance(found, BeamBody) and found.theory == "euler-bernoulli" and found.points == "section"
    assert found.mass == "consistent" and not found.tip_masses and not found.modes.static
    return found


def splines(body: BeamBody, degree: int, continuity: int) -> list[BSpline]:
    """A basis of the piecewise polynomials, without those that the clamp fixes."""
    nodes = np.linspace(0.0, body.length_m, body.elements + 1)
    ends = [nodes[0]] * (degree + 1), [nodes[-1]] * (degree + 1)
    knots = np.concatenate([ends[0], np.repeat(nodes[1:-1], degree - continuity), ends[1]])
    every = [BSpline(knots, row, degree) for row in np.eye(len(knots) - degree - 1)]
    return every[continuity + 1 :]


def gauss(body: BeamBody) -> tuple[Real, Real]:
    nodes = np.unique([*np.linspace(0.0, body.length_m, body.elements + 1), *(each.x_m for each in body.stations)])
    s, w = np.polynomial.legendre.leggauss(6)
    x = np.concatenate([0.5 * (b + a) + 0.5 * (b - a) * s for a, b in pairwise(nodes)])
    return x, np.concatenate([0.5 * (b - a) * w for a, b in pairwise(nodes)])


def section(body: BeamBody, key: str, x: Real) -> Real:
    return np.interp(x, [each.x_m for each in body.stations], [getattr(each, key) for each in body.stations])


def by_hand(body: BeamBody) -> dict[str, Any]:
    """The content of modal/BODY.json, by points 1 to 7."""
    x, weight = gauss(body)
    mass = weight * section(body, "mass_per_length_kg_m", x)
    rotary = {"y": weight * section(body, "rotary_y_kg_m", x), "z": weight * section(body, "rotary_z_kg_m", x)}
    tip = np.array([body.length_m])
    found = []
    for rank, family in enumerate(("axial", "torsion", "bending_y", "bending_z")):
        if family not in families(body):
            continue
        bending = family in PLANES
        basis = splines(body, 5, 1) if bending else splines(body, 4, 0)
        bent = 2 if bending else 1
        stiff = {"axial": "EA_N", "torsion": "GJ_Nm2", "bending_y": "EIz_Nm2", "bending_z": "EIy_Nm2"}[family]
        values, slopes, strains = (np.array([b(x, k) for b in basis]) for k in (0, 1, bent))
        K = strains * (weight * section(body, stiff, x)) @ strains.T
        turning = {"torsion": rotary["y"] + rotary["z"], "bending_y": rotary["z"], "bending_z": rotary["y"]}
        inertia = turning["torsion"] if family == "torsion" else mass
        M = values * inertia @ values.T + (slopes * turning[family] @ slopes.T if bending else 0.0)
        if not np.any(inertia):
            continue
        squares, columns = scipy.linalg.eigh(K, M, subset_by_index=(0, min(body.modes.count, len(basis)) - 1))
        for square, column in zip(squares, columns.T, strict=True):
            moved = {at: np.zeros((len(where), 6)) for at, where in (("x", x), ("tip", tip))}
            for at, where in (("x", x), ("tip", tip)):
                field, slope = (sum(c * b(where, k) for c, b in zip(column, basis, strict=True)) for k in (0, 1))
                if bending:
                    row, turn, sign = PLANES[family]
                    moved[at][:, row], moved[at][:, turn] = field, sign * slope
                else:
                    moved[at][:, 0 if family == "axial" else 3] = field
            largest = moved["tip"][0, :3] if np.any(moved["tip"][0, :3]) else moved["tip"][0, 3:]
            sign = np.sign(largest[np.argmax(np.abs(largest))])
            omega = np.sqrt(square)
            found.append((float(f"{omega:.8e}"), rank, omega, sign * moved["x"], sign * moved["tip"]))
    found.sort(key=lambda mode: mode[:2])
    modes = found[: body.modes.count]
    axis, end = (np.stack([mode[k] for mode in modes], axis=-1) for k in (3, 4))
    omega = np.array([mode[2] for mode in modes])
    a, b = np.sqrt(rotary["z"] / mass), np.sqrt(rotary["y"] / mass)
    points = [
        (mass / 4.0, np.column_stack([x, sy * a, sz * b]), np.column_stack([0.0 * x, sy * a, sz * b]))
        for sy, sz in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    translation = np.concatenate([axis[:, :3] + np.cross(axis[:, 3:], o[:, :, None], axis=1) for _, _, o in points])
    rotation = np.concatenate([axis[:, 3:]] * 4)
    count = len(translation)
    zeta = np.broadcast_to(body.modes.damping_ratio, omega.shape)
    none = np.zeros((3, len(omega)))
    nodes = {"origin": (np.zeros(3), none, none), "root": (np.zeros(3), none, none)}
    nodes["tip"] = (np.array([body.length_m, 0.0, 0.0]), end[0, :3], end[0, 3:])
    return {
        "level": "full", "clamped": True, "modes": len(omega),
        "stiffness": np.diag(omega**2).tolist(), "damping": np.diag(2.0 * zeta * omega).tolist(),
        "points": {
            "mass_kg": np.concatenate([each[0] for each in points]).tolist(),
            "position_m": np.concatenate([each[1] for each in points]).tolist(),
            "translation_modes": translation.tolist(), "rotation_modes": rotation.tolist(),
            "mass_centre_offset_m": np.zeros((count, 3)).tolist(), "inertia_kg_m2": np.zeros((count, 3, 3)).tolist(),
        },
        "nodes": {
            name: {"position_m": p.tolist(), "rotation": np.eye(3).tolist(), "translation_modes": phi.tolist(),
                   "rotation_modes": psi.tolist()}
            for name, (p, phi, psi) in nodes.items()
        },
        "integrals": {},
    }  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_cases(tmp_path_factory.mktemp("release") / "all", CASE) / CASE


def test_points_and_modes_are_those_of_the_file(folder: Path) -> None:
    ours, theirs = by_hand(beam()), json.loads((folder / f"modal/{BODY}.json").read_text(encoding="utf-8"))
    # Eigenvectors are known to the rounding of K, about eps times the ratio of its extreme eigenvalues: 1e-16 x 1e6.
    for key in ("mass_kg", "position_m", "translation_modes"):
        one, other = (np.array(each["points"][key]) for each in (ours, theirs))
        assert np.max(np.abs(one - other)) < 1e-9 * np.max(np.abs(other)), key
    for key in ("stiffness", "damping"):
        one, other = np.array(ours[key]), np.array(theirs[key])
        assert np.max(np.abs(one - other)) <= 1e-9 * np.max(np.abs(other)), key


def test_a_beam_made_by_hand_moves_within_the_error_bars(folder: Path, tmp_path: Path) -> None:
    """For half a second, summed over its points, of which it has the same: not over integrals that were exported."""
    made = by_hand(beam())
    exported = json.loads((folder / f"modal/{BODY}.json").read_text(encoding="utf-8"))["nodes"]
    assert set(made["nodes"]) <= set(exported)
    change(folder, lambda data: data.update(made, integrals={}), f"modal/{BODY}.json")
    found = compare(folder, rtol=1e-12, until=0.2)
    assert all(off <= bar for off, bar in found.values())
