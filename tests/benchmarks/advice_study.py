"""Is the advice honest and is it cheap? On every case of the library, over its whole horizon.

    python -m tests.benchmarks.advice_study [--only WORD] [--tolerance 1e-2 ...]

Honest: the advised scene is run again with five times as many output times and held against a reference that the advice
did not use: for scenes with beams twice as many welded pieces with one eigenmode more, for rigid scenes the tightest
integration. Cheap: every rung of the body's ladder that fits, with its cheapest method, is sought exhaustively; with
several bodies every rung for all of them alike, and every change of one or of two bodies of the advised model. The
table goes to docs/advice.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from time import perf_counter

import numpy as np

from crosscheck.library import shipped_cases
from flexmb.advisor.advice import Advice, advise, prepare
from flexmb.advisor.confirm import Confirmation
from flexmb.advisor.ladder import Step
from flexmb.advisor.methods import FINEST, Method, simulated
from flexmb.advisor.models import Model, Rung, built, flexible_bodies, levels
from flexmb.advisor.quantity import error, measured, scales
from flexmb.scene.bodies import BeamBody
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Scene
from flexmb.system import compile

TOLERANCES = (1e-2, 1e-3)
PAGE = Path(__file__).parents[2] / "docs" / "advice.md"
START, END = "<!-- study -->\n", "<!-- /study -->"
FINER = 5
DEARER = 30.0  # fine runs that cost so many times the advised model's are not tried with other methods


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
            yield from ("refused: " + a.refusal.replace("|", "/"), *[""] * 7, f"{self.seconds:.0f}")
            return
        models = "; ".join(f"{each.body}: {each.rung}" for each in a.bodies) or "rigid as it is"
        yield from (models, str(a.method), f"{a.predicted:.1e}", f"{a.measured:.1e}", f"{self.true_error:.1e}")
        yield from (f"{a.predicted_operations:.1e}", f"{a.operations:.1e}")
        yield from (f"{a.operations / self.cheapest:.2f} of {self.tried}", f"{self.seconds:.0f}")


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
    fine = simulated(compile(built(scene, finer(scene))), times, Method("dop853", max(FINEST, 1e-6 * advice.tolerance)))
    assert fine.finished, fine.message
    reference = measured(advice.quantities, fine)
    run = measured(advice.quantities, simulated(compile(advice.scene), times, advice.method))
    return error(run, reference, scales(advice.quantities, reference))


def finer(scene: Scene) -> Model:
    """Beams in eight pieces, four where there are several; those that start bent with twelve modes more."""
    bent = {state.body for state in scene.modal_states}
    bodies = flexible_bodies(scene)
    found = []
    for body in bodies:
        level = levels(body)[-1]
        if isinstance(body, BeamBody) and body.name not in bent:
            found.append((body.name, Rung("pieces", 0, level, pieces=8 if len(bodies) == 1 else 4)))
        elif isinstance(body, BeamBody):
            found.append((body.name, Rung("modes", body.modes.count + 12, level, body.modes.static)))
    return tuple(found)


def exhaustive(scene: Scene, advice: Advice) -> tuple[float, int]:
    """Operations of the cheapest adequate model and method, and how many models were run."""
    asked = prepare(scene, advice.tolerance, advice.quantities, advice.t_end)
    confirmation = asked.confirmation()
    chosen = tuple((each.body, each.rung) for each in advice.bodies)
    limit = DEARER * confirmation.run_cost(chosen)
    least, tried = np.inf, 0
    for model in choices(asked.ladders, chosen):
        tried += 1
        if confirmation.adequate(model) and confirmation.run_cost(model) <= limit:
            least = min(least, best(confirmation, model))
    return least, tried


def best(confirmation: Confirmation, model: Model) -> float:
    """Operations of the model by its cheapest method."""
    return confirmation.bench.run(model, confirmation.cheapest_method(model)).operations


def choices(ladders: dict[str, tuple[Step, ...]], chosen: Model) -> Iterator[Model]:
    """Every model of one body; of several, the same rung for all, and every change of one body or of two."""
    if len(ladders) < 2:
        yield from (tuple((name, step.rung) for name in ladders) for step in next(iter(ladders.values()), ()))
        return
    seen = {chosen}
    alike = set.intersection(*({step.rung for step in steps} for steps in ladders.values()))
    for rung in sorted(alike, key=str):
        seen.add(tuple((name, rung) for name in ladders))
    for names in (*combinations(ladders, 1), *combinations(ladders, 2)):
        for steps in product(*(ladders[name] for name in names)):
            change = {name: step.rung for name, step in zip(names, steps, strict=True)}
            seen.add(tuple((name, change.get(name, rung)) for name, rung in chosen))
    yield from sorted(seen, key=str)


if __name__ == "__main__":
    main()
