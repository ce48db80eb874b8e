"""A stored reference inside records, so that they can be judged without the case's folder."""

from __future__ import annotations

import msgspec

from crosscheck.records.packing import Packed


class ReferenceGoals(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Goals and scales of an engine's comparison with the reference, by patterns of channels."""

    goals: dict[str, float]
    scales: dict[str, float] = {}


class RecordedReference(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The reference of `variant`: channels (T, k) at `times` (T,), their `uncertainties` (SI), and the engines that are
    compared with it (`asked`). `routes` say how its numbers were made; older records have none. If the stored files
    cannot be used, `fault` says why, and there are no arrays.
    """

    variant: str
    asked: dict[str, ReferenceGoals]
    times: Packed | None = None
    channels: dict[str, Packed] = {}
    uncertainties: dict[str, float] = {}
    routes: tuple[str, ...] = ()
    fault: str = ""
