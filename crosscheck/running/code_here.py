"""The code that a machine runs, as one digest: workers elsewhere must run the same."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import crosscheck
import flexmb


@cache  # the first reading counts: what is edited while this process runs is not what it has loaded
def code_here() -> str:
    """Digest of all sources of flexmb and crosscheck that this process has imported from."""
    digest = hashlib.sha256()
    for package in (flexmb, crosscheck):
        root = Path(str(package.__file__)).parent
        for file in sorted(root.rglob("*.py")):
            digest.update(f"{package.__name__}/{file.relative_to(root).as_posix()}\n".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]
