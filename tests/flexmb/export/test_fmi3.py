"""The same models by FMI 3.0: what its functions and its description add to those of FMI 2.0."""

from __future__ import annotations

import ctypes as ct
import math
import os
import platform
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.export import writing
from flexmb.export.model import ExportedModel
from tests.flexmb.export.differentiated import errors
from tests.flexmb.export.exported_scenes import COMPILER, machine, mechanism, some_state
from tests.flexmb.export.loaded import SIMULATION, Fmu
from tests.flexmb.export.loaded3 import Fmu3, Instance3

pytestmark = [
    pytest.mark.skipif(platform.machine() != "x86_64" or os.name != "posix", reason="export is for Linux on x86-64"),
    pytest.mark.skipif(COMPILER is None, reason="no C compiler is on the path"),
]
STEP, LIMIT = 1e-3, 300_000
MODELS = {"tree": machine, "chain": mechanism}


@pytest.fixture(scope="module", params=list(MODELS))
def kind(request: Any) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def scene(kind: str) -> fm.Scene:
    return MODELS[kind]()


@pytest.fixture(scope="module")
def exported(kind: str, machine_model: ExportedModel, mechanism_model: ExportedModel) -> ExportedModel:
    return {"tree": machine_model, "chain": mechanism_model}[kind]


@pytest.fixture(scope="module")
def archive(exported: ExportedModel, tmp_path_factory: Any) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "model.fmu"
    writing.write_fmu(exported, path, STEP, "3")
    return path


@pytest.fixture(scope="module")
def fmu(archive: Path, tmp_path_factory: Any) -> Fmu3:
    return Fmu3(archive, tmp_path_factory.mktemp("unpacked"))


def state_count(fmu: Fmu3) -> int:
    return len(fmu.root.findall("ModelStructure/ContinuousStateDerivative"))


def test_both_versions_give_the_same_numbers(
    fmu: Fmu3, exported: ExportedModel, scene: fm.Scene, tmp_path: Path
) -> None:
    writing.write_fmu(exported, tmp_path / "two.fmu", STEP)
    two = Fmu(tmp_path / "two.fmu", tmp_path / "there")
    assert set(fmu.numbers) == {*two.numbers, "time"}
    assert {name: unit for name, unit in fmu.unit.items() if name != "time"} == two.unit
    instances = [each.instance().start() for each in (fmu, two)]
    system, events = fm.compile(scene), [each.events() for each in instances]
    assert (events[0].has_next, events[0].next) == (events[1].has_next, events[1].next)
    y = some_state(system) if "crank.drive[0]" in fmu.numbers else instances[1].states(len(exported.states))
    seen = [name for name, causality in fmu.causality.items() if causality in ("output", "local")]
    rates = [each.rates(0.004, y) for each in instances]
    assert np.array_equal(*rates) and np.array_equal(*(each.get(*seen) for each in instances))
    assert not np.array_equal(rates[0], instances[0].rates(0.004, y * 1.001))
    assert instances[0].get("time") == [0.004]
    state = system.state(y[: system.nq], y[system.nq : -1], 0.004)
    instances[0].rates(0.004, y)
    assert max(errors(instances[0], system, state).values()) < 1e-11


def test_co_simulation_takes_the_steps_of_a_run(scene: fm.Scene, fmu: Fmu3) -> None:
    run = fm.simulate(scene, 0.06, "rk4", step=STEP, samples=4)
    instance, count = fmu.instance(SIMULATION).start(), len(run.q_names) + len(run.u_names)
    for n in range(3):
        assert instance.step(run.t[n], run.t[n + 1] - run.t[n]) == run.t[n + 1]
        y = np.concatenate([run.q[n + 1], run.u[n + 1]])
        assert instance.states(count) == pytest.approx(y, rel=1e-11, abs=1e-12)
    assert np.abs(run.u[-1] - run.u[0]).max() > 1e-3  # it moves


def test_a_state_is_saved_serialised_and_restored(fmu: Fmu3) -> None:
    instance, count = (
        fmu.instance(SIMULATION).start(),
        len(fmu.root.findall("ModelStructure/ContinuousStateDerivative")),
    )
    instance.step(0.0, 0.005)
    state, size, again = ct.c_void_p(), ct.c_size_t(), ct.c_void_p()
    instance.do("fmi3GetFMUState", ct.byref(state))
    instance.step(0.005, 0.005)
    first = instance.states(count)
    instance.do("fmi3SerializedFMUStateSize", state, ct.byref(size))
    text = ct.create_string_buffer(size.value)
    instance.do("fmi3SerializeFMUState", state, text, size)
    other = fmu.instance(SIMULATION).start()
    other.do("fmi3DeserializeFMUState", text, size, ct.byref(again))
    other.do("fmi3SetFMUState", again)
    other.step(0.005, 0.005)
    assert np.array_equal(first, other.states(count))
    foreign = ct.create_string_buffer(b"x" * size.value, size.value)
    assert other.call("fmi3DeserializeFMUState", foreign, size, ct.byref(again)) == 3
    for each in (state, again):
        instance.do("fmi3FreeFMUState", ct.byref(each))


