"""The stability maps beside a session's records, as `crosscheck stability` leaves them: `maps.json` and pictures."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path

import msgspec

from flexmb.scene.reading import read_text

FILE = "maps.json"
PLACE = "assets/maps"  # of the pictures in a report of several files


class MapShown(msgspec.Struct, frozen=True, kw_only=True):
    """The verdict on a map, and the text of its picture, empty if there is none."""

    map: str
    title: str
    status: str
    worst: str
    cells: dict[str, int]
    overlay: str
    source: str
    picture: str = ""

    @property
    def file(self) -> str:
        return f"{PLACE}/{self.map}.svg"

    @property
    def inline(self) -> str:
        """The picture as an address that needs no file; as an image it can run no script."""
        return f"data:image/svg+xml;base64,{base64.b64encode(self.picture.encode()).decode()}"


class Maps(msgspec.Struct, frozen=True, kw_only=True):
    """All maps, or why they cannot be read."""

    maps: tuple[MapShown, ...] = ()
    error: str = ""

    @property
    def pictures(self) -> Mapping[str, str]:
        """Texts of pictures by their file in the report."""
        return {each.file: each.picture for each in self.maps if each.picture}


def read_maps(out: Path) -> Maps:
    """The maps in a folder; none if there is no file, the error if it cannot be read."""
    file = out / FILE
    if not file.is_file():
        return Maps()
    try:
        found = msgspec.json.decode(read_text(file), type=tuple[MapShown, ...])
        named = {each.map for each in found}
        if len(named) < len(found) or not all(name.isidentifier() for name in named):
            raise ValueError("names of maps are identifiers, each once")
        return Maps(maps=tuple(_with_picture(each, out) for each in found))
    except (ValueError, OSError, RecursionError) as error:
        return Maps(error=f"{FILE} cannot be read: {error}")


def _with_picture(each: MapShown, out: Path) -> MapShown:
    picture = out / f"{each.map}.svg"
    return msgspec.structs.replace(each, picture=read_text(picture) if picture.is_file() else "")
