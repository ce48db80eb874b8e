"""A stored reference as records hold it, so that they can be judged where the case's folder is not."""

from __future__ import annotations

import msgspec

from crosscheck.records.packing import Packed


class Asked(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What an engine is asked against the reference: goals and scales by patterns of channels, as in a comparison."""

    goals: dict[str, float]
    scales: dict[str, float] = {}


class RecordedReference(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The reference of `variant`: channels (T, k) at `times` (T,), the `uncertainties` of these (SI), and who is held
    against it (`asked`, by engine). Where the stored files cannot be used, `fault` says why, and there are no arrays.
    """

    variant: str
    asked: dict[str, Asked]
    times: Packed | None = None
    channels: dict[str, Packed] = {}
    uncertainties: dict[str, float] = {}
    fault: str = ""

    @property
    def arrays(self) -> tuple[Packed, ...]:
        """All of its arrays."""
        return (*self.channels.values(), *([] if self.times is None else [self.times]))
