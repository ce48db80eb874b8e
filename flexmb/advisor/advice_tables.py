"""Tables of advice for a terminal: the model, the reasons and the trials; or why no model is known to be adequate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from flexmb.advisor.advice import Advice, Trial
from flexmb.output.listing import Listing, figures, names, prose

_SHOWN = 20


def advice_tables(advice: Advice, trials: bool = True) -> RenderableType:
    """Tables and lines of one advice; `trials`: also every model that was run, cheapest first."""
    parts: list[RenderableType] = [_asked(advice)]
    if advice.accepted:
        parts += [_bodies(advice)] if advice.bodies else []
        parts += [_run(advice)]
    else:
        parts += [Text("refused: ", style="bold red") + Text(advice.refusal)]
        parts += [Text(f"what helps: {remedy}") for remedy in advice.remedies]
    if trials and len(advice.trials) > 1:
        parts.append(_trials(advice))
    parts += [Text(f"note: {note}", style="yellow") for note in advice.notes]
    return Group(*parts)


def _asked(advice: Advice) -> Text:
    wanted = ", ".join(str(quantity) for quantity in advice.quantities)
    return Text(f"{advice.name}: {wanted} to {advice.tolerance:g} of its scale, 0 to {advice.t_end:g} s")


def _bodies(advice: Advice) -> Listing:
    columns = (*names("body", "model"), *figures("its error, predicted"), *prose("because"))
    table = Listing(*columns, title="\nModel of each flexible body")
    for body in advice.bodies:
        table.add(body.body, str(body.rung), _number(body.predicted), body.reason)
    return table


def _run(advice: Advice) -> Listing:
    caption = f"Measured against: {advice.reference}" if advice.reference else ""
    table = Listing(*names(""), *figures("predicted", "measured"), title="\nThe whole run", caption=caption)
    table.add("error, relative to the scale", _number(advice.predicted), _number(advice.measured))
    table.add("of which uncertainty of the reference", "", _number(advice.uncertainty))
    table.add("operations", _number(advice.predicted_operations), _number(advice.operations))
    table.add("evaluations", "", str(advice.evaluations))
    table.add("seconds on this machine (not used)", "", f"{advice.seconds:.2g}")
    table.add("method", "", str(advice.method))
    return table


def _trials(advice: Advice) -> Listing:
    title = "\nModels that were run" + (f" (the {_SHOWN} cheapest)" if len(advice.trials) > _SHOWN else "")
    numbers = figures("predicted error", "measured error", "operations, finely integrated")
    table = Listing(*prose("model"), *numbers, *names(""), title=title)
    for trial in sorted(advice.trials, key=lambda row: row.operations)[:_SHOWN]:
        fits = Text("adequate", style="green") if trial.adequate else Text("no", style="red")
        table.add(
            ", ".join(_model(trial)), _number(trial.predicted), _number(trial.measured), _number(trial.operations), fits
        )
    return table


def _model(trial: Trial) -> Iterator[str]:
    several = len(trial.model) > 1
    for name, rung in trial.model:
        yield f"{name}: {rung}" if several else str(rung)


def _number(value: float) -> str:
    if np.isnan(value):
        return "-"
    return "does not run" if np.isinf(value) else f"{value:.2g}"
