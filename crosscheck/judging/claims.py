"""The user's claims that name nothing in a session: a misspelt pattern must not be ignored silently."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from crosscheck.judging.applicable import Inapplicable
from crosscheck.judging.results import CaseResults
from crosscheck.judging.verdict import Verdict
from crosscheck.library.claims import ClaimedFailure, ClaimedGoals
from flexmb.run.channels import matches


def idle_claims(
    cases: Sequence[CaseResults], verdicts: Mapping[str, Sequence[Verdict]], inapplicable: Iterable[Inapplicable]
) -> tuple[str, ...]:
    """Each pattern of channels that names none in any case of its entry, with its place.

    Only entries all of whose cases are in the session are judged, and engines that finished everything there: what the
    others would offer is not known.
    """
    apart = tuple(inapplicable)
    places: dict[tuple[str, str, str], list[CaseResults]] = {}  # place, engine, pattern
    for case in cases:
        claims = case.case.claims
        named: list[tuple[ClaimedGoals | ClaimedFailure, str]]
        named = [(each, pattern) for each in claims.goals for pattern in each.goals]
        named += [(each, pattern) for each in claims.failures for pattern in each.channels]
        for each, pattern in named:
            if each.whole:
                places.setdefault((each.place, each.engine, pattern), []).append(case)
    found = []
    for (place, engine, pattern), group in places.items():
        names = {case.case.case for case in group}
        judged = [each for name in names for each in verdicts[name] if _judges(each, engine)]
        known = {each.channel for each in judged}
        known |= {each.channel for each in apart if each.case in names and each.engine == engine}
        certain = judged and all(_finished(case, engine) for case in group)
        if certain and not any(matches(pattern, channel) for channel in known):
            found.append(f'{place}: "{pattern}" names no channel of {engine} that is judged: correct it')
    return tuple(found)


def _judges(verdict: Verdict, engine: str) -> bool:
    return verdict.kind != "control" and any(side == engine for _, side in verdict.sides)


def _finished(case: CaseResults, engine: str) -> bool:
    mine = [result for (_, name, role), result in case.results.items() if name == engine and role == "main"]
    return bool(mine) and all(result.status == "finished" for result in mine)
