"""No bad engine makes a session green, and none moves a verdict between others, on a tree and on closed chains."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import numpy as np
import pytest

from crosscheck.engines.registry import PROVIDER
from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import collect
from crosscheck.library.channels import LINEAR_KINDS, is_judged, part_of
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.records.archive import read
from crosscheck.records.kinds import CaseRecord, RunRecord
from crosscheck.records.packing import Packed, pack, unpack
from crosscheck.records.session import last_session
from crosscheck.report.charts import payload
from crosscheck.running.plan import plan
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Limits
from flexmb.typing import Real
from tests.crosscheck.bad_engines import BESIDE_OPEN, FATAL, HARMLESS, WRONG
from tests.crosscheck.sessions import CASE, run_case, run_here

SHIPPED = Path(__file__).parents[3] / "cases" / "closed_chains" / "four_bar" / "scene.toml"
HEAD = """
title = "Spoilt"
duration_s = {duration}
samples = 21
"""
VARIANT = """
[[variant]]
name = "{name}"
{scene}
engines = ["{one}", "{two}"{more}]
{efforts}

[[comparison]]
name = "{name}, all"
variant = "{name}"
goals = {{ marker = 1e-4, load = 1e-3, energy = 1e-4, momentum = 1e-3 }}

[[conservation]]
variant = "{name}"
quantity = "energy"
limit = 1e-3
engines = ["{one}", "{two}"]

