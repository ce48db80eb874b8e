"""Every number of a user that sets a size or the length of a loop, given absurdly: a process of limited memory.

So is every whole number and time of run files and files of sweeps.

Prints a line of JSON for each door and number: what came of it, its message, and the processor time it took. With
`--all` every number is tried at every door, else one in three, other ones at the next door.
"""

from __future__ import annotations

import copy
import inspect
import json
import math
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
import typing
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from typer.testing import CliRunner

import flexmb as fm
from crosscheck.library.case import RunFile
from crosscheck.library.find import load_case
from crosscheck.sampling.file import SweepFile
from crosscheck.sampling.run import run_sweep
from tests.flexmb.interchange.test_superelement_files import NODES, written

ABSURD: tuple[float, ...] = (10**15, 1e15, math.inf, math.nan, -1, 0, 10**400, 10**5000)
SHARE = 3
LIMIT_S = 2.0  # of the processor, for one refusal
CEILING = 2**30  # bytes of address space beyond what the process has when all doors are known
NUMBER = re.compile(r"\b(int|float)\b")
CASES = Path(__file__).resolve().parents[1] / "cases"


class Door(NamedTuple):
    """A call with one number; `taken` are those of the absurd numbers that make sense there."""

    call: Callable[[Any], Any]
    taken: tuple[float, ...] = ()


class _TooLong(BaseException):
    """Raised by the clock."""


def beam(elements: int = 4, modes: Any = 2) -> fm.Scene:
    """A clamped panel."""
    plain = fm.BeamStation(x_m=0.0, EA_N=1e6, EIy_Nm2=1e3, EIz_Nm2=1e3, GJ_Nm2=1e3, mass_per_length_kg_m=1.0)
    made = fm.SceneBuilder("x").rigid_body("hub", mass=1.0, inertia=(0.1, 0.1, 0.1)).free("base", "ground", "hub")
    made.beam("panel", length=1.0, elements=elements, section=plain, modes=modes)
    return made.weld("root", "hub", "panel").scene()


def user_law(outputs: Any) -> fm.Scene:
    """A wheel that a law of a user's drives."""
    made = fm.SceneBuilder("x").rigid_body("hub", mass=1.0, inertia=(0.1, 0.1, 0.1)).free("base", "ground", "hub")
    made.sense_time("t").user_law("law", "t", "flexmb.control.attitude:eigenaxis_slew", outputs=outputs)
    torque = fm.ControlSignal(source="law[0]", gain=-1.0)
    made.wheel("w", "hub", axis=(0, 0, 1), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3, torque=torque)
    return fm.compile(made.scene()).scene


