"""What is exported suffices: equations built from it by NumPy and SciPy alone come within the error bars, and so does a
body made from the words of the page of keys alone.
"""

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from scipy.interpolate import BSpline

from crosscheck.export.rebuild import compare, read_case
from crosscheck.library.find import load_case, shipped_folder
from flexmb.scene.schema import BeamBody
from flexmb.scene.strains import families
from flexmb.typing import Real
from tests.crosscheck.export.exported import Data, change, export_cases

DOUBLE, TOP, MASS = "pendulums/double", "tops/lagrange", "sliders/oscillator"
FLEXIBLE = "wheel_gyrostat/flexible_appendage"
CASES = (DOUBLE, TOP, MASS, FLEXIBLE)
UNTIL = {DOUBLE: 1.0, TOP: 0.2, MASS: 2.0, FLEXIBLE: 0.3}  # s, so that the four take seconds; `slow` goes to the end

ALONE = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("flexmb", "crosscheck", "msgspec", "numba"):
            raise ImportError(f"{name} must not be needed")

sys.meta_path.insert(0, Refuse())
from rebuild import compare
for words in sys.argv[1:]:
    case, _, until = words.partition("=")
    for channel, (off, bar) in compare(case, until=float(until)).items():
        print(case, channel, off, bar)
assert not {"flexmb", "crosscheck"} & set(sys.modules)
"""


@pytest.fixture(scope="module")
def release(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_cases(tmp_path_factory.mktemp("release") / "all", *CASES)


def off_and_bars(folder: Path, until: float) -> dict[str, tuple[float, float]]:
    return compare(folder, until=until)


def test_a_process_without_our_packages_comes_within_the_error_bars(release: Path) -> None:
    asked = [f"{case}={until:g}" for case, until in UNTIL.items()]
    command = [sys.executable, "-c", ALONE, *asked]  # -c puts the folder of the release on the path
    done = subprocess.run(command, cwd=release, capture_output=True, text=True, check=False, env={"PATH": "/nowhere"})
    assert done.returncode == 0, done.stderr
    rows = [line.rsplit(" ", 3) for line in done.stdout.splitlines()]
    assert {case for case, *_ in rows} == set(CASES)
    for case, channel, off, bar in rows:
        assert float(off) <= float(bar), (case, channel)


@pytest.mark.slow  # three minutes: the whole of eight motions at the tolerances of their references
@pytest.mark.parametrize("case", [*CASES, "pendulums/ten_links", "wheel_gyrostat/torque_free", "sliders/crane"])
def test_the_whole_motion_comes_within_the_error_bars(tmp_path: Path, case: str) -> None:
    folder = export_cases(tmp_path / "all", case) / case
    assert all(off <= bar for off, bar in compare(folder).values())


def heavier(data: Data) -> None:
    for body in data["bodies"]:
        if "mass_kg" in body:
            body["mass_kg"] *= 1.01


def more_massive(data: Data) -> None:
    data["points"]["mass_kg"] = [1.01 * mass for mass in data["points"]["mass_kg"]]
    for name in ("s0", "s1", "J0", "J1", "J2", "C0", "C1", "M_ff"):
        data["integrals"][name] = (1.01 * np.array(data["integrals"][name])).tolist()
    data["integrals"]["mass"] *= 1.01


@pytest.mark.parametrize("case, file, edit", [
    (DOUBLE, "model.json", heavier),
    (TOP, "model.json", heavier),
    (MASS, "model.json", heavier),
    (FLEXIBLE, "modal/panel.json", more_massive),
])  # fmt: skip
def test_one_per_cent_more_mass_is_beyond_them(tmp_path: Path, case: str, file: str, edit) -> None:  # noqa: ANN001
    folder = export_cases(tmp_path / "all", case) / case
    change(folder, edit, file)
    found = off_and_bars(folder, UNTIL[case] / 2.0)
    assert any(off > 100.0 * bar for off, bar in found.values())


def test_integrals_and_points_are_the_same_body(release: Path) -> None:
    """The equations by the modal integrals are those by the sum over all points, at a state that is bent and moves."""
    by_integrals, by_points = read_case(release / FLEXIBLE), read_case(release / FLEXIBLE)
    for body in by_points.modal.values():
        assert body["summed"]
        body["summed"] = False
    y = by_integrals.start + 0.3 * np.random.default_rng(1).standard_normal(len(by_integrals.start))
    one, other = by_integrals.accelerations(0.3, y), by_points.accelerations(0.3, y)
    assert np.max(np.abs(one - other)) < 1e-12 * np.max(np.abs(one))


@pytest.mark.parametrize("case, part", [
    ("closed_chains/bennett", "closures"), ("connectors/one_at_a_time", "connectors"),
    ("control/servos", "controllers"), ("frames/right_angle", "beams"),
])  # fmt: skip
def test_what_the_program_does_not_hold_it_names(tmp_path: Path, case: str, part: str) -> None:
    folder = export_cases(tmp_path / "all", case) / case
    with pytest.raises(SystemExit, match=part):
        read_case(folder)


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
    nodes = np.unique(
        [*np.linspace(0.0, body.length_m, body.elements + 1), *(station.x_m for station in body.stations)]
    )
    s, w = np.polynomial.legendre.leggauss(6)
    x = np.concatenate([0.5 * (b + a) + 0.5 * (b - a) * s for a, b in pairwise(nodes)])
    return x, np.concatenate([0.5 * (b - a) * w for a, b in pairwise(nodes)])


def section(body: BeamBody, key: str, x: Real) -> Real:
    return np.interp(
        x, [station.x_m for station in body.stations], [getattr(station, key) for station in body.stations]
    )


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
            "mass_kg": np.concatenate([point[0] for point in points]).tolist(),
            "position_m": np.concatenate([point[1] for point in points]).tolist(),
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
