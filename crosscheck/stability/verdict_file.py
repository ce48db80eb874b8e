"""The file with verdicts of maps, to which several runs of different maps write."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from crosscheck.records.archive import BrokenRecords
from crosscheck.stability.boundary import MapVerdict
from flexmb.output.files import take_away, write_whole
from flexmb.scene.reading import regular_size

VERDICTS = "maps.json"


def write_verdicts(verdicts: Sequence[MapVerdict], file: Path) -> None:
    """Write verdicts into a JSON file; those of other maps in it are kept.

    A file with other content is renamed to `<file>.broken`, with a warning, so that the verdicts can be
    written.
    """
    try:
        known = {verdict.map: verdict for verdict in read_verdicts(file)} if file.exists() else {}
    except ValueError as error:
        aside = file.replace(file.with_name(file.name + ".broken"))
        warnings.warn(f"{error}; moved to {aside.name}", BrokenRecords, stacklevel=2)
        known = {}
    _write(known | {verdict.map: verdict for verdict in verdicts}, file)


def take_away_verdicts(maps: Sequence[str], file: Path) -> None:
    """Remove the verdicts on maps that are about to run from the file, so that a killed run leaves none.

    A file with other content stays until there are new verdicts. Without verdicts the file is removed, since an empty
    list would look like success.
    """
    try:
        known = {verdict.map: verdict for verdict in read_verdicts(file)} if file.exists() else {}
    except ValueError:
        return
    left = {name: verdict for name, verdict in known.items() if name not in maps}
    if left:
        _write(left, file)
    else:
        take_away(file)


def _write(verdicts: Mapping[str, MapVerdict], file: Path) -> None:
    text = msgspec.json.format(msgspec.json.encode([verdicts[name] for name in sorted(verdicts)]), indent=1)
    write_whole(file, text + b"\n")


def read_verdicts(file: Path) -> list[MapVerdict]:
    """The verdicts that `write_verdicts` wrote. Raises OSError, or ValueError naming the file."""
    text = file.read_bytes() if regular_size(file) else b""
    try:
        return msgspec.json.decode(text, type=list[MapVerdict])
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file}: these are no verdicts on maps: {error}") from None
