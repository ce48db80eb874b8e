"""Digests of files: SHA-256 of one file, and of all files of a case."""

from __future__ import annotations

import hashlib
from pathlib import Path

OF_A_CASE = (".toml", ".csv", ".py")


def file_digest(file: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def case_digests(folder: Path) -> dict[str, str]:
    """Digests of the files in a case's folder that determine what is run and judged: scenes, rules, references."""
    files = sorted(file for file in folder.iterdir() if file.suffix in OF_A_CASE and file.is_file())
    return {file.name: file_digest(file) for file in files}
