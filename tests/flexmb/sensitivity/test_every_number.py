"""Every number of the schema through a run with events: its derivative is that of differences, or it is refused.

The test finds the numbers of the schema by itself, and that its scenes have all of them. Scenes have events that hold,
strike, release and change values, which are numbers too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.parameters.numbers import Number
from flexmb.parameters.parameters import ParameterError
from flexmb.scene.keys import kinds, number_keys
from flexmb.scene.schema import Scene
from flexmb.scene.values import PathError
from flexmb.sensitivity.gate import admitted_to, prepared
from tests import trees
from tests.flexmb.connectors import connected_scenes
from tests.flexmb.control import scenes as controlled
from tests.flexmb.parameters.test_closed import four_bar
from tests.flexmb.sensitivity.differences import outputs, rounding

T_END, TOGETHER, STEP, OTHER_STEPS = 0.12, 16, 1e-3, (1e-2, 1e-6)
TIGHT = {"rtol": 1e-11, "atol": 1e-12}
ROUGH = 3e-3  # of it: differences by small steps that are known to no more show nothing
CLOSE = 3e-6  # of the largest derivative of an output, beyond what halving the steps of the differences changes
IN_DIFFERENCES = 1.9
"""Of the runs' rounding over the step, in (4 d1 - d0) / 3, with half the step in d1."""
NOT_IN_SCENES = {
    "Pulse.start_s": "moves a jump, see test_refusals", "Pulse.duration_s": "likewise",
    "Pulse.value": "see test_refusals",
    "SpinUp.rate": "a function of time, see tests/flexmb/parameters", "SpinUp.duration_s": "likewise",
    "UserLaw.initial": "laws of users, see test_sensitivities", "UserLaw.parameters": "likewise",
    **{f"{law}.{key}": "as of a Pid" for law in ("GainTable", "Saturation", "StateSpace", "UserLaw")
       for key in ("period_s", "offset_s", "delay_s")},
    "SidBody.stiffness_factor": "as of the ModalBody that it becomes, see tests/flexmb/modal/test_stiffness_factor",
    "Dock.tolerance_m": "no number that a motion depends on: what is refused", "Dock.tolerance_rad": "likewise",
    "ModalBody.gradient_stiffness": "stiffness under loads, from other codes",
    "ModalBody.gravity_stiffness": "likewise", "ModalNode.force_stiffness": "likewise",
}  # fmt: skip
PLACES = 2
"""Numbers under one key of one kind of struct that are walked in a scene: the first ones that are not zero."""


def places(node: Any, path: tuple[str, ...] = (), of: str = "") -> Iterator[tuple[str, str]]:
    """(path, Struct.field) of every real number of a scene."""
    if isinstance(node, msgspec.Struct):
        for name in node.__struct_fields__:
            yield from places(getattr(node, name), (*path, name), f"{type(node).__name__}.{name}")
    elif isinstance(node, tuple):
        for i, each in enumerate(node):
            yield from places(each, (*path, str(i)), of)
    elif isinstance(node, float):
        yield ".".join(path), of


def with_changes(scene: Scene, *changes: fm.Change, **actions: Any) -> Scene:
    """The scene with changes of values, and with further events, at instants that nothing else needs."""
    events = [fm.schema.SceneEvent(name="changes", watch="time", level=0.3 * T_END, actions=changes)]
    for i, (name, action) in enumerate(actions.items()):
        level = (0.5 + 0.1 * i) * T_END
        events.append(fm.schema.SceneEvent(name=name, watch="time", level=level, actions=(action,)))
    return msgspec.structs.replace(scene, events=(*scene.events, *events))