def test_instances_are_independent_also_in_threads(fmu: Fmu3) -> None:
    count = state_count(fmu)

    def run(i: int) -> Any:
        instance = fmu.instance(SIMULATION).start(**{"parameters.gravity_m_s2.y": -1.0 - i})
        instance.step(0.0, 0.05)
        return instance.states(count)

    with ThreadPoolExecutor(8) as threads:
        together = list(threads.map(run, range(8)))
    assert all(np.array_equal(together[i], run(i)) for i in range(8))
    assert len({each.tobytes() for each in together}) == 8


def test_what_is_wrong_is_said(fmu: Fmu3, exported: ExportedModel, tmp_path: Path) -> None:
    stranger = fmu.instance(guid="{other}")
    assert stranger.address is None and "are of different models" in stranger.messages[0]
    writing.write_fmu(exported._replace(tangent=None), tmp_path / "exchange.fmu", fmi="3")
    alone = Fmu3(tmp_path / "exchange.fmu", tmp_path / "there")
    refused = alone.instance(SIMULATION)
    assert refused.address is None and "export it with --step" in refused.messages[0]
    assert alone.root.find("CoSimulation") is None
    instance = alone.instance().start()
    assert instance.call("fmi3EnterConfigurationMode") == 3 and "structural" in instance.messages[-1]
    instance.events()
    with pytest.raises(AssertionError, match="export it with --derivatives"):
        instance.along(["der(work)"], {"work": 1.0})
    number, one = (ct.c_uint * 1)(0), ct.c_size_t(1)
    assert instance.call("fmi3GetInt32", number, one, (ct.c_int * 1)(), one) == 3
    assert "real variables only" in instance.messages[-1]
    assert instance.call("fmi3GetFloat64", number, one, (ct.c_double * 2)(), ct.c_size_t(2)) == 3


def test_what_is_not_finite_is_refused(fmu: Fmu3) -> None:
    count = state_count(fmu)
    instance, bad = fmu.instance().start(), ct.c_double(math.nan)
    instance.events()
    y, n = instance.states(count), ct.c_size_t(count)
    y[0] = math.nan
    assert instance.call("fmi3SetContinuousStates", y.ctypes.data_as(ct.c_void_p), n) == 2  # a shorter step may do
    assert "not finite" in instance.messages[-1]
    assert instance.call("fmi3SetTime", bad) == 3 and "not finite" in instance.messages[-1]
    with pytest.raises(AssertionError, match="direction is not finite"):
        instance.along(["der(work)"], {"work": math.nan})
    assert np.all(np.isfinite(instance.get("der(work)", "energy.total")))  # nothing of it was taken
    steps = fmu.instance(SIMULATION).start()
    for t, size in ((math.nan, 0.1), (0.0, math.nan), (0.0, math.inf)):
        with pytest.raises(AssertionError, match="positive and finite"):
            steps.step(t, size)
    waiting: Instance3 = fmu.instance()
    assert waiting.call("fmi3EnterInitializationMode", False, bad, bad, False, bad) == 3
    assert "start time" in waiting.messages[-1]


def test_fmpy_finds_no_problem_and_comes_to_the_same_end(scene: fm.Scene, archive: Path, kind: str) -> None:
    """CVode, with the events of a load that jumps, or the projections of a loop; and Co-Simulation, step by step."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
    from fmpy.validation import validate_fmu

    assert archive.stat().st_size < LIMIT
    assert validate_fmu(str(archive)) == []
    end, interval = 0.04, 5e-4 if kind == "tree" else STEP
    exchange = fm.simulate(scene, end, rtol=1e-12, atol=1e-13, samples=2)
    found = fmpy.simulate_fmu(
        str(archive), fmi_type="ModelExchange", solver="CVode", stop_time=end, output_interval=interval,
        relative_tolerance=1e-13 if kind == "tree" else 1e-12, record_events=False,
    )  # fmt: skip
    check(found, exchange, 1e-9)
    steps = fm.simulate(scene, end, "rk4", step=STEP, samples=41)  # a sample at each communication point
    check(fmpy.simulate_fmu(str(archive), fmi_type="CoSimulation", stop_time=end, output_interval=STEP), steps, 1e-11)


def check(found: Any, run: fm.Trajectory, limit: float) -> None:
    """Compare the ends."""
    for names, row in ((run.q_names, run.q[-1]), (run.u_names, run.u[-1])):
        for (name, _), value in zip(names, row, strict=True):
            assert found[name][-1] == pytest.approx(value, rel=limit, abs=limit), name
