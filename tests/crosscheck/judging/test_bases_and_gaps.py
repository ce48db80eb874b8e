"""What a conserved quantity stands on, and who is named where a channel or an effort is missing."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from crosscheck.judging.results import collect
from crosscheck.library.accepted import Figure, dumps
from crosscheck.records.kinds import CaseRecord
from tests.crosscheck.made_records import ONE_PAIR, TIMES, TIP, judged, ladder, run_file, single, way


def test_a_figure_is_written_with_its_basis_if_it_has_one() -> None:
    written = dumps({"both": {"with": Figure(1e-9, 1e-8, "ab.c"), "without": Figure(1e-9)}}).splitlines()[3:]
    assert written == ['"with" = { E = 1.0e-09, U = 1.0e-08, of = "ab.c" }', '"without" = { E = 1.0e-09 }']


def test_a_drift_stands_on_its_run_and_scale() -> None:
    """The basis of a conserved quantity names the rule, the scene and scale, the efforts and the version."""
    text = 'engines = ["one"]\nname = "rigid"\n[[conservation]]\nvariant = "rigid"\nquantity = "linear_momentum"\n'
    signals = {"momentum.linear": np.ones((len(TIMES), 3))}

    def stands_on(scale: str, spread: float = 1e-6, scenes: str = "s1", steps: float = 1.0) -> list[str]:
        runs = [
            msgspec.structs.replace(run, effort_value=run.effort_value * steps)
            for run in ladder("one", signals, spread=spread)
        ]
        found = single(judged(f"[[variant]]\n{text}limit = 1e-3\n{scale}", runs, basis=scenes)).basis
        return found.split(".")

    first = stands_on("scale = 1.0")
    assert len(first) == 4 and "-" not in first
    assert stands_on("scale = 1.0", spread=1e-7) == first  # figures change, what they stand on does not
    for place, other in ((1, stands_on("scale = 2.0")), (1, stands_on("scale = 1.0", scenes="s2")),
                         (2, stands_on("scale = 1.0", steps=2.0))):  # fmt: skip
        assert [then != now for then, now in zip(first, other, strict=True)] == [part == place for part in range(4)]


@pytest.mark.parametrize(
    ("one", "two", "reason"),
    [
        ("energy.kinetic", "energy.gravity", 'one and two share no channel "energy"'),
        ("energy.kinetic", TIP, 'two has no channel "energy"'),
        (TIP, "energy.kinetic", 'one has no channel "energy"'),
        (TIP, TIP, 'neither one nor two has a channel "energy"'),
    ],
)
def test_who_lacks_a_channel_is_named(one: str, two: str, reason: str) -> None:
    """Kinds of energy that only one engine offers are left out; if none is left, the goal was never judged."""
    text = ONE_PAIR.replace('"marker:tip.position"', "energy")
    found = judged(text, [*ladder("one", {one: way()[:, :1]}), *ladder("two", {two: way()[:, :1]})])
    assert [(each.channel, each.status, each.reason) for each in found.all] == [("energy", "did not run", reason)]


def test_a_record_that_finished_without_an_effort_is_a_damaged_one() -> None:
    case = CaseRecord(case="made/made", run=run_file(ONE_PAIR), provenance=None, readme="", variants={})
    damaged = msgspec.structs.replace(ladder("one", {TIP: way()})[-1], effort="")
    found = collect([case, damaged]).cases[0].get("rigid", "one")
    assert (found.variant, found.engine, found.status, found.runs) == ("rigid", "one", "failed", ())
    assert found.message == "its record names no effort"
