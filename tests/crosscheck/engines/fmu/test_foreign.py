"""A foreign FMU by a mapping: units, signs, arrays, rotations; verdicts on it; what is wrong is said before a run."""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("fmpy", reason="FMPy is not installed: pip install flexmb[fmu]")

from msgspec.structs import replace

from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, EngineMissing, Run, Trajectory
from crosscheck.engines.fmu.bad import BadFmu
from crosscheck.engines.registry import PROVIDER, engine
from crosscheck.judging.verdict import Verdict
from crosscheck.library.case_error import CaseError
from crosscheck.library.model_case import write_case
from crosscheck.running.installed import require_engines
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Limits
from flexmb.run.channels import channels_of, distance
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Marker, Scene
from flexmb.scene.user_code import no_user_code
from tests.crosscheck.engines.fmu import foreign
from tests.crosscheck.sessions import run_case

pytestmark = foreign.needs_compiler
TIMES = np.linspace(0.0, 2.0, 41)
SIGN = '"pivot.rotation" = { variable = "phi", sign = -1 }'
MASS = 'mass = { scene = "rod.mass_kg" }'


@pytest.fixture(scope="module")
def known() -> Trajectory:
    return engine("native").compile(foreign.scene()).simulate(Run(TIMES), Effort("tolerance", 1e-12, "dop853"))


def off(run: Trajectory, known: Trajectory) -> float:
    """The largest distance of all channels that the run has."""
    a, b = channels_of(run), channels_of(known)
    return max(float(np.max(distance(name, a[name], b[name]))) for name in a)


WAYS = {
    "FMI 2, exchange": ("2.0", "exchange", foreign.MAPPING, 1e-9, 1e-5),
    "FMI 2, simulation": ("2.0", "simulation", foreign.MAPPING, 1e-11, 1e-8),
    "FMI 2, simulation, own step": ("2.0", "simulation", 'step = "h"\n' + foreign.MAPPING, 1e-9, 1e-6),
    "FMI 3, exchange": ("3.0", "exchange", foreign.MAPPING, 1e-9, 1e-5),
    "FMI 3, exchange, arrays": ("3.0", "exchange", foreign.with_arrays(), 1e-9, 1e-5),
    "FMI 3, simulation, arrays": ("3.0", "simulation", foreign.with_arrays(), 1e-11, 1e-8),
}


@pytest.mark.parametrize("way", WAYS)
def test_all_channels_converge_to_those_of_the_scene(way: str, known: Trajectory, tmp_path: Path) -> None:
    version, interfaces, mapping, fine, coarse = WAYS[way]
    found = CheckedEngine(engine(foreign.write_mapping(tmp_path, mapping, version, interfaces=interfaces)))
    assert found.supports(foreign.scene()).kind == "exact"
    model, ladder = found.compile(foreign.scene()), found.efforts(foreign.scene())
    runs = [model.simulate(Run(TIMES), effort) for effort in (ladder[-1], ladder[1])]
    assert [run.status for run in runs] == ["finished", "finished"], runs[0].message
    assert off(runs[0], known) < fine < off(runs[1], known) < coarse
    assert {"marker:end.position", "marker:end.orientation", "load:pivot.force", "energy.total"} < set(
        channels_of(runs[0])
    )


def test_its_numbers_are_those_of_the_scene_and_runs_may_begin_later(tmp_path: Path) -> None:
    scene = foreign.scene(mass=0.4, angle=1.2, rate=-0.3)
    found = CheckedEngine(engine(foreign.write_mapping(tmp_path)), t_start=1.0)
    run = found.compile(scene).simulate(Run(TIMES + 1.0), Effort("tolerance", 1e-12, "CVode"))
    other = engine("native").compile(scene).simulate(Run(TIMES), Effort("tolerance", 1e-12, "dop853"))
    assert off(run, other) < 1e-9
    snapshot = found.compile(scene).evaluate()
    assert snapshot.loads["pivot"] == pytest.approx(other.loads["pivot"][0], abs=1e-12)
    assert snapshot.markers["end"].acceleration is None


