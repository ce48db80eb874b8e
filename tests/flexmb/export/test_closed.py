"""Exported closed chains against `simulate`: their motion, their loads, and what an importer does with them."""

from __future__ import annotations

import ctypes as ct
import os
import platform
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.integrate import DOP853

import flexmb as fm
from flexmb.export import writing
from flexmb.export.model import ExportedModel, model, tabled
from flexmb.export.refusals import NotExportable
from tests.flexmb.closure import mechanisms
from tests.flexmb.export.differentiated import errors
from tests.flexmb.export.exported_scenes import COMPILER, mechanism
from tests.flexmb.export.loaded import SIMULATION, EventInfo, Fmu

pytestmark = [
    pytest.mark.skipif(platform.machine() != "x86_64" or os.name != "posix", reason="export is for Linux on x86-64"),
    pytest.mark.skipif(COMPILER is None, reason="no C compiler is on the path"),
]
STEP, END = 1e-3, 0.2


@pytest.fixture(scope="module")
def scene() -> fm.Scene:
    return mechanism()


@pytest.fixture(scope="module")
def exported(mechanism_model: ExportedModel) -> ExportedModel:
    return mechanism_model


@pytest.fixture(scope="module")
def archive(exported: ExportedModel, tmp_path_factory: Any) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "chain.fmu"
    writing.write_fmu(exported, path, STEP)
    return path


@pytest.fixture(scope="module")
def fmu(archive: Path, tmp_path_factory: Any) -> Fmu:
    return Fmu(archive, tmp_path_factory.mktemp("unpacked"))


def state_of(run: fm.Trajectory, n: int) -> Any:
    return np.concatenate([run.q[n], run.u[n], [run.work[n]]])


def spatial(name: str) -> list[str]:
    return [f"{name}.{part}.{axis}" for part in ("torque", "force") for axis in "xyz"]


def test_co_simulation_takes_the_steps_of_a_run(scene: fm.Scene, fmu: Fmu) -> None:
    run = fm.simulate(scene, END, "rk4", step=STEP, samples=5)
    instance = fmu.instance(SIMULATION).start()
    for n in range(len(run.t) - 1):
        instance.do("fmi2DoStep", ct.c_double(run.t[n]), ct.c_double(run.t[n + 1] - run.t[n]), 1)
        assert instance.states(len(state_of(run, 0))) == pytest.approx(state_of(run, n + 1), rel=1e-11, abs=1e-12)
    assert np.abs(state_of(run, 4) - state_of(run, 0)).max() > 0.1  # it moves
    for name in ("drive", "pin", "loop"):
        assert instance.get(*spatial(name)) == pytest.approx(run.loads[name][-1], rel=1e-8, abs=1e-9)
    assert instance.get("energy.total") == pytest.approx(run.total_energy[-1], rel=1e-11)


def test_directional_derivatives_are_those_of_the_system(scene: fm.Scene, fmu: Fmu) -> None:
    system, instance = fm.compile(scene), fmu.instance(SIMULATION).start()
    instance.do("fmi2DoStep", ct.c_double(0.0), ct.c_double(0.1), 1)
    y = instance.states(count(fmu))
    state = system.state(y[: system.nq], y[system.nq : -1], 0.1)
    found = errors(instance, system, state)
    assert {"loop.force.x", "pin.torque.z", "energy.kinetic", "joint.position.x"} <= set(found)
    assert max(found.values()) < 1e-11, sorted(found.items(), key=lambda each: -each[1])[:5]
    rates = {name: error for name, error in found.items() if name.startswith("der(")}
    assert max(rates.values()) < 1e-12
    instance.do("fmi2DoStep", ct.c_double(0.1), ct.c_double(0.01), 1)
    assert max(errors(instance, system, state).values()) > 1e-3  # of that state only


def test_an_integrator_of_another_tool_comes_to_the_same_end(scene: fm.Scene, fmu: Fmu) -> None:
    run = fm.simulate(scene, END, rtol=1e-12, atol=1e-13, samples=2)
    for tolerance, limit in ((1e-12, 1e-9), (1e-4, 1e-2)):
        y, events = exchanged(fmu, END, tolerance)
        assert y == pytest.approx(state_of(run, -1), rel=limit, abs=limit)
        assert events < 40  # closing loops does not start the integrator anew at each step


def exchanged(fmu: Fmu, end: float, tolerance: float) -> tuple[Any, int]:
    """The state at the end by SciPy's method of order 8, and the number of projections."""
    instance = fmu.instance()
    instance.do("fmi2SetupExperiment", 1, ct.c_double(tolerance), ct.c_double(0.0), 0, ct.c_double(0.0))
    instance.do("fmi2EnterInitializationMode")
    instance.do("fmi2ExitInitializationMode")
    instance.events()
    y, t, events = instance.states(count(fmu)), 0.0, 0
    while t < end:
        solver = DOP853(lambda t, y: instance.rates(t, y), t, y, end, rtol=tolerance, atol=tolerance, max_step=0.01)
        while solver.status == "running":
            solver.step()
            t, y = solver.t, solver.y
            instance.rates(t, y)
            asks, ends = ct.c_int(), ct.c_int()
            instance.do("fmi2CompletedIntegratorStep", 1, ct.byref(asks), ct.byref(ends))
            if asks.value:
                info, events = EventInfo(), events + 1
                instance.do("fmi2EnterEventMode")
                instance.do("fmi2NewDiscreteStates", ct.byref(info))
                assert info.states == 1
                instance.do("fmi2EnterContinuousTimeMode")
                before, y = y, instance.states(len(y))
                assert np.abs(y - before).max() > tolerance
                break
    return y, events


