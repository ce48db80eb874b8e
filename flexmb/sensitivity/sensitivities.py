"""The entry point: derivatives of the outputs of a whole run by numbers of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Unpack

import numpy as np

from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.parameters.numbers import Number, numbers
from flexmb.run.driver import Leg
from flexmb.run.samples import sample_times
from flexmb.run.simulate import RunSettings, refuse_unknown, run_with_course
from flexmb.run.trajectory import Trajectory
from flexmb.scene.check import check_and_warn
from flexmb.scene.problems import closest
from flexmb.scene.schema import Scene
from flexmb.sensitivity.channels import chosen, refuse_unknown_outputs
from flexmb.sensitivity.following import Following
from flexmb.sensitivity.refusals import refuse_measured_loads, refuse_moving_instants
from flexmb.system.compile import assembled
from flexmb.tables import arguments
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

METHODS: tuple[Method, ...] = ("dop853", "rk4")


@dataclass(frozen=True)
class EventSensitivity:
    """An event that happened at t (s), and the derivatives (P,) of its time by the parameters."""

    name: str
    t: float
    derivatives: Real


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of a run, by `sensitivities`.

    t (T,) s; outputs (K,) and units (K,) with their values (T,K); parameters (P,) with theirs, parameter_values (P,);
    derivatives (T,K,P) at fixed times, each in the unit of the output over that of the parameter; events with the
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
    PathError or ParameterError (ValueErrors) for a number that is none or by which there is no derivative;
    DynamicsError for a run that fails, or that has no derivative beyond an event, with the time and the event;
    NotImplementedError for what derivatives do not pass yet.
    """
    refuse_unknown("sensitivities", settings)
    run = run_to_follow(scene, t_end, numbers(scene, by), method, samples, settings, of)
    if not run.trajectory.finished:
        raise DynamicsError(f"there are no derivatives of a run that does not finish: {run.trajectory.message}")
    return run.derivatives(of)


class RunToFollow(NamedTuple):
    """A run that may be followed with derivatives by numbers of its scene; course: its parts between events."""

    scene: Scene
    numbers: tuple[Number, ...]
    settings: Settings
    trajectory: Trajectory
    course: list[Leg]

    def derivatives(self, of: Sequence[str]) -> Sensitivities:
        """Derivatives of these outputs of the run, which has finished, by the numbers."""
        outputs = chosen(self.trajectory, of)
        following = Following(self.scene, self.numbers, self.settings, self.trajectory, outputs)
        derivatives, events = following(self.course)
        return Sensitivities(
            self.trajectory.t, outputs.names, outputs.units, outputs.values, tuple(each.name for each in self.numbers),
            np.array([each.value for each in self.numbers]), derivatives,
            tuple(EventSensitivity(*each) for each in events), self.trajectory,
        )  # fmt: skip


def run_to_follow(
    scene: Scene, t_end: float, found: tuple[Number, ...], method: Method, samples: int | Sequence[float] | Real,
    settings: RunSettings, of: Sequence[str] | None = None,
) -> RunToFollow:  # fmt: skip
    """The run of `sensitivities`, whether it finishes or not, after everything that these refuse before a run.

    of: the outputs, None where the caller looks for them in the run.
    """
    if method not in METHODS:
        names = " or ".join(f'"{name}"' for name in METHODS)
        raise ValueError(f'method "{method}" does not integrate derivatives: use {names}')
    t_end = arguments.number("t_end", t_end)
    check_and_warn(scene, t_end, 0.0)
    refuse_measured_loads(scene)
    refuse_moving_instants(scene, found)
    given = Settings(method, **settings).checked(abs(t_end))
    system, times = assembled(scene), sample_times(samples, t_end, 0.0)
    if of is not None:
        refuse_unknown_outputs(system, of)
    trajectory, course = run_with_course(system, times, given)
    return RunToFollow(scene, found, given, trajectory, course)
