"""Exported scenes against the scenes themselves: FMUs by ctypes and by fmpy, C by a compiler."""

from __future__ import annotations

import ctypes as ct
import getpass
import math
import os
import platform
import subprocess
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.export import writing
from flexmb.export.description import exponents
from flexmb.export.model import ExportedModel, model, tabled
from flexmb.export.numbers import affine
from flexmb.export.refusals import NotExportable, c_compiler, refuse
from tests.flexmb.export.differentiated import errors, names_of
from tests.flexmb.export.exported_scenes import COMPILER, PUSH, machine, some_state
from tests.flexmb.export.loaded import EXCHANGE, SIMULATION, Fmu, Instance
from tests.repo.project import ROOT

pytestmark = [
    pytest.mark.skipif(platform.machine() != "x86_64" or os.name != "posix", reason="export is for Linux on x86-64"),
    pytest.mark.skipif(COMPILER is None, reason="no C compiler is on the path"),
]
STEP, LIMIT = 1e-3, 300_000


@pytest.fixture(scope="module")
def scene() -> fm.Scene:
    return machine()


@pytest.fixture(scope="module")
def exported(machine_model: ExportedModel) -> ExportedModel:
    return machine_model


@pytest.fixture(scope="module")
def archive(exported: ExportedModel, tmp_path_factory: Any) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "machine.fmu"
    writing.write_fmu(exported, path, STEP)
    return path


@pytest.fixture(scope="module")
def fmu(archive: Path, tmp_path_factory: Any) -> Fmu:
    return Fmu(archive, tmp_path_factory.mktemp("unpacked"))


def running(fmu: Fmu, **values: float) -> Instance:
    instance = fmu.instance().start(**values)
    instance.events()
    return instance


def accelerations(scene: fm.Scene, t: float, y: Any) -> Any:
    system = fm.compile(scene)
    return system.evaluate(t, y[: system.nq], y[system.nq : -1]).accelerations


