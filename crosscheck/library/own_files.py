"""The source files of flexmb and crosscheck, which crosscheck reads: the key of a record is a digest of them.

Imported from a zip file, in a frozen program or without sources, flexmb works. But crosscheck
could not distinguish the records of different states of the code, nor find its cases: it refuses to run.
"""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from crosscheck.library.case_error import CaseError

OURS = ("flexmb", "crosscheck")


def source_folder(package: str) -> Path:
    """Folder of the source files of `flexmb` or `crosscheck`; CaseError if they are no files."""
    spec = find_spec(package)
    folder = Path(spec.origin).parent if spec is not None and spec.origin is not None else None
    if folder is None or not (folder / "__init__.py").is_file():
        place = folder or "what it was loaded from"
        raise CaseError(
            f"crosscheck reads the source files of {package}, and {place} has none: from a zip file, in a frozen "
            "program or without sources only flexmb runs. Install both with pip to run crosscheck."
        )
    return folder


@cache  # computed once: later edits of the files are not what this process has loaded
def code_here() -> str:
    """Digest of all sources of flexmb and crosscheck that this process imported; workers must have the same."""
    digest = hashlib.sha256()
    for package in OURS:
        root = source_folder(package)
        for file in sorted(root.rglob("*.py")):
            digest.update(f"{package}/{file.relative_to(root).as_posix()}\n".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]
