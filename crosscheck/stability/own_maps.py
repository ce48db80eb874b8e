"""The maps of a user's Python file."""

from __future__ import annotations

from pathlib import Path

from crosscheck.library.case_error import CaseError
from crosscheck.library.code import executed
from crosscheck.stability.map import StabilityMap


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
