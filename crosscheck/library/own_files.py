"""The source files of flexmb and crosscheck, which crosscheck reads: the key of a record is a digest of them.

Imported from a zip file, by the loader of a frozen program or without sources, flexmb computes as ever. But crosscheck
could not tell the records of one state of the code from those of another, nor find its cases: it refuses to begin.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from crosscheck.library.case_error import CaseError

OURS = ("flexmb", "crosscheck")


def source_folder(package: str) -> Path:
    """Folder of the source files of `flexmb` or `crosscheck`; CaseError where they are no files."""
    spec = find_spec(package)
    folder = Path(spec.origin).parent if spec is not None and spec.origin is not None else None
    if folder is None or not (folder / "__init__.py").is_file():
        place = folder or "what it was loaded from"
        raise CaseError(
            f"crosscheck reads the source files of {package}, and {place} has none: from a zip file, in a frozen "
            "program or without sources only flexmb runs. Install both with pip to run crosscheck."
        )
    return folder
