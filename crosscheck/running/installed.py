"""The known engines: whether each is installed, in which version, and how to install it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from crosscheck.engines.answers import checked_version, clean, describe
from crosscheck.engines.contract import EngineMissing
from crosscheck.engines.registry import BUILT_IN, BrokenPlugIn, engine, plug_ins
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Work

ANSWER_LIMIT_S = 60.0


@dataclass(frozen=True)
class EngineState:
    """An engine: a one-line summary, its version, or None with the kind of `absence` and how to install it."""

    name: str
    version: str | None
    advice: str
    summary: str = ""
    absence: str = "not installed"


def describe_engines() -> list[EngineState]:
    """All engines, built-in ones and plug-ins; plug-ins are asked in their own processes."""
    states = [_state(name) for name in BUILT_IN]
    names = plug_ins()
    found = {name: _useless(name, "it gave no answer") for name in names}
    with tempfile.TemporaryDirectory() as folder:
        log = str(Path(folder) / "log")
        for event in run_jobs(Work(tell, names, log, 1, str, lambda name: ANSWER_LIMIT_S)):
            name = names[event.job]
            if event.kind == "emitted":
                found[name] = event.content
            elif event.kind in ("crashed", "stopped"):
                found[name] = _useless(name, event.content)
    return [*states, *(found[name] for name in names)]


def tell(name: str, emit: Callable[[EngineState], None]) -> None:
    """The job of a worker that describes an engine."""
    emit(_state(name))


def _state(name: str) -> EngineState:
    summary = ""
    try:
        found = engine(name)
        summary = clean(str(getattr(found, "summary", "")))
        return EngineState(name, checked_version(found.version()), "", summary)
    except EngineMissing as error:
        return EngineState(name, None, clean(str(error)), summary)
    except BrokenPlugIn as error:
        return _useless(name, str(error))
    except Exception as error:
        return _useless(name, describe(error))


def _useless(name: str, why: str) -> EngineState:
    return EngineState(name, None, clean(why), absence="does not work")
