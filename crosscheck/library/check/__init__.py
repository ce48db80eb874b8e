"""The rules of a run file and of accepted figures.

Every problem is reported with its place and the remedy, and all problems are reported at once.
"""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.library.accepted import Accepted
from crosscheck.library.case import CaseError, Provenance, RunFile
from crosscheck.library.check.judged import (
    check_chart,
    check_comparison,
    check_conservation,
    check_control,
    check_figures,
    check_open,
)
from crosscheck.library.check.ranges import (
    ROOT,
    check_duration,
    check_samples,
    check_unique,
    check_within,
    item_place,
    problem,
)
from crosscheck.library.check.references import check_anchors, check_reference
from crosscheck.library.check.variants import check_sides_run, check_variant
from flexmb.scene.problems import Defect

TIME_LIMITS_S = (1e-3, 1e7)
MOST_FINER = 8  # each effort about doubles the time


def check_run_file(run: RunFile) -> None:
    """Refuse what cannot be run or judged; CaseError lists every problem with its place and the remedy."""
    _refuse(_run(run))


def check_accepted(accepted: Accepted, run: RunFile) -> None:
    """Refuse accepted figures that are invalid or belong to no comparison of the run file."""
    _refuse(check_figures(accepted, run))


def check_provenance(provenance: Provenance) -> None:
    """Refuse published numbers that cannot be compared."""
    _refuse(check_anchors(provenance))


def check_recorded(run: RunFile) -> None:
    """Refuse a run file from records, with every comparison a pair, that names a variant or engine it does not have.

    Its numbers are not checked: judging handles all of them, and archives may be older than some rules.
    """
    _refuse(_recorded(run))


def _refuse(problems: Iterator[Defect]) -> None:
    lines = [str(problem) for problem in problems]
    if lines:
        raise CaseError("\n".join(lines))


def _run(run: RunFile) -> Iterator[Defect]:
    if not run.title.strip():
        yield problem(ROOT.key("title"), "it is empty", "say what the case is")
    if not run.variants:
        yield problem(ROOT.key("variant"), "there is none", "add at least one variant with its engines")
    yield from check_duration(run.duration_s, ROOT)
    yield from check_samples(run.samples, ROOT)
    if run.time_limit_s is not None:
        yield from check_within(run.time_limit_s, TIME_LIMITS_S, ROOT.key("time_limit_s"))
    yield from check_unique([variant.name for variant in run.variants], ROOT.key("variant"), "variants")
    if not 0 <= run.finer <= MOST_FINER:
        yield problem(ROOT.key("finer"), f"{run.finer} makes no sense", f"give 0 to {MOST_FINER} efforts more")
    names = [item.name for item in run.comparisons]
    yield from check_unique(names, ROOT.key("comparison"), "comparisons")
    yield from check_unique([item.name for item in run.controls], ROOT.key("control"), "controls")
    for i, variant in enumerate(run.variants):
        yield from check_variant(run, variant, item_place("variant", i, variant.name))
    for i, comparison in enumerate(run.comparisons):
        yield from check_comparison(run, comparison, item_place("comparison", i, comparison.name))
    for i, control in enumerate(run.controls):
        yield from check_control(run, control, item_place("control", i, control.name))
    seen: set[tuple[str, str, str]] = set()
    for i, conservation in enumerate(run.conservations):
        yield from check_conservation(run, conservation, ROOT.key("conservation", i), seen)
    for i, item in enumerate(run.open):
        yield from check_open(run, item, ROOT.key("open", i))
    for i, chart in enumerate(run.charts):
        yield from check_chart(run, chart, ROOT.key("chart", i))
    if run.reference is not None:
        yield from check_reference(run, run.reference, ROOT.key("reference"))


def _recorded(run: RunFile) -> Iterator[Defect]:
    yield from check_unique([variant.name for variant in run.variants], ROOT.key("variant"), "variants")
    sides = {ROOT.key("comparison", i): (item.a, item.b) for i, item in enumerate(run.comparisons)}
    sides |= {ROOT.key("control", i): control.sides for i, control in enumerate(run.controls)}
    for place, pair in sides.items():
        for side in pair:
            if side is None:
                yield problem(place, "it does not name its two sides", "run the case again")
            else:
                yield from check_sides_run(run, side.variant, (side.engine,), place)
    for i, conservation in enumerate(run.conservations):
        yield from check_sides_run(run, conservation.variant, conservation.engines, ROOT.key("conservation", i))
    for i, chart in enumerate(run.charts):
        yield from check_chart(run, chart, ROOT.key("chart", i))