def test_rates_and_outputs_are_those_of_the_scene(scene: fm.Scene, fmu: Fmu) -> None:
    system, t = fm.compile(scene), 0.004
    y, instance = some_state(system), running(fmu)
    dy = instance.rates(t, y)
    found = system.evaluate(t, y[: system.nq], y[system.nq : -1])
    assert dy[system.nq : -1] == pytest.approx(found.accelerations, rel=1e-11, abs=1e-11)
    spatial = [f"{part}.{axis}" for part in ("torque", "force") for axis in "xyz"]
    for hinge, load in found.loads.items():
        assert instance.get(*(f"{hinge}.{name}" for name in spatial)) == pytest.approx(load, rel=1e-10, abs=1e-10)
    end = found.markers["end"]
    assert instance.get(*(f"end.position.{axis}" for axis in "xyz")) == pytest.approx(end.position, abs=1e-13)
    cells = [f"end.rotation[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)]
    assert instance.get(*cells) == pytest.approx(end.rotation.ravel(), abs=1e-13)
    moving = [f"end.{part}.{axis}" for part in ("angular_acceleration", "acceleration") for axis in "xyz"]
    assert instance.get(*moving) == pytest.approx(end.acceleration, rel=1e-10, abs=1e-10)
    assert instance.get("crank.drive[0]") == pytest.approx(found.drives["crank"], rel=1e-10)
    kinds = [f"energy.{name}" for name in (*found.energy, "total")]
    assert instance.get(*kinds) == pytest.approx([*found.energy.values(), sum(found.energy.values())], rel=1e-12)


CHANGES = {
    "inputs.hold.force": ("hold.function.value", -4.0),
    "inputs.pivot.rotation.torque_Nm": ("pivot.rotation.torque_Nm.value", 1.7),
    "parameters.arm.mass_kg": ("arm.mass_kg", 0.9),
    "parameters.gravity_m_s2.z": ("gravity_m_s2.2", -3.0),
    "parameters.pivot.rotation.stiffness_Nm_rad": ("pivot.rotation.stiffness_Nm_rad", 5.0),
    "parameters.spin.mass_kg": ("spin.mass_kg", 0.3),
    "parameters.push.force.value": ("push.function.value", 7.0),
    "parameters.crank.rotation.prescribed_rad.rate": ("crank.rotation.prescribed_rad.rate", 3.0),
}


@pytest.mark.parametrize("names", [*([name] for name in CHANGES), list(CHANGES)], ids=[*CHANGES, "all"])
def test_numbers_are_changed_as_in_the_scene(scene: fm.Scene, fmu: Fmu, names: list[str]) -> None:
    y, t = some_state(fm.compile(scene)), 0.02
    plain, instance = running(fmu), running(fmu, **{name: CHANGES[name][1] for name in names})
    for each in (plain, instance):  # into the pulse
        each.do("fmi2SetTime", ct.c_double(0.013))
        each.do("fmi2EnterEventMode")
        each.events()
    expected = accelerations(scene.with_values(dict(CHANGES[name] for name in names)), t, y)
    free = slice(-1 - len(expected), -1)
    assert instance.rates(t, y)[free] == pytest.approx(expected, rel=1e-10, abs=1e-10)
    assert np.abs(plain.rates(t, y)[free] - expected).max() > 1e-6  # what is not changed differs


def test_directional_derivatives_are_those_of_the_system(scene: fm.Scene, fmu: Fmu) -> None:
    system, t, instance = fm.compile(scene), 0.004, running(fmu)
    y = some_state(system)
    state = system.state(y[: system.nq], y[system.nq : -1], t)
    instance.rates(t, y)
    found = errors(instance, system, state)
    assert {"end.acceleration.x", "crank.drive[0]", "root.torque.y", "energy.total"} <= set(found)
    assert max(found.values()) < 1e-12, sorted(found.items(), key=lambda each: -each[1])[:5]
    elsewhere = system.state(y[: system.nq] + 1e-3, y[system.nq : -1], t)
    assert max(errors(instance, system, elsewhere).values()) > 1e-5  # of this state only
    instance.rates(t, elsewhere.y)
    assert max(errors(instance, system, elsewhere).values()) < 1e-12


def test_derivatives_by_inputs_are_those_by_forces(scene: fm.Scene, fmu: Fmu) -> None:
    system, t, instance = fm.compile(scene), 0.004, running(fmu)
    y = some_state(system)
    instance.rates(t, y)
    names, pivot = names_of(system), system.state_names[1].index(("pivot.rotation.rate", "rad/s"))
    expected = system.acceleration_derivatives(system.state(y[: system.nq], y[system.nq : -1], t)).by_force[:, pivot]
    rates = [f"der({name})" for name in names[system.nq :]]
    motor, force = "inputs.pivot.rotation.torque_Nm", "inputs.hold.force"
    by_motor = instance.along(rates, {motor: 1.0})
    assert by_motor == pytest.approx(expected, rel=1e-12, abs=1e-12 * np.abs(expected).max())
    before = instance.rates(t, y)
    seen = [*rates, "der(work)", "end.acceleration.x", "root.force.z", "energy.total"]
    by_force = instance.along(seen, {force: 1.0})
    assert np.array_equal(instance.rates(t, y), before)  # the inputs are as they were
    large = [running(fmu, **{force: side * 1e6}) for side in (1.0, -1.0)]
    for each in large:
        each.rates(t, y)
    slope = (large[0].get(*seen) - large[1].get(*seen)) / 2e6
    assert by_force == pytest.approx(slope, rel=1e-11, abs=1e-12)
    direction = {names[0]: 0.3, motor: -2.0, force: 5.0, names[-1]: 0.7}
    parts = sum(instance.along(seen, {name: 1.0}) * size for name, size in direction.items())
    assert instance.along(seen, direction) == pytest.approx(parts, rel=1e-11, abs=1e-11)
    instance.set({"parameters.arm.mass_kg": 0.9})
    assert np.abs(instance.along(rates, {motor: 1.0}) - expected).max() > 1e-3  # of this mass only


def test_derivatives_that_are_not_offered_are_refused_by_name(
    fmu: Fmu, exported: ExportedModel, tmp_path: Path
) -> None:
    instance = running(fmu)
    assert fmu.root.find("ModelExchange").get("providesDirectionalDerivative") == "true"  # type: ignore[union-attr]
    refused = {
        ("der(work)", "parameters.arm.mass_kg"): "not by arm.mass_kg", ("inputs.hold.force", "work"): "not of inputs",
        ("der(work)", "der(work)"): "by states",
    }  # fmt: skip
    for names, said in refused.items():
        with pytest.raises(AssertionError, match=said):
            instance.along([names[0]], {names[1]: 1.0})
    writing.write_fmu(exported._replace(tangent=None), tmp_path / "plain.fmu")
    plain = Fmu(tmp_path / "plain.fmu", tmp_path / "there")
    assert plain.root.find("ModelExchange").get("providesDirectionalDerivative") == "false"  # type: ignore[union-attr]
    with pytest.raises(AssertionError, match="export it with --derivatives"):
        running(plain).along(["der(work)"], {"work": 1.0})


def test_numbers_are_as_changeable_with_derivatives_as_without(scene: fm.Scene, exported: ExportedModel) -> None:
    plain, _ = tabled(scene)
    for one, other in zip(plain.numbers.changeable, exported.numbers.changeable, strict=True):
        assert one.candidate == other.candidate and len(other.effects) >= len(one.effects)
    assert plain.tangent is None and plain.numbers.fixed == exported.numbers.fixed


def test_units_and_names_are_those_of_the_scene(exported: ExportedModel, fmu: Fmu) -> None:
    assert fmu.unit["inputs.hold.force"] == "N" and fmu.unit["parameters.pivot.rotation.damping_Nms_rad"] == "N m s/rad"
    assert fmu.unit["crank.drive[0]"] == "N m" and fmu.unit["der(root.rotation.rate)"] == "rad/s²"
    names = "inputs.hold.force", "parameters.arm.mass_kg", "work", "der(work)"
    assert [fmu.causality[name] for name in names] == ["input", "parameter", "output", "local"]
    assert len(fmu.numbers) == len(fmu.root.findall("ModelVariables/ScalarVariable"))  # no name twice
    assert "root.rotation.armature_kg_m2" in exported.numbers.fixed
    assert not any("com_m" in name or name.startswith("rod.") for name in fmu.numbers if "parameters" in name)
    listed = {each.get("name") for each in fmu.root.findall("UnitDefinitions/Unit")}
    assert listed == set(fmu.unit.values())


def test_units_have_their_exponents() -> None:
    assert exponents("N m/rad") == {"kg": 1, "m": 2, "s": -2, "rad": -1}
    assert exponents("m/s²") == {"m": 1, "s": -2} and exponents("1/s") == {"s": -1} and exponents("1") == {}
    assert exponents("N m s") == {"kg": 1, "m": 2, "s": -1} and exponents("W") == exponents("J/s")
    with pytest.raises(KeyError):
        exponents("furlong")


def test_only_affine_numbers_are_changed_in_place() -> None:
    base, x = np.array([1.0, 2.0, 0.5]), 0.25
    assert [
        (effect.word, effect.slope) for effect in affine(base, base + [0, x, 0], base + [0, 2 * x, 0], x) or ()
    ] == [(1, 1.0)]
    assert affine(base, base + [0, x, 0], base + [0, 4 * x, 0], x) is None  # a square
    assert affine(base, base, base, x) == ()
    whole = np.array([1, 2], np.int64).view(float)
    assert affine(whole, np.array([1, 3]).view(float), np.array([1, 4]).view(float), x) is None


def test_instances_are_independent_also_in_threads(scene: fm.Scene, fmu: Fmu) -> None:
    system = fm.compile(scene)
    masses = np.linspace(0.42, 1.12, 8)
    states = [some_state(system, seed) for seed in range(8)]

    def rates(i: int) -> Any:
        instance = running(fmu, **{"parameters.arm.mass_kg": float(masses[i])})
        return [instance.rates(0.001, states[i]) for _ in range(300)]

    with ThreadPoolExecutor(8) as threads:
        together = list(threads.map(rates, range(8)))
    for i in range(8):
        alone = rates(i)[0]
        assert all(np.array_equal(each, alone) for each in together[i])
        assert not np.array_equal(alone, running(fmu).rates(0.001, states[i]))  # the mass matters


def test_the_state_of_an_instance_is_saved_and_restored(fmu: Fmu) -> None:
    instance = fmu.instance(SIMULATION).start(**{"parameters.arm.mass_kg": 0.8})
    step = lambda t: instance.do("fmi2DoStep", ct.c_double(t), ct.c_double(0.005), 1)  # noqa: E731
    step(0.0)
    state, size = ct.c_void_p(), ct.c_size_t()
    instance.do("fmi2GetFMUstate", ct.byref(state))
    step(0.005)
    first = instance.get("end.position.x", "work", "flight.position.x")
    instance.set({"parameters.arm.mass_kg": 5.0})
    step(0.010)
    instance.do("fmi2SerializedFMUstateSize", state, ct.byref(size))
    text = ct.create_string_buffer(size.value)
    instance.do("fmi2SerializeFMUstate", state, text, size)
    again = ct.c_void_p()
    instance.do("fmi2DeSerializeFMUstate", text, size, ct.byref(again))
    instance.do("fmi2SetFMUstate", again)
    assert instance.get("parameters.arm.mass_kg") == 0.8
    step(0.005)
    second = instance.get("end.position.x", "work", "flight.position.x")
    assert np.array_equal(first, second)
    foreign = ct.create_string_buffer(b"x" * size.value, size.value)
    assert instance.call("fmi2DeSerializeFMUstate", foreign, size, ct.byref(again)) == 3
    assert "state of another model" in instance.messages[-1]
    for each in (state, again):
        instance.do("fmi2FreeFMUstate", ct.byref(each))


def test_co_simulation_takes_the_steps_of_a_run(scene: fm.Scene, fmu: Fmu) -> None:
    """Through the jumps of a load, which no step crosses."""
    end, samples = 0.06, 7
    run = fm.simulate(scene, end, "rk4", step=STEP, samples=samples)
    instance, count = fmu.instance(SIMULATION).start(), len(run.q_names) + len(run.u_names)
    for n in range(samples - 1):
        instance.do("fmi2DoStep", ct.c_double(run.t[n]), ct.c_double(run.t[n + 1] - run.t[n]), 1)
        y = np.concatenate([run.q[n + 1], run.u[n + 1]])
        assert instance.states(count) == pytest.approx(y, rel=1e-11, abs=1e-12)
    assert instance.get("work") == pytest.approx(run.work[-1], rel=1e-11)


def test_time_events_are_the_jumps_of_functions(fmu: Fmu) -> None:
    instance = fmu.instance().start()
    info = instance.events()
    assert (info.has_next, info.next) == (1, PUSH.start_s)
    y = instance.states(len(fmu.root.findall("ModelStructure/Derivatives/Unknown")))
    before = instance.rates(PUSH.start_s, y)
    assert np.array_equal(before[:-1], instance.rates(PUSH.start_s, y)[:-1])
    instance.do("fmi2EnterEventMode")
    assert instance.events().next == PUSH.start_s + PUSH.duration_s
    assert np.abs(instance.rates(PUSH.start_s, y) - before).max() > 1.0  # the load acts from here on


def test_what_is_wrong_is_said(fmu: Fmu, exported: ExportedModel, tmp_path: Path) -> None:
    stranger = fmu.instance(guid="{other}")
    assert stranger.address is None and "are of different models" in stranger.messages[0]
    instance = fmu.instance()
    assert instance.call("fmi2EnterContinuousTimeMode") == 3 and "calling sequences" in instance.messages[-1]
    writing.write_fmu(exported, tmp_path / "exchange.fmu")
    alone = Fmu(tmp_path / "exchange.fmu", tmp_path / "there")
    refused = alone.instance(SIMULATION)
    assert refused.address is None and "export it with --step" in refused.messages[0]
    assert alone.root.find("CoSimulation") is None and alone.instance(EXCHANGE).address
    broken, bad = fmu.instance(SIMULATION).start(), ct.c_double(math.nan)
    number = (ct.c_uint * 1)(fmu.numbers["root.rotation"])
    assert broken.call("fmi2SetReal", number, ct.c_size_t(1), ct.byref(bad)) == 3
    assert "not finite" in broken.messages[-1]
    broken.set({"root.rotation.rate": 1e200})
    assert broken.call("fmi2DoStep", ct.c_double(0.0), ct.c_double(0.01), 1) == 3
    assert "the motion diverged" in broken.messages[-1] or "not positive definite" in broken.messages[-1]


def test_nothing_names_a_machine_or_a_path(archive: Path, fmu: Fmu, exported: ExportedModel, tmp_path: Path) -> None:
    assert archive.stat().st_size < LIMIT
    words = {str(ROOT), str(Path.home()), os.sep + "tmp", platform.node(), "site-packages", ".py", "numba"}
    words |= {getpass.getuser()} - {"root"}  # a hinge may be called so
    held = b"\n".join([*fmu.contents.values(), "".join(fmu.contents).encode()])
    found = [word for word in words if len(word) > 2 and word.encode() in held]  # shorter ones occur by chance
    assert not found
    assert b"fmi2DoStep" in held  # words of the library are seen
    writing.write_fmu(exported, tmp_path / "again.fmu", STEP)
    assert (tmp_path / "again.fmu").read_bytes() == archive.read_bytes()


def test_c_compiles_without_a_warning_and_runs_as_the_scene(
    exported: ExportedModel, scene: fm.Scene, tmp_path: Path
) -> None:
    writing.write_c(exported, tmp_path)
    name = exported.identifier
    sources = ["example.c", f"{name}.c", f"{name}_kernels.o", "-lm", "-o", "example"]
    flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror"]
    done = subprocess.run([COMPILER, *flags, *sources], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    out = subprocess.run([tmp_path / "example", "0.06", "1e-3"], capture_output=True, text=True, check=True).stdout
    found = dict(line.rsplit(" ", 1) for line in out.splitlines())
    run = fm.simulate(scene, 0.06, "rk4", step=1e-3, samples=2)
    for names, row in ((run.q_names, run.q[-1]), (run.u_names, run.u[-1])):
        assert [float(found[each]) for each, _ in names] == pytest.approx(row, rel=1e-11, abs=1e-12)
    assert float(found["energy.total"]) == pytest.approx(run.total_energy[-1], rel=1e-12)
    build = [COMPILER, "-shared", "-fPIC", f"{name}.c", f"{name}_kernels.o", "-lm", "-o", "model.so"]
    subprocess.run(build, cwd=tmp_path, check=True)
    assert differentiated(exported, ct.CDLL(str(tmp_path / "model.so")), scene) < 1e-12
    subprocess.run([COMPILER, "-c", f"{name}.c"], cwd=tmp_path, check=True)
    for part in (f"{name}.o", f"{name}_kernels.o"):
        contents = (tmp_path / part).read_bytes()
        assert b"malloc" not in contents and b"calloc" not in contents
    assert b"malloc" in (tmp_path / "example").read_bytes()  # the example's own, which is seen


def differentiated(exported: ExportedModel, library: ct.CDLL, scene: fm.Scene) -> float:
    """The largest error of the derivatives by speeds in the Jacobian of the C functions, relative to the row."""
    name, system = exported.identifier, fm.compile(scene)
    n, y = len(exported.states), some_state(system)
    instance, J = ct.create_string_buffer(4 * 8 * len(exported.image.words)), np.empty((n, n))
    doubles = [each.ctypes.data_as(ct.POINTER(ct.c_double)) for each in (y, J)]
    getattr(library, f"{name}_init")(instance)
    assert getattr(library, f"{name}_jacobian")(instance, ct.c_double(0.004), *doubles) == 0
    expected = system.acceleration_derivatives(system.state(y[: system.nq], y[system.nq : -1], 0.004)).by_speed
    difference = np.abs(J[system.nq : -1, system.nq : -1] - expected).max(axis=1)
    return float(np.max(difference / np.maximum(np.abs(expected).max(axis=1), 1e-300)))


def controlled() -> fm.Scene:
    scene = fm.SceneBuilder("steered").rigid_body("arm", mass=1.0, inertia=(0.1, 0.1, 0.1))
    scene.revolute("pivot", "ground", "arm", torque=fm.ControlSignal(source="law"))
    scene.sense_coordinate("angle", "pivot").pid("law", "angle", kp=1.0)
    return scene.scene()


def stopped() -> fm.Scene:
    scene = fm.SceneBuilder("stopped").rigid_body("arm", mass=1.0, inertia=(0.1, 0.1, 0.1))
    scene.revolute("pivot", "ground", "arm", rate=1.0)
    scene.event("done", "time", 1.0, fm.EndRun())
    return scene.scene()


@pytest.mark.parametrize(
    "made, words",
    [(controlled, "--input HINGE"), (stopped, "take the events out")],
)
def test_what_is_not_exported_is_refused_with_the_remedy(made: Any, words: str, monkeypatch: Any) -> None:
    monkeypatch.setattr("flexmb.export.model.machine_code", lambda *_: pytest.fail("compiled"))
    with pytest.raises(NotExportable, match=words):
        model(made())


def test_a_machine_without_a_compiler_is_told_what_to_install(
    scene: fm.Scene, tmp_path: Path, monkeypatch: Any
) -> None:
    assert c_compiler()
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(writing, "model", lambda *_: pytest.fail("compiled"))
    with pytest.raises(NotExportable, match="apt-get install gcc"):
        writing.export_fmu(scene, tmp_path / "machine.fmu")
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    with pytest.raises(NotExportable, match="Linux on x86-64"):
        c_compiler()


def test_inputs_are_loads_motors_and_actuators(scene: fm.Scene) -> None:
    refuse(scene)
    with pytest.raises(NotExportable, match="drive the hinge by its motor"):
        model(scene, ["crank.rotation.prescribed_rad"])
    with pytest.raises(ValueError, match='there is no "pull"'):
        model(scene, ["pull.function"])
    with pytest.raises(ValueError, match="give a positive one"):
        writing.export_fmu(scene, Path("machine.fmu"), step=-1.0)


def invoke(*words: object) -> Any:
    return CliRunner().invoke(app, [str(word) for word in words])


WRONG = {
    "nothing": ((), "give one of --out"),
    "both": (("rod", "--out", "a.sid", "--fmu", "a.fmu"), "give one of --out"),
    "body": (("rod", "--fmu", "a.fmu"), "without a BODY"),
    "no body": (("--out", "a.sid"), "a BODY is written by"),
    "step": (("--c", "a", "--step", "1e-3"), "--step for --fmu"),
    "version": (("--c", "a", "--fmi", "3"), "--fmi and --step for --fmu"),
    "input": (("rod", "--out", "a.sid", "--input", "push.function"), "are for --fmu and --c"),
    "derivatives": (("rod", "--out", "a.sid", "--derivatives"), "--derivatives are for"),
}


@pytest.mark.parametrize("words, said", WRONG.values(), ids=WRONG)
def test_options_that_do_not_fit_are_refused(
    words: tuple[str, ...], said: str, tmp_path: Path, scene: fm.Scene
) -> None:
    fm.save_scene(scene, tmp_path / "scene.toml")
    result = invoke("export", tmp_path / "scene.toml", *words)
    assert result.exit_code == 2 and said in " ".join(result.output.split())


def test_the_command_says_what_can_be_changed(
    scene: fm.Scene, exported: ExportedModel, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setattr(writing, "model", lambda *_: exported)
    fm.save_scene(scene, tmp_path / "scene.toml")
    result = invoke("export", tmp_path / "scene.toml", "--fmu", tmp_path / "new" / "machine.fmu", "--step", "1e-3")
    assert result.exit_code == 0, result.output
    assert "inputs: pivot.rotation.torque_Nm, hold.force" in result.output
    assert "root.rotation.armature_kg_m2 is fixed" in result.output
    assert zipfile.is_zipfile(tmp_path / "new" / "machine.fmu")


def test_fmpy_finds_no_problem_and_comes_to_the_same_end(scene: fm.Scene, archive: Path) -> None:
    """CVode with the events of a load that jumps; the beam's modes are what limits it."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(archive)) == []
    end = 0.04
    run = fm.simulate(scene, end, rtol=1e-12, atol=1e-13, samples=2)
    found = fmpy.simulate_fmu(
        str(archive), fmi_type="ModelExchange", solver="CVode", stop_time=end, output_interval=5e-4,
        relative_tolerance=1e-13, record_events=False,
    )  # fmt: skip
    for names, row in ((run.q_names, run.q[-1]), (run.u_names, run.u[-1])):
        for (name, _), value in zip(names, row, strict=True):
            assert found[name][-1] == pytest.approx(value, rel=1e-9, abs=1e-9), name
    assert math.isclose(found["time"][-1], end)