def test_event_indicators_are_found(tmp_path: Path) -> None:
    """An elastic wall at the lowest point: the motion is that without it, mirrored at every second passage."""
    text = foreign.MAPPING + "wall = 0.0\n"
    scene = foreign.scene(angle=-0.9, rate=0.0)
    free, walled = (
        engine(foreign.write_mapping(tmp_path, each))
        .compile(scene)
        .simulate(Run(TIMES), Effort("tolerance", 1e-12, ""))
        for each in (foreign.MAPPING, text)
    )
    x, mirrored = (run.markers["end"].position[:, 0] for run in (free, walled))
    assert x.min() < -0.1, "it passes"
    assert mirrored == pytest.approx(np.abs(x), abs=1e-8)


def verdicts(scene: Scene, *names: str, folder: Path, **options: object) -> list[Verdict]:
    write_case(scene, folder / "cases" / "swing", ("native", "native-radau5"), 2.0, 41)
    asked = ("native", "native-radau5", *names)
    outcome = run_case(folder / "cases" / "swing", folder / "records.jsonl", asked, provider=PROVIDER, **options)
    return [verdict for case in outcome.verdicts.values() for verdict in case]


def against_native(found: list[Verdict], name: str) -> list[Verdict]:
    return [each for each in found if {"native", name} == {each.engine_a, each.engine_b}]


def test_a_session_agrees_and_wrong_signs_and_masses_differ(tmp_path: Path) -> None:
    name = foreign.write_mapping(tmp_path)
    right = against_native(verdicts(foreign.scene(), name, folder=tmp_path), name)
    assert len(right) > 8 and {verdict.status for verdict in right} == {"agree"}
    wrong = {
        "sign": (SIGN, SIGN.replace(", sign = -1", "")),
        "mass": (MASS, "mass = 251.0"),
        "unit": ('"T", unit = "mJ"', '"T", unit = "J"'),
    }
    for what, (old, new) in wrong.items():
        folder = tmp_path / what
        folder.mkdir()
        assert old in foreign.MAPPING
        name = foreign.write_mapping(folder, foreign.MAPPING.replace(old, new))
        status = {
            verdict.channel: verdict.status
            for verdict in against_native(verdicts(foreign.scene(), name, folder=folder), name)
        }
        channel = {"sign": "marker:end.position", "mass": "load:pivot.force", "unit": "energy.kinetic"}[what]
        assert status[channel] == "differ", (what, status)


FAULTS = {
    1: ("crashed", "worker process died"), 2: ("did not finish", "at its limit of 20 s"),
    3: ("diverged", "the string is torn"), 4: ("diverged", "its derivatives are not finite"),
}  # fmt: skip


def test_an_fmu_that_crashes_or_hangs_ends_its_own_runs_alone(tmp_path: Path) -> None:
    names = {}
    for fault in FAULTS:
        folder = tmp_path / str(fault)
        folder.mkdir()
        names[fault] = foreign.write_mapping(folder, foreign.MAPPING + f"fault = {fault}.0\n")
    limits = Limits(workers=2, time_s=20.0)
    everything = verdicts(foreign.scene(), *names.values(), folder=tmp_path, scheduler=run_jobs, limits=limits)
    for fault, (status, words) in FAULTS.items():
        found = against_native(everything, names[fault])
        assert found and {verdict.status for verdict in found} == {status}, (fault, found[0])
        assert all(words in str(verdict) for verdict in found), found[0]
    alone = against_native(everything, "native-radau5")
    assert alone and all(each.status == "agree" for each in alone)


