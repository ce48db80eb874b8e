"""The known engines: whether each is installed, in which version, and how to install it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from crosscheck.engines.registry import (
    BUILT_IN,
    OWN_CODE,
    PROVIDER,
    NoSuchEngine,
    find_engine,
    known_engine,
    plug_ins,
)
from crosscheck.engines.unusable import Unusable
from crosscheck.library.case_error import CaseError
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Scheduler, Work

ANSWER_LIMIT_S = 60.0
SECOND = "native-radau5"
ABSENT, USELESS = "not installed", "does not work"  # why an engine cannot be used

if TYPE_CHECKING:
    from flexmb.scene.schema import Scene


@dataclass(frozen=True)
class EngineState:
    """An engine: a one-line summary, its version, or None with the kind of `absence` and how to install it."""

    name: str
    version: str | None
    advice: str
    summary: str = ""
    absence: str = ABSENT


def describe_engines() -> list[EngineState]:
    """All engines, built-in ones and plug-ins; plug-ins are asked in their own processes."""
    return _describe((*BUILT_IN, *plug_ins()), PROVIDER, run_jobs)


def codes_for(scenes: Sequence[Scene]) -> list[str]:
    """The engines that are installed and work, but for built-in ones that can represent none of the scenes; of our own
    only the first, as the others share its code."""
    names = [state.name for state in describe_engines() if state.version and state.name not in OWN_CODE[1:]]
    return [name for name in names if name not in BUILT_IN or any(_takes(name, scene) for scene in scenes)]


def partner_of(scene: Scene, codes: Iterable[str]) -> str:
    """The first of the built-in codes beside our own that can represent a scene; our own second method without one."""
    others = (name for name in codes if name in BUILT_IN and name not in OWN_CODE)
    return next((name for name in others if _takes(name, scene)), SECOND)


def _takes(name: str, scene: Scene) -> bool:
    return find_engine(PROVIDER, name).supports(scene).kind != "no"


def require_engines(
    names: Iterable[str], broken: bool = False, provider: str = PROVIDER, scheduler: Scheduler = run_jobs
) -> None:
    """Engines that a user names, before anything runs: CaseError unless all of them are installed and work.

    With `broken` those that do not work may be named too, to find out why. What a case names by itself is not required:
    its absence is a status of its runs.
    """
    names = tuple(dict.fromkeys(names))
    try:
        for name in names:
            known_engine(provider, name)
    except NoSuchEngine as error:
        raise CaseError(f"{error}; `crosscheck engines` shows them") from None
    for state in _describe(names, provider, scheduler):
        if state.version is None and not (broken and state.absence == USELESS):
            why = f"is {ABSENT}" if state.absence == ABSENT else state.absence
            raise CaseError(f"engine {state.name} {why}: {state.advice}")


def tell(asked: tuple[str, str], emit: Callable[[EngineState], None]) -> None:
    """The job of a worker that describes an engine: its provider and name."""
    emit(_state(*asked))


def _describe(names: Sequence[str], provider: str, scheduler: Scheduler) -> list[EngineState]:
    """The states of engines; all but built-in ones are asked in processes of their own."""
    others = [(provider, name) for name in names if name not in BUILT_IN]
    reasons = {name: _useless(name, "it gave no answer") for _, name in others}
    reasons |= {name: _state(provider, name) for name in names if name in BUILT_IN}
    if others:
        with tempfile.TemporaryDirectory() as folder:
            log = str(Path(folder) / "log")
            for event in scheduler(Work(tell, others, log, 1, str, lambda asked: ANSWER_LIMIT_S)):
                _, name = others[event.job]
                if event.kind == "emitted":
                    reasons[name] = event.content
                elif event.kind in ("crashed", "stopped"):
                    reasons[name] = _useless(name, event.content)
    return [reasons[name] for name in names]


def _state(provider: str, name: str) -> EngineState:
    from crosscheck.engines.answers import checked_version, clean, describe  # after the names, which need it not
    from crosscheck.engines.contract import EngineMissing

    summary = ""
    try:
        engine_state = find_engine(provider, name)
        summary = clean(str(getattr(engine_state, "summary", "")))
        return EngineState(name, checked_version(engine_state.version()), "", summary)
    except EngineMissing as error:
        return EngineState(name, None, clean(str(error)), summary)
    except Unusable as error:
        return _useless(name, str(error))
    except Exception as error:
        return _useless(name, describe(error))


def _useless(name: str, why: str) -> EngineState:
    from crosscheck.engines.answers import clean

    return EngineState(name, None, clean(why), absence=USELESS)
