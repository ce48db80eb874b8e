"""Rules of accepted figures: each is a valid number and belongs to something that the run file judges."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Set

from crosscheck.library.accepted import Accepted
from crosscheck.library.case import RunFile
from crosscheck.library.channels import part_of
from crosscheck.library.check.ranges import ROOT, problem
from flexmb.scene.problems import Defect

SIDE = re.compile(r"[^()]+ \((.+)\)")


def check_figures(accepted: Accepted, run: RunFile) -> Iterator[Defect]:
    names = [item.name for item in run.comparisons]
    names += [f"{item.quantity.replace('_', ' ')} conserved" for item in run.conservations]
    variants = {variant.name for variant in run.variants}
    stale = "take it out; `crosscheck run --accept` writes what is there now"
    for name, table in accepted.items():
        place = ROOT.key(name)
        if name not in names:
            yield problem(place, "the run file has no such comparison", stale)
        for where, figure in table.items():
            if what := _of_no_verdict(where, variants):
                yield problem(place.key(where), what, stale)
            if not (0.0 <= figure.E < math.inf and 0.0 <= figure.U < math.inf):
                yield problem(place.key(where), f"E = {figure.E:g}, U = {figure.U:g} are no figures", stale)


def _of_no_verdict(where: str, variants: Set[str]) -> str:
    """Why no verdict of the run file can have this key of an accepted figure; "" if one can."""
    channel, *sides = where.split(" | ")
    if len(sides) != 2:
        return "it is no channel with two sides"
    if part_of(channel) is None:
        return f'there is no kind of channel such as "{channel}"'
    for side in sides:
        match = SIDE.fullmatch(side)
        if match is None:
            return f'"{side}" is not an engine with a variant in brackets'
        if match[1] not in variants:
            return f'the run file has no variant "{match[1]}"'
    return ""
