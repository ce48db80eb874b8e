"""The outcome of a CSV: its verdicts, with the time and the possible causes of each distance, and what is not in it."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from crosscheck.judging.outcome import SessionOutcome


@dataclass(frozen=True)
class Detail:
    """For one channel the time (s) of the largest distance from the reference, and the possible causes.

    After correction for any one of `causes` the channel agrees; `cause` is all of them in words. `left_out` are times
    (s) of samples that are not compared, because the reference jumps there.
    """

    worst_s: float
    causes: tuple[str, ...] = ()
    left_out: tuple[float, ...] = ()

    @property
    def cause(self) -> str:
        return ", or ".join(self.causes)


@dataclass(frozen=True)
class CsvOutcome(SessionOutcome):
    """The outcome of a CSV, with details by channel; `left_out` are columns that were not compared.

    `against` describes the reference, `interpolated` how a CSV with times of its own was compared ("" if it has the
    reference's). `not_given` are channels that could be compared and are not in the file.
    """

    details: dict[str, Detail] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    against: str = ""
    interpolated: str = ""
    not_given: tuple[str, ...] = ()

    @property
    def inventory(self) -> str:
        """How many channels agree, and which were not given, in words."""
        counts = [f"{number} {status}" for status, number in self.counts().items() if number]
        if self.not_given:
            counts.append(f"{len(self.not_given)} not given: {', '.join(self.not_given)}")
        return ", ".join(counts)


def outcome_json(outcome: CsvOutcome) -> str:
    """The outcome as JSON: the reference, whether all channels agree, and each channel with its figures."""
    channels = {}
    for verdict in outcome.all:
        detail = outcome.details.get(verdict.channel)
        channels[verdict.channel] = {
            "status": verdict.status,
            "E": verdict.E,
            "U": verdict.U,
            "goal": verdict.goal,
            "worst_s": detail.worst_s if detail else None,
            "cause": detail.cause if detail else "",
            "causes": detail.causes if detail else (),
            "left_out_s": detail.left_out if detail else (),
            "reason": verdict.reason,
        }
    document = {
        "case": next(iter(outcome.verdicts)),
        "against": outcome.against,
        "ok": outcome.ok,
        "interpolated": outcome.interpolated,
        "left_out": outcome.left_out,
        "not_given": outcome.not_given,
        "channels": channels,
    }
    return msgspec.json.format(msgspec.json.encode(document)).decode()
