"""Stability maps by name: those of crosscheck, one `MAPS` for each module in `maps`, and those of a user's file."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from crosscheck.library.case_error import CaseError
from crosscheck.library.code import executed
from crosscheck.stability import maps
from crosscheck.stability.map import StabilityMap


def stability_maps() -> dict[str, StabilityMap]:
    """The maps of crosscheck, by name."""
    modules = (import_module(f"{maps.__name__}.{module.name}") for module in iter_modules(maps.__path__))
    found = [what for module in modules for what in module.MAPS]
    return {what.name: what for what in sorted(found, key=lambda what: what.name)}


def maps_in(file: Path) -> dict[str, StabilityMap]:
    """The maps of a Python file, by name: those in its tuple `MAPS`. The file is executed.

    CaseError names the file: if it is not there or cannot be loaded, if user code was forbidden, if `MAPS` is no tuple
    of maps, and for names that are used twice or are no identifiers, as pictures and records are named by them.
    """
    found = getattr(executed(file, "its maps are asked for"), "MAPS", None)
    if not isinstance(found, tuple | list) or not found or not all(isinstance(what, StabilityMap) for what in found):
        raise CaseError(f"{file}: it has no maps: add MAPS, a tuple of crosscheck.stability.map.StabilityMap")
    known = {what.name: what for what in found}
    wrong = [name for name in known if not name.isidentifier()]
    if wrong or len(known) < len(found):
        why = f'"{wrong[0]}" is no identifier' if wrong else "a name is used twice"
        raise CaseError(f"{file}: {why}: name each of its maps by letters, digits and underscores, and differently")
    return known