def functions() -> dict[str, Door]:
    """By the function and its argument; t_end = 1e15 is bounded by max_steps."""
    builder = fm.SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
    builder.rigid_body("rod", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.1, 0.1)).marker("tip", "rod")
    scene = builder.revolute("pivot", "ground", "rod", axis=(0, 0, 1), angle=0.3).scene()
    system, one = fm.compile(scene), np.zeros((1, 1))
    batch, run = fm.compile_batch([scene]), fm.simulate(scene, 0.1, samples=3)
    runs = fm.simulate_batch(system, 0.1, samples=3)
    by, of, given, huge = ["rod.mass_kg"], ["energy.total"], {"rod.mass_kg": 0.1}, (10**15, 1e15)

    def stage(n: Any, samples: Any = 3) -> Any:
        return fm.simulate_stages(scene, [fm.RunStage(n, samples=samples)], max_steps=20)

    def many(n: int) -> Any:
        return fm.simulate(scene, 0.1, samples=3, max_steps=n)

    return {
        "simulate.t_end": Door(lambda n: fm.simulate(scene, n, samples=3, max_steps=20), huge),
        "simulate.t_start": Door(lambda n: fm.simulate(scene, 0.1, samples=3, t_start=n), (-1, 0)),
        "simulate.samples": Door(lambda n: fm.simulate(scene, 0.1, samples=n)),
        "simulate.stabilise": Door(lambda n: fm.simulate(scene, 0.1, samples=3, stabilise=n), (0,)),
        "simulate.max_steps": Door(many, (10**15,)),
        "simulate.step": Door(lambda n: fm.simulate(scene, 0.1, "rk4", samples=3, step=n), huge),
        "simulate.rtol": Door(lambda n: fm.simulate(scene, 0.1, samples=3, rtol=n)),
        "simulate_stages.t_start": Door(
            lambda n: fm.simulate_stages(scene, [fm.RunStage(0.1, samples=3)], t_start=n, max_steps=20), (*huge, -1, 0)
        ),
        "simulate_stages.stabilise": Door(
            lambda n: fm.simulate_stages(scene, [fm.RunStage(0.1, samples=3)], stabilise=n), (0,)
        ),
        "RunStage.duration_s": Door(stage, huge),
        "RunStage.samples": Door(lambda n: stage(0.1, n)),
        "simulate_batch.t_end": Door(lambda n: fm.simulate_batch(system, n, samples=3, max_steps=20), huge),
        "simulate_batch.samples": Door(lambda n: fm.simulate_batch(system, 0.1, samples=n)),
        "simulate_batch.threads": Door(lambda n: fm.simulate_batch(system, 0.1, samples=3, threads=n), (10**15,)),
        "Batch.accelerations.threads": Door(lambda n: batch.accelerations(one, one, threads=n), (10**15,)),
        "System.accelerations_batch.threads": Door(
            lambda n: system.accelerations_batch(one, one, threads=n), (10**15,)
        ),
        "Batch.system.copy": Door(batch.system, (10**15, 0)),
        "BatchTrajectory.message.copy": Door(runs.message, (-1, 0)),
        "Trajectory.state_at.sample": Door(run.state_at, (-1, 0)),
        "Trajectory.values_at.sample": Door(run.values_at, (-1, 0)),
        "sensitivities.t_end": Door(lambda n: fm.sensitivities(scene, n, by, of, samples=3), huge),
        "sensitivities.samples": Door(lambda n: fm.sensitivities(scene, 0.1, by, of, samples=n)),
        "uncertainty.t_end": Door(lambda n: fm.uncertainty(scene, n, given, of, samples=3), huge),
        "uncertainty.samples": Door(lambda n: fm.uncertainty(scene, 0.1, given, of, samples=n)),
        "gradient.t_end": Door(lambda n: fm.gradient(scene, n, by, fm.FinalValue("energy.total")), huge),
        "TimeIntegral.panels": Door(
            lambda n: fm.gradient(scene, 0.1, by, fm.TimeIntegral("energy.total", panels=n))
        ),
        "fit.max_runs": Door(lambda n: fm.fit(scene, {"t": [0.0, 0.1], "tip.position.x": [0.5, 0.4]}, by, max_runs=n),
                             (10**15,)),
        "advise.tolerance": Door(lambda n: fm.advise(scene, n, t_end=0.1)),
        "advise.budget": Door(lambda n: fm.advise(scene, 1e-2, t_end=0.1, budget=n), (*huge, -1, 0)),
        "advise.t_end": Door(lambda n: fm.advise(scene, 1e-2, t_end=n), huge),
        "steady_spin.rate": Door(lambda n: fm.steady_spin(scene, "pivot", n), (*huge, -1, 0)),
        "linearize_sampled.period": Door(lambda n: fm.linearize_sampled(scene, n), huge),
        "campbell.rates": Door(lambda n: fm.campbell(scene, "pivot", [n]), (*huge, -1, 0)),
        "check_scene.t_end": Door(lambda n: fm.check_scene(scene, t_end=n), huge),
        "SceneBuilder.scene.t_end": Door(lambda n: builder.scene(t_end=n), huge),
        "SceneBuilder.user_law.outputs": Door(lambda n: user_law(outputs=n)),
        "SceneBuilder.beam.elements": Door(lambda n: beam(elements=n)),
        "SceneBuilder.beam.modes": Door(lambda n: beam(modes=n), (0,)),
        "Modes.pieces": Door(lambda n: beam(modes=fm.Modes(count=2, pieces=n))),
        "Modes.points": Door(lambda n: beam(modes=fm.Modes(count=2, points=n))),
    }  # fmt: skip


NO_SIZE = {
    "EquilibriumPath.at": {"value"},
    "LinearModel.displaced": {"size", "phase"},
    "TimeIntegral.at": {"t"},
    "System.scene_state": {"t"},
    "System.state": {"t"},
    "check_scene": {"t_start"},
    "Campbell.plot": {"modes"},  # a slice of what there is
    "System.route": {"stabilise"},
    "fit": {"sigma"},
}
"""Numbers of public functions that are a state, a time or a scale: they set no size."""
LAYERS = (
    "FinalValue.probes", "Misfit.probes", "TimeIntegral.probes", "System.observe", "System.check", "System.fault",
    "System.evaluate", "System.refuse", "Batch.constants",
)  # fmt: skip
"""Methods for the library's own modules, whose arguments come from it."""


