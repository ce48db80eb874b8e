"""A case's stored reference: `reference.csv` with the numbers, `reference.toml` with the uncertainty of each channel.

`reference.csv` is in SI and World axes, time first, one quoted header line, 17 digits::

    "t [s]","marker:tip.position.x [m]","marker:tip.position.y [m]",...

`reference.toml` gives the uncertainty of every channel, the routes that made the numbers, the scene, the horizon,
and the digests of the csv and the provenance to which it belongs. `crosscheck regenerate` writes both files.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from crosscheck.library.case import CaseError, Variant
from crosscheck.library.find import Case
from crosscheck.library.read_file import struct_of, text_of
from crosscheck.library.work import StoredWork
from flexmb.run.channels import unit
from flexmb.scene.problems import SceneError
from flexmb.scene.reading import MIB, Unreadable, parse_toml
from flexmb.typing import Real

VALUES, KNOWLEDGE = "reference.csv", "reference.toml"
LIMIT = 64 * MIB
MADE_BY = "`crosscheck regenerate` makes it"
AGAIN = "run `crosscheck regenerate`"
ANEW = f"put back what it was, or delete both files and {AGAIN}"
TIME = "t [s]"


class Known(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The uncertainty of one channel (its SI unit, rad for orientations) at every sample up to the
    horizon, the channel's range `scale`, and in `how` the routes and the estimate."""

    uncertainty: float
    scale: float
    how: str


