"""The entry point: derivatives of the outputs of a whole run by numbers of its scene.

The finished run is followed again with the derivatives of its state: from part to part, and across the events between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.parameters.numbers import numbers
from flexmb.run.driver import Leg
from flexmb.run.simulate import RunSettings, refuse_unknown, run_with_course
from flexmb.run.times import refuse_large_run, sample_times
from flexmb.run.trajectory import Trajectory
from flexmb.scene.check import check_and_warn
from flexmb.scene.problems import closest
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_bytes
from flexmb.sensitivity.channels import Chosen, Seen, channels, chosen, refuse_unknown_outputs
from flexmb.sensitivity.gate import Admitted, admitted
from flexmb.sensitivity.leg import Variation
from flexmb.sensitivity.parts import FollowedPart, Passage
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

# Derivatives are integrated as changes by this part of each number. The error of a step is held below rtol times them
# plus atol, so that what changes by less than atol if a number changes by 3 % does not shorten steps.
SHARE = 0.03
TOGETHER = 256  # samples whose observables are kept until channels are taken from all of them

EventTimes = list[tuple[str, float, Real]]
"""Name, time (s), derivatives (P,) of the time of each event."""


class Following:
    """One run, followed with scaled derivatives: each is per SHARE of the `scale` of its number."""

    def __init__(self, admitted: Admitted, settings: Settings, trajectory: Trajectory, outputs: Chosen) -> None:
        self._scales = np.array([SHARE * number.scale for number in admitted.numbers])
        self._settings, self._trajectory, self._outputs = settings, trajectory, outputs
        length = float(trajectory.t[-1] - trajectory.t[0])
        self._passage = Passage(admitted, admitted.numbers, self._scales, settings, length)
        self._derivatives = np.full((*outputs.values.shape, len(self._scales)), np.nan)
        self._events: EventTimes = []

    def __call__(self, course: Sequence[Leg]) -> tuple[Real, EventTimes]:
        """Derivatives (T,K,P) of the outputs, and those of the times of events."""
        t = self._trajectory.t
        for part in self._passage.followed(course, lambda leg, is_last: t[self._times(leg, is_last)]):
            self._see(part)
            after = self._passage.ended(part.variation, part.before)
            self._events += [(crossing.event.name, part.leg.raw.t, crossing.dt) for crossing in after.crossings]
        self._derivatives[np.isnan(self._outputs.values)] = np.nan  # of loads that closures leave undetermined
        return self._derivatives / self._scales, [(name, t, dt / self._scales) for name, t, dt in self._events]

    def _times(self, leg: Leg, is_last: bool) -> slice:
        """The numbers of the output times of a part of the run."""
        t, start, stop = self._trajectory.t, leg.begin.state.t, leg.raw.t
        first = int(np.searchsorted(t, start, side="left"))
        if is_last and start == stop:
            return slice(len(t) - 1, len(t))
        last = int(np.searchsorted(t, stop, side="right" if is_last else "left"))
        return slice(first, last)

    def _see(self, part: FollowedPart) -> None:
        """Derivatives of the outputs at the output times of a part of the run."""
        variation, times, states = part.variation, part.times, part.states
        known = channels(variation.blocks.system, {} if part.feedback is None else part.feedback.names)
        wanted = self._times(part.leg, part.is_last)
        places = np.searchsorted(times, self._trajectory.t[wanted])
        for first in range(0, len(places), TOGETHER):
            own = slice(first, first + TOGETHER)
            seen = self._seen(variation, times[places[own]], states[places[own]])
            samples = slice(wanted.start + first, min(wanted.start + first + TOGETHER, wanted.stop))
            for k, name in enumerate(self._outputs.names):
                if name in known:
                    self._derivatives[samples, k] = known[name](seen)
                elif ".drive[" in name:  # of a coordinate that is free here
                    self._derivatives[samples, k] = 0.0

    def _seen(self, variation: Variation, times: Real, states: Real) -> Seen:
        """What is known at times (T,), in states (T,.) that are joined with their derivatives."""
        loops, signals = variation.loops, list[Real]()
        observed = variation.observed(times, states) if self._outputs.observed and len(times) else None
        if loops is not None and any(name.startswith("signal.") for name in self._outputs.names):
            if observed is not None:
                loops.replay()  # once more from the first of these times
            for t, z in zip(times.tolist(), states, strict=True):
                variation.take(variation.parted(z))
                signals.append(loops.look(t)[1])
        return Seen(variation.parted(states).Y, observed, np.array(signals) if signals else None)


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
