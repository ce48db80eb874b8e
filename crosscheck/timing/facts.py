"""Statements of engines for a timing report: their algorithm and how they are run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from crosscheck.engines.answers import clean
from crosscheck.engines.registry import NoSuchEngine, find_engine

UNSAID = "it does not say with which settings it runs"


@dataclass(frozen=True)
class EngineFacts:
    """An engine's `algorithm` ("" if unknown) and its `settings`, in words."""

    algorithm: str
    settings: str


def facts_of(names: Iterable[str], provider: str) -> dict[str, EngineFacts]:
    """The facts of each engine by its name; of an engine that cannot be made the reason."""
    return {name: _facts(name, provider) for name in names}


def _facts(name: str, provider: str) -> EngineFacts:
    try:
        engine = find_engine(provider, name)
        algorithm, settings = (getattr(engine, what, "") for what in ("algorithm", "settings"))
    except NoSuchEngine as error:
        return EngineFacts("", str(error))
    except Exception as error:  # a plug-in may raise anything
        return EngineFacts("", clean(f"it cannot be asked: {error}"))
    return EngineFacts(clean(str(algorithm)), clean(str(settings)) or UNSAID)
