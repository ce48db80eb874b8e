"""docs/gallery.md shows every map and every picture, and none of them is large."""

from crosscheck.stability.catalogue import stability_maps
from crosscheck.stability.verdict_file import VERDICTS, read_verdicts
from tests.repo.gallery import PICTURES, other_pictures

LARGEST = 200_000  # bytes


def test_every_map_has_a_picture_and_a_verdict_and_every_picture_is_shown() -> None:
    maps = {f"{name}.svg" for name in stability_maps()}
    assert {f"{verdict.map}.svg" for verdict in read_verdicts(PICTURES / VERDICTS)} == maps
    shown = maps | {picture.file for picture in other_pictures()}
    assert shown == {file.name for file in PICTURES.iterdir() if file.suffix in (".svg", ".png")}


def test_pictures_are_small() -> None:
    large = {file.name: file.stat().st_size for file in PICTURES.iterdir() if file.stat().st_size > LARGEST}
    assert not large