def count(fmu: Fmu) -> int:
    return len(fmu.root.findall("ModelStructure/Derivatives/Unknown"))


def test_start_values_that_are_nearly_closed_are_closed_and_others_are_refused(scene: fm.Scene, fmu: Fmu) -> None:
    system = fm.compile(scene)
    instance = fmu.instance().start(**{"pin.rotation": system.initial_state.q[1] + 1e-4})
    y = instance.states(count(fmu))
    assert mechanisms.gap(system, fm.State(y[: system.nq], y[system.nq : -1], 0.0)) < 1e-12
    wrong = fmu.instance()
    wrong.do("fmi2SetupExperiment", 0, ct.c_double(0.0), ct.c_double(0.0), 0, ct.c_double(0.0))
    wrong.do("fmi2EnterInitializationMode")
    wrong.set({"pin.rotation": 3.0})
    assert wrong.call("fmi2ExitInitializationMode") == 3
    assert 'closure "loop"' in wrong.messages[-1]


def test_a_state_is_restored_with_its_branch(fmu: Fmu) -> None:
    instance = fmu.instance(SIMULATION).start()
    state = ct.c_void_p()
    step = lambda t: instance.do("fmi2DoStep", ct.c_double(t), ct.c_double(0.05), 1)  # noqa: E731
    step(0.0)
    instance.do("fmi2GetFMUstate", ct.byref(state))
    step(0.05)
    first = instance.states(count(fmu))
    step(0.1)
    instance.do("fmi2SetFMUstate", state)
    step(0.05)
    assert np.array_equal(first, instance.states(count(fmu)))
    other = fmu.instance(SIMULATION).start()  # of the same archive, which has not been there
    other.do("fmi2SetFMUstate", state)
    other.do("fmi2DoStep", ct.c_double(0.05), ct.c_double(0.05), 1)
    assert np.array_equal(first, other.states(count(fmu)))
    instance.do("fmi2FreeFMUstate", ct.byref(state))


def test_instances_are_independent_also_in_threads(fmu: Fmu) -> None:
    rates = np.linspace(1.0, 3.0, 8)

    def run(i: int) -> Any:
        instance = fmu.instance(SIMULATION).start(**{"parameters.gravity_m_s2.y": -float(rates[i])})
        instance.do("fmi2DoStep", ct.c_double(0.0), ct.c_double(END), 1)
        return instance.states(count(fmu))

    with ThreadPoolExecutor(8) as threads:
        together = list(threads.map(run, range(8)))
    assert all(np.array_equal(together[i], run(i)) for i in range(8))
    assert len({each.tobytes() for each in together}) == 8


def test_c_runs_as_the_scene(exported: ExportedModel, scene: fm.Scene, tmp_path: Path) -> None:
    writing.write_c(exported, tmp_path)
    name = exported.identifier
    sources = ["example.c", f"{name}.c", f"{name}_kernels.o", "-lm", "-o", "example"]
    flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror"]
    done = subprocess.run([COMPILER, *flags, *sources], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    out = subprocess.run([tmp_path / "example", str(END), str(STEP)], capture_output=True, text=True, check=True)
    found = dict(line.rsplit(" ", 1) for line in out.stdout.splitlines())
    run = fm.simulate(scene, END, "rk4", step=STEP, samples=2)
    for names, row in ((run.q_names, run.q[-1]), (run.u_names, run.u[-1])):
        assert [float(found[each]) for each, _ in names] == pytest.approx(row, rel=1e-11, abs=1e-12)


def test_derivatives_of_undeformed_inertia_are_refused_with_the_remedy(monkeypatch: Any) -> None:
    beams = mechanisms.tilted_four_bar(flexible=True, drive=None)
    bodies = tuple(msgspec.structs.replace(body, level="ruthless") for body in beams.bodies)
    monkeypatch.setattr("flexmb.export.model.machine_code", lambda *_: pytest.fail("compiled"))
    with pytest.raises(NotExportable, match="leave the derivatives out"):
        model(msgspec.structs.replace(beams, bodies=bodies), derivatives=True)


def test_loads_that_are_not_determined_are_left_out_and_said(exported: ExportedModel) -> None:
    names = {output.name for output in exported.outputs}
    assert not exported.open_loads and set(spatial("loop")) <= names
    redundant, _ = tabled(mechanisms.four_bar())
    left = {output.name for output in redundant.outputs}
    assert "suppresses fewer motions" in redundant.open_loads
    assert not left & {*spatial("loop"), *spatial("pin")} and "joint.position.x" in left


def test_fmpy_finds_no_problem(archive: Path) -> None:
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(archive)) == []