[[control]]
name = "{name}, too heavy"
mutation = "mass"
target = "{target}"
a = {{ variant = "{name}", engine = "{one}" }}
b = {{ variant = "{name}", engine = "{two}" }}
goals = {{ {seen} }}
"""


@dataclass(frozen=True)
class Kind:
    """A case: its folder, provider of engines, two sound engines, duration and variants with their scene files."""

    provider: str
    sound: tuple[str, str]
    duration: float
    variants: dict[str, str]
    target: str
    seen: str
    efforts: str = ""

    def text(self, *more: str) -> str:
        """The run file with more engines."""
        one, two = self.sound
        efforts = ", ".join(self.efforts.format(engine) for engine in (one, two, *more) if self.efforts)
        return HEAD.format(duration=self.duration) + "".join(
            VARIANT.format(
                name=name, scene=f'scene = "{scene}"' if scene else "", one=one, two=two, target=self.target,
                more="".join(f', "{each}"' for each in more), seen=self.seen,
                efforts=f"efforts = [{efforts}]" if efforts else "",
            )
            for name, scene in self.variants.items()
        )  # fmt: skip


KINDS = {
    "tree": Kind(
        "tests.crosscheck.bad_engines:of_pendulum", ("one", "two"), 2.0, {"rigid": ""},
        "rod", '"load:pivot.force" = 1e-4',
    ),
    "chain": Kind(
        "tests.crosscheck.bad_engines:of_chain", ("native", "native-composite"), 0.4,
        {"determined": "", "redundant": "redundant.toml"}, "coupler", '"marker:joint.position" = 1e-6',
        '{{ engine = "{}", kind = "tolerance", method = "dop853", values = [1e-6, 1e-8, 1e-10] }}',
    ),
}  # fmt: skip
BY_DEFAULT = {
    "tree": (
        "claims-all-void", "raises-when-coarsest", "nan-later", "no-loads", "a-sample-late", "modest", "minus-force",
    ),
    "chain": ("claims-all", "minus-force", "boastful", "any-open-loads"),
}


def parameters(names: Any) -> list[Any]:
    return [
        pytest.param(kind, name, marks=() if name in BY_DEFAULT[kind] else pytest.mark.slow)
        for kind in KINDS
        for name in names
    ]


@dataclass(frozen=True)
class Sound:
    """A session without a bad engine, whose records others start from."""

    kind: Kind
    case: Path
    records: Path
    outcome: SessionOutcome

    def beside(self, folder: Path, bad: str, **options: Any) -> SessionOutcome:
        """The session with a bad engine; what the sound ones did is recorded."""
        case = folder / self.case.parent.name / self.case.name
        shutil.copytree(self.case, case)
        (case / "run.toml").write_text(self.kind.text(bad), encoding="utf-8")
        shutil.copy(self.records, folder / "records.jsonl")
        return run_case(case, folder / "records.jsonl", provider=self.kind.provider, **options)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Sound]:
    found = {}
    for name, kind in KINDS.items():
        folder = tmp_path_factory.mktemp(name)
        case = folder / "spoilt" / name
        shutil.copytree(CASE, case)
        if name == "chain":
            shutil.copy(SHIPPED, case / "scene.toml")
            text = SHIPPED.read_text(encoding="utf-8").replace('type = "spherical"', 'type = "revolute"')
            (case / "redundant.toml").write_text(text, encoding="utf-8")
        (case / "run.toml").write_text(kind.text(), encoding="utf-8")
        outcome = run_case(case, folder / "records.jsonl", provider=kind.provider)
        assert outcome.ok and not outcome.lost_controls, outcome.headline
        found[name] = Sound(kind, case, folder / "records.jsonl", outcome)
    assert (found["tree"].outcome.partly_determined, found["chain"].outcome.partly_determined > 0) == (0, True)
    return found


def holds(alone: SessionOutcome, beside: SessionOutcome, bad: str) -> None:
    """No verdict that the bad engine has no part in differs."""
    theirs = [each for each in beside.all if bad not in (each.engine_a, each.engine_b)]
    assert theirs == alone.all
    assert [each for each in beside.inapplicable if each.engine != bad] == list(alone.inapplicable)
    assert beside.lost_controls == alone.lost_controls


@pytest.mark.parametrize(("kind", "bad"), parameters(WRONG))
def test_a_wrong_engine_is_never_green_and_moves_no_verdict_of_others(tmp_path, sound, kind, bad):
    beside = sound[kind].beside(tmp_path, bad)
    holds(sound[kind].outcome, beside, bad)
    assert not beside.ok, beside.headline


@pytest.mark.parametrize(("kind", "bad"), parameters(HARMLESS))
def test_what_is_not_wrong_stays_green(tmp_path, sound, kind, bad):
    """Also numbers where the motion determines none: they are compared with nothing."""
    beside = sound[kind].beside(tmp_path, bad)
    holds(sound[kind].outcome, beside, bad)
    assert beside.ok, [each.reason for each in beside.unexpected]
    assert any(bad in (each.engine_a, each.engine_b) for each in beside.all)


@pytest.mark.parametrize("bad", BESIDE_OPEN)
def test_what_is_wrong_beside_open_components_is_noticed_there_alone(tmp_path, sound, bad):
    """A wrong value in a determined component, one that is none, and a claim that it is open."""
    beside = sound["chain"].beside(tmp_path, bad)
    holds(sound["chain"].outcome, beside, bad)
    mine = [each for each in beside.all if bad in (each.engine_a, each.engine_b)]
    assert {each.variant_a for each in mine if not each.ok} == {"redundant"}
    if bad == "wrong-beside-open":
        wrong = [each for each in mine if not each.ok]
        assert {each.status for each in wrong} == {"differ"} and {each.channel[:5] for each in wrong} == {"load:"}
        assert all("not determined and not compared" in each.reason for each in wrong)
    else:
        said = {"nan-beside-open": "is not finite", "claims-beside-open": "the motion of the scene determines it"}
        assert all(each.status == "failed" and said[bad] in each.reason for each in mine if not each.ok)


def test_numbers_in_open_components_need_no_verdict_in_a_strict_session(tmp_path, sound):
    """They are judged by nothing, and are nothing that must be judged; what they are is told by component."""
    beside = sound["chain"].beside(tmp_path, "any-open-loads")
    assert not beside.unexpected and {each.channel for each in beside.unaccounted} <= {"work"}
    told = {each.channel for each in beside.inapplicable if each.engine == "any-open-loads"}
    assert "load:loop.force[z]" in told and "load:loop.torque[x, y]" in told


def test_charts_draw_determined_components_alone(sound):
    (case,) = collect(last_session(read(sound["chain"].records))).cases
    panels = payload(case, sound["chain"].outcome.verdicts[case.case.case])["panels"]
    drawn = {
        (panel["comparison"].partition(",")[0], channel["name"]): channel["components"]
        for panel in panels
        for channel in panel["channels"]
    }
    assert drawn["redundant", "load:loop.force"] == ["x", "y"] and drawn["redundant", "load:loop.torque"] == ["z"]
    assert drawn["determined", "load:loop.force"] == drawn["redundant", "marker:joint.position"] == ["x", "y", "z"]


@pytest.mark.slow
@pytest.mark.parametrize("bad", FATAL)
@pytest.mark.parametrize("kind", KINDS)
def test_a_process_that_dies_or_hangs_moves_no_verdict_of_others(tmp_path, sound, kind, bad):
    limits = Limits(time_s=8.0 if kind == "tree" else 40.0)  # the chain's engine loads its kernels
    beside = sound[kind].beside(tmp_path, bad, scheduler=run_jobs, limits=limits)
    holds(sound[kind].outcome, beside, bad)
    assert not beside.ok


MINE = "mine"
SPOILED: dict[str, Callable[[Real], Real]] = {
    "reversed": lambda values: -values, "zero": np.zeros_like, "doubled": lambda values: 2.0 * values,
    "off by one": lambda values: values + 1.0,
}  # fmt: skip
LINEARISED = tuple(sorted(f"linearised/{folder.name}" for folder in (shipped_folder() / "linearised").iterdir()))
ROUNDING = 1e-9  # SI: a channel that is zero up to it cannot be told from its negative
OTHERS = ("pendulums/compound", "tops/sleeping")


@cache
def session(name: str) -> tuple[CaseRecord, tuple[RunRecord, ...]]:
    """The record of a case that an engine joins, and native's runs of it."""
    asked = ("native", MINE)
    record, jobs = plan(load_case(shipped_folder() / name), asked, PROVIDER)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "records.jsonl"
        run_here([(record, [job for job in jobs if job.engine == "native"])], asked, file)
        return record, tuple(each for each in read(file) if isinstance(each, RunRecord))


