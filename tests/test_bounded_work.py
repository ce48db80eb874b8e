"""Work is bounded before it is done: an absurd number of a user is refused with its place and a number, at once."""

from __future__ import annotations

import dataclasses
import inspect
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene import sizes
from flexmb.system import compile as compiling
from tests.bounded_doors import LIMIT_S, commands
from tests.repo.project import ROOT

LARGE = "1000000000000000"
TAKEN = {
    f"flexmb simulate t_end {LARGE}", f"flexmb advise t_end {LARGE}",  # max_steps bounds the run
    f"flexmb view t_end {LARGE}",
    f"flexmb simulate atol {LARGE}", "flexmb simulate from_time -1", f"flexmb check t_end {LARGE}",
    f"flexmb campbell modes {LARGE}",  # of those that there are
    f"flexmb equivalence angle {LARGE}", "flexmb equivalence angle -1",
    "RunFile RunFile.finer 0", "RunFile Variant.eigenmodes 0", "SweepFile SweptQuantity.component 0",
    "SweepFile SweepFile.seed 0", f"SweepFile SweepFile.seed {LARGE}",
}  # fmt: skip
"""Options of the command lines and keys of files that may be so large or so small."""


@pytest.fixture(scope="module", params=["some", pytest.param("all", marks=pytest.mark.slow)])
def answers(request: pytest.FixtureRequest) -> tuple[dict[str, list[str]], list[Any]]:
    words = [*TAKEN, "--all"] if request.param == "all" else TAKEN
    done = subprocess.run(
        [sys.executable, "-m", "tests.bounded_doors", *words], capture_output=True, text=True, check=False, cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"}, timeout=500,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    head, *lines = map(json.loads, done.stdout.splitlines())
    return head, lines


def test_every_number_of_a_public_function_is_tried(answers) -> None:
    head, _ = answers
    assert sorted(set(head["found"]) - set(head["doors"])) == [], "give it a door in tests/bounded_doors.py"


def test_absurd_numbers_are_refused_by_name_at_once(answers) -> None:
    head, lines = answers
    bad = [
        (name, number, outcome, message[:200], f"{spent:.1f} s")
        for name, number, outcome, message, spent in lines
        if not (outcome == "refused" and spent < LIMIT_S and re.search(_named(name), message) and len(message) < 2000)
    ]
    assert not bad, "\n".join(map(str, bad))
    assert {name for name, *_ in lines} >= {*head["doors"], *commands()} - {name.rpartition(" ")[0] for name in TAKEN}


def _named(place: str) -> str:
    """What a message must contain: the last name of the place, as an argument, a key or an option."""
    words = {
        "duration_s": "stages|t_end|duration_s", "tol": "tolerance", "from_time": "t_start|its start",
        "t_start": "t_start|t_end", "modes": "modes?|elements|count",
    }  # fmt: skip
    last = re.split(r"[. ]", place)[-1]
    return words.get(last, f"{last}|{last.replace('_', '-')}|nobody|none\\.toml|no (case|map)")


DENSE, FEWER = "fewer bodies or modes", "ask for fewer"
TOO_LARGE: dict[str, list[tuple[Callable[[fm.Scene], object], str]]] = {
    "simulate": [
        (lambda scene: fm.simulate(scene, 0.1, algorithm="composite", samples=2), 'take "articulated"'),
        (lambda scene: fm.simulate(scene, 0.1, algorithm="frisch", samples=2), 'take "articulated"'),
        (lambda scene: fm.simulate(scene, 0.1, "radau5", samples=2), '"dop853" or "rk4"'),
        (lambda scene: fm.simulate(scene, 0.1, "exponential", samples=2), '"dop853" or "rk4"'),
        (lambda scene: fm.simulate(scene, 0.1, "generalised_alpha", step=0.01, samples=2), '"dop853" or "rk4"'),
        (lambda scene: fm.simulate(scene, 0.1, samples=200), FEWER),
    ],
    "simulate_stages": [
        (lambda scene: fm.simulate_stages(scene, [fm.RunStage(0.1, samples=200)]), FEWER),
        (lambda scene: fm.simulate_stages(scene, [fm.RunStage(0.1, samples=2)], "radau5"), '"dop853" or "rk4"'),
    ],
    "sensitivities": [(lambda scene: fm.sensitivities(scene, 0.1, ["a.mass_kg"], ["u"], samples=200), FEWER)],
    "uncertainty": [(lambda scene: fm.uncertainty(scene, 0.1, {"a.mass_kg": 0.1}, ["u"]), FEWER)],
    "gradient": [
        (lambda scene: fm.gradient(scene, 0.1, ["a.mass_kg"], fm.FinalValue("energy.total")), "fewer bodies or modes"),
        (lambda scene: fm.gradient(scene, 0.1, ["a.mass_kg"] * 999, fm.FinalValue("energy.total")), "fewer numbers"),
    ],
    "fit": [(lambda scene: fm.fit(scene, {"t": np.arange(200.0), "u": np.arange(200.0)}, ["a.mass_kg"]), FEWER)],
    "advise": [(lambda scene: fm.advise(scene, 1e-2, "energy.total"), FEWER)],
    "linearize": [(fm.linearize, DENSE)],
    "base_excitation": [(fm.base_excitation, DENSE)],
    "linearize_sampled": [(fm.linearize_sampled, DENSE)],
    "stability_map": [
        (lambda scene: fm.stability_map(scene, {"a.mass_kg": [1.0], "i.rotation.angle_rad": [0.0]}), DENSE)
    ],
    "equilibrium": [(fm.equilibrium, DENSE)],
    "equilibrium_path": [(lambda scene: fm.equilibrium_path(scene, "a.mass_kg", [1.0, 2.0]), DENSE)],
    "steady_spin": [(lambda scene: fm.steady_spin(scene, "i", 1.0), DENSE)],
    "campbell": [(lambda scene: fm.campbell(scene, "i", [1.0]), DENSE)],
    "ControlledMotion": [(fm.ControlledMotion, DENSE)],
}
AS_LONG_AS_GIVEN = {
    "check_scene", "compile", "compile_batch", "open_loop", "save_scene", "simulate_batch",  # its copies are built
    "Restart", "RunStage", "System",
}  # fmt: skip
"""What takes a scene and makes no more of it than tables that are as long as the scene itself."""


def test_every_door_for_scenes_is_tried_with_one_that_is_too_large() -> None:
    found = {name for name in fm.__all__ if _takes_a_scene(getattr(fm, name))}
    assert found - AS_LONG_AS_GIVEN == set(TOO_LARGE), "give it a call in TOO_LARGE"


def _takes_a_scene(item: Any) -> bool:
    """Whether it is called with a scene; records that calls return, and the scene's own parts, are not."""
    if not callable(item) or item.__module__.startswith("flexmb.scene.schema") or (
        dataclasses.is_dataclass(item) and item not in (fm.RunStage, fm.Restart)
    ):  # fmt: skip
        return False
    try:
        arguments = inspect.signature(item).parameters.values()
    except ValueError:  # of compiled classes
        return False
    return any(re.search(r"\bScene\b", str(argument.annotation)) for argument in arguments)


@pytest.mark.parametrize(("call", "remedy"), [call for calls in TOO_LARGE.values() for call in calls])
def test_a_scene_that_is_too_large_is_refused_before_it_is_built(call, remedy: str, monkeypatch) -> None:
    builder, names = fm.SceneBuilder("sixty"), ["a", *(f"body {i}" for i in range(2, 61))]
    for before, name in zip(("ground", *names), names, strict=False):
        builder.rigid_body(name, mass=1.0, com=(1, 0, 0), inertia=(0.1, 0.1, 0.1))
        builder.revolute("i" if name == "a" else f"to {name}", before, name, axis=(0, 0, 1))
    scene = builder.scene()
    monkeypatch.setattr(sizes, "MOST_BYTES", 30_000)
    monkeypatch.setattr(compiling, "System", None)
    monkeypatch.setattr(compiling, "assembled", None)
    with pytest.raises(ValueError, match=f"GiB are allowed: .*{remedy}"):
        call(scene)
