"""A digest of the code that this process runs: workers on other machines must run the same."""

from __future__ import annotations

import hashlib
from functools import cache

from crosscheck.library.own_files import OURS, source_folder


@cache  # computed once: later edits of the files are not what this process has loaded
def code_here() -> str:
    """Digest of all sources of flexmb and crosscheck that this process has imported from."""
    digest = hashlib.sha256()
    for package in OURS:
        root = source_folder(package)
        for file in sorted(root.rglob("*.py")):
            digest.update(f"{package}/{file.relative_to(root).as_posix()}\n".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]
