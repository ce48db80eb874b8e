"""Records which special kernels were compiled ahead, so that the choice "auto" takes them.

The record is a file beside the kernels, whose name depends on the features and the compiler. The kernels themselves are
found by their own keys: if the record is older than the code, they are compiled anew.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path

from flexmb.jit.fingerprint import compiler
from flexmb.jit.folder import cache_directory, mark_used

SUFFIX = ".special"


def is_warm(features: frozenset[str]) -> bool:
    """Whether special kernels for exactly these features were compiled ahead."""
    note = _note(features)
    if note is None or not note.is_file():
        return False
    mark_used(note)
    return True


def note_warm(features: frozenset[str]) -> None:
    """Record that they were, if the folder is writable."""
    note = _note(features)
    if note is not None:
        with suppress(OSError):
            note.touch()


def _note(features: frozenset[str]) -> Path | None:
    folder = cache_directory()
    if folder is None:
        return None
    words = repr((sorted(features), compiler().hex()))
    return folder / f"{hashlib.sha256(words.encode()).hexdigest()[:32]}{SUFFIX}"