class Knowledge(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """reference.toml. `values`, `provenance` and `scene` are digests of reference.csv, of provenance.toml and of
    the variant (see `scene_digest`); `routes` describe how the numbers were made, `made_with` by which versions, and
    `work` what each effort of an engine took (`crosscheck.library.work`); older files do not say."""

    variant: str
    horizon_s: float
    values: str
    provenance: str
    scene: str
    routes: tuple[str, ...]
    made_with: tuple[str, ...]
    work: StoredWork = {}
    channels: dict[str, Known]


@dataclass(frozen=True)
class StoredReference:
    """A reference that was read and checked: channels (T, k) at `times` (T,), in SI and World axes."""

    times: Real
    channels: dict[str, Real]
    knowledge: Knowledge


def load_reference(folder: Path) -> StoredReference:
    """The reference of the case in `folder`; CaseError if there is none, or its files are inconsistent."""
    values, knowledge = text_of(folder / VALUES, LIMIT, MADE_BY), _knowledge(folder / KNOWLEDGE)
    if digest(values) != knowledge.values:
        raise CaseError(f"{folder / VALUES} was changed after {KNOWLEDGE} was written: {ANEW}")
    times, channels = parse_values(values, str(folder / VALUES))
    if set(channels) != set(knowledge.channels):
        raise CaseError(f"{folder / KNOWLEDGE} names other channels than {VALUES}: {ANEW}")
    return StoredReference(times, channels, knowledge)


def has_reference(folder: Path) -> bool:
    """Whether the case in `folder` has a stored reference."""
    return (folder / VALUES).exists() or (folder / KNOWLEDGE).exists()


def digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def scene_digest(case: Case, variant: Variant) -> str:
    """A digest of a variant: its scene file without comments, the files it names, and its transformation.

    The scene is taken before the transformation, whose results depend in their last digits on the machine.
    """
    try:
        scene = json.dumps(parse_toml(text_of(case.folder / variant.scene)), sort_keys=True, default=str)
        model = msgspec.structs.replace(
            variant,
            engines=(),
            also=(),
            efforts=(),
            refined=None,
            duration_s=None,
            samples=None,
            linear=msgspec.UNSET,
            note="",
        )
        digest = hashlib.sha256(scene.encode() + msgspec.json.encode(model))
        for body in case.scene(variant).bodies:
            file = getattr(body, "file", None)
            if file is not None:
                digest.update(Path(file).read_bytes())
    except (Unreadable, OSError, SceneError) as error:
        raise CaseError(f"{case.folder / variant.scene}: {error}") from None
    return digest.hexdigest()


def current_reference(case: Case) -> StoredReference:
    """The stored reference of a case, which must belong to the present case.

    CaseError if there is none, if its files are inconsistent, if it is of another variant than the run file
    asks for, or if the scene was changed after it was made.
    """
    stored = load_reference(case.folder)
    place = f"{case.folder / KNOWLEDGE}:"
    of, recipe = stored.knowledge.variant, case.run.reference
    if recipe is not None and recipe.variant != of:
        raise CaseError(f'{place} it is of variant "{of}", [reference] asks for "{recipe.variant}": {AGAIN}')
    variant = case.run.variant(of)
    if scene_digest(case, variant) != stored.knowledge.scene:
        raise CaseError(f"{place} {variant.scene} or its variant was changed after the reference was made: {AGAIN}")
    return stored


def column_names(channel: str, width: int) -> list[str]:
    """Names of a channel's columns, with its unit: "marker:tip.position.x [m]"; a quaternion has no unit."""
    symbol = "1" if channel.endswith(".orientation") else unit(channel)
    letters = {1: [""], 3: [".x", ".y", ".z"], 4: [".w", ".x", ".y", ".z"]}
    numbered = channel.startswith(("drive:", "derivatives.", "frequencies"))
    endings = [f".{i}" for i in range(width)] if numbered else letters[width]
    return [f"{channel}{ending} [{symbol}]" for ending in endings]


def values_text(times: Real, channels: dict[str, Real]) -> str:
    header = [TIME, *(name for channel, rows in channels.items() for name in column_names(channel, rows.shape[1]))]
    text = io.StringIO()
    csv.writer(text, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow(header)
    np.savetxt(text, np.column_stack([times, *channels.values()]), fmt="%.17g", delimiter=",")
    return text.getvalue()


def parse_values(text: str, file: str) -> tuple[Real, dict[str, Real]]:
    """Times (T,) and channels (T, k) of a reference.csv; CaseError names the line or the column that is wrong."""
    try:
        rows = list(csv.reader(io.StringIO(text, newline=""), strict=True))
    except csv.Error as error:
        raise CaseError(f"{file}: not a table of comma-separated values: {error}") from None
    if len(rows) < 3 or rows[0][:1] != [TIME]:
        raise CaseError(f'{file}: it must begin with a header whose first column is "{TIME}", and hold two samples')
    header = rows[0]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise CaseError(f"{file}: line {number} has {len(row)} cells, the header has {len(header)}")
    try:
        table = np.array(rows[1:], float)
    except ValueError as error:
        raise CaseError(f"{file}: {error}") from None
    if not (np.all(np.isfinite(table)) and np.all(np.diff(table[:, 0]) > 0.0)):
        raise CaseError(f"{file}: it holds numbers that are not finite, or times that do not rise")
    try:
        places = channels_by_column(header[1:])
    except CaseError as error:
        raise CaseError(f"{file}: {error}") from None
    return table[:, 0], {channel: table[:, [place + 1 for place in found]] for channel, found in places.items()}


def channels_by_column(names: list[str]) -> dict[str, list[int]]:
    """The indices of the columns of each channel, by names such as "marker:tip.position.x [m]".

    CaseError names the first column with a wrong name or in a wrong place.
    """
    places: dict[str, list[int]] = {}
    for place, name in enumerate(names):
        places.setdefault(_channel_of(name), []).append(place)
    for channel, found in places.items():
        try:
            expected = column_names(channel, len(found))
        except KeyError:
            raise CaseError(f"{channel} has {len(found)} columns: none of its kind has") from None
        for place, name in zip(found, expected, strict=True):
            if names[place] != name:
                raise CaseError(f'column "{names[place]}" is not where or what it should be: expected is "{name}"')
    if (flat := [place for found in places.values() for place in found]) != list(range(len(names))):
        wrong = next(place for place, other in enumerate(flat) if place != other)
        raise CaseError(f'column "{names[wrong]}" is not where it should be: the columns of a channel stand together')
    return places


def _channel_of(column: str) -> str:
    """The channel of a column: its name without the component, if it has one, and the unit."""
    name = column.rpartition(" [")[0]
    head, _, last = name.rpartition(".")
    return head if last in ("w", "x", "y", "z") or last.isdigit() else name


def _knowledge(file: Path) -> Knowledge:
    knowledge = struct_of(file, Knowledge, MADE_BY)
    for channel, known in knowledge.channels.items():
        if not (0.0 < known.uncertainty < np.inf and 0.0 <= known.scale < np.inf):
            raise CaseError(f"{file}: the uncertainty and scale of {channel} are no numbers that can be judged by")
    if not 0.0 < knowledge.horizon_s < np.inf:
        raise CaseError(f"{file}: a horizon of {knowledge.horizon_s:g} s is none")
    return knowledge
