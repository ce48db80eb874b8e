"""The work of a run: counts that are the same on every machine, as stored references keep them.

In reference.toml a line for each effort of each engine that made the numbers::

    [work]
    "native (rigid), dop853 rtol=1e-12" = { evaluations = 8147, steps = 601, operations = 6372421 }

A count that the engine does not make is left out, and so are all counts of a run in which nothing moves: how many steps
that takes is decided by rounding. A later run has the same work if each count is within `ALIKE` of the
stored one: other processors round otherwise, so that a few steps more or less are accepted or refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, get_args

import msgspec

ALIKE = 0.1  # relative change of a count up to which the work is the same
Counted = Literal["evaluations", "steps", "operations"]
COUNTED: tuple[Counted, ...] = get_args(Counted)


class Counts(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Evaluations of the right-hand side or residual, steps, refused ones too, and floating-point operations of a run;
    0 is not counted."""

    evaluations: int = 0
    steps: int = 0
    operations: int = 0


StoredWork = dict[str, Counts]  # engine, variant and effort -> counts


def key(engine: str, variant: str, effort: str) -> str:
    """The key of a run in a stored reference."""
    return f"{engine} ({variant}), {effort}"


def changes(then: Counts, now: Counts) -> Iterator[tuple[Counted, int, int]]:
    """The counts that both have and that differ by more than `ALIKE` of the earlier one: name, then, now."""
    for name in COUNTED:
        before, after = getattr(then, name), getattr(now, name)
        if before and after and abs(after - before) > ALIKE * before:
            yield name, before, after


class RunWork(Counts, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """What a run took at its `effort`: `wall_s` of the solve alone, `cpu_s` of processor time on all threads, outputs
    included, and its counts."""

    effort: str = ""
    wall_s: float = 0.0
    cpu_s: float = 0.0

    @property
    def uncounted(self) -> tuple[Counted, ...]:
        """What the engine does not count."""
        return tuple(name for name in COUNTED if not getattr(self, name))

    def words(self, engine: str) -> str:
        """All of it on a line; what is not counted is named, with the engine that does not."""
        parts = [f"{self.wall_s:.3g} s", f"{self.cpu_s:.3g} s of processor time" if self.cpu_s else ""]
        parts += [f"{getattr(self, name):.4g} {name}" for name in COUNTED if getattr(self, name)]
        missing = f"{', '.join(self.uncounted)} not counted by {engine}" if self.uncounted else ""
        return ", ".join(filter(None, (*parts, missing)))
