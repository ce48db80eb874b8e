"""Rules of accepted figures: each is a valid number and belongs to something that the run file judges."""

from __future__ import annotations

import math
from collections.abc import Iterator

from crosscheck.library.accepted import Accepted
from crosscheck.library.case import RunFile
from crosscheck.library.check.ranges import ROOT, problem
from flexmb.scene.problems import Defect


def check_figures(accepted: Accepted, run: RunFile) -> Iterator[Defect]:
    names = [item.name for item in run.comparisons]
    names += [f"{item.quantity.replace('_', ' ')} conserved" for item in run.conservations]
    stale = "take it out; `crosscheck run --accept` writes what is there now"
    for name, table in accepted.items():
        place = ROOT.key(name)
        if name not in names:
            yield problem(place, "the run file has no such comparison", stale)
        for where, figure in table.items():
            if where.count(" | ") != 2:
                yield problem(place.key(where), "it is no channel with two sides", stale)
            if not (0.0 <= figure.E < math.inf and 0.0 <= figure.U < math.inf):
                yield problem(place.key(where), f"E = {figure.E:g}, U = {figure.U:g} are no figures", stale)
