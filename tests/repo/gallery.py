"""docs/gallery.md: every picture with what it shows, the command that draws it, and what was measured. Write it with

    python -m tests.repo.gallery

Stability maps come from the catalogue and from docs/pictures/maps.json, the other pictures from docs/gallery.toml.
"""

import tomllib
from typing import NamedTuple

from crosscheck.stability.boundary import MapVerdict
from crosscheck.stability.catalogue import stability_maps
from crosscheck.stability.map import StabilityMap
from crosscheck.stability.verdict_file import VERDICTS, read_verdicts
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "gallery.md"
OTHERS = ROOT / "docs" / "gallery.toml"
PICTURES = ROOT / "docs" / "pictures"
INTRODUCTION = """# Gallery

Every picture with what it shows, the command that draws it, and what was found. This page is generated:
`python -m tests.repo.gallery`.

## Stability maps

A map is one case, one quantity and two axes. Cells are refined where the class or the status changes, and cells that
failed or did not finish have colours of their own. The black line is a boundary known from elsewhere. A map *agrees* if
every cell is of the class that the line predicts, there or within one of the finest cells. This draws all maps and
writes their verdicts:

<!-- not run: it takes half an hour -->
```sh
crosscheck stability all --pictures docs/pictures
```
"""


class Picture(NamedTuple):
    """A picture that is not a stability map."""

    file: str
    title: str
    text: str
    command: str


def other_pictures() -> list[Picture]:
    """The pictures that docs/gallery.toml lists."""
    return [Picture(**entry) for entry in tomllib.loads(OTHERS.read_text(encoding="utf-8"))["picture"]]


def page() -> str:
    """The text of docs/gallery.md."""
    verdicts = {verdict.map: verdict for verdict in read_verdicts(PICTURES / VERDICTS)}
    maps = [_map(what, verdicts[name]) for name, what in stability_maps().items()]
    others = [
        f"### {picture.title}\n\n![{picture.title}](pictures/{picture.file})\n\n{picture.text} `{picture.command}`\n"
        for picture in other_pictures()
    ]
    return "\n".join([INTRODUCTION, *maps, "## Other pictures\n", *others])


def _map(what: StabilityMap, verdict: MapVerdict) -> str:
    cells = ", ".join(f"{count} {name}" for name, count in verdict.cells.items())
    found = {
        "agree": "no cell exceeds the bound" if what.overlay.bound else f"farthest cell: {verdict.distance}",
        "differ": verdict.worst,
        "did not run": verdict.worst,
    }[verdict.status]
    return (
        f"### {what.title}\n\n![{what.title}](pictures/{what.name}.svg)\n\n"
        f"{what.shows} Line: {what.overlay.name} ({what.overlay.source}). Verdict: **{verdict.status}** ({found}; "
        f"cells: {cells}). `crosscheck stability {what.name}`\n"
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
