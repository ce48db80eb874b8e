"""Results: the runs of one engine on one variant, read from records, with the uncertainty of every channel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from crosscheck.records import BrokenLine, CaseRecord, Environment, Packed, Record, RunRecord, unpack
from crosscheck.uncertainty import Rung, Uncertainty, estimate, spatial
from crosscheck.verdict import Signal
from flexmb.channels import family, magnitude, signal_range

Array = NDArray[np.float64]
Key = tuple[str, str, str]  # variant, engine, role
RUNGS = 3


@dataclass
class Result:
    """The runs of one ladder, coarse to fine. `status` and `message` are those of the finest effort.

    `refined` is the same engine's result with the finer spatial discretisation, where there is one.
    """

    variant: str
    engine: str
    status: Literal["finished", "failed", "refused", "did not run"]
    message: str
    runs: tuple[RunRecord, ...]
    refined: Result | None = None
    refinement: tuple[float, float] = (2.0, 2.0)
    _unpacked: dict[int, Array] = field(default_factory=dict, repr=False)
    _estimates: dict[str, Uncertainty] = field(default_factory=dict, repr=False)

    @property
    def finest(self) -> RunRecord:
        """The run at the finest effort."""
        return self.runs[-1]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that the finest run has."""
        return tuple(self.finest.channels) if self.status == "finished" else ()

    @property
    def times(self) -> Array:
        """Sample times of the finest run (s)."""
        assert self.finest.times is not None
        return self._array(self.finest.times)

    def values(self, channel: str, run: RunRecord | None = None) -> Array:
        """A channel (T, k) of the finest run, or of another run of the ladder."""
        return self._array((run or self.finest).channels[channel])

    def uncertainty(self, channel: str) -> Uncertainty:
        """Numerical U of a channel of the finest run, from the last three efforts of its method that finished."""
        if channel not in self._estimates:
            method = (self.finest.effort_kind, self.finest.effort_method)
            ladder = [
                run
                for run in self.runs
                if (run.effort_kind, run.effort_method) == method
                and run.status == "finished"
                and channel in run.channels
            ][-RUNGS:]
            if _without_effect(ladder):
                ladder = ladder[-1:]
            rungs = [Rung(run.effort_value, self.values(channel, run)) for run in ladder]
            size = max(magnitude(name, self.values(name)) for name in self._relatives(channel))
            evaluations = self.finest.evaluations
            self._estimates[channel] = estimate(channel, self.finest.effort_kind, rungs, evaluations, size)
        return self._estimates[channel]

    def signal(self, channel: str, across: bool) -> Signal:
        """The channel as a verdict needs it; `across` variants, the spatial discretisation adds to U."""
        doubt = self.uncertainty(channel)
        if across and self.refined is not None and channel in self.refined.channels:
            ratio, order = self.refinement
            extra = spatial(channel, self.values(channel), self.refined.values(channel), ratio, order)
            envelope = doubt.envelope + extra
            doubt = Uncertainty(envelope, float(envelope[-1]), f"{doubt.how}; spatial refinement", doubt.order)
        return self._signal(channel, doubt)

    def control_signal(self, channel: str, like: Result) -> Signal:
        """The channel of a control's one run, with the U of the same engine's unmutated result `like`."""
        return self._signal(channel, like.uncertainty(channel))

    def _signal(self, channel: str, doubt: Uncertainty) -> Signal:
        sizes = [max(signal_range(name, self.values(name)) for name in self._relatives(channel))]
        if channel.endswith(".torque"):
            sizes.append(self._largest(".force") * self._largest(".position"))
        return Signal(self.values(channel), doubt, tuple(sizes))

    def _largest(self, ending: str) -> float:
        """Largest magnitude (SI) among the channels with that ending; 0 if there is none."""
        sizes = (magnitude(name, self.values(name)) for name in self.finest.channels if name.endswith(ending))
        return max(sizes, default=0.0)

    def _relatives(self, channel: str) -> list[str]:
        kin = family(channel)
        return [name for name in self.finest.channels if family(name) == kin]

    def _array(self, packed: Packed) -> Array:
        if id(packed) not in self._unpacked:
            self._unpacked[id(packed)] = unpack(packed)
        return self._unpacked[id(packed)]


