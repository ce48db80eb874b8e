"""The figures E and U of verdicts: which of them are accepted, and when one has grown since.

A figure has grown, and its verdict is *worse than recorded*, if

    U > 10 max(U_accepted, floor)    or    E > 10 max(E_accepted, U_accepted, floor).

E below U is noise and may be anything from 0 to U on another machine; therefore E is also compared with U. The floor is
the rounding eps sqrt(N) of a million evaluations. The factor is 10 because an estimate of U is accurate only to a
factor of a few: whether an order is observed, and the difference of two runs, depend on chance. A figure that was
accepted on another basis (`crosscheck.judging.basis`) is *stale*: its growth is no evidence of an error.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from crosscheck.judging.verdict import Verdict
from crosscheck.library.accepted import Accepted, Figure, key

GROWTH = 10.0
FLOOR = float(np.finfo(np.float64).eps) * 1e3


def worse(figure: Figure | None, E: float | None, U: float | None) -> str:
    """How E or U has grown beyond the accepted figure; "" if not, or if there is none."""
    if figure is None:
        return ""
    if E is None:
        return f"accepted with E {figure.E:.1e}, and now there is no figure at all"
    grown = []
    for name, now, then in (("U", U or 0.0, figure.U), ("E", E, max(figure.E, figure.U))):
        if not now <= GROWTH * max(then, FLOOR):
            grown.append(f"{name} is {now:.1e}, accepted were {getattr(figure, name):.1e}")
    return "; ".join(grown)


def figures(verdicts: Iterable[Verdict], engines: Iterable[str]) -> Accepted:
    """The figures of verdicts between the given `engines`, which are the library's own."""
    own = set(engines)
    accepted: Accepted = {}
    for verdict in verdicts:
        if recordable(verdict, own) and verdict.E is not None:
            figure = Figure(_rounded(verdict.E), _rounded(verdict.U or 0.0), verdict.basis)
            accepted.setdefault(verdict.comparison, {})[key_of(verdict)] = figure
    return accepted


def recordable(verdict: Verdict, own: Iterable[str]) -> bool:
    """Whether a verdict should have an accepted figure: it compares numbers of our `own` engines and is no control."""
    if verdict.kind == "control" or verdict.E is None:
        return False
    return verdict.engine_a in own and (verdict.kind == "conservation" or verdict.engine_b in own)


def key_of(verdict: Verdict) -> str:
    """The key of a verdict in accepted.toml, within its comparison."""
    return key(verdict.channel, (verdict.engine_a, verdict.variant_a), (verdict.engine_b, verdict.variant_b))


def _rounded(number: float) -> float:
    return float(f"{number:.1e}")
