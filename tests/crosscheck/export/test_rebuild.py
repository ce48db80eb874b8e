"""What is exported suffices: equations built from it by NumPy and SciPy alone come within the error bars."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from crosscheck.export.rebuild import compare, read_case
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
