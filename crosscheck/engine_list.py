"""Which engines there are here: what they are, installed or not, in which version, and how to get them."""

from __future__ import annotations

from dataclasses import dataclass

from crosscheck.engines.contract import EngineMissing
from crosscheck.engines.registry import engines


@dataclass(frozen=True)
class EngineState:
    """An engine: what it is in a line, its version, or None and how to install it."""

    name: str
    version: str | None
    advice: str
    summary: str = ""


def describe_engines() -> list[EngineState]:
    """All engines known here, shipped ones and plug-ins."""
    states = []
    for name, engine in engines().items():
        summary = getattr(engine, "summary", "")
        try:
            states.append(EngineState(name, engine.version(), "", summary))
        except EngineMissing as error:
            states.append(EngineState(name, None, str(error), summary))
    return states