def found_numbers() -> set[str]:
    """The numbers that public functions and methods take, "function.argument", but for those of bodies in a scene."""
    found = set[str]()
    for name in fm.__all__:
        item = getattr(fm, name)
        members = {name: item}
        if inspect.isclass(item):
            own = not item.__module__.startswith("flexmb.scene") or name == "SceneBuilder"
            members = {f"{name}.{each}": value for each, value in vars(item).items() if own and each[0] != "_"}
        for place, call in members.items():
            if inspect.isfunction(call) and not place.startswith(LAYERS):
                for parameter in inspect.signature(call).parameters.values():
                    plain = re.sub(r"(Mapping|tuple|Sequence|dict|list)\[.*\]", "", str(parameter.annotation))
                    physics = place.startswith("SceneBuilder.") and "int" not in plain and parameter.name != "t_end"
                    if NUMBER.search(plain) and not physics and parameter.name not in NO_SIZE.get(place, ()):
                        found.add(f"{place}.{parameter.name}")
    return found


def commands() -> dict[str, tuple[Any, str, str]]:
    """Numeric options of both command lines, "program command option": the application, the command and its word."""
    found: dict[str, tuple[Any, str, str]] = {}
    for program in ("flexmb", "crosscheck"):
        app = import_module(f"{program}.cli").app
        for command in app.registered_commands:
            name = command.name or command.callback.__name__
            for argument in inspect.signature(command.callback, eval_str=True).parameters.values():
                kind, *about = typing.get_args(argument.annotation) or (argument.annotation,)
                if NUMBER.search(str(kind)):
                    words = [word for part in about for word in getattr(part, "param_decls", None) or ()]
                    word = next((word for word in words if word.startswith("--")), None)
                    found[f"{program} {name} {argument.name}"] = (
                        app, name, word or f"--{argument.name.replace('_', '-')}"
                    )  # fmt: skip
    return found


_SWEEP = """
title = "sizes"
scene = "panel.toml"
engines = ["native"]
seed = 3
number = 4
duration_s = 0.1
samples = 3
parameter = [{ path = "gravity_m_s2.0", distribution = "uniform", low = 0.0, high = 1.0 }]
quantity = [{ name = "energy", channel = "energy.total", value = "final" }]
"""
SWEEPS = (_SWEEP, _SWEEP.replace("seed", 'sampling = "latin_hypercube"\nseed'))
SCENE = str(CASES / "pendulums" / "double" / "scene.toml")
WORDS = {
    "simulate": (SCENE, "--t-end", "0.01", "--out", "out"), "check": (SCENE,), "equivalence": ("panel.toml", "panel"),
    "view": (SCENE, "--out", "view.html"),
    "advise": (SCENE,), "linearize": (SCENE,), "vibrate": (SCENE,), "campbell": (SCENE, "shoulder", "--rates", "0:1:2"),
    "reduce": ("K.mtx", "M.mtx", "nodes.csv", "--interface", "1", "--out", "x.sid"), "stability": ("no map",),
    "sweep": ("none.toml",), "contract": ("nobody",),
}  # fmt: skip
"""The other words of a command; all other commands take a case, and there is none of that name."""


Steps = tuple[str | int, ...]


class Key(NamedTuple):
    """A key of a file that sets a size or a time: where it is in a file that is right, which is read by `read`."""

    content: dict[str, Any]
    place: Steps
    read: Callable[[str], Any]

    def with_number(self, n: Any) -> Any:
        """What reading the file with another number there gives."""
        content = item = copy.deepcopy(self.content)
        for step in self.place[:-1]:
            item = item[step]
        item[self.place[-1]] = n
        return self.read("\n".join(f"{key} = {_inline(value)}" for key, value in content.items()))


def _inline(value: Any) -> str:
    """A value as TOML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_inline(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return str(value) if isinstance(value, float) else json.dumps(value)


def keys_of_files() -> dict[str, Key]:
    """By file and key, all whole numbers and times (s) of run files and sweeps, in the first file with its table."""
    found, tables = dict[str, Key](), set[type]()
    runs = ((RunFile, file, partial(_read_case, file.parent)) for file in sorted(CASES.glob("*/*/run.toml")))
    sweeps = ((SweepFile, sweep, _read_sweep) for sweep in SWEEPS)
    for root, given, read in (*runs, *sweeps):
        content = tomllib.loads(given if isinstance(given, str) else given.read_text(encoding="utf-8"))
        for kind, place, numbers in _tables(root, content, ()):
            for key in numbers:
                found.setdefault(f"{root.__name__} {kind.__name__}.{key}", Key(content, (*place, key), read))
            tables.add(kind)
    missing = (_kinds(RunFile) | _kinds(SweepFile)) - tables
    assert not missing, f"no file has {missing}"
    return found


def _kinds(kind: Any) -> set[type]:
    """The structs that a type is made of and that have such numbers, itself among them."""
    found, waiting = set[type](), [kind]
    while waiting:
        each = waiting.pop()
        if isinstance(each, type) and issubclass(each, msgspec.Struct):
            if each not in found:
                found.add(each)
                waiting += typing.get_type_hints(each).values()
        else:
            waiting += typing.get_args(each)
    return {each for each in found if _sizes(each)}


def _sizes(kind: type) -> list[str]:
    hints = typing.get_type_hints(kind)
    return [
        field.encode_name
        for field in msgspec.structs.fields(kind)
        if int in (hints[field.name], *typing.get_args(hints[field.name])) or field.name.endswith("_s")
    ]


def _tables(kind: Any, content: Any, place: Steps) -> Iterator[tuple[type, Steps, list[str]]]:
    """The tables of a file that are structs: kind, place, keys of sizes."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        yield kind, place, _sizes(kind)
        hints = typing.get_type_hints(kind)
        for field in msgspec.structs.fields(kind):
            if field.encode_name in content:
                yield from _tables(hints[field.name], content[field.encode_name], (*place, field.encode_name))
    elif isinstance(content, list):
        for i, each in enumerate(content):
            yield from _tables(typing.get_args(kind)[0], each, (*place, i))
    elif isinstance(content, dict):
        for each in typing.get_args(kind):
            if isinstance(each, type) and issubclass(each, msgspec.Struct):
                yield from _tables(each, content, place)


