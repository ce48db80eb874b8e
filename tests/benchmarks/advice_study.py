"""Is the advice honest and is it cheap? On ten questions with truths from outside, and on every case of the library.

    python -m tests.benchmarks.advice_study [--only WORD] [--tolerance 1e-2 ...] [--no-search]

The ten are those of `tests.benchmarks.advice_questions`; the library is asked over its whole horizon.

Honest: the advised scene is run again with five times as many output times and held against a reference that the advice
did not use: for scenes with beams twice as many welded pieces with one eigenmode more, or with seven polynomials where
it used polynomials, for rigid scenes the tightest integration. Cheap: every rung of the body's ladder with every
method; with several bodies every rung for all of them alike, every change of one body of the advised model, and every
change of two to rungs of the simplest level with 0, 1, 2, 4, 8 modes, by the explicit methods. A run ends where it has
executed as many operations as the cheapest found so far: it cannot be cheaper any more. Predictions take no part in it.
The table goes to docs/advice.md.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise, product
from pathlib import Path
from time import perf_counter

import numpy as np

from crosscheck.library.find import shipped_cases
from flexmb.advisor.advice import Advice, advise, prepare
from flexmb.advisor.confirm import Confirmation
from flexmb.advisor.ladder import STAGES, Step, highest_frequency
from flexmb.advisor.methods import FINEST, RunMethod, ladders, simulated
from flexmb.advisor.models import EXACT, LEVELS, BodyModel, Model, built, flexible_bodies, levels
from flexmb.advisor.modes import all_strains
from flexmb.advisor.quantity import error, measured, scales
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.scene.bodies import BeamBody
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Scene
from flexmb.scene.strains import CURVATURES
from flexmb.system.compile import compile
from tests.benchmarks.advice_questions import Question, questions

TOLERANCES = (1e-2, 1e-3)
PAGE = Path(__file__).parents[2] / "docs" / "advice.md"
START, END = "<!-- study -->\n", "<!-- /study -->"
FINER = 5
DEARER = 4.0  # the next tighter method may take so many times the operations


@dataclass(frozen=True)
class Row:
    """A question and its answer, the error that it has, the cheapest adequate cost, and how many models were tried."""

    case: str
    advice: Advice
    true_error: float
    cheapest: float
    tried: int
    seconds: float

    @property
    def cells(self) -> Iterator[str]:
        a = self.advice
        yield from (self.case, f"{a.tolerance:g}")
        if not a.accepted:
            why = a.refusal.partition(": ")[2] or a.refusal  # without the tolerance, which the row has
            yield from (f"refused: {why}", *[""] * 7, f"{self.seconds:.0f}")
            return
        models = "; ".join(f"{body.body}: {body.rung}" for body in a.bodies) or "rigid as it is"
        yield from (models, str(a.method), f"{a.predicted:.1e}", f"{a.measured:.1e}", f"{self.true_error:.1e}")
        yield from (f"{a.predicted_operations:.1e}", f"{a.operations:.1e}")
        over = f"{a.operations / self.cheapest:.2f} of {self.tried}" if self.tried else "not searched"
        yield from (over, f"{self.seconds:.0f}")


HEAD = (
    "case", "tolerance", "model", "method", "error predicted", "measured", "true", "operations predicted", "counted",
    "over the cheapest", "s",
)  # fmt: skip


def main() -> None:
    """Write the table, a line as soon as it is known."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--only", default="")
    words.add_argument("--tolerance", type=float, nargs="+", default=TOLERANCES)
    words.add_argument("--no-search", action="store_true", help="leave the exhaustive search out")
    asked = words.parse_args()
    lines = [HEAD, tuple("-" for _ in HEAD)]
    for question in questions():
        if asked.only in question.name:
            lines.append(tuple(ask(question).cells))
            print("| " + " | ".join(lines[-1]) + " |", flush=True)
    for case in shipped_cases():
        if asked.only not in case.name:
            continue
        scene = load_scene(case.folder / "scene.toml")
        for tolerance in asked.tolerance:
            row = study(case.name, scene, case.run.duration_s, tolerance, not asked.no_search)
            lines.append(tuple(row.cells))
            print("| " + " | ".join(lines[-1]) + " |", flush=True)
    if not asked.only and not asked.no_search:
        table = "".join("| " + " | ".join(line) + " |\n" for line in lines)
        before, _, rest = PAGE.read_text().partition(START)
        PAGE.write_text(before + START + table + END + rest.partition(END)[2])


def ask(question: Question) -> Row:
    """Ask, and hold the answer against the truth, whose uncertainty is added."""
    begin = perf_counter()
    advice = advise(question.scene, question.tolerance, question.quantity, question.t_end)
    seconds = perf_counter() - begin
    if advice.scene is None or advice.method is None:
        return Row(question.name, advice, np.nan, np.nan, 0, seconds)
    times = np.linspace(0.0, question.t_end, FINER * 400 + 1)
    values, uncertain = question.truth(times)
    truth = {question.quantity: values}
    scale = scales(advice.quantities, truth)
    run = measured(advice.quantities, simulated(compile(advice.scene), times, advice.method))
    apart = error(run, truth, scale) + uncertain / scale[question.quantity]
    return Row(question.name, advice, apart, advice.operations, 0, seconds)


def study(name: str, scene: Scene, t_end: float, tolerance: float, search: bool) -> Row:
    """Ask, check, and look for something cheaper."""
    begin = perf_counter()
    advice = advise(scene, tolerance, None, t_end)
    seconds = perf_counter() - begin
    if not advice.accepted:
        return Row(name, advice, np.nan, np.nan, 0, seconds)
    cheapest, tried = exhaustive(scene, advice) if search else (advice.operations, 0)
    return Row(name, advice, true_error(scene, advice), min(cheapest, advice.operations), tried, seconds)


