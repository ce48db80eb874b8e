"""A stamp on what a command found about a folder: by which files of it, by which code, and a seal over all of that.

What bears a stamp is evidence only as long as files and code are the same. The seal is that of results.json: it
notices that a number was changed after it was written, and is no signature.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from crosscheck.library.digests import case_digests
from crosscheck.library.own_files import code_here
from crosscheck.sealed.seal import SEAL, seal_of
from flexmb.output.files import write_whole

FILES, CODE = "files", "code"


def stamped(content: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Plain data on the folder, with the digests of its files and of our code, and the seal; NaN becomes None."""
    plain = msgspec.json.decode(msgspec.json.encode({**content, FILES: case_digests(folder), CODE: code_here()}))
    return {**plain, SEAL: seal_of(plain)}


def add_stamped(content: Mapping[str, Any], file: Path) -> Path:
    """Write stamped content by name into a file, beside what it holds of other names; what is no table is replaced."""
    try:
        before = msgspec.json.decode(file.read_bytes(), type=dict[str, Any])
    except (OSError, msgspec.DecodeError):
        before = {}
    write_whole(file, msgspec.json.format(msgspec.json.encode({**before, **content}), indent=1) + b"\n")
    return file


def unlike(files: Mapping[str, str], code: str, of_files: Mapping[str, str], of_code: str) -> str:
    """What differs from what evidence was made of, in words: names of `of_files`, or the code; "" if nothing does."""
    names = sorted(name for name in {*files, *of_files} if files.get(name) != of_files.get(name))
    if names:
        return f"{', '.join(names)} changed since"
    if not of_code:
        return "it does not say by which code it was made"
    return "" if code == of_code else "the code of flexmb and crosscheck changed since"


def opened(content: object, files: Mapping[str, str], code: str) -> tuple[str, str]:
    """Why stamped content is broken, and what has changed since it was made; both "" where it is evidence.

    `files` and `code` are the present digests.
    """
    if not isinstance(content, dict):
        return "it is no table", ""
    rest = {key: value for key, value in content.items() if key != SEAL}
    try:
        sealed = content.get(SEAL) == seal_of(rest)
    except ValueError:
        sealed = False
    if not sealed:
        return "it was changed after it was written: its seal does not fit", ""
    of_files, of_code = rest.get(FILES), rest.get(CODE)
    if not isinstance(of_files, dict) or not isinstance(of_code, str):
        return "it says neither files nor code", ""
    return "", unlike(files, code, of_files, of_code)