def _read_case(folder: Path, text: str) -> None:
    """Read a case, and make the scenes of all its variants."""
    own = Path("a case")
    shutil.rmtree(own, ignore_errors=True)
    shutil.copytree(folder, own)
    (own / "accepted.toml").unlink(missing_ok=True)
    (own / "run.toml").write_text(text)
    case = load_case(own)
    for variant in case.run.variants:
        case.scene(variant)


def _read_sweep(text: str) -> None:
    """Read a sweep, and make its samples, without running them."""
    Path("sweep.toml").write_text(text)
    run_sweep(Path("sweep.toml"), Path("swept"), fresh=True, scheduler=lambda *_: (_ for _ in ()))


def main() -> None:
    """Try all doors; the memory is limited once everything is imported and compiled."""
    warnings.simplefilter("ignore")
    os.chdir(tempfile.mkdtemp())
    written("mtx", Path())
    Path("nodes.csv").write_text(NODES)
    fm.save_scene(beam(), "panel.toml")
    doors, options, keys = functions(), commands(), keys_of_files()
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + CEILING, size + CEILING))
    signal.signal(signal.SIGVTALRM, _ring)
    print(json.dumps({"doors": sorted(doors), "found": sorted(found_numbers())}), flush=True)
    for i, (name, door) in enumerate(doors.items()):
        for n in _some(ABSURD, i):
            if not any(n is each or (type(n) is type(each) and n == each) for each in door.taken):
                _report(name, n, _tried(lambda door=door, n=n: door.call(n)))
    for i, (name, key) in enumerate(keys.items()):
        for n in _some((10**15, 1e15, math.inf, math.nan, -1, 0), i):
            if f"{name} {_short(n)}" not in sys.argv[1:]:
                _report(name, n, _tried(lambda key=key, n=n: key.with_number(n)))
    for i, (name, (app, command, word)) in enumerate(options.items()):
        for n in _some(("1000000000000000", "inf", "nan", "-1", "9" * 5000), i):
            if f"{name} {n}" in sys.argv[1:]:
                continue
            words = [command, *WORDS.get(command, ("no case",)), f"{word}={n}"]
            _report(name, n, _tried(lambda app=app, words=words: _invoked(app, words)))


def _some(numbers: tuple[Any, ...], i: int) -> tuple[Any, ...]:
    """Those that the door of this number is tried with."""
    return numbers if "--all" in sys.argv[1:] else numbers[i % SHARE :: SHARE]


def _report(name: str, n: Any, outcome: tuple[str, str, float]) -> None:
    print(json.dumps([name, _short(n), *outcome]), flush=True)


def _short(n: Any) -> str:
    return "many digits" if isinstance(n, int) and n.bit_length() > 1000 else str(n)[:16]


def _invoked(app: Any, words: list[str]) -> str:
    done = CliRunner().invoke(app, words)
    if done.exit_code == 2 and isinstance(done.exception, SystemExit):
        raise ValueError(" ".join(done.output.split()))
    raise AssertionError(f"exit code {done.exit_code}, {done.exception!r}")


def _tried(call: Callable[[], Any]) -> tuple[str, str, float]:
    begun = time.process_time()
    signal.setitimer(signal.ITIMER_VIRTUAL, 10.0 * LIMIT_S)
    try:
        call()
        outcome = "taken", ""
    except (ValueError, TypeError, IndexError) as error:
        outcome = "refused", str(error)
    except BaseException as error:
        outcome = type(error).__name__, str(error)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    return outcome[0], outcome[1][:3000], time.process_time() - begun


def _ring(*_: Any) -> None:
    raise _TooLong


if __name__ == "__main__":
    main()
