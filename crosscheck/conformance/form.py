"""The form of an answer: names, statuses, shapes, times, reasons, and reproducibility."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic, perf_counter, sleep

import msgspec
import numpy as np
import psutil

from crosscheck.conformance.clause import (
    MASS,
    Chapter,
    allowance,
    equal,
    ladder,
    require,
    simple_scenes,
    simplest,
    simulated,
)
from crosscheck.engines.answers import RUNGS
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import ENERGIES, Engine, Model, Snapshot, Trajectory
from flexmb.run.channels import channels_of, distance
from flexmb.scene.schema import Scene
from flexmb.typing import Real

FORM = Chapter(physical=False)
TIMES = np.linspace(0.0, 0.5, 11)
LEAST_SHARE = 1e-4  # of a call's time that the solve must take: converting takes most of some adapters' time
CLEANUP_S = 2.0  # within which threads and processes of a run must end


@FORM.clause("`version` names the version of the library, or raises EngineMissing where it is not installed.")
def version_is_text(engine: Engine) -> None:
    require(isinstance(engine, Engine), "it lacks a name or a method of the protocol Engine")
    CheckedEngine(engine).version()


@FORM.clause("`supports` says how exactly a scene can be represented, and gives its reason where it cannot.")
def a_refusal_has_a_reason(engine: Engine) -> None:
    for scene in simple_scenes():
        support = CheckedEngine(engine).supports(scene)
        text = f'supports() of the scene "{scene.name}" is "{support.kind}" without a reason'
        require(support.kind == "exact" or bool(support.reason.strip()), text)


@FORM.clause("Efforts are a ladder of at least three, coarse to fine, each once, however long the run is.")
def efforts_are_a_ladder(engine: Engine) -> None:
    simplest(engine)
    for scene in simple_scenes():
        for duration_s in (1e-3, 1.0, 1e3) if CheckedEngine(engine).supports(scene).kind != "no" else ():
            ladder(engine, scene, duration_s)


@FORM.clause("Every effort is another run: to ask for more changes the result, and counts no fewer evaluations.")
def efforts_make_a_difference(engine: Engine) -> None:
    scene, model = _compiled(engine)
    runs = [simulated(model, TIMES, effort) for effort in ladder(engine, scene, TIMES[-1])]
    paths = [run.markers["tip"].position for run in runs if run.status == "finished"]
    require(len(paths) >= RUNGS, f"of {len(runs)} efforts {len(paths)} finish half a second of the simplest scene")
    for i, path in enumerate(paths):
        same = any(np.array_equal(path, other) for other in paths[:i])
        require(not same, "two efforts give the same numbers: efforts that do not reach the solver are one effort")
    counts = [run.evaluations for run in runs]
    require(counts[0] <= counts[-1], f"the finest effort has {counts[-1]} evaluations, the coarsest {counts[0]}")


@FORM.clause("`wall_s` is what the solve takes: more than nothing, and not more than the whole call.")
def a_solve_takes_time(engine: Engine) -> None:
    scene, model = _compiled(engine)
    finest = ladder(engine, scene, TIMES[-1])[-1]
    taken, told = [], []
    for _ in range(3):
        before = perf_counter()
        told.append(simulated(model, TIMES, finest).wall_s)
        taken.append(perf_counter() - before)
    for claimed_s, call_s in zip(told, taken, strict=True):
        clocks = f"wall_s is {claimed_s:.3g} s of a call that takes {call_s:.3g} s"
        require(
            claimed_s > LEAST_SHARE * min(taken), f"{clocks}: time the solve by a clock, such as time.perf_counter()"
        )
        require(claimed_s <= 1.01 * call_s + 1e-3, f"{clocks}: compiling and warming up are no part of it")


@FORM.clause("A run leaves nothing behind: no thread of Python, and neither threads, processes nor files that add up.")
def a_run_leaves_nothing_behind(engine: Engine) -> None:
    known = set(threading.enumerate())
    with _only_new_garbage():
        for _ in range(2):  # the first may start a pool of threads that serves all others
            _leave(engine)
        before = _holdings()
        for _ in range(4):
            _leave(engine)
    patience = monotonic() + CLEANUP_S
    while (left := _left(known, before)) and monotonic() < patience:
        sleep(0.02)
    require(not left, f"after runs have returned there are {left}: end what a run begins before it returns")


@FORM.clause("A run has the sample times asked for, arrays of the right shapes, finite, and names that the scene has.")
def a_run_is_what_was_asked_for(engine: Engine) -> None:
    run = _run(engine)
    require(run.status == "finished", f"half a second of the simplest scene ended as {run.status}: {run.message}")
    require(set(run.markers) == {"tip"}, f"it gives markers {sorted(run.markers)}: the scene has tip")


@FORM.clause("The motion is the same however many samples of it are asked for.")
def sample_times_do_not_change_the_motion(engine: Engine) -> None:
    scene, model = _compiled(engine)
    coarser, finest = ladder(engine, scene, TIMES[-1])[-2:]
    few = channels_of(simulated(model, TIMES[::5], finest))
    many = channels_of(simulated(model, TIMES, finest))
    rough = channels_of(simulated(model, TIMES, coarser))
    require(set(few) == set(many) == set(rough), "it has other channels with fewer sample times, or another effort")
    for name, values in many.items():
        size = max(1.0, float(np.abs(values).max()))
        error, refinement = distance(name, few[name], values[::5]).max(), distance(name, rough[name], values).max()
        bound = 2.0 * min(refinement, 1e-2 * size) + allowance(1e-9) * size
        require(bool(error <= bound), f"with fewer sample times {name} is {error:.3g} (SI) another")


@FORM.clause("The same effort gives the same result when it is run again.")
def a_run_can_be_repeated(engine: Engine) -> None:
    first, second = _run(engine), _run(engine)
    before, after = channels_of(first), channels_of(second)
    for channel, values in before.items():
        same = channel in after and np.array_equal(values, after[channel])
        require(same, f"{channel} is another when the same effort is run again")


@FORM.clause("A model runs as often as it is asked, and no run changes another, nor the scene.")
def runs_do_not_disturb_each_other(engine: Engine) -> None:
    scene = simplest(engine)
    before = msgspec.json.encode(scene)
    model = CheckedEngine(engine).compile(scene)
    efforts = ladder(engine, scene, TIMES[-1])
    first = simulated(model, TIMES, efforts[-1]).markers["tip"].position
    for effort in (efforts[0], efforts[-1]):
        last = simulated(model, TIMES, effort).markers["tip"].position
    require(np.array_equal(first, last), "a run at another effort in between changes the result")
    require(msgspec.json.encode(scene) == before, "the scene is another after the runs")


@FORM.clause("`evaluate` and the first sample of `simulate` say the same of the initial state.")
def a_run_begins_at_the_initial_state(engine: Engine) -> None:
    start, run = _start(engine), _run(engine)
    require(set(start.markers) == set(run.markers), "they have other markers")
    for name, marker in start.markers.items():
        path = run.markers[name]
        equal(f"the position of {name} at t = 0", path.position[0], marker.position)
        equal(f"the velocity of {name} at t = 0", path.velocity[0], marker.velocity)
        turned = _same_side(path.quaternion[0], marker.quaternion)
        equal(f"the quaternion of {name} at t = 0", turned, marker.quaternion)
    for name in set(start.loads) & set(run.loads):
        equal(f"the load of {name} at t = 0", run.loads[name][0], start.loads[name], MASS)
    for kind in set(start.energy) & set(run.energy):
        equal(f"the {kind} energy at t = 0", run.energy[kind][0], start.energy[kind])
    if start.momentum is not None and run.momentum is not None:
        equal("the momentum at t = 0", run.momentum[0], start.momentum)


@FORM.clause("Kinds of energy are kinetic, strain, spring and gravity; names of loads are those of the scene.")
def a_snapshot_names_what_the_scene_has(engine: Engine) -> None:
    answer, scene = _start(engine), simplest(engine)
    require(set(answer.markers) == {"tip"}, f"it gives markers {sorted(answer.markers)}: the scene has tip")
    hinge = scene.hinges[0].name
    require(set(answer.loads) <= {hinge}, f"it gives loads of {sorted(answer.loads)}: the scene has {hinge}")
    require(set(answer.energy) <= set(ENERGIES), f"it gives energies {sorted(answer.energy)}")
    require(not answer.wheel_loads and not answer.drives, "it gives wheels or drives, of which the scene has none")


@FORM.clause("A run that diverges is a status with its reason and the good samples, never an exception.")
def a_violent_run_has_a_status(engine: Engine) -> None:
    scene = simplest(engine, rate=1e6)
    times = np.linspace(0.0, 1e-3, 3)
    model = CheckedEngine(engine).compile(scene)
    run = simulated(model, times, ladder(engine, scene, times[-1])[0])  # an exception fails the check
    require(run.status == "finished" or bool(run.message.strip()), f"it {run.status} without saying why")


def _compiled(engine: Engine) -> tuple[Scene, Model]:
    """The simplest scene that the engine represents, and its model, ready to run."""
    scene = simplest(engine)
    model = CheckedEngine(engine).compile(scene)
    model.warm_up()
    return scene, model


def _run(engine: Engine) -> Trajectory:
    """Half a second at the finest effort."""
    scene, model = _compiled(engine)
    return simulated(model, TIMES, ladder(engine, scene, TIMES[-1])[-1])


def _start(engine: Engine) -> Snapshot:
    answer = _compiled(engine)[1].evaluate()
    require(isinstance(answer, Snapshot), f"evaluate() returned a {type(answer).__name__}, not a Snapshot")
    return answer


def _leave(engine: Engine) -> None:
    """A run of a new model, of which nothing is kept."""
    scene, model = _compiled(engine)
    simulated(model, TIMES, ladder(engine, scene, TIMES[-1])[0])
    del model
    gc.collect()


@contextmanager
def _only_new_garbage() -> Iterator[None]:
    """Let `gc.collect` skip the objects that exist already, about a million, which would take 0.5 s each time."""
    was_frozen = gc.get_freeze_count() > 0  # then the caller has frozen its own objects
    gc.freeze()
    try:
        yield
    finally:
        if not was_frozen:
            gc.unfreeze()


def _holdings() -> dict[str, int]:
    """The numbers of this process's threads, children and open files."""
    me = psutil.Process()
    files = me.num_fds() if hasattr(me, "num_fds") else len(me.open_files())
    return {"threads": me.num_threads(), "processes": len(me.children()), "open files": files}


def _left(known: set[threading.Thread], before: dict[str, int]) -> str:
    """What exists in addition to what was known before, in words."""
    threads = [thread.name for thread in threading.enumerate() if thread not in known]
    more = {what: number - before[what] for what, number in _holdings().items() if number > before[what]}
    told = [f"threads of Python ({', '.join(threads)})"] if threads else []
    return " and ".join(told + [f"{number} {what} more" for what, number in more.items()])


def _same_side(answer: Real, like: Real) -> Real:
    """The quaternion or its negative, whichever is nearer to the other."""
    return answer if float(np.dot(answer, like)) >= 0.0 else -answer