@cache
def catalogue() -> dict[str, Scene]:
    """Scenes by name."""
    sine = fm.Sine(amplitude=2.0, angular_frequency_rad_s=9.0, phase_rad=0.3, offset=0.1)
    springs = connected_scenes.to_ground(connected_scenes.losses(connected_scenes.between_bodies(
        connected_scenes.bodies(grounded=True))))  # fmt: skip
    springs.linear_spring("buffers", "rail", stiffness=2.0, stiffening=(0.3,), lower=-0.4, upper=0.5,
                          stop_stiffness=90.0, stop_dissipation=0.1)  # fmt: skip
    springs.angular_spring("curve of moments", "elbow", table=(-0.5, 0.0, 0.5, 1.0), loads=(-1.0, 0.0, 0.8, 2.0))
    springs.linear_friction("stiction", "rail", sliding=0.2, static=0.3, stribeck=0.1, smoothing=0.02)
    connected = with_changes(
        springs.scene(), fm.Change(path="spring.stiffness_N_m", value=45.0),
        fm.Change(path="gravity_m_s2.2", value=-3.0), fm.Change(path="slider.mass_kg", value=1.1),
        held=fm.Latch(coordinate="elbow.rotation"), stiffer=fm.Change(path="ram.force_N", value=sine),
        struck=fm.Impact(coordinate="rail.translation", restitution=0.4),
        free=fm.Release(coordinate="elbow.rotation"),
    )  # fmt: skip
    driven = controlled.pendulum(
        fm.ProfileSensor(name="wanted", function=fm.SmoothStep(start_value=0.1, end_value=0.4, start_s=0.0,
                                                               duration_s=0.2)),
        fm.Pid(name="servo", inputs=("angle", "wanted[0]"), kp=3.0, ki=2.0, kd=0.2, filter_s=0.02, lower=-50.0,
               upper=50.0, tracking_s=0.3),
        fm.StateSpace(name="filter", inputs=("servo",), A=((-4.0,),), B=((1.0,),), C=((2.0,),), D=((0.3,),),
                      initial=(0.2,)),
        fm.GainTable(name="scheduled", inputs=("angle", "filter"), points=(-2.0, 0.11, 3.0), values=(0.5, 1.0, 2.0)),
        fm.Saturation(name="limited", inputs=("scheduled",), lower=-40.0, upper=40.0),
        torque=fm.ControlSignal(source="limited", gain=0.7),
    ).scene()  # fmt: skip
    driven = with_changes(
        driven, fm.Change(path="servo.kp", value=4.0), fm.Change(path="pivot.rotation.torque_Nm.gain", value=0.9),
        other=fm.Change(path="pivot.rotation.torque_Nm", value=fm.ControlSignal(source="filter", gain=0.4)),
    )  # fmt: skip
    sampled = controlled.pendulum(
        fm.Pid(name="servo", inputs=("angle",), kp=3.0, ki=2.0, kd=0.2, period_s=0.02, offset_s=0.01, delay_s=0.005),
        torque=fm.ControlSignal(source="servo"),
    ).scene()
    closed = four_bar()
    # Of two equal stiffnesses, a change makes the softer direction the first mode: outputs by its name would swap.
    closed = closed.with_values({
        f"coupler.stations.{i}.EIy_Nm2": 1.7 * each.EIy_Nm2
        for body in closed.bodies if body.name == "coupler" for i, each in enumerate(body.stations)
    })  # fmt: skip
    geared = fm.SceneBuilder("gear", gravity=(1.0, 0.0, 0.0))
    for each in ("a", "b"):
        geared.rigid_body(each, mass=1.0, com=(0.1, 0.2, 0.0), inertia=(1.0, 1.0, 2.0))
    geared.revolute("in", "ground", "a", torque=fm.Ramp(value=3.0, rate=2.0, start_s=0.1))
    geared.revolute("out", "ground", "b")
    geared.coupling("gear", "out", {"in": 1.5}, offset=0.1)
    return {
        "connectors and events": connected,
        "controllers": driven,
        "closures": with_changes(closed, fm.Change(path=f"bodies.{closed.bodies[0].name}.mass_kg", value=1.7)),
        "couplings": with_changes(geared.scene(), fm.Change(path="in.rotation.torque_Nm.value", value=5.0)),
        "sampled controllers": with_changes(sampled, fm.Change(path="servo.kp", value=4.0)),
        "controlled closures": controlled.driven_four_bar(period_s=0.05, delay_s=0.01),
        "hinges": with_changes(trees.random_scene(3, replace(trees.ARMED_RIGID, bodies=12)),
                               fm.Change(path="gravity_m_s2.0", value=1.0)),
        "bodies": trees.random_scene(1, replace(trees.FULL, bodies=4)),
        "blades": trees.random_scene(1, replace(trees.BLADES, bodies=3)),
        "stiffened bodies": trees.random_scene(2, replace(trees.STIFFENED, bodies=3)),
        "exact beams": trees.random_scene(2, replace(trees.EXACT, bodies=3)),
    }  # fmt: skip


def test_scenes_have_every_number_of_the_schema():
    known = {
        f"{kind.__name__}.{key.name}" for kind in kinds(Scene) for key in number_keys(kind).values() if not key.whole
    }
    found = {of for scene in catalogue().values() for _, of in places(scene)}
    assert len(known) > 100 and not known - found - set(NOT_IN_SCENES), sorted(known - found - set(NOT_IN_SCENES))
    assert not set(NOT_IN_SCENES) - known


def channels(scene: Scene) -> list[str]:
    """Coordinates, speeds, and the work, which gathers what happens on the way."""
    q, u = fm.compile(scene).state_names
    known = [name for name, _, _ in fm.simulate(scene, 1e-3, samples=2).columns()]
    return [name for name, _ in (*q, *u) if name in known][:12] + ["work"]