EDITS = {
    "no variable": ('"T"', '"Tkin"', 'swing.fmu has no variable "Tkin"'),
    "no column": ('"pivot.force.x"', '"pivot.force.w"', 'scene "swing" has no column "pivot.force.w"'),
    "wrong unit": ('"Fx", sign', '"length", sign', '"length" is in mm, which is m, and N is wanted: kg m s^-2'),
    "unit against the declared one": (
        '"Fx", sign',
        '"Fx", unit = "kN", sign',
        'declares "Fx" in mN: leave unit = "kN"',
    ),
    "unknown unit": ('unit = "mJ" }', 'unit = "erg" }', 'unit "erg" is not known'),
    "no unit": (
        'variable = "V", unit = "mJ"',
        'variable = "V"',
        'declares no unit of "V": state it, such as unit = "J"',
    ),
    "text": ('variable = "V", unit = "mJ"', 'variable = "label"', '"label" is of type String'),
    "missing column": ('"pivot.force.y" = 0.0\n', "", 'maps "pivot.torque.x" and not "pivot.force.y"'),
    "missing speed": ('"pivot.rotation.rate" =', '# "pivot.rotation.rate" =', 'and not "pivot.rotation.rate"'),
    "calculated parameter": ("torque = 0.0", "torque = 0.0\nJ0 = 1.0", "the model calculates it from other"),
    "constant": ("torque = 0.0", "torque = 0.0\npi = 4.0", '"pi" cannot be set: it is constant'),
    "calculated output": ("torque = 0.0", "torque = 0.0\nFx = 4.0", '"Fx" cannot be set: the model calculates it'),
    "no parameter": ("torque = 0.0", "torque = 0.0\nM = 4.0", 'has no variable "M"'),
    "no number of the scene": ("rod.mass_kg", "bar.mass_kg", "bar"),
    "an array of the scene": ("rod.com_m.2", "rod.com_m", "is not one number of the scene"),
    "wrong unit of a parameter": ("rod.mass_kg", "rod.com_m.0", '"mass" is in g, which is kg, and m is wanted'),
    "input": ("torque = 0.0", "", 'needs its input "torque"'),
    "no scene": ('scene = "scene.toml"', "", "does not say which scene the FMU models"),
    "scene not there": ('scene = "scene.toml"', 'scene = "other.toml"', "its scene cannot be read"),
    "unknown key": ("[channels]", "chanels = 3\n[channels]", "chanels"),
    "no TOML": ("[channels]", "[channels", "is no mapping of an FMU"),
    "interface": ("[channels]", 'interface = "co-simulation"\n[channels]', "offers model exchange alone"),
    "a step of exchange": ("[channels]", 'step = "h"\n[channels]', '"step" is of co-simulation'),
    "no FMU": ('"swing.fmu"', '"sving.fmu"', "sving.fmu: there is no such file"),
}


@pytest.mark.parametrize("what", EDITS)
def test_a_mapping_that_does_not_fit_is_refused_by_name(what: str, tmp_path: Path) -> None:
    old, new, message = EDITS[what]
    assert old in foreign.MAPPING
    name = foreign.write_mapping(tmp_path, foreign.MAPPING.replace(old, new), interfaces="exchange")
    with pytest.raises(BadFmu, match=re.escape(message)):
        engine(name).version()


def test_fmpy_and_code_of_others_are_asked_for_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = foreign.write_mapping(tmp_path)
    with no_user_code(), pytest.raises(BadFmu, match="native code of its author, which --no-user-code forbids"):
        engine(name).version()
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(EngineMissing, match=r"FMPy is not installed: pip install flexmb\[fmu\]"):
        engine(name).version()


def test_arrays_have_sizes(tmp_path: Path) -> None:
    text = foreign.with_arrays()
    cases = {'"tip[3]"': ('"tip[4]"', "is outside"), '"tip[1]"': ('"tip"', "has 3 numbers, and one is wanted")}
    for old, (new, message) in cases.items():
        with pytest.raises(BadFmu, match=message):
            engine(foreign.write_mapping(tmp_path, text.replace(old, new), "3.0")).version()


def test_a_rotation_that_is_none_is_said(tmp_path: Path) -> None:
    text = foreign.with_arrays().replace('"end.rotation[1,3]" = "R[3,1]"', '"end.rotation[1,3]" = "R[1,3]"')
    model = engine(foreign.write_mapping(tmp_path, text, "3.0")).compile(foreign.scene())
    with pytest.raises(ValueError, match='matrix of marker "end" is no rotation at sample'):
        model.simulate(Run(TIMES), Effort("tolerance", 1e-8, "CVode"))