def true_error(scene: Scene, advice: Advice) -> float:
    """Error of the advised run against a finer model than any that the advice saw, at more output times."""
    times = np.linspace(0.0, advice.t_end, FINER * 400 + 1)
    assert advice.scene is not None and advice.method is not None
    model = finer(scene, advice)
    stiff = any(rung.kind == "pieces" and rung.pieces > 8 for _, rung in model)
    if any(rung.kind == "strains" for _, rung in model):
        stiff = INTEGRATORS[advice.method.integrator].linearises  # otherwise waves of shear set the steps of any method
    tight = RunMethod("radau5" if stiff else "dop853", max(FINEST, 1e-4 * advice.tolerance))
    fine = simulated(compile(built(scene, model)), times, tight)
    assert fine.finished, fine.message
    reference = measured(advice.quantities, fine)
    run = measured(advice.quantities, simulated(compile(advice.scene), times, advice.method))
    return error(run, reference, scales(advice.quantities, reference))


def finer(scene: Scene, advice: Advice) -> Model:
    """Beams in eight pieces, four where there are several, or twice as many as the advice saw; those that start bent
    with twelve modes more."""
    bent = {state.body for state in scene.modal_states}
    bodies = flexible_bodies(scene)
    exact = "polynomials" in advice.reference
    seen = re.findall(r"(\d+) pieces of", advice.reference)
    of_exact = 2 * int(seen[-1]) if seen else 2
    pieces = max(8 if len(bodies) == 1 else 4, *(2 * int(n) for n in re.findall(r"(\d+) pieces", advice.reference)), 0)
    found = []
    for body in bodies:
        level = LEVELS[-1] if isinstance(body, BeamBody) else levels(body)[-1]
        if isinstance(body, BeamBody) and body.name not in bent and exact:
            stretching = not set(all_strains(body)) <= set(CURVATURES)
            rung = BodyModel("strains", level=EXACT, pieces=of_exact, polynomials=7, stretching=stretching)
            found.append((body.name, rung))
        elif isinstance(body, BeamBody) and body.name not in bent:
            found.append((body.name, BodyModel("pieces", 0, level, pieces=pieces)))
        elif isinstance(body, BeamBody):
            found.append((body.name, BodyModel("modes", body.modes.count + 12, level, body.modes.static)))
    return tuple(found)


def exhaustive(scene: Scene, advice: Advice) -> tuple[float, int]:
    """Operations of the cheapest run within the tolerance, and how many models were tried."""
    asked = prepare(scene, advice.tolerance, advice.quantities, advice.t_end)
    confirmation = asked.confirmation()
    chosen = tuple((body.body, body.rung) for body in advice.bodies)
    least, tried = advice.operations, 0
    for model in choices(asked.ladders, chosen):
        least, tried = cheapest_run(confirmation, model, least), tried + 1
    return least, tried


def cheapest_run(confirmation: Confirmation, model: Model, least: float) -> float:
    """The least operations of a run of the model within the tolerance, by a method whose next tighter one holds it too;
    `least` if there is none with fewer."""
    bench = confirmation.bench
    if isinstance(bench.system(model), str):
        return least
    highest, slow = highest_frequency(bench.scene, model), confirmation.cost.slow / (STAGES * bench.t_end)
    linearising = len(model) < 2 and not bench.scene.closures
    for ladder in ladders(highest, slow, bench.algorithm(model), linearising, float(bench.times[1])):
        for method, tighter in pairwise(ladder):
            if fits(confirmation, model, method, least) and fits(confirmation, model, tighter, DEARER * least):
                least = bench.run(model, method).operations
                break
            done = bench.run(model, method, least)
            if (done.cut or done.finished) and done.tighter >= least:
                break
    return least


def fits(confirmation: Confirmation, model: Model, method: RunMethod, most: float) -> bool:
    """Whether a run takes less than `most` operations and is within the tolerance."""
    done = confirmation.bench.run(model, method, most)
    cheap = done.finished and done.operations < most
    return cheap and confirmation.total_error(model, method) <= confirmation.tolerance


def choices(steps_of: dict[str, tuple[Step, ...]], chosen: Model) -> Iterator[Model]:
    """Every model of one body; of several, the same rung for all, and changes of one body, and of two to plain ones."""
    if len(steps_of) < 2:
        yield from (tuple((name, step.rung) for name in steps_of) for step in next(iter(steps_of.values()), ()))
        if not steps_of:
            yield ()
        return
    rungs = {name: [step.rung for step in steps] for name, steps in steps_of.items()}
    simple = {name: list(filter(plain, rung)) for name, rung in rungs.items()}
    alike = set.intersection(*map(set, rungs.values()))
    seen = dict.fromkeys(tuple((name, rung) for name in steps_of) for rung in sorted(alike, key=str))
    for number, allowed in ((1, rungs), (2, simple)):
        for names in combinations(steps_of, number):
            for some in product(*(allowed[name] for name in names)):
                change = dict(zip(names, some, strict=True))
                seen[tuple((name, change.get(name, rung)) for name, rung in chosen)] = None
    yield from seen


def plain(rung: BodyModel) -> bool:
    """At the simplest level, with 0, 1, 2, 4, 8 modes."""
    return rung.level in ("rigid", LEVELS[0]) and rung.modes & (rung.modes - 1) == 0


if __name__ == "__main__":
    main()
