"""The report of measured sets: an index, a page for each set, and all numbers as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from crosscheck.report.html import INDEX, embedded, places, templates
from crosscheck.report.site import FOLDER, SINGLE, asset_files, clear_site, write_pages
from crosscheck.validation.budget import Budget, document
from flexmb.output.files import write_whole
from flexmb.view.page import PLOTLY

RESULTS = "validation.json"
SCRIPTS = ("unpack.js", "data.js", "plotting.js", "charts.js", "page.js", "measured.js")
LIBRARIES = (PLOTLY,)
NO_SERIES = {"shapes": [], "data": ""}  # the readings are few, and are not packed


def write_measured(budgets: Sequence[Budget], headline: str, out: Path) -> Path:
    """Write `report/`, a `report.html` that leads there, and `validation.json`; returns the path of the index.

    The names of the sets differ.
    """
    site = out / FOLDER
    clear_site(site)
    known = {budget.of.name: document(budget) for budget in budgets}
    where, pages = places(known, single=False), asset_files(SCRIPTS, LIBRARIES)
    for name, numbers in known.items():
        place = where[name]
        pages[place.page] = _rendered("measured_page.html.j2", root=place.root, name=name, set=numbers, place=place)
        data = embedded({"name": name, **numbers, "series_of": numbers["series"], "series": NO_SERIES})
        pages[place.data] = f"crosscheck.register({embedded(place.anchor)}, {data});\n"
    pages[INDEX] = _rendered("measured_index.html.j2", root="", sets=known, places=where, headline=headline)
    write_pages(site, pages)
    leading = _rendered("leading.html.j2", outcome={"headline": headline}, index=f"{FOLDER}/{INDEX}")
    write_whole(out / SINGLE, leading)
    write_whole(out / RESULTS, msgspec.json.format(msgspec.json.encode(known), indent=1))
    return site / INDEX


def _rendered(template: str, **words: object) -> str:
    return templates().get_template(template).render(scripts_of_site=SCRIPTS, **words)
