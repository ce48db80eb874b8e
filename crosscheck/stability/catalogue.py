"""All stability maps by name; every module in `maps` lists its own as `MAPS`."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from crosscheck.stability import maps
from crosscheck.stability.map import StabilityMap


def stability_maps() -> dict[str, StabilityMap]:
    """The maps, by name."""
    modules = (import_module(f"{maps.__name__}.{module.name}") for module in iter_modules(maps.__path__))
    found = [what for module in modules for what in module.MAPS]
    return {what.name: what for what in sorted(found, key=lambda what: what.name)}