def differences(scene: Scene, path: str, of: list[str], step: float = STEP) -> tuple[np.ndarray, np.ndarray] | None:
    """At the end of the run, with what halving the steps changes; None where runs with other values are refused."""
    number = Number(scene, path)

    def last(change: float) -> np.ndarray:
        return outputs(fm.simulate(number.scene_at(number.value + change), T_END, samples=2, **TIGHT), of)[-1]

    h = step * number.scale
    try:
        one, two = ((last(each) - last(-each)) / (2.0 * each) for each in (h, 0.5 * h))
    except fm.SceneError:
        return None
    best = two + (two - one) / 3.0
    return best, np.abs(best - two)


def walked(scene: Scene, chosen: list[str]) -> Counter[str]:
    """How many of these numbers were compared, refused, or cannot have other values."""
    of, found, taken, wrong = channels(scene), Counter[str](), list[str](), list[Any]()
    system = prepared(scene)
    for path in chosen:
        try:
            admitted_to(system, [path])
            taken.append(path)
        except (ParameterError, PathError, NotImplementedError) as error:
            assert path in str(error) or isinstance(error, NotImplementedError), error
            if "nothing in the run depends on it" in str(error):
                other = differences(scene, path, of)
                if other is not None and np.any(other[0]):
                    wrong.append((path, str(error), *other))
            found["refused"] += 1
    for first in range(0, len(taken), TOGETHER):
        group = taken[first : first + TOGETHER]
        found.update(compared(scene, group, of, wrong))
    assert not wrong, wrong
    return found


def compared(scene: Scene, group: list[str], of: list[str], wrong: list[Any]) -> Counter[str]:
    """The same of numbers by which there are derivatives; those that are off are added to `wrong`.

    Differences by three sizes of steps must contradict a derivative: a viscosity of zero has no size of its own, and a
    millisecond is far for it. Runs whose numbers differ by little may take other
    steps, as before and behind a stop that is touched, and then differ by more than they round: of what changes the run
    by a millionth, small steps show nothing else.
    """
    run, found = fm.sensitivities(scene, T_END, group, of, samples=2, **TIGHT), Counter[str]()
    others = {path: other for path in group if (other := differences(scene, path, of)) is not None}
    found["without runs beside it"] = len(group) - len(others)
    scales = {path: Number(scene, path).scale for path in others}
    kept = run.derivatives[-1][:, [group.index(path) for path in others]]
    noise = rounding(scene, T_END, {path: 1e-4 * STEP * scale for path, scale in scales.items()}, of, kept, **TIGHT)
    for derivative, (path, other) in zip(kept.T, others.items(), strict=True):
        size = max(float(np.max(np.abs(other[0]))), 1e-9 / scales[path])
        doubt = _doubt(other[1], noise, STEP * scales[path])
        if not _agrees(derivative, other, CLOSE * size + doubt):
            tried = {step: differences(scene, path, of, step) for step in OTHER_STEPS}
            bounds = {
                step: CLOSE * size + _doubt(each[1], noise, step * scales[path]) for step, each in tried.items() if each
            }
            sharp = [step for step, bound in bounds.items() if step > STEP or np.max(bound) < ROUGH * size]
            if not any(_agrees(derivative, tried[step], bounds[step]) for step in sharp):
                wrong.append((path, derivative, *other, tried))
        found["compared" if np.max(doubt) < ROUGH * size else "compared roughly"] += 1
    return found


def _agrees(derivative: np.ndarray, other: tuple[np.ndarray, np.ndarray] | None, bound: np.ndarray) -> bool:
    return other is not None and bool(np.all(np.abs(derivative - other[0]) <= bound))


def _doubt(halving: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    """Of differences, by what halving their step changes, and by what runs round."""
    doubt: np.ndarray = 3.0 * halving + 4.0 * IN_DIFFERENCES * noise / step
    return doubt


pytestmark = pytest.mark.filterwarnings("ignore::flexmb.SceneWarning")  # of what random scenes are like


@pytest.mark.parametrize("name", ["controllers", "connectors and events", "controlled closures"])
def test_some_numbers_agree_with_differences(name):
    """Those of changes, of the initial state of a controller, and every fortieth."""
    scene = catalogue()[name]
    every = [path for path, _ in places(scene)]
    chosen = [path for path in every if path.startswith("events.") and "level" not in path][:3]
    chosen += [path for path in every if ".initial." in path][:1]
    found = walked(scene, [*chosen, *every[:: max(40, len(every) // 4)]])
    assert found["compared"] >= 3


def of_every_key(scene: Scene) -> list[str]:
    """The numbers that are walked."""
    taken, found = Counter[str](), list[str]()
    for path, of in sorted(places(scene), key=lambda each: Number(scene, each[0]).value == 0.0):
        taken[of] += 1
        if taken[of] <= PLACES:
            found.append(path)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", catalogue())
def test_all_numbers_agree_with_differences(name):
    scene = catalogue()[name]
    found = walked(scene, of_every_key(scene))
    print(name, dict(found))
    assert found["compared"] > 0.3 * found.total()
