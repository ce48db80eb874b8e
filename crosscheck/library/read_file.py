"""Reading the files of cases, sweeps, references and measured sets: every error is a CaseError that names the file."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from crosscheck.library.case_error import CaseError
from flexmb.scene.convert import to_struct
from flexmb.scene.problems import SceneError
from flexmb.scene.reading import TEXT_LIMIT, Unreadable, parse_toml, read_text

T = TypeVar("T")


def text_of(file: Path, limit: int = TEXT_LIMIT, made_by: str = "") -> str:
    """The text of a file of at most `limit` bytes; CaseError names it, and `made_by` says what would make it."""
    try:
        return read_text(file, limit)
    except Unreadable as error:
        raise CaseError(f"{file}: {error}") from None
    except OSError as error:
        raise CaseError(f"{file}: {error.strerror}{made_by and f': {made_by}'}") from None


def struct_of(file: Path, kind: type[T], made_by: str = "") -> T:
    """What a TOML file holds, as a `kind`; CaseError names the file, each place in it that is wrong, and the remedy."""
    text = text_of(file, made_by=made_by)
    try:
        return to_struct(parse_toml(text), kind, str(file))
    except SceneError as error:  # its message would call the file a scene
        raise CaseError(f"{file}: {'; '.join(map(str, error.problems))}") from None
    except (Unreadable, RecursionError, OverflowError) as error:
        raise CaseError(f"{file}: {error}") from None