@dataclass(frozen=True)
class CaseResults:
    """A case with all its results by (variant, engine, role)."""

    case: CaseRecord
    results: dict[Key, Result]

    def get(self, variant: str, engine: str, role: str = "main") -> Result:
        """A result; one that was never recorded "did not run"."""
        missing = Result(variant, engine, "did not run", "no run of it is recorded: the session was cut short", ())
        return self.results.get((variant, engine, role), missing)


@dataclass(frozen=True)
class Session:
    """Everything a file of records says; `broken` are its lines that say nothing."""

    environments: tuple[Environment, ...]
    cases: tuple[CaseResults, ...]
    broken: tuple[BrokenLine, ...] = ()


def collect(records: Sequence[Record]) -> Session:
    """Records -> results by case. The last record of a case and of each run counts."""
    cases = {record.case: record for record in records if isinstance(record, CaseRecord)}
    runs: dict[tuple[str, ...], RunRecord] = {}
    for record in records:
        if isinstance(record, RunRecord):
            runs.pop(record.key, None)  # so that the order is that of the last records
            runs[record.key] = record
    return Session(
        environments=tuple(record for record in records if isinstance(record, Environment)),
        cases=tuple(
            _case_results(case, [run for run in runs.values() if run.case == name]) for name, case in cases.items()
        ),
        broken=tuple(record for record in records if isinstance(record, BrokenLine)),
    )


def _case_results(case: CaseRecord, runs: Iterable[RunRecord]) -> CaseResults:
    groups: dict[Key, list[RunRecord]] = {}
    for run in runs:
        groups.setdefault((run.variant, run.engine, run.role), []).append(run)
    results = {key: _result(key, group) for key, group in groups.items()}
    for variant in case.run.variants:
        if variant.refined is None:
            continue
        counts = [(getattr(variant, key), getattr(variant.refined, key)) for key in ("segments", "pieces")]
        ratio = next((fine / coarse for coarse, fine in counts if fine is not None), 2.0)
        for engine in variant.engines:
            main, refined = results.get((variant.name, engine, "main")), results.get((variant.name, engine, "refined"))
            if main is not None and refined is not None and refined.status == "finished":
                main.refined, main.refinement = refined, (ratio, variant.refined.order)
    return CaseResults(case, results)


def _without_effect(ladder: Sequence[RunRecord]) -> bool:
    """Whether the last two efforts did the very same work with the very same result.

    Then the engine did not follow the effort (say, a step cut short by the sample times), and equality means nothing.
    """
    if len(ladder) < 2:
        return False
    one, other = ladder[-2:]
    return one.evaluations == other.evaluations and all(
        name in one.channels and one.channels[name].data == packed.data for name, packed in other.channels.items()
    )


def _result(key: Key, group: list[RunRecord]) -> Result:
    """A result from the runs of one scene and one version: those of the record that came last."""
    variant, engine, _ = key
    last = group[-1]
    if not last.effort:
        status = "failed" if last.status == "diverged" else last.status
        return Result(variant, engine, status, last.message, ())
    stamp = (last.scene, last.version, last.rungs)
    same = [run for run in group if run.effort and (run.scene, run.version, run.rungs) == stamp]
    runs = tuple(sorted(same, key=lambda run: run.rung))
    finest = runs[-1]
    if finest.rung < finest.rungs - 1:
        message = "the finest effort is not recorded: the session was cut short"
        return Result(variant, engine, "did not run", message, runs)
    if finest.status == "diverged":
        end = "" if finest.times is None else f" at t = {unpack(finest.times)[-1]:.4g} s"
        return Result(variant, engine, "failed", f"diverged{end}: {finest.message}", runs)
    return Result(variant, engine, finest.status, finest.message, runs)
