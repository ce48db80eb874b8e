"""A manufactured motion as a case: scene, run file, provenance, and the exact answers as its reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomlkit

from crosscheck.engines.contract import Effort, Engine, EngineMissing, Run
from crosscheck.engines.registry import PROVIDER, known_engine
from crosscheck.judging.uncertainty import RungSignal, estimate
from crosscheck.library import basis
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case
from crosscheck.library.reference import Knowledge, Known, digest, scene_digest, values_text
from crosscheck.manufacture.doubt import answers
from crosscheck.manufacture.drives import Manufactured
from crosscheck.references.files import knowledge_text, write_both
from flexmb.output.files import write_whole
from flexmb.run.channels import channels_of, distance, family, magnitude, signal_range
from flexmb.scene.files import dumps
from flexmb.scene.schema import Scene
from flexmb.typing import Real

SAMPLES = 17
GOAL = 1e-6
"""Of every channel, relative to its range."""
CANDIDATES = (
    "native", "native-composite", "native-frisch", "native-radau5", "pinocchio", "mujoco", "drake", "dart",
)  # fmt: skip
"""Engines that are asked; those that are installed and represent the scene exactly are named in the run file. Exudyn's
steps are of order 2 and do not come to GOAL: whoever asks for it has its U."""


def sample_times(duration_s: float) -> Real:
    """Times (s) of the reference; every interval of the tables ends at one or lies between two."""
    return np.linspace(0.0, duration_s, SAMPLES)


def write_case(made: Manufactured, folder: Path, command: str, seed: int) -> tuple[str, ...]:
    """Write the case of a manufactured motion, which `command` makes again, and say which engines are to run it.

    CaseError where the folder holds anything already, OSError where it cannot be written.
    """
    if folder.exists() and any(folder.iterdir()):
        raise CaseError(f"{folder} is not empty: give another folder, or empty it")
    folder.mkdir(parents=True, exist_ok=True)
    channels, known = answers(made, sample_times(made.duration_s))
    engines = _engines(made.scene)
    write_whole(folder / "scene.toml", dumps(made.scene, folder))
    write_whole(folder / "run.toml", _run(made, channels, engines, command))
    provenance = tomlkit.dumps({
        "reference": "closed form",
        "sources": [f"a manufactured motion: {command}"],
        "uncertainty": f"what tables of {made.interval_s:.3g} s miss of the loads, and rounding, as channels show it",
    })  # fmt: skip
    write_whole(folder / "provenance.toml", provenance)
    write_whole(folder / "README.md", _readme(made, command, seed))
    case = load_case(folder)
    values = values_text(sample_times(made.duration_s), channels)
    knowledge = Knowledge(
        variant="manufactured", horizon_s=made.duration_s, values=digest(values), provenance=digest(provenance),
        scene=scene_digest(case, case.run.variant("manufactured")),
        routes=(basis.title("dense", basis.MANUFACTURED, False),), made_with=(),
        channels={
            name: Known(
                uncertainty=float(f"{1.05 * known[name]:.1e}"), scale=float(f"{signal_range(name, rows):.3g}"),
                how="exact for loads that tables leave out in part: to first order what that makes, and rounding",
            )
            for name, rows in channels.items()
        },
    )  # fmt: skip
    write_both(folder, values, knowledge_text(knowledge))
    return engines


def _engines(scene: Scene) -> tuple[str, ...]:
    """The installed engines that take the scene exactly, those of the library first."""
    engines, found = known_engine(PROVIDER, "native"), []
    for name in CANDIDATES:
        try:
            engines[name].version()
        except EngineMissing:
            continue
        found += [name] if engines[name].supports(scene).kind == "exact" else []
    return tuple(found)


def _run(made: Manufactured, channels: dict[str, Real], engines: tuple[str, ...], command: str) -> str:
    kinds = dict.fromkeys(name.partition(":")[0].partition(".")[0] for name in channels)
    goals = dict.fromkeys(kinds, GOAL)
    unknown = ["work", *(f"load:{mass.name}" for mass in made.scene.point_masses)]
    unknown += [f"load:{coupling.name}" for coupling in made.scene.couplings]
    variant = {"name": "manufactured", "engines": list(engines)}
    run: dict[str, Any] = {
        "title": f"Manufactured motion of {made.scene.name}", "tags": ["manufactured"],
        "duration_s": made.duration_s, "samples": SAMPLES, "variant": [variant],
        "open": [{"channels": unknown, "reason": "the dense route does not give them"}],
        "reference": {"variant": "manufactured", "manufactured": command, "goals": goals},
    }  # fmt: skip
    return tomlkit.dumps(run)


def _readme(made: Manufactured, command: str, seed: int) -> str:
    return (
        f"# Manufactured motion of {made.scene.name}\n\n"
        f"All coordinates follow sines drawn by seed {seed}, for {made.duration_s:g} s; motors, and loads at nodes "
        "whose names begin with `drive`, make this motion exact. They were found by the dense route and are tables of "
        f"{len(made.between)} intervals. Every code must return the motion and the loads of all joints.\n\n"
        f"Made by `{command}`.\n"
    )


# One engine held against a manufactured motion in this process, without case folder, records or report.


class Held(NamedTuple):
    """Of one channel, in its SI unit: the largest distance from the exact answer, and the U of engine and answer."""

    error: float
    doubt: float

    @property
    def agrees(self) -> bool:
        """Whether the engine returned the answer within U."""
        return self.error <= self.doubt


def held(
    engine: Engine, scene: Scene, times: Real, channels: Mapping[str, Real], known: Mapping[str, float],
    efforts: Sequence[Effort] = (),
) -> dict[str, Held]:  # fmt: skip
    """The channels (T,k) at `times` (T,), known to `known`, that the engine offers, by its own ladder or `efforts`.

    CaseError where a run does not finish.
    """
    for_scene = getattr(engine, "efforts_for", lambda scene, duration_s: engine.efforts(scene))
    model, runs = engine.compile(scene), []
    efforts = efforts or for_scene(scene, float(times[-1]))
    for effort in efforts:
        run = model.simulate(Run(times), effort)
        if run.status != "finished":
            raise CaseError(f"{engine.name}, {effort.label}: {run.status}: {run.message}")
        runs.append((effort.value, channels_of(run), run.evaluations))
    finest = runs[-1][1]
    sizes: dict[str, float] = {}
    for name, values in finest.items():
        sizes[family(name)] = max(sizes.get(family(name), 0.0), magnitude(name, values))
    found = {}
    for name in channels.keys() & finest.keys():
        rungs = [RungSignal(value, of[name], evaluations) for value, of, evaluations in runs]
        doubt = estimate(name, efforts[0].kind, rungs, sizes[family(name)], len(scene.bodies)).value
        error = float(np.max(distance(name, finest[name], channels[name])))
        found[name] = Held(error, doubt + known[name])
    return found
