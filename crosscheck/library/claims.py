"""What is claimed and expected of engines in one case, from files `crosscheck-expect.toml` and from options.

Claims are part of the record of a case, so that a judged session says by which goals it was judged.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import msgspec

from crosscheck.library.case_error import CaseError
from crosscheck.library.case_words import Tags, chosen, meant
from crosscheck.library.check.judged import check_expect_file
from crosscheck.library.expect_file import EffortsEntry, ExpectFile, FailureEntry, FailureStatus, GoalEntry
from flexmb.scene.problems import Place


class _Claim(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of claims: the `engine`; the `place` where it is written, such as "crosscheck-expect.toml: $.goal[0]".

    `whole`: all cases that the place means are in the session, so that one of its patterns that names nothing there
    names nothing at all.
    """

    engine: str
    place: str
    whole: bool = False


class ClaimedGoals(_Claim, frozen=True, kw_only=True):
    """The largest U by pattern of channels, relative to the channel's range."""

    goals: dict[str, float]
    reason: str


class ClaimedFailure(_Claim, frozen=True, kw_only=True):
    """Channels, by patterns, that are expected to have a `status` other than agreement."""

    channels: tuple[str, ...]
    status: FailureStatus
    reason: str


class ClaimedEfforts(_Claim, frozen=True, kw_only=True):
    """Efforts besides the engine's own or the case's."""

    values: tuple[float, ...]


class Claims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All claims on one case, in the order in which they were written."""

    goals: tuple[ClaimedGoals, ...] = ()
    failures: tuple[ClaimedFailure, ...] = ()
    efforts: tuple[ClaimedEfforts, ...] = ()

    def of(self, engines: Collection[str]) -> Claims:
        """Those on some engines."""
        return Claims(
            goals=tuple(goal for goal in self.goals if goal.engine in engines),
            failures=tuple(failure for failure in self.failures if failure.engine in engines),
            efforts=tuple(effort for effort in self.efforts if effort.engine in engines),
        )

    def goals_of(self, engine: str) -> dict[str, tuple[float, str]]:
        """Goal and reason by pattern of channels; of equal patterns the last counts."""
        mine = (goal for goal in self.goals if goal.engine == engine)
        return {pattern: (goal, failure.reason) for failure in mine for pattern, goal in failure.goals.items()}

    def efforts_of(self, engine: str) -> tuple[float, ...]:
        """All efforts that are written for an engine, from coarse to fine."""
        found = {value for effort in self.efforts if effort.engine == engine for value in effort.values}
        return tuple(sorted(found, reverse=True))


def claims_on(
    session: Sequence[str],
    written: Mapping[str, ExpectFile],
    *,
    names: Sequence[str],
    tags: Tags,
    engines: Iterable[str],
) -> dict[str, Claims]:
    """The claims on each case of a session, by name.

    `written` is what was read, by where it stands (a file, an option); `names` and `tags` are those of all cases that
    there are, `engines` all engines. CaseError lists what is wrong with its place and the remedy.
    """
    claims = {name: Claims() for name in session}
    for source, content in written.items():
        problems = [str(problem) for problem in check_expect_file(content, engines)]
        if problems:
            raise CaseError("\n".join(f"{source}: {problem}" for problem in problems))
        for place, entry in _entries(content):
            where = f"{source}: {place}"
            called = _called(entry.cases, names, tags, f"{source}: {place.key('cases')}")
            whole = set(called) <= set(session)
            for name in called:
                if name in claims:
                    claims[name] = _with(claims[name], entry, where, whole)
    return claims


def _entries(content: ExpectFile) -> Iterator[tuple[Place, GoalEntry | FailureEntry | EffortsEntry]]:
    kinds: dict[str, tuple[GoalEntry | FailureEntry | EffortsEntry, ...]]
    kinds = {"goal": content.goals, "expected_failure": content.failures, "efforts": content.efforts}
    for kind, entries in kinds.items():
        for number, entry in enumerate(entries):
            yield Place().key(kind, number), entry


def _called(words: Iterable[str], names: Sequence[str], tags: Tags, where: str) -> tuple[str, ...]:
    try:
        return chosen(words, lambda word: meant(word, names, tags))
    except CaseError as error:
        raise CaseError(f"{where}: {error}") from None


def _with(claims: Claims, entry: GoalEntry | FailureEntry | EffortsEntry, place: str, whole: bool) -> Claims:
    """The claims with one more."""
    match entry:
        case GoalEntry():
            goals = ClaimedGoals(engine=entry.engine, place=place, whole=whole, goals=entry.goals, reason=entry.reason)
            return msgspec.structs.replace(claims, goals=(*claims.goals, goals))
        case FailureEntry():
            failure = ClaimedFailure(
                engine=entry.engine, place=place, whole=whole, channels=entry.channels, status=entry.status,
                reason=entry.reason,
            )  # fmt: skip
            return msgspec.structs.replace(claims, failures=(*claims.failures, failure))
        case EffortsEntry():
            efforts = ClaimedEfforts(engine=entry.engine, place=place, whole=whole, values=entry.values)
            return msgspec.structs.replace(claims, efforts=(*claims.efforts, efforts))
