"""The entry point: derivatives of the outputs of a whole run by numbers of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.parameters.numbers import numbers
from flexmb.run.driver import Leg
from flexmb.run.samples import refuse_large_run, sample_times
from flexmb.run.simulate import RunSettings, refuse_unknown, run_with_course
from flexmb.run.trajectory import Trajectory
from flexmb.scene.check import check_and_warn
from flexmb.scene.problems import closest
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_bytes
from flexmb.sensitivity.channels import Chosen, chosen, refuse_unknown_outputs
from flexmb.sensitivity.following import Following
from flexmb.sensitivity.gate import Admitted, admitted
from flexmb.tables import arguments
from flexmb.tables.brief import brief
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

METHODS: tuple[Method, ...] = ("dop853", "rk4")


@dataclass(frozen=True)
class EventSensitivity:
    """An event that happened at t (s), and the derivatives (P,) of its time by the parameters."""

    name: str
    t: float
    derivatives: Real

    __repr__ = brief


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of a run, by `sensitivities`.

    t (T,) s; outputs (K,) and units (K,) with their values (T,K); parameters (P,) with theirs, parameter_values (P,);
    derivatives (T,K,P) at fixed times, each in the unit of the output over that of the parameter, NaN for loads that
    redundant closures leave undetermined, whose values are NaN; events with the
    derivatives of their times; the trajectory of the run itself.
    """

    t: Real
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    values: Real
    parameters: tuple[str, ...]
    parameter_values: Real
    derivatives: Real
    events: tuple[EventSensitivity, ...]
    trajectory: Trajectory

    def __repr__(self) -> str:
        """Its size, for an interactive prompt."""
        size = f"{len(self.outputs)} outputs by {len(self.parameters)} parameters at {len(self.t)} times"
        return f"<Sensitivities of {self.trajectory.scene!r}: {size}>"

    def derivative(self, output: str, parameter: str) -> Real:
        """(T,) of one output by one parameter; ValueError for other names."""
        for what, name, names in (("output", output, self.outputs), ("parameter", parameter, self.parameters)):
            if name not in names:
                raise ValueError(f"there is no {what} {name!r} here: {closest(name, names)}")
        return self.derivatives[:, self.outputs.index(output), self.parameters.index(parameter)]


def sensitivities(
    scene: Scene,
    t_end: float,
    by: Sequence[str],
    of: Sequence[str],
    method: Method = "dop853",
    *,
    samples: int | Sequence[float] | Real = 201,
    **settings: Unpack[RunSettings],
) -> Sensitivities:
    """Derivatives of the outputs `of` a run from t = 0 to `t_end` (s) by numbers of its scene.

    by: paths of real numbers as `Scene.with_values` takes them: of bodies, hinges, springs, loads, functions of time,
    controllers, levels of events, initial values. of: names of channels as in `Trajectory.columns`. method: "dop853",
    which controls the error of the derivatives as that of the motion, or "rk4". samples and settings: see `simulate`.

    The variational equations are integrated beside the motion, exact to the tolerance, through latches, impacts,
    releases and changes of values, closures, and sampled and continuous controllers. Raises what `simulate` raises;
    PathError or ParameterError (ValueErrors) for a number that is none, by which there is no derivative, or on which
    nothing in the run depends;
    DynamicsError for a run that fails, or that has no derivative beyond an event, with the time and the event;
    NotImplementedError for what derivatives do not pass yet.
    """
    refuse_unknown("sensitivities", settings)
    if method not in METHODS:
        names = " or ".join(f'"{name}"' for name in METHODS)
        raise ValueError(f'method "{method}" does not integrate derivatives: use {names}')
    t_end = arguments.number("t_end", t_end)
    check_and_warn(scene, t_end, 0.0)
    given, times = Settings(method, **settings).checked(abs(t_end)), sample_times(samples, t_end, 0.0)
    count = len(numbers(scene, by))
    size = 8.0 * len(times) * len(of) * count
    refuse_bytes(size, f"{len(of)} outputs by {count} numbers at {len(times)} times take", "ask for fewer")
    refuse_large_run(scene, len(times), given, "articulated")
    gated = admitted(scene, by)
    refuse_unknown_outputs(gated.system, of)
    trajectory, course = run_with_course(gated.system, times, given)
    if not trajectory.finished:
        raise DynamicsError(f"there are no derivatives of a run that does not finish: {trajectory.message}")
    return of_run(gated, given, trajectory, course, chosen(trajectory, of))


def of_run(
    gated: Admitted, settings: Settings, trajectory: Trajectory, course: Sequence[Leg], outputs: Chosen
) -> Sensitivities:
    """The derivatives of a run that has finished; course: its parts between events; outputs: of its channels."""
    derivatives, events = Following(gated, settings, trajectory, outputs)(course)
    return Sensitivities(
        trajectory.t, outputs.names, outputs.units, outputs.values, tuple(number.name for number in gated.numbers),
        np.array([number.value for number in gated.numbers]), derivatives,
        tuple(EventSensitivity(*event) for event in events), trajectory,
    )  # fmt: skip
