"""What flexmb exports comes back: FMUs of scenes agree with the scenes, in Model Exchange and in Co-Simulation."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

pytest.importorskip("fmpy", reason="FMPy is not installed: pip install flexmb[fmu]")

from msgspec.structs import replace

import flexmb as fm
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.fmu.bad import BadFmu
from crosscheck.engines.registry import PROVIDER, engine
from crosscheck.judging.verdict import Verdict
from crosscheck.library.find import Case, load_case
from crosscheck.library.model_case import scene_of, write_case
from crosscheck.running.plan import variant_scene
from flexmb.export.writing import export_fmu
from flexmb.run.channels import channels_of, distance
from flexmb.scene.schema import Scene
from flexmb.scene.without_start import without_start
from tests.crosscheck.engines.fmu.foreign import needs_compiler
from tests.crosscheck.sessions import run_case
from tests.repo.project import ROOT

pytestmark = needs_compiler
TIMES = np.linspace(0.0, 0.1, 11)
STEP = 1e-3
CASES = {  # with the largest step of Co-Simulation (s)
    "pendulums/compound": 1e-3, "pendulums/double": 1e-3, "pendulums/geared": 1e-3, "pendulums/point_mass": 1e-3,
    "sliders/rotating_tube": 1e-3, "sliders/crane": 2e-3, "tops/free_body": 2e-3, "tops/gyrostat": 2e-3,
    "wheels/spin_up": 2e-3, "wheel_gyrostat/torque_driven": 2e-3, "closed_chains/four_bar": 1e-3,
    "closed_chains/slider_crank": 1e-3, "manipulators/two_joints": 1e-3, "rotors/unbalanced": 1e-3,
    "spacecraft/slosh": 1e-3, "deploying_boom/rigid": 2e-3,
    "sliders/oscillator": 1e-3, "pendulums/bar_and_plate": 1e-3, "tops/lagrange": 1e-3,
}  # fmt: skip
SENSITIVE = "pendulums/bar_and_plate", "tops/lagrange"
"""Motions of which CVode's finest tolerance leaves U above the goals; Co-Simulation meets them."""
KINDS = {"model exchange": "CVode", "co-simulation": "doStep"}


def machine() -> Scene:
    """Free flight with a wheel, a driven and a sprung arm, and a load that jumps."""
    scene = fm.SceneBuilder("machine", gravity=(0.1, -0.2, -9.81))
    scene.rigid_body("hub", mass=2.0, inertia=(0.3, 0.4, 0.5)).rigid_body("arm", mass=0.5, inertia=(0.02, 0.03, 0.04))
    scene.rigid_body("lever", mass=0.7, inertia=(0.02, 0.05, 0.04))
    scene.free("flight", "ground", "hub", angular_velocity=(0.3, -0.4, 0.5))
    scene.revolute("pivot", "hub", "arm", parent_position=(0.2, 0.1, 0.0), angle=0.4, rate=1.0, stiffness=3.0)
    scene.revolute("crank", "hub", "lever", axis=(1, 0, 0), prescribed=fm.SpinUp(rate=2.0, duration_s=0.5))
    scene.wheel("spin", "hub", axis=(0, 0, 1), mass=0.1, axial_inertia=0.01, transverse_inertia=0.006, speed=30.0)
    scene.force("push", "arm", direction=(0, 0, 1), function=fm.Pulse(value=3.0, start_s=0.013, duration_s=0.02))
    scene.marker("end", "arm")
    return scene.scene()


@cache
def exported(scene: Scene, name: str, step: float = STEP) -> Path:
    """The FMU of a scene, once a process."""
    path = Path(mkdtemp()) / f"{name}.fmu"
    export_fmu(scene, path, step=step)
    return path


def mapped(fmu: Path, text: str) -> str:
    """The name of the engine that is the FMU by a mapping of its own."""
    path = Path(mkdtemp()) / "mapping.toml"
    path.write_text(f'fmu = "{fmu}"\n{text}', encoding="utf-8")
    return f"fmu:{path}"


@pytest.fixture(scope="module")
def machine_fmu() -> Path:
    return exported(machine(), "machine")


def test_every_channel_of_a_machine_comes_back(machine_fmu: Path) -> None:
    known = channels_of(engine("native").compile(machine()).simulate(Run(TIMES), Effort("tolerance", 1e-12, "dop853")))
    for interface, bound in (("model exchange", 1e-7), ("co-simulation", 1e-9)):
        found = CheckedEngine(engine(mapped(machine_fmu, f'interface = "{interface}"')), duration_s=0.1)
        ladder = found.efforts(machine())
        run = found.compile(machine()).simulate(Run(TIMES), ladder[-1])
        assert (run.status, ladder[-1].method) == ("finished", KINDS[interface]), run.message
        channels = channels_of(run)
        assert channels.keys() == known.keys()
        far = {name: float(np.max(distance(name, channels[name], known[name]))) for name in known}
        assert max(far.values()) < bound * 30.0, far  # loads are up to 30 N
    snapshot, own = (engine(name).compile(machine()).evaluate() for name in (f"fmu:{machine_fmu}", "native"))
    assert snapshot.markers["end"].acceleration == pytest.approx(own.markers["end"].acceleration, abs=1e-12)


