"""All cases of the library that are not refused, as FMUs: their rates at the start, and a step of Co-Simulation."""

from __future__ import annotations

import ctypes as ct
import os
import platform
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from crosscheck.library.find import Case, shipped_cases
from flexmb.export import model as models
from flexmb.export import numbers, writing
from flexmb.export.model import ExportedModel, tabled
from flexmb.export.refusals import NotExportable, refuse
from flexmb.scene.problems import SceneWarning
from flexmb.system.compile import compile
from tests.flexmb.export.exported_scenes import COMPILER
from tests.flexmb.export.loaded import SIMULATION, Fmu

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(platform.machine() != "x86_64" or os.name != "posix", reason="export is for Linux on x86-64"),
    pytest.mark.skipif(COMPILER is None, reason="no C compiler is on the path"),
]
STEP = 1e-4
NAME = "walked"


def exportable() -> list[Case]:
    """The cases whose first variant is not refused."""
    found = list[Case]()
    for case in shipped_cases():
        try:
            refuse(scene_of(case))
        except NotExportable:
            continue
        found.append(case)
    return found


def scene_of(case: Case) -> fm.Scene:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # what is doubtful in a case is the case's matter
        return case.scene(case.run.variants[0])


@pytest.fixture(scope="module")
def compiled() -> Iterator[Callable[[fm.Scene], ExportedModel]]:
    """Models with general kernels, which contain every feature, so that scenes share their code: the special ones of
    each would take a quarter of an hour. Few numbers of a scene are tried: they are `test_export`'s matter."""
    codes = dict[Any, bytes]()

    def of(scene: fm.Scene) -> ExportedModel:
        prepared, kinds = tabled(scene)
        if kinds not in codes:
            codes[kinds] = models.machine_code(NAME, kinds)
        return prepared._replace(identifier=NAME, code=codes[kinds])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(models, "compile", lambda scene, kernels: compile(scene, kernels="general"))
        patch.setattr(numbers, "MOST", 8)
        yield of


@pytest.mark.filterwarnings("ignore::flexmb.scene.problems.SceneWarning")
@pytest.mark.parametrize("case", exportable(), ids=lambda case: case.name)
def test_a_case_runs_as_an_fmu(case: Case, compiled: Callable[[fm.Scene], ExportedModel], tmp_path: Path) -> None:
    scene = scene_of(case)
    writing.write_fmu(compiled(scene), tmp_path / "case.fmu", STEP)
    fmu, system = Fmu(tmp_path / "case.fmu", tmp_path / "there"), fm.compile(scene)
    start, n = system.initial_state, system.nq + system.nu + 1
    instance = fmu.instance().start(start.t)
    instance.events()
    y = instance.states(n)
    assert y[:-1] == pytest.approx(np.concatenate([start.q, start.u]), rel=1e-12, abs=1e-12)
    expected = system.evaluate(start.t, start.q, start.u).accelerations
    size = np.abs(expected).max()
    assert instance.rates(start.t, y)[system.nq : -1] == pytest.approx(expected, rel=1e-9, abs=1e-10 * size + 1e-12)
    if not scene.constraints and size > 0.0 and np.any(system.constants.speed["prescribed"] < 0):
        other = instance.rates(start.t, 1.01 * y + 0.01)[system.nq : -1]
        assert other != pytest.approx(expected, rel=1e-9, abs=1e-10 * size + 1e-12)  # of another state
    run = fm.simulate(scene, start.t + STEP, "rk4", step=STEP, samples=2)
    steps = fmu.instance(SIMULATION).start(start.t)
    steps.do("fmi2DoStep", ct.c_double(start.t), ct.c_double(STEP), 1)
    for part, row in ((slice(0, system.nq), run.q), (slice(system.nq, -1), run.u)):
        size = np.abs(row[-1] - row[0]).max()
        assert steps.states(n)[part] == pytest.approx(row[-1], rel=1e-10, abs=1e-9 * size + 1e-13)
