"""Writing and reading results.json, a canonical text that contains its own digest.

The canonical form is what Python's ``json.dumps`` writes with sorted keys, without spaces, in ASCII. The seal is the
SHA-256 of that form without the key ``sha256``. A file is accepted if it is the canonical form of its contents, with
its seal, and one line end, so that every changed byte is noticed. To check one by other means::

    jq -cS 'del(.sha256)' results.json | tr -d '\n' | sha256sum     # where jq prints numbers as they stand
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import msgspec

from crosscheck.library.digests import case_digests
from crosscheck.library.own_files import code_here
from crosscheck.sealed.document import FORMAT, VERSION, SealedResults
from flexmb.output.files import write_whole
from flexmb.scene.reading import MIB, Unreadable, read_bytes

FILE = "results.json"
LIMIT = 256 * MIB
SEAL = "sha256"


class ResultsError(ValueError):
    """A results.json that cannot be read, is of another format, or was changed after it was written."""


def sealed_text(results: SealedResults) -> str:
    """The text of results.json."""
    content = msgspec.to_builtins(results)
    return _canonical(content | {SEAL: seal_of(content)}) + "\n"


def write_results(results: SealedResults, folder: Path) -> None:
    """Write results.json into a folder."""
    write_whole(folder / FILE, sealed_text(results))


def read_results(file: Path) -> SealedResults:
    """The content of a results.json; ResultsError if the file is invalid."""
    try:
        data = read_bytes(file, LIMIT)  # the very bytes: a byte order mark and other line ends are changes too
        content = json.loads(data.decode("ascii"), parse_constant=_no_number, parse_float=_finite)
    except UnicodeDecodeError as error:
        what = f"byte {error.start} is not ASCII, so another program saved it: fetch it anew"
        raise ResultsError(f"{file} cannot be read: {what}") from None
    except (OSError, Unreadable, ValueError, RecursionError) as error:
        raise ResultsError(f"{file} cannot be read: {error}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ResultsError(f"{file} is no results.json of crosscheck")
    if content.get("version") != VERSION:
        raise ResultsError(f"{file} is of version {content.get('version')!r:.40}: this crosscheck reads {VERSION}")
    claimed = content.pop(SEAL, None)
    if claimed != seal_of(content) or data != (_canonical(content | {SEAL: claimed}) + "\n").encode("ascii"):
        raise ResultsError(f"{file} was changed after it was written: its seal does not fit what it says")
    try:
        return msgspec.convert(content, SealedResults)
    except msgspec.ValidationError as error:
        raise ResultsError(f"{file}: {error}") from None


def read_finished(file: Path) -> SealedResults:
    """The results of a session that has come to its end; ResultsError for any other."""
    results = read_results(file)
    if results.unfinished:
        began = f", begun at {results.made.at}" if results.made.at else ""
        raise ResultsError(f"{file} is unfinished{began}: the session runs, or it was killed. Run it to its end")
    return results


def seal_of(content: dict[str, Any]) -> str:
    """The digest of the canonical form; ValueError where it holds a number that JSON has not."""
    return hashlib.sha256(_canonical(content).encode("ascii")).hexdigest()


def _canonical(content: dict[str, Any]) -> str:
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number")


def _finite(word: str) -> float:
    """A number with a point or an exponent; one that overflows, such as 1e999, is an error."""
    return float(word) if math.isfinite(float(word)) else _no_number(word)


# A stamp on what a command found about a folder: by which files of it, by which code, and a seal over all of that. What
# bears a stamp is evidence only as long as files and code are the same. The seal is that of results.json: it notices
# that a number was changed after it was written, and is no signature.

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