def test_other_starts_and_parameters_are_set_and_all_else_is_refused(machine_fmu: Path) -> None:
    found, scene = engine(f"fmu:{machine_fmu}"), machine()
    changed = scene.with_values({
        "pivot.rotation.angle_rad": -0.7, "pivot.rotation.stiffness_Nm_rad": 5.0, "flight.velocity_m_s.1": 0.3,
        "spin.speed_rad_s": -4.0, "gravity_m_s2.2": -3.0, "flight.quaternion": (0.6, 0.8, 0.0, 0.0),
    })  # fmt: skip
    assert found.supports(changed).kind == "exact"
    run = found.compile(changed).simulate(Run(TIMES), Effort("tolerance", 1e-12, "CVode"))
    known = engine("native").compile(changed).simulate(Run(TIMES), Effort("tolerance", 1e-12, "dop853"))
    a, b = channels_of(run), channels_of(known)
    assert max(float(np.max(distance(name, a[name], b[name]))) for name in a) < 3e-6
    unmoved = found.compile(scene).simulate(Run(TIMES), Effort("tolerance", 1e-12, "CVode"))
    assert np.max(np.abs(unmoved.markers["end"].position - run.markers["end"].position)) > 0.1
    more = replace(scene, markers=(*scene.markers, fm.scene.schema.Marker(name="far", body="hub")))
    assert found.supports(more).kind == "exact", "a marker that it lacks is not offered"
    for values in ({"pivot.axis": (1.0, 0.0, 0.0)}, {"arm.com_m.0": 0.1}, {"push.function.start_s": 0.02}):
        answer = found.supports(scene.with_values(values))
        assert answer.kind == "no" and "flexmb export SCENE.toml --fmu machine.fmu" in answer.reason
    moved = replace(scene, markers=(replace(scene.markers[0], offset_m=(0.1, 0.0, 0.0)),))
    assert found.supports(moved).kind == "no"


def test_beside_an_own_export_lies_its_scene_which_is_no_mapping(machine_fmu: Path) -> None:
    fm.save_scene(machine(), machine_fmu.with_suffix(".toml"))
    try:
        assert engine(f"fmu:{machine_fmu}").version().startswith("machine, FMI 2.0, ")
        with pytest.raises(BadFmu, match="is no mapping of an FMU"):
            engine(f"fmu:{machine_fmu.with_suffix('.toml')}").version()
    finally:
        machine_fmu.with_suffix(".toml").unlink()


def test_a_start_is_no_part_of_the_model() -> None:
    scene = machine()
    other = scene.with_values({"pivot.rotation.rate_rad_s": 9.0, "flight.position_m": (1.0, 2.0, 3.0)})
    assert without_start(scene) == without_start(other) != without_start(scene.with_values({"arm.mass_kg": 1.0}))


def verdicts(case: Path, name: str, records: Path) -> list[Verdict]:
    outcome = run_case(case, records, asked=("native", name), provider=PROVIDER)
    return [each for found in outcome.verdicts.values() for each in found if name in (each.engine_a, each.engine_b)]


def test_a_session_on_a_scene_agrees_and_on_a_heavier_one_differs(machine_fmu: Path, tmp_path: Path) -> None:
    fm.save_scene(machine(), tmp_path / "machine.toml")
    scene, _ = scene_of(tmp_path / "machine.toml")
    assert len(scene.markers) > 1
    write_case(scene, tmp_path / "cases" / "machine", ("native", "native-radau5"), 0.5, 26)
    right = verdicts(tmp_path / "cases" / "machine", f"fmu:{machine_fmu}", tmp_path / "records.jsonl")
    assert len(right) > 10 and {each.status for each in right} == {"agree"}
    wrong = exported(machine().with_values({"arm.mass_kg": 0.505}), "heavier")
    name = mapped(wrong, 'scene = "{}"\n[channels]\n{}\n'.format(
        tmp_path / "machine.toml",
        "\n".join(f'"end.{column}" = "end.{column}"' for column in (
            *(f"{part}.{axis}" for part in ("position", "velocity", "angular_velocity") for axis in "xyz"),
            *(f"rotation[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)))),
    ))  # fmt: skip
    found = {each.channel: each.status for each in verdicts(tmp_path / "cases" / "machine", name, tmp_path / "w.jsonl")}
    assert found["marker:end.position"] == "differ", found


def first_variant(case: Case) -> Scene:
    """The scene of the first variant that native runs."""
    variant = next(each for each in case.run.variants if "native" in (*each.engines, *each.also))
    return variant_scene(case.scene(variant), variant)


@pytest.mark.slow
@pytest.mark.parametrize("interface", KINDS)
@pytest.mark.parametrize("name", CASES)
def test_cases_come_back(name: str, interface: str, tmp_path: Path) -> None:
    case = load_case(ROOT / "cases" / name)
    fmu = exported(first_variant(case), name.replace("/", "_"), CASES[name])
    found = verdicts(ROOT / "cases" / name, mapped(fmu, f'interface = "{interface}"'), tmp_path / "records.jsonl")
    found = [each for each in found if each.status not in ("not applicable", "not offered")]
    allowed = {"agree", "unresolved"} if (interface, name in SENSITIVE) == ("model exchange", True) else {"agree"}
    assert len(found) > 20 and {each.status for each in found} <= allowed, [str(each) for each in found][:4]