def joined(name: str, spoil: Callable[[str, Packed], Packed] = lambda channel, packed: packed) -> SessionOutcome:
    """The strict outcome of a session of native and a spoiled copy of it."""
    record, runs = session(name)
    copies = [
        msgspec.structs.replace(
            run, engine=MINE, channels={channel: spoil(channel, packed) for channel, packed in run.channels.items()}
        )
        for run in runs
        if run.role == "main"
    ]
    return conclude(collect([record, *runs, *copies]), strict=True)


def spoilt(name: str, channel: str) -> list[str]:
    """The ways of spoiling a channel that change it, and are not noticed."""
    _, runs = session(name)
    unnoticed = []
    for how, change in SPOILED.items():

        def spoil(each: str, packed: Packed, change: Callable[[Real], Real] = change) -> Packed:
            return pack(change(unpack(packed))) if each == channel else packed

        changes = any(np.max(np.abs(change(values) - values)) > ROUNDING for values in _values(runs, channel))
        changes = changes and not (how == "reversed" and channel.endswith(".orientation"))  # it is the same one
        if changes and joined(name, spoil).ok:
            unnoticed.append(how)
    return unnoticed


def _values(runs: Sequence[RunRecord], channel: str) -> list[Real]:
    return [unpack(run.channels[channel]) for run in runs if run.role == "main" and channel in run.channels]


def channels(name: str) -> list[str]:
    """The channels that native offers in the variants that it runs."""
    _, runs = session(name)
    return sorted({channel for run in runs if run.role == "main" for channel in run.channels if is_judged(channel)})


@pytest.mark.parametrize("name", [*LINEARISED, *OTHERS])
def test_a_wrong_derivative_of_an_engine_that_joins_is_noticed(name: str) -> None:
    assert joined(name).ok, joined(name).headline
    linear = [channel for channel in channels(name) if channel.startswith(LINEAR_KINDS)]
    assert len(linear) == 4
    assert {channel: spoilt(name, channel) for channel in linear} == {channel: [] for channel in linear}


@pytest.mark.parametrize("name", [*LINEARISED, *OTHERS])
def test_a_wrong_channel_of_an_engine_that_joins_is_noticed(name: str) -> None:
    """One of each part of each kind, in a strict session also where the case has no goal: it is held against others."""
    others = [channel for channel in channels(name) if not channel.startswith(LINEAR_KINDS)]
    each = {part_of(channel): channel for channel in others}.values()
    assert {channel: spoilt(name, channel) for channel in each} == {channel: [] for channel in each}
