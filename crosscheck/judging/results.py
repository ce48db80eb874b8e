"""Results: the runs of one engine on one variant, read from records, with the uncertainty of every channel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import msgspec
import numpy as np

from crosscheck.engines.openness import NOTHING_OPEN, Openness
from crosscheck.judging.uncertainty import RUNGS, RungSignal, Uncertainty, at_rest, estimate, spatial, unknown
from crosscheck.judging.verdict import Ending, Signal
from crosscheck.library.channels import is_judged, known_to
from crosscheck.records.kinds import (
    FILM,
    BrokenLine,
    CaseRecord,
    ChartRecord,
    Environment,
    Record,
    RunRecord,
    RunStatus,
)
from crosscheck.records.packing import Packed, unpack
from flexmb.kept import kept
from flexmb.run.channels import signal_range
from flexmb.run.rounding import Sizes, ulp_of_arithmetic
from flexmb.typing import Real

AT_REST = 1e-12  # m or rad: what stays within it has not moved
NEEDED = 3  # the last efforts, which must all be recorded for an estimate of U
Key = tuple[str, str, str]  # variant, engine, role


@dataclass
class Result:
    """The runs of one ladder, coarse to fine. `status` and `message` are those of the finest effort.

    `refined` is the same engine's result with the finer spatial discretisation, finished or not, where the variant
    asks for one. `reached_s` is the last sample time of a run that diverged. `open` are the components that its motion
    leaves open: they are numbers of one engine's choice, and part of no value here.
    """

    variant: str
    engine: str
    status: RunStatus
    message: str
    runs: tuple[RunRecord, ...]
    reached_s: float | None = None
    refined: Result | None = None
    refinement: tuple[float, float] = (2.0, 2.0)
    open: Openness = NOTHING_OPEN
    _unpacked: dict[int, Real] = field(default_factory=dict, repr=False)
    _determined: dict[int, Real] = field(default_factory=dict, repr=False)
    _estimates: dict[str, Uncertainty] = field(default_factory=dict, repr=False)

    @kept
    def _sizes(self) -> Sizes:
        return Sizes(tuple(self.finest.channels), self.values)

    def floor(self, channel: str) -> float:
        """What rounding alone may add to a channel of the finest run (SI)."""
        return self._sizes.floor(channel, self.finest.evaluations)

    @property
    def finest(self) -> RunRecord:
        return self.runs[-1]

    @property
    def channels(self) -> tuple[str, ...]:
        return tuple(filter(is_judged, self.finest.channels)) if self.status == "finished" else ()

    @property
    def determined_channels(self) -> tuple[str, ...]:
        """The channels without open components."""
        return tuple(channel for channel in self.channels if channel not in self.open)

    @property
    def times(self) -> Real:
        """Sample times of the finest run (s)."""
        assert self.finest.times is not None
        return self._array(self.finest.times)

    def values(self, channel: str, run: RunRecord | None = None) -> Real:
        """A channel (T, k) of the finest run, or of another run of the ladder, projected on its determined components:
        the open ones are 0, and so take part in no distance and no size."""
        packed = (run or self.finest).channels[channel]
        if channel not in self.open:
            return self._array(packed)
        if id(packed) not in self._determined:
            self._determined[id(packed)] = self.open.filled(channel, self._array(packed), 0.0)
        return self._determined[id(packed)]

    @property
    def ending(self) -> Ending:
        """How the run ended; only for an unfinished run."""
        assert self.status != "finished"
        return Ending(self.status, f"{self.engine} on {self.variant}: {self.message}", self.reached_s)

    def uncertainty(self, channel: str) -> Uncertainty:
        """Numerical U of a channel of the finest run, from the last efforts of its method.

        A coarse effort may diverge and is left out. If one is not recorded, or one of the last lacks the channel,
        nothing is known about convergence, and U is unknown.
        """
        if channel not in self._estimates:
            self._estimates[channel] = self._estimate(channel)
        return self._estimates[channel]

    def _estimate(self, channel: str) -> Uncertainty:
        finest = self.finest
        gap = self._gap(channel)
        if gap:
            return unknown(len(self.values(channel)), gap)
        ladder = [run for run in self._ladder() if run.status == "finished" and channel in run.channels]
        size, joints = self._sizes.magnitude(channel, finest.evaluations), self._sizes.joints
        if _without_effect(ladder):
            if not all(map(is_judged, finest.channels)) and self.rests:  # the run is about the linearised motion
                return self._with_own(channel, at_rest(len(self.values(channel)), size, finest.evaluations, joints))
            ladder = ladder[-1:]
        rungs = [RungSignal(run.effort_value, self.values(channel, run), run.evaluations) for run in ladder]
        return self._with_own(channel, estimate(channel, finest.effort_kind, rungs, size, joints))

    @property
    def rests(self) -> bool:
        """Whether nothing that is seen moves: then efforts that give the same are no sign that they are ignored."""
        seen = [name for name in self.finest.channels if name.endswith((".position", ".orientation"))]
        return bool(seen) and all(signal_range(name, self.values(name)) <= AT_REST for name in seen)

    def _with_own(self, channel: str, of_run: Uncertainty) -> Uncertainty:
        """U with what the engine says of how well it knows a derivative or a frequency of a state, and with what moved
        inputs do to its run."""
        own, moved = self._own(channel), self.finest.rounding.get(channel, 0.0) * ulp_of_arithmetic(self._sizes.joints)
        envelope, how = of_run.envelope, of_run.how
        if own is not None:
            envelope = envelope + np.maximum.accumulate(own)
            how = f"{how}; {self.own_account(channel):.1e} by the engine's own account"
        if moved:
            envelope, how = envelope + moved, f"{how}; {moved:.1e} by rounding, as runs with moved inputs show"
        return Uncertainty(envelope, float(envelope[-1]), how, of_run.order)

    def own_account(self, channel: str) -> float:
        """How well the engine says that it knows a derivative or a frequency of a state (SI); 0 for other channels."""
        own = self._own(channel)
        return 0.0 if own is None else float(np.max(own))

    def _own(self, channel: str) -> Real | None:
        packed = self.finest.channels.get(known_to(channel))
        return None if packed is None else self._array(packed)[:, 0]

    def _ladder(self) -> list[RunRecord]:
        method = (self.finest.effort_kind, self.finest.effort_method)
        return [run for run in self.runs if (run.effort_kind, run.effort_method) == method][-RUNGS:]

    def _gap(self, channel: str) -> str:
        """What is missing from the ladder, so that U cannot be estimated; "" if nothing is."""
        recorded = {run.rung for run in self.runs}
        missing = [rung for rung in range(self.finest.rungs) if rung not in recorded]
        if missing:
            return f"effort {missing[0] + 1} of {self.finest.rungs} is not recorded"
        for run in self._ladder()[-NEEDED:]:
            if run.status == "finished" and channel not in run.channels:
                return f"effort {run.effort} does not offer the channel"
        return ""

    def doubt(self, channel: str, across: bool) -> Uncertainty:
        """U of a channel; in comparisons `across` variants the spatial discretisation adds to it.

        If a refined run was asked for and gave no result, U is unknown.
        """
        own = self.uncertainty(channel)
        if not across or self.refined is None:
            return own
        fault = self._unrefined(channel, self.refined)
        if fault:
            return unknown(len(own.envelope), f"its refined run {fault}")
        ratio, order = self.refinement
        envelope = own.envelope + spatial(channel, self.values(channel), self.refined.values(channel), ratio, order)
        return Uncertainty(envelope, float(envelope[-1]), f"{own.how}; spatial refinement", own.order)

    def _unrefined(self, channel: str, refined: Result) -> str:
        """Why the refined run cannot be used for the channel; "" if it can."""
        if refined.status != "finished":
            return f"{_past(refined.status)}: {refined.message}"
        if channel not in refined.channels:
            return "does not offer the channel"
        if channel in refined.open.beyond(self.open):
            return f"leaves components of it open, {refined.open.name(channel)}, that are determined here"
        if _same(self.finest, refined.finest):
            return "gave the very same result: it is not refined"
        return ""

    def signal(self, channel: str, across: bool) -> Signal:
        """The channel as input of a verdict; `across` variants the spatial discretisation adds to U."""
        return self._signal(channel, self.doubt(channel, across))

    def control_signal(self, channel: str, like: Result, across: bool) -> Signal:
        """The channel of a control's one run, with the U of the same engine's unmutated result `like`."""
        return self._signal(channel, like.doubt(channel, across))

    def _signal(self, channel: str, doubt: Uncertainty) -> Signal:
        return Signal(self.values(channel), doubt, self._sizes.of(channel))

    def _array(self, packed: Packed) -> Real:
        if id(packed) not in self._unpacked:
            self._unpacked[id(packed)] = unpack(packed)
        return self._unpacked[id(packed)]


@dataclass(frozen=True)
class CaseResults:
    """A case with all its results by (variant, engine, role), and by (variant, engine) the runs for its charts."""

    case: CaseRecord
    results: dict[Key, Result]
    charted: dict[tuple[str, str], ChartRecord] = field(default_factory=dict)

    def get(self, variant: str, engine: str, role: str = "main") -> Result:
        """A result; one that was never recorded "did not run"."""
        return self.results.get((variant, engine, role)) or _never_recorded(variant, engine)

    def undetermined(self, *variants: str) -> Openness:
        """Components that the motion of any of these variants does not determine: what an engine gives is one choice of
        infinitely many. They were found from the scenes; what engines say changes nothing here."""
        return _of_variants(self.case, variants)


def _of_variants(case: CaseRecord, variants: Iterable[str]) -> Openness:
    infos = [case.variants[name] for name in variants if name in case.variants]
    found = [info.undetermined for info in infos if not isinstance(info.undetermined, msgspec.UnsetType)]
    return Openness.of(chain.from_iterable(found))


@dataclass(frozen=True)
class Session:
    """The contents of a records file; `broken` are its invalid lines."""

    environments: tuple[Environment, ...]
    cases: tuple[CaseResults, ...]
    broken: tuple[BrokenLine, ...] = ()


def collect(records: Sequence[Record]) -> Session:
    """Records -> results by case. The last record of a case and of each run counts."""
    cases = {record.case: record for record in records if isinstance(record, CaseRecord)}
    runs: dict[tuple[str, ...], RunRecord] = {}
    for record in records:
        if isinstance(record, RunRecord):
            runs.pop(record.key, None)  # the order is that of the last records
            runs[record.key] = record
    charted = {record.key: record for record in records if isinstance(record, ChartRecord)}
    return Session(
        environments=tuple(record for record in records if isinstance(record, Environment)),
        cases=tuple(
            replace(
                _case_results(case, [run for run in runs.values() if run.case == name]),
                charted={(each.variant, each.engine): each for each in charted.values() if each.case == name},
            )
            for name, case in cases.items()
        ),
        broken=tuple(record for record in records if isinstance(record, BrokenLine)),
    )


def _case_results(case: CaseRecord, runs: Iterable[RunRecord]) -> CaseResults:
    groups: dict[Key, list[RunRecord]] = {}
    ladders: dict[tuple[str, str], list[tuple[str, str, float]]] = {}
    for variant in case.run.variants:
        for item in variant.efforts:
            prescribed = [(item.kind, item.method, value) for value in item.values]
            ladders.setdefault((variant.name, item.engine), []).extend(prescribed)
    for run in runs:
        ladder = ladders.get((run.variant, run.engine))
        if not run.effort or ladder is None or run.role == FILM or _on(ladder, run):  # a film climbs no ladder
            groups.setdefault((run.variant, run.engine, run.role), []).append(run)
    results = {key: _result(key, group, _contrary_claim(case, key, group)) for key, group in groups.items()}
    for (name, _, role), result in results.items():
        claims = () if role == "main" else chain.from_iterable(run.undetermined for run in result.runs)
        result.open = _of_variants(case, (name,)) | Openness.of(claims)
    for variant in case.run.variants:
        if variant.refined is None:
            continue
        counts = [(getattr(variant, key), getattr(variant.refined, key)) for key in ("segments", "pieces")]
        ratio = next((fine / coarse for coarse, fine in counts if fine is not None), 2.0)
        for engine in variant.engines:
            main, refined = results.get((variant.name, engine, "main")), results.get((variant.name, engine, "refined"))
            if main is not None:
                main.refined = refined or _never_recorded(variant.name, engine)
                main.refinement = (ratio, variant.refined.order)
    return CaseResults(case, results)


def _contrary_claim(case: CaseRecord, key: Key, group: Iterable[RunRecord]) -> str:
    """What an engine calls undetermined though the motion determines it, in words; "" if there is nothing.

    A contrary claim fails its author: it would take its wrong loads out of the session. The scene of a control is
    another one, whose loads may be undetermined; a fault that is not compared there is not noticed.
    """
    variant, _, role = key
    info = case.variants.get(variant)
    named = Openness.of(chain.from_iterable(run.undetermined for run in group))
    if role != "main" or info is None or not named:
        return ""
    if isinstance(info.undetermined, msgspec.UnsetType):
        return f"undetermined has {named.names[0]!r}, which this older record cannot show: run the case again"
    contrary = named.beyond(Openness.of(info.undetermined)).names
    return f"undetermined has {contrary[0]!r:.80}: the motion of the scene determines it" if contrary else ""


def _malformed(run: RunRecord) -> str:
    """Why the signals of a finished run are not arrays (T, k) at T sample times; "" if they are."""
    if run.status != "finished":
        return ""
    if run.times is None:
        return "its record holds no times"
    samples = run.times.shape
    for name, packed in run.channels.items():
        if len(samples) != 1 or samples[0] == 0 or len(packed.shape) != 2 or packed.shape[0] != samples[0]:
            return f"its record holds {name} of shape {packed.shape} at times of shape {samples}"
    return ""


def _never_recorded(variant: str, engine: str) -> Result:
    return Result(variant, engine, "did not run", "no run of it is recorded: the session was cut short", ())


def _on(ladder: Sequence[tuple[str, str, float]], run: RunRecord) -> bool:
    """Whether a run is one of the efforts that the case prescribes now, at its present rung."""
    place = slice(run.rung, run.rung + 1)
    return run.rungs == len(ladder) and list(ladder[place]) == [(run.effort_kind, run.effort_method, run.effort_value)]


def _without_effect(ladder: Sequence[RunRecord]) -> bool:
    """Whether the last two efforts made as many evaluations and gave the same result.

    Then the engine ignored the effort (say, since sample times limit the step), and equality means nothing.
    """
    return len(ladder) >= 2 and _same(*ladder[-2:])


def _same(one: RunRecord, other: RunRecord) -> bool:
    """Whether two runs made as many evaluations and gave the same result in every channel of the second."""
    return one.evaluations == other.evaluations and all(
        name in one.channels and one.channels[name].data == packed.data for name, packed in other.channels.items()
    )


def _past(status: RunStatus) -> str:
    """A status as the verb of a sentence about a run."""
    return f"was {status}" if status == "refused" else status


def _result(key: Key, group: list[RunRecord], claim: str) -> Result:
    """A result from the runs with the same scene and key as the last record; a contrary `claim` of them fails it."""
    variant, engine, _ = key
    last = group[-1]
    if not last.effort:
        if last.status == "finished":  # only a damaged record says so
            return Result(variant, engine, "failed", "its record names no effort", ())
        return Result(variant, engine, last.status, last.message, ())
    stamp = (last.scene, last.version, last.rungs, last.made_by)
    same = [run for run in group if run.effort and (run.scene, run.version, run.rungs, run.made_by) == stamp]
    rungs = {run.rung: run for run in same}  # of two ladders of the same length the later runs count
    runs = tuple(rungs[rung] for rung in sorted(rungs))
    finest = runs[-1]
    ending = next((run for run in reversed(runs) if run.status not in ("finished", "diverged")), None)
    refuses_some = {run.status == "refused" for run in runs} == {True, False}  # a scene is refused as a whole
    if ending is not None and (refuses_some or ending.rung < ending.rungs - 1):  # whoever fails any effort has failed
        message = f"effort {ending.effort} {_past(ending.status)}: {ending.message}"
        status = "failed" if ending.status == "refused" and refuses_some else ending.status
        return Result(variant, engine, status, message, runs)
    if finest.rung < finest.rungs - 1:
        message = "the finest effort is not recorded: the session was cut short"
        return Result(variant, engine, "did not run", message, runs)
    fault = _malformed(finest)
    if fault or claim:
        return Result(variant, engine, "failed", fault or claim, runs)
    if finest.status != "diverged":
        return Result(variant, engine, finest.status, finest.message, runs)
    reached = 0.0 if finest.times is None else float(np.max(unpack(finest.times), initial=0.0))
    message = f"diverged at t = {reached:.4g} s: {finest.message}"
    return Result(variant, engine, "diverged", message, runs, reached)
