"""Scenes in which the sampled controllers of another one are continuous: they hold, or rest as those do.

Between its instants a sampled controller holds its outputs w: it is a continuous one with the states w and w' = 0. So
the motion between instants has the linear model of a scene without instants, and w are among its states.

Where a sampled loop rests, x = A x + B u. So does the continuous controller x' = (A - 1) x + B u with the same outputs:
both loops rest at the same states, whatever periods and delays are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import assert_never

import msgspec
import numpy as np

from flexmb.control.laws import BEGUN, FILTERED, INTEGRAL
from flexmb.scene.check.control import depends_at_once, sensor_width
from flexmb.scene.control import Controller, GainTable, Pid, Saturation, StateSpace, UserLaw
from flexmb.scene.schema import Scene
from flexmb.typing import Real

SMALL = 1e-8  # integral, in units of an output, that Newton's method leaves where it is zero
_INTEGRAL, _REST = ", its integral", ", the rest"


def holding(scene: Scene, outputs: Mapping[str, Real], resting: Mapping[str, Real]) -> Scene:
    """The scene whose sampled controllers hold these outputs, by name, and without events. Continuous controllers begin
    at their states in `resting`, where they are there.

    A continuous `Pid` begins with an integral of zero. One that rests with another gets it from a controller of its own
    with one state that does not change, see `is_added`. NotImplementedError where it may be at a limit.
    """

    def held(controller: Controller) -> tuple[Controller, ...]:
        if controller.period_s is None:
            return _begun(controller, resting.get(controller.name))
        p = len(outputs[controller.name])
        still, unit = (tuple(map(tuple, of.tolist())) for of in (np.zeros((p, p)), np.eye(p)))
        values = tuple(outputs[controller.name].tolist())
        return (StateSpace(name=controller.name, inputs=(), A=still, C=unit, initial=values),)

    controllers = tuple(each for controller in scene.controllers for each in held(controller))
    return msgspec.structs.replace(scene, controllers=controllers, events=())


def is_added(state: str) -> bool:
    """Whether a state of controllers, by its name, is none of the scene itself but an integral of `holding`."""
    return state.endswith(f"{_INTEGRAL}.state[0]")


def own_name(state: str) -> str:
    """The name that a state of controllers has in the scene itself."""
    return state.replace(f"{_REST}.state[", ".state[")


def _begun(controller: Controller, states: Real | None) -> tuple[Controller, ...]:
    """A continuous controller that begins at these states, or its own."""
    if states is None:
        return (controller,)
    match controller:
        case StateSpace() | UserLaw():
            return (msgspec.structs.replace(controller, initial=tuple(states.tolist())),)
        case Pid():
            return _with_integral(controller, float(states[INTEGRAL]))
        case Saturation() | GainTable():
            return (controller,)
        case _:
            assert_never(controller)


def _with_integral(pid: Pid, integral: float) -> tuple[Controller, ...]:
    if abs(integral) <= SMALL:
        return (pid,)
    limits = [limit for limit in (pid.lower, pid.upper) if limit is not None]
    # Within limits the error of what rests is zero, so that the integral is the whole output; at a limit it is that.
    if any(abs(integral - limit) <= SMALL * (1.0 + abs(limit)) for limit in limits) or (limits and pid.tracking_s):
        raise NotImplementedError(
            f'controller "{pid.name}" is continuous, and may rest at a limit, with an integral of {integral:.3g}: '
            "leave its limits out, give it a period_s, or give linearize_sampled a state, about which it begins at zero"
        )
    constant, rest = f"{pid.name}{_INTEGRAL}", f"{pid.name}{_REST}"
    return (
        StateSpace(name=constant, inputs=(), A=((0.0,),), C=((1.0,),), initial=(integral,)),
        msgspec.structs.replace(pid, name=rest, lower=None, upper=None),
        StateSpace(name=pid.name, inputs=(constant, rest), D=((1.0, 1.0),)),
    )


def resting_alike(scene: Scene) -> Scene:
    """The scene whose controllers are continuous and rest where those of this scene do, and without events.

    Accelerations and loads, which depend at once on what controllers put out, reach those that were sampled through
    lags, which rest at what they follow. NotImplementedError for a sampled law of a user with states, whose next values
    are known only to it.
    """
    sampled = [controller for controller in scene.controllers if controller.period_s is not None]
    read = {reference.partition("[")[0] for controller in sampled for reference in controller.inputs}
    at_once = [sensor for sensor in scene.sensors if sensor.name in read and depends_at_once(sensor)]
    lags = tuple(_lag(sensor.name, sensor_width(scene, sensor) or 1) for sensor in at_once)
    controllers = (_continuous(each, {sensor.name for sensor in at_once}) for each in scene.controllers)
    return msgspec.structs.replace(scene, controllers=(*lags, *controllers), events=())


def _lag(sensor: str, width: int) -> StateSpace:
    unit = tuple(map(tuple, np.eye(width).tolist()))
    rates = tuple(map(tuple, (-np.eye(width)).tolist()))
    return StateSpace(name=_lagged(sensor), inputs=(sensor,), A=rates, B=unit, C=unit)


def _lagged(reference: str) -> str:
    """The reference to the lag of what is referred to."""
    name, bracket, number = reference.partition("[")
    return f"{name}, lagged{bracket}{number}"


def _continuous(controller: Controller, at_once: set[str]) -> Controller:
    if controller.period_s is None:
        return controller
    inputs = tuple(_lagged(each) if each.partition("[")[0] in at_once else each for each in controller.inputs)
    alike = msgspec.structs.replace(controller, inputs=inputs, period_s=None, offset_s=0.0, delay_s=0.0)
    match alike:
        case StateSpace(A=A):
            rates = tuple(tuple(row[:i]) + (row[i] - 1.0,) + tuple(row[i + 1 :]) for i, row in enumerate(A))
            return msgspec.structs.replace(alike, A=rates)
        case Pid(filter_s=filter_s):
            return alike if filter_s else msgspec.structs.replace(alike, kd=0.0)  # the error rests: no difference
        case Saturation() | GainTable():
            return alike
        case UserLaw():
            if alike.initial:
                raise NotImplementedError(
                    f'controller "{alike.name}" is a sampled law of a user with states: where it rests is not known. '
                    "Give linearize_sampled a state, about which the law has its initial states"
                )
            return alike
        case _:
            assert_never(alike)


def resting_states(controller: Controller, alike: Real) -> Real:
    """States of a controller that rests, from those of its continuous counterpart."""
    if not isinstance(controller, Pid) or controller.period_s is None:
        return alike
    states = np.ones(BEGUN + 1)
    states[: FILTERED + 1] = alike
    return states
