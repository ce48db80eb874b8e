"""No bad engine makes a session green, and none moves a verdict between others, on a tree and on closed chains."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Limits
from tests.crosscheck.bad_engines import FATAL, HARMLESS, WRONG
from tests.crosscheck.sessions import CASE, run_case

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
    assert (found["tree"].outcome.undetermined, found["chain"].outcome.undetermined > 0) == (0, True)
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


@pytest.mark.slow
@pytest.mark.parametrize("bad", FATAL)
@pytest.mark.parametrize("kind", KINDS)
def test_a_process_that_dies_or_hangs_moves_no_verdict_of_others(tmp_path, sound, kind, bad):
    limits = Limits(time_s=8.0 if kind == "tree" else 40.0)  # the chain's engine loads its kernels
    beside = sound[kind].beside(tmp_path, bad, scheduler=run_jobs, limits=limits)
    holds(sound[kind].outcome, beside, bad)
    assert not beside.ok
