"""Advice: the cheapest model and method that give a quantity of a scene to a tolerance, with the evidence."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import Any

import numpy as np

from flexmb.advisor.bench import SAMPLES, Bench
from flexmb.advisor.confirm import MOST, Confirmation, NoReference, Reference
from flexmb.advisor.indicators import Indicators, indicators, of_level, predicted
from flexmb.advisor.ladder import Cost, Step, cost, model_cost, references, rungs, softest, step
from flexmb.advisor.methods import RunMethod
from flexmb.advisor.modal_response import RigidRun, modal_response, rigid_run
from flexmb.advisor.models import EXACT, LEVELS, BodyModel, Model, built, flexible_bodies, levels, undamped
from flexmb.advisor.quantity import Quantity, measured, quantities, scales
from flexmb.advisor.search import search
from flexmb.closure.closures import ClosureError
from flexmb.integrate.settings import Settings
from flexmb.run.times import refuse_large_run
from flexmb.scene.bodies import BeamBody, Level, ModalBody
from flexmb.scene.check import check_and_warn
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.problems import SceneWarning
from flexmb.scene.schema import Scene
from flexmb.scene.sticking import refuse_sticking
from flexmb.system.compile import compile
from flexmb.system.held_stretch import unstretchable
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import DynamicsError

SAFE = 1.1  # a tolerance for which models suffice, over what they were seen to reach
AT_REST = 1e-9  # acceleration in SI units that is rounding


def remedies(
    scene: Scene, wanted: tuple[Quantity, ...], tolerance: float, budget: float, needs: float, reached: float
) -> tuple[str, ...]:
    """Sentences, those first that change the scene so that fewer modes are excited, or ring less long; one at least.

    `needs`: budget with which a finer model may run, infinite if there is none; `reached`: tolerance for which those
    that ran suffice, infinite if none does.
    """
    return tuple(_remedies(scene, wanted, tolerance, budget, needs, reached))


def _remedies(
    scene: Scene, wanted: tuple[Quantity, ...], tolerance: float, budget: float, needs: float, reached: float
) -> Iterator[str]:
    if _jumps_at_the_start(scene):
        yield (
            "start from equilibrium (`fm.equilibrium`), or let loads and drives grow smoothly: this scene is let go "
            "out of balance, which excites all modes at once"
        )
    pulses = [str(place) for place, _, value in values(ROOT, scene) if isinstance(value, Pulse)]
    if pulses:
        yield f"a smoother pulse, of two smooth steps, in place of that of {', '.join(pulses)}, which jumps"
    ringing = [body.name for body in flexible_bodies(scene) if undamped(body)]
    if ringing:
        yield f"damping of {', '.join(ringing)}, whose modes ring to the end: `damping_ratio` or `viscosity_s`"
    if np.isfinite(needs):
        yield f"a longer budget, of {_above(needs, 2):g} in place of {budget:g}, so that a finer model may run"
    loads = [str(quantity) for quantity in wanted if "load" in quantity.pattern or "drive" in quantity.pattern]
    of = f", or another quantity than {', '.join(loads)}, which high modes move more than a path" if loads else ""
    such = f", such as {larger:g}," if (larger := _above(SAFE * reached, 1)) < 1.0 else ""
    yield f"a larger tolerance than {tolerance:g}{such} or a shorter time{of}"


def _above(value: float, digits: int) -> float:
    """The least number of so many significant digits above a positive one."""
    if not np.isfinite(value):
        return value
    unit = 10.0 ** (np.floor(np.log10(value)) + 1 - digits)
    return float(np.ceil(value / unit) * unit)


def _jumps_at_the_start(scene: Scene) -> bool:
    """Whether the scene starts with accelerations, although at rest."""
    try:
        system = compile(scene)
        start = system.initial_state
        first = system.evaluate(start.t, start.q, start.u).accelerations
    except (ClosureError, DynamicsError, ValueError, NotImplementedError):
        return False
    return not np.any(start.u) and bool(np.any(np.abs(first) > AT_REST))


BUDGET = 4e10
"""The search for cheaper models ends when its runs have taken this many operations (about 20 s)."""
REFERENCE = 4e10
"""A reference whose predicted cost exceeds this number of operations is not run."""
MOST_BUDGET = 1e6
"""Largest factor of both."""
PARAGRAPH = 100
"""Columns of an advice in words."""
FAR = 0.2
"""Deflection over length, predicted by linear modes, beyond which references are of level exact."""
NEGLECTED = 0.1
"""Bodies get rungs of level exact if stiffened ones are predicted to neglect more than this part of the tolerance."""
_EXCITED = 1e-3
"""A family of modes that contributes less than this fraction of the tolerance counts as not excited."""


@dataclass(frozen=True)
class Trial:
    """A model that was run: predicted and measured error (U included), operations of its fine run, and the verdict."""

    model: Model
    predicted: float
    measured: float
    operations: float
    adequate: bool


@dataclass(frozen=True)
class BodyAdvice:
    """The rung of one body, its predicted error, and the reason: the indicators in words."""

    body: str
    rung: BodyModel
    predicted: float
    reason: str


@dataclass(frozen=True)
class Advice:
    """The advised model and method, with the evidence.

    If `accepted`, it has `bodies`, `method` and the reduced `scene`. Errors are fractions of the scale of `quantities`:
    the `predicted` one, and the one `measured` over the whole horizon with the chosen method, which includes the
    `uncertainty` of the reference. Operations of the run are `predicted_operations` and the counted `operations`; the
    `seconds` of integration are shown but not used. If not accepted, `refusal` says why no model is known to be
    adequate, and `remedies` what to change. `trials` lists all models that were run, `notes` are further remarks.
    """

    name: str
    t_end: float
    tolerance: float
    quantities: tuple[Quantity, ...]
    refusal: str = ""
    remedies: tuple[str, ...] = ()
    bodies: tuple[BodyAdvice, ...] = ()
    method: RunMethod | None = None
    scene: Scene | None = None
    predicted: float = np.nan
    measured: float = np.nan
    uncertainty: float = np.nan
    predicted_operations: float = np.nan
    operations: float = np.nan
    evaluations: int = 0
    seconds: float = np.nan
    reference: str = ""
    trials: tuple[Trial, ...] = ()
    notes: tuple[str, ...] = ()

    __repr__ = brief

    @property
    def accepted(self) -> bool:
        return not self.refusal

    def __str__(self) -> str:
        """A paragraph: the question, what is advised with its error and cost, or why nothing is and what to change."""
        asked = " and ".join(map(str, self.quantities))
        text = f"{self.name}: {asked} to {self.tolerance:g} of its scale, from 0 to {self.t_end:g} s. "
        if self.accepted:
            models = "; ".join(f"{body.body} as {body.rung}" for body in self.bodies) or "the scene as it is"
            text += (
                f"Take {models}, and integrate by {self.method}. The error of that run is {self.measured:.2g}, of "
                f"which {self.uncertainty:.2g} is the uncertainty of what it was measured against, {self.reference}; "
                f"{self.predicted:.2g} was predicted. It takes {self.operations:.2g} counted operations in "
                f"{self.evaluations} evaluations."
            )
        else:
            text += f"Refused: {self.refusal}. What helps: {'; '.join(self.remedies)}."
        if len(self.trials) > 1:
            good = sum(trial.adequate for trial in self.trials)
            text += f" {len(self.trials)} models were run, of which {good} are adequate."
        text += "".join(f" {note[0].upper()}{note[1:]}." for note in self.notes)
        return fill(text, PARAGRAPH, break_long_words=False, break_on_hyphens=False)


def advise(
    scene: Scene,
    tolerance: float,
    quantity: str | Quantity | Sequence[str | Quantity] | None = None,
    t_end: float = 10.0,
    budget: float = 1.0,
) -> Advice:
    """The cheapest model of every flexible body, and method, that give `quantity` to `tolerance` up to `t_end` (s).

    `quantity`: one or several as in `flexmb.advisor.quantity`, by default the positions of all markers; `tolerance`:
    largest error, relative to its scale; `budget`: its runs may take so many times the operations that they may by
    default (about 20 s for each reference and for the search). All runs go to the end of the horizon, and cost is
    measured in counted operations, so that the advice does not depend on the machine. Raises SceneError for an invalid
    scene, ValueError for a quantity that does not exist; if no model is adequate, `refusal` of the advice says why, and
    `remedies` what helps.
    """
    refuse_feedback(scene, "advise")
    refuse_sticking(scene, "models are not advised for instants that change with the model")
    budget = arguments.number("budget", budget)
    if not 0.0 < budget <= MOST_BUDGET:
        raise ValueError(f"the budget is {budget:g}: give a factor above 0, at most {MOST_BUDGET:g}")
    asked = prepare(scene, tolerance, quantity, t_end, budget)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # of candidates: those of the scene itself have been given
        return _advice(scene, asked)


def _advice(scene: Scene, asked: Prepared) -> Advice:
    tolerance, budget, t_end = asked.tolerance, asked.budget, asked.bench.t_end
    advice = Advice(scene.name, t_end, tolerance, asked.bench.wanted, notes=asked.notes)

    def refused(why: str, needs: float, reached: float, **more: Any) -> Advice:
        helpful = remedies(scene, asked.bench.wanted, tolerance, budget, needs / REFERENCE, reached)
        return replace(advice, refusal=why, remedies=helpful, **more)

    try:
        confirmation = asked.confirmation()
    except NoReference as problem:
        return refused(str(problem), problem.beyond, problem.reached / MOST)
    known, ladders, bench, notes = asked.known, asked.ladders, asked.bench, asked.notes
    found = search(ladders, confirmation, budget * BUDGET)
    if found is None and confirmation.refine():  # with a smaller uncertainty some may be adequate
        found = search(ladders, confirmation, budget * BUDGET)
    steps = {(name, step.rung): step for name, each in ladders.items() for step in each}
    trials = tuple(_trial(model, steps, confirmation) for model in confirmation.measured)
    if found is None:
        described = _described(confirmation.reference)
        best = min(trials, key=lambda trial: trial.measured)
        why = _none_adequate(best, len(trials), tolerance)
        return refused(why, confirmation.beyond, best.measured, trials=trials, reference=described)
    run = bench.run(found.model, found.method)
    if found.exhausted:
        notes += ("the search for cheaper models ended at its budget of operations",)
    return replace(
        advice,
        bodies=tuple(
            BodyAdvice(name, rung, steps[name, rung].error, known[name].reason() if name in known else "")
            for name, rung in found.model
        ),
        method=found.method,
        scene=built(scene, found.model),
        predicted=sum(steps[each].error for each in found.model),
        measured=confirmation.total_error(found.model, found.method),
        uncertainty=confirmation.reference.uncertainty,
        predicted_operations=model_cost(scene, found.model, asked.cost),
        operations=run.operations, evaluations=run.evaluations, seconds=run.seconds,
        reference=_described(confirmation.reference), trials=trials, notes=notes,
    )  # fmt: skip


@dataclass(frozen=True)
class Prepared:
    """A question and the predictions that are made before any candidate runs.

    `known`: the indicators of each body, empty if the rigid scene does not run; `cost` and `hidden` as for
    `Confirmation`; `ladders`: the steps of each body; `notes`: why there are no indicators, and what is held;
    `budget` as for `advise`.
    """

    bench: Bench
    tolerance: float
    known: dict[str, Indicators]
    cost: Cost
    hidden: float
    ladders: dict[str, tuple[Step, ...]]
    notes: tuple[str, ...]
    budget: float

    def confirmation(self) -> Confirmation:
        """Run the references; returns what measures candidates against them. Raises NoReference."""
        far = frozenset(name for name, predicted in self.known.items() if predicted.deflection > FAR)
        known = references(self.bench.scene, far if self.known else softest(self.bench.scene))
        return Confirmation(self.bench, self.tolerance, self.hidden, self.cost, self.budget * REFERENCE, known)


def prepare(
    scene: Scene, tolerance: float, quantity: str | Quantity | Sequence[str | Quantity] | None, t_end: float,
    budget: float = 1.0,
) -> Prepared:  # fmt: skip
    """Check the question, run the rigid scene, predict. Raises as `advise` does."""
    t_end, tolerance = arguments.number("t_end", t_end), arguments.number("tolerance", tolerance)
    check_and_warn(scene, t_end)
    refuse_large_run(scene, SAMPLES, Settings(), "articulated")
    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"the tolerance is {tolerance:g}: give a fraction, such as 1e-3")
    bench = Bench(scene, t_end, quantities(quantity, scene))
    base = rigid_run(scene, bench.times)
    known, slow = {}, 0
    if isinstance(base, RigidRun):
        known, slow = _indicators(base, scene, bench.wanted), base.run.statistics.evaluations
    return Prepared(
        bench, tolerance, known, cost(scene, t_end, slow), _hidden(scene, known),
        _ladders(scene, known, tolerance), (*((base,) if isinstance(base, str) else ()), *_held(scene)), budget,
    )  # fmt: skip


def _indicators(base: RigidRun, scene: Scene, wanted: tuple[Quantity, ...]) -> dict[str, Indicators]:
    """The indicators of every flexible body, by name. A quantity that is constant in the rigid run has the scale 1."""
    signals = measured(wanted, base.own())
    try:
        scale = scales(wanted, signals)
    except ValueError:
        scale = dict.fromkeys(signals, 1.0)
    return {
        body.name: indicators(base, scene, modal_response(base, scene, body), scale) for body in flexible_bodies(scene)
    }


def _hidden(scene: Scene, known: dict[str, Indicators]) -> float:
    """Predicted error of the finest models of bodies that cannot be refined: raw ones and beams that start bent."""
    bent = {state.body for state in scene.modal_states}
    return sum(
        of_level(_finest(body), known[body.name])
        for body in flexible_bodies(scene)
        if body.name in known and (body.name in bent or not isinstance(body, BeamBody))
    )


def _held(scene: Scene) -> Iterator[str]:
    """What no reference has, because the modes of the scene say so."""
    beams = ", ".join(f'"{body.name}"' for body in unstretchable(scene))
    if beams:
        yield (
            f'errors are those of beams that do not stretch, as the modes of {beams} hold it: give them "axial" where '
            "a length matters, as near the fold of a mechanism"
        )


def _finest(body: BeamBody | ModalBody) -> Level:
    """The level of a body in references that do not divide it."""
    if isinstance(body, BeamBody):
        return EXACT if body.level == EXACT else LEVELS[-1]
    return levels(body)[-1]


def _ladders(scene: Scene, known: dict[str, Indicators], tolerance: float) -> dict[str, tuple[Step, ...]]:
    """The steps of every flexible body, by name, for the rungs that are possible for it."""
    ladders = {}
    for body in flexible_bodies(scene):
        of = known.get(body.name)
        excited = of.families_above(_EXCITED * tolerance) if of else frozenset[str]()
        far = of is None or body.level == EXACT or of_level(LEVELS[-1], of) > NEGLECTED * tolerance
        every = rungs(scene, body, excited, far)
        steps = [step(scene, body.name, rung, predicted(rung, of) if of else 0.0) for rung in every]
        ladders[body.name] = tuple(step for step in steps if step is not None)
    return ladders


def _trial(model: Model, steps: dict[tuple[str, BodyModel], Step], confirmation: Confirmation) -> Trial:
    return Trial(
        model,
        sum(steps[name].error for name in model),
        confirmation.error(model),
        confirmation.run_cost(model),
        confirmation.adequate(model),
    )


def _none_adequate(best: Trial, number: int, tolerance: float) -> str:
    names = ", ".join(f"{name}: {rung}" for name, rung in best.model)
    return (
        f"no model of the ladder is within {tolerance:g}: the best of {number}, {names}, has the error "
        f"{best.measured:.2g}"
    )


def _described(reference: Reference) -> str:
    steps = "; ".join(reference.history)
    return reference.name + (f" ({steps})" if steps else "")
