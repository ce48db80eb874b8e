"""Versions of installed distributions."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def version_of(distribution: str) -> str:
    """The version; "source" for a source tree that is on the path but not installed."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "source"
