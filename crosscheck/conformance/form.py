"""What an answer looks like: names, statuses, shapes, times, reasons, and that it is the same every time."""

from __future__ import annotations

import msgspec
import numpy as np

from crosscheck.conformance.clause import Chapter, equal, ladder, offered, require, simulated, snapshot
from crosscheck.conformance.scenes import MASS, pendulum
from crosscheck.engines.answers import checked_version, support_of
from crosscheck.engines.contract import ENERGIES, Engine, Trajectory
from flexmb.run.channels import channels_of
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.typing import Real

FORM = Chapter(physical=False)
TIMES = np.linspace(0.0, 0.5, 11)


@FORM.clause("`version` names the version of the library, or raises EngineMissing where it is not installed.")
def version_is_text(engine: Engine) -> None:
    require(isinstance(engine, Engine), "it lacks a name or a method of the protocol Engine")
    checked_version(engine.version())


@FORM.clause("`supports` says how exactly a scene can be represented, and gives its reason where it cannot.")
def a_refusal_has_a_reason(engine: Engine) -> None:
    for scene in (pendulum(), _exotic()):
        support = support_of(engine, scene)
        text = f'supports() of the scene "{scene.name}" is "{support.kind}" without a reason'
        require(support.kind == "exact" or bool(support.reason.strip()), text)


@FORM.clause("Efforts are a ladder of at least three, coarse to fine, each once, however long the run is.")
def efforts_are_a_ladder(engine: Engine) -> None:
    offered(engine, pendulum())
    for duration_s in (1e-3, 1.0, 1e3):
        ladder(engine, pendulum(), duration_s)


@FORM.clause("A run has the sample times asked for, arrays of the right shapes, finite, and names that the scene has.")
def a_run_is_what_was_asked_for(engine: Engine) -> None:
    run = _pendulum_run(engine)
    require(run.status == "finished", f"half a second of a pendulum ended as {run.status}: {run.message}")
    require(set(run.markers) == {"tip"}, f"it gives markers {sorted(run.markers)}: the scene has tip")


@FORM.clause("The motion is the same however many samples of it are asked for.")
def sample_times_do_not_change_the_motion(engine: Engine) -> None:
    scene = pendulum()
    model = offered(engine, scene)
    coarser, finest = ladder(engine, scene, TIMES[-1])[-2:]
    few = simulated(model, scene, TIMES[::5], finest).markers["tip"].position
    many = simulated(model, scene, TIMES, finest).markers["tip"].position
    rough = simulated(model, scene, TIMES, coarser).markers["tip"].position
    error, refinement = np.abs(few - many[::5]).max(), np.abs(rough - many).max()
    require(error <= 2.0 * refinement + 1e-9, f"with fewer sample times the tip is {error:.3g} m elsewhere")


@FORM.clause("The same effort gives the same result when it is run again.")
def a_run_can_be_repeated(engine: Engine) -> None:
    first, second = _pendulum_run(engine), _pendulum_run(engine)
    before, after = channels_of(first), channels_of(second)
    for channel, values in before.items():
        same = channel in after and np.array_equal(values, after[channel])
        require(same, f"{channel} is another when the same effort is run again")


@FORM.clause("A model runs as often as it is asked, and no run changes another, nor the scene.")
def runs_do_not_disturb_each_other(engine: Engine) -> None:
    scene = pendulum()
    before = msgspec.json.encode(scene)
    model = offered(engine, scene)
    efforts = ladder(engine, scene, TIMES[-1])
    first = simulated(model, scene, TIMES, efforts[-1]).markers["tip"].position
    for effort in (efforts[0], efforts[-1]):
        last = simulated(model, scene, TIMES, effort).markers["tip"].position
    require(np.array_equal(first, last), "a run at another effort in between changes the result")
    require(msgspec.json.encode(scene) == before, "the scene is another after the runs")


@FORM.clause("`evaluate` and the first sample of `simulate` say the same of the initial state.")
def a_run_begins_at_the_initial_state(engine: Engine) -> None:
    scene = pendulum()
    start, run = snapshot(engine, scene), _pendulum_run(engine)
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
    found = snapshot(engine, pendulum())
    require(set(found.markers) == {"tip"}, f"it gives markers {sorted(found.markers)}: the scene has tip")
    require(set(found.loads) <= {"pivot"}, f"it gives loads of {sorted(found.loads)}: the scene has pivot")
    require(set(found.energy) <= set(ENERGIES), f"it gives energies {sorted(found.energy)}")
    require(not found.wheel_loads and not found.drives, "it gives wheels or drives, of which the scene has none")


@FORM.clause("A run that diverges is a status with its reason and the good samples, never an exception.")
def a_violent_run_has_a_status(engine: Engine) -> None:
    scene = pendulum(rate=1e6)
    times = np.linspace(0.0, 1e-3, 3)
    model = offered(engine, scene)
    run = simulated(model, scene, times, ladder(engine, scene, times[-1])[0])  # where it raises, that is told
    require(run.status == "finished" or bool(run.message.strip()), f"it {run.status} without saying why")


def _pendulum_run(engine: Engine) -> Trajectory:
    scene = pendulum()
    model = offered(engine, scene)
    model.warm_up()
    return simulated(model, scene, TIMES, ladder(engine, scene, TIMES[-1])[-1])


def _same_side(found: Real, like: Real) -> Real:
    """The quaternion or its negative, which is the same rotation, whichever is nearer."""
    return found if float(np.dot(found, like)) >= 0.0 else -found


def _exotic() -> Scene:
    """A flexible beam on a hinge, which many codes refuse."""
    from flexmb.scene.shapes import beam_section

    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    return (
        SceneBuilder("flexible pendulum", gravity=(0.0, 0.0, -9.81))
        .beam("rod", length=1.0, elements=4, section=section, modes=2)
        .revolute("pivot", "ground", "rod", axis=(0.0, 1.0, 0.0))
        .marker("tip", "rod", node="tip")
        .scene()
    )