def damaged(folder: Path, what: str) -> Path:
    """A file that cannot be used."""
    path = folder / "swing.fmu"
    match what:
        case "there is no such file":
            path.unlink()
        case "is no zip archive":
            path.write_bytes(b"MZ, but no archive")
        case "is corrupted":
            content = bytearray(path.read_bytes())
            at = content.index(b"binaries/") + 200
            content[at : at + 64] = bytes(64)
            path.write_bytes(content)
        case "has no modelDescription.xml":
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("readme.txt", "none")
        case "is no XML":
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("modelDescription.xml", "<fmiModelDescription")
        case "is of FMI 1.0":
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("modelDescription.xml", '<fmiModelDescription fmiVersion="1.0"/>')
        case "leads out of the archive":
            with zipfile.ZipFile(path, "a") as archive:
                archive.writestr("../../evil.so", "x")
        case "cannot run on this platform, linux64: it has libraries for win64":
            foreign.write_fmu(path, folder="win64")
        case "offers neither Model Exchange nor Co-Simulation":
            foreign.write_fmu(path, interfaces="none")
        case _:
            raise AssertionError(what)
    return path


@pytest.mark.parametrize(
    "what",
    ["there is no such file", "is no zip archive", "is corrupted", "has no modelDescription.xml", "is no XML",
     "is of FMI 1.0", "leads out of the archive", "cannot run on this platform, linux64: it has libraries for win64",
     "offers neither Model Exchange nor Co-Simulation"],
)  # fmt: skip
def test_a_file_that_is_no_fmu_for_here_is_refused_before_anything_runs(what: str, tmp_path: Path) -> None:
    name = foreign.write_mapping(tmp_path)
    damaged(tmp_path, what)
    with pytest.raises(CaseError, match=what):
        require_engines([name])


def test_a_foreign_fmu_needs_a_mapping_and_finds_the_one_beside_it(tmp_path: Path) -> None:
    foreign.write_mapping(tmp_path)
    beside = engine(f"fmu:{tmp_path / 'swing.fmu'}")
    assert beside.version() == engine(f"fmu:{tmp_path / 'swing.toml'}").version()
    (tmp_path / "swing.toml").unlink()
    with pytest.raises(CaseError, match="none of flexmb's own exports, so a mapping must say.*write swing.toml beside"):
        require_engines([f"fmu:{tmp_path / 'swing.fmu'}"])


def test_another_scene_is_refused_with_the_place_in_which_it_differs(tmp_path: Path) -> None:
    found, scene = engine(foreign.write_mapping(tmp_path)), foreign.scene()
    with_more = replace(scene, markers=(*scene.markers, Marker(name="origin", body="rod")))
    assert found.supports(with_more).kind == "exact", "coordinates place any marker"
    heavier = replace(scene, bodies=(replace(scene.bodies[0], com_m=(0.01, 0.0, -0.3)),))
    assert "differs in bodies.rod.com_m.0, which the mapping gives no parameter" in found.supports(heavier).reason
    moved = replace(scene, markers=(replace(scene.markers[0], offset_m=(0.1, 0.0, 0.0)),))
    assert "differs in markers.end.offset_m" in found.supports(moved).reason
    (hinge,) = scene.hinges
    driven = replace(scene, hinges=(replace(hinge, rotation=replace(hinge.rotation, torque_Nm=Constant(value=1.0))),))
    assert "differs in hinges.pivot.rotation.torque_Nm" in found.supports(driven).reason
    with pytest.raises(ValueError, match=r"differs in bodies\.rod\.com_m"):
        found.compile(heavier)


def test_the_digest_of_the_files_is_in_the_version(tmp_path: Path) -> None:
    name = foreign.write_mapping(tmp_path)
    before = engine(name).version()
    (tmp_path / "swing.toml").write_text(foreign.MAPPING + "fault = 0.0\n", encoding="utf-8")
    mapped = engine(name).version()
    foreign.write_fmu(tmp_path / "swing.fmu", more='author="another"')
    assert len({before, mapped, engine(name).version()}) == 3
