"""`crosscheck-expect.toml`: what the user of an outside engine claims and expects of it, beside the engine's sources.

A complete file::

    [[goal]]                                # how accurate the engine claims to be
    engine = "mycode"
    cases = ["pendulums/*", "canonical"]    # words as on the command line; left out: all cases
    goals = { "*" = 1e-3, load = 1e-2 }     # patterns of channels, as in a run.toml
    reason = "semi-implicit Euler is of first order"

    [[expected_failure]]                    # strict: if it agrees, the session fails
    engine = "mycode"
    cases = ["wheels/*"]
    channels = ["load"]                     # left out: all channels
    status = "differ"
    reason = "bearing loads are without the gyroscopic torque, our issue 12"

    [[efforts]]                             # besides the engine's own, or the case's
    engine = "mycode"
    cases = ["pendulums/double"]
    values = [1e-5, 5e-6]                   # steps (s) or relative tolerances

A goal replaces the case's goal in every comparison in which the engine takes part, and the case's limit to the drift of
a conserved quantity. Of the patterns that name a channel the longest counts, of equal ones the last; if both engines of
a comparison claim a goal, the larger one counts. Negative controls keep the goals of the case. A goal says only how
large the uncertainty U may be: results that are further apart than U differ, whatever is claimed.

An expected failure counts where the case expects agreement. `status` is "differ", "unresolved", "refused", "diverged"
or "failed"; what crashed, did not finish or did not run is never as expected.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from crosscheck.engines.registry import FMU
from crosscheck.library.case_error import CaseError
from crosscheck.library.read_file import struct_of

NAME = "crosscheck-expect.toml"
EVERY_CASE, EVERY_CHANNEL = "all", "*"
FailureStatus = Literal["differ", "unresolved", "refused", "diverged", "failed"]


class _Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the entries, which refuses unknown keys."""


class GoalEntry(_Entry, frozen=True, kw_only=True):
    """Goals that an engine claims: the largest U by pattern of channels, relative to the channel's range."""

    engine: str
    cases: tuple[str, ...] = (EVERY_CASE,)
    goals: dict[str, float]
    reason: str


class FailureEntry(_Entry, frozen=True, kw_only=True):
    """Channels in which an engine is expected not to agree, with the status that is expected instead."""

    engine: str
    cases: tuple[str, ...] = (EVERY_CASE,)
    channels: tuple[str, ...] = (EVERY_CHANNEL,)
    status: FailureStatus
    reason: str


class EffortsEntry(_Entry, frozen=True, kw_only=True):
    """Efforts besides the engine's own or those of the case, of the kind and method of the finest of these."""

    engine: str
    cases: tuple[str, ...] = (EVERY_CASE,)
    values: tuple[float, ...]


class ExpectFile(_Entry, frozen=True, kw_only=True):
    """The whole file."""

    goals: tuple[GoalEntry, ...] = msgspec.field(name="goal", default=())
    failures: tuple[FailureEntry, ...] = msgspec.field(name="expected_failure", default=())
    efforts: tuple[EffortsEntry, ...] = ()


def read_expect_file(file: Path) -> ExpectFile:
    """The content of a file; CaseError names the file, the place in it and the remedy."""
    return struct_of(file, ExpectFile)


def goal_option(text: str) -> ExpectFile:
    """What `--goal ENGINE[:PATTERN]=NUMBER` says, for all cases; CaseError if it is no such text."""
    what, _, number = text.rpartition("=")
    mark, file = (FMU, what.removeprefix(FMU)) if what.startswith(FMU) else ("", what)  # its name has a colon itself
    engine, _, pattern = file.partition(":")
    engine = mark + engine
    if engine == mark:
        raise CaseError(f"--goal {text}: write ENGINE=NUMBER or ENGINE:CHANNELS=NUMBER, such as mycode:load=1e-3")
    (value,) = _numbers("--goal", text, [number])
    entry = GoalEntry(engine=engine, goals={pattern or EVERY_CHANNEL: value}, reason=f"--goal {text}")
    return ExpectFile(goals=(entry,))


def efforts_option(text: str) -> ExpectFile:
    """What `--efforts ENGINE=NUMBER,NUMBER...` says, for all cases; CaseError if it is no such text."""
    engine, _, values = text.rpartition("=")
    if not engine:
        raise CaseError(f"--efforts {text}: write ENGINE=NUMBER,NUMBER, such as mycode=1e-4,5e-5")
    return ExpectFile(efforts=(EffortsEntry(engine=engine, values=_numbers("--efforts", text, values.split(","))),))


def _numbers(option: str, text: str, parts: list[str]) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in parts)
    except ValueError:
        raise CaseError(f"{option} {text}: behind the = must be numbers, such as 1e-3") from None
