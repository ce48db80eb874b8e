"""The report: an index, and for each case a page with its data in another file; or all in a single file.

Pages open from a disk as from a server: scripts and data are classic scripts, which a browser loads from `file://` too.
A page loads its case's data only, and plotly and three.js when a chart or an animation comes into view.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from markupsafe import Markup

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import CaseResults, Session
from crosscheck.judging.verdict import STATUSES
from crosscheck.label.document import LabelFile
from crosscheck.report.case_view import CaseView, case_view
from crosscheck.report.charts import payload
from crosscheck.report.html import INDEX, CasePlace, embedded, places, source, style, templates
from crosscheck.report.maps import Maps
from crosscheck.report.mutations import Scores
from crosscheck.report.overview import findings, matrix
from crosscheck.report.speed import LEVELS, speed_view
from flexmb.output.files import folder, write_whole
from flexmb.view.page import PLOTLY, THREE, asset

FOLDER = "report"
SINGLE = "report.html"
ASSETS = "assets"
LISTING = f"{ASSETS}/pages.json"  # the files of the report, which the next report removes
SCRIPTS = ("unpack.js", "data.js", "plotting.js", "charts.js", "scene.js", "page.js", "index.js", "speed.js")
LIBRARIES = (PLOTLY, THREE)  # loaded when first needed


@dataclass(frozen=True)
class Material:
    session: Session
    outcome: SessionOutcome
    scores: Scores
    maps: Maps
    labels: LabelFile


def write_site(material: Material, out: Path) -> Path:
    """Write `report/` with its index and pages, and a `report.html` that leads there; returns the index's path."""
    site = out / FOLDER
    clear_site(site)
    where = places((case.case.case for case in material.session.cases), single=False)
    index = _page("index.html.j2", material, root="", inline=False, **_overview(material, where))
    written = asset_files(SCRIPTS, LIBRARIES) | dict(material.maps.pictures)
    for case in material.session.cases:
        place = where[case.case.case]
        view = _view(case, material, place)
        written[place.page] = _page("case_page.html.j2", material, root=place.root, case=view)
        written[place.data] = _registration(case, material, place)
    write_pages(site, written | {INDEX: index})
    leading = templates().get_template("leading.html.j2").render(outcome=material.outcome, index=f"{FOLDER}/{INDEX}")
    write_whole(out / SINGLE, _encoded(leading))
    return site / INDEX


def write_single(material: Material, out: Path) -> Path:
    """Write the whole report into one file that loads no other, instead of pages; returns its path."""
    clear_site(out / FOLDER)
    cases = material.session.cases
    where = places((case.case.case for case in cases), single=True)
    text = _page(
        "single.html.j2",
        material,
        **_overview(material, where),
        root="",
        inline=True,
        cases=[_view(case, material, where[case.case.case]) for case in cases],
        style=style(),
        scripts=[*(Markup(asset(name)) for name in LIBRARIES), *map(source, SCRIPTS)],
        data=[Markup(_registration(case, material, where[case.case.case])) for case in cases],
    )
    write_whole(out / SINGLE, _encoded(text))
    return out / SINGLE


def write_unfinished(outcome: SessionOutcome, out: Path) -> None:
    """Replace an earlier report by a page that says that the session has not ended."""
    text = templates().get_template("unfinished.html.j2").render(outcome=outcome)
    write_whole(out / SINGLE, _encoded(text))
    if clear_site(out / FOLDER):
        write_pages(out / FOLDER, {INDEX: text})


def asset_files(scripts: Iterable[str], libraries: Iterable[str]) -> dict[str, str]:
    """The style sheet, scripts and libraries of a folder of pages, by their names in it."""
    written = {f"{ASSETS}/style.css": str(style())} | {f"{ASSETS}/{name}": str(source(name)) for name in scripts}
    return written | {f"{ASSETS}/{Path(name).name}": asset(name) for name in libraries}


def write_pages(site: Path, pages: Mapping[str, str]) -> None:
    """Write pages by name, their list first, so that they can be removed later even if this is interrupted."""
    listing = msgspec.json.encode(sorted([*pages, LISTING])).decode()
    for name, text in {LISTING: listing, **pages}.items():
        folder((site / name).parent)
        write_whole(site / name, _encoded(text))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", errors="backslashreplace")


def _page(name: str, material: Material, **more: Any) -> str:
    return templates().get_template(name).render(outcome=material.outcome, scripts_of_site=SCRIPTS, **more)


def _overview(material: Material, where: dict[str, CasePlace]) -> dict[str, Any]:
    session, outcome = material.session, material.outcome
    speed = speed_view(session, where)
    return {
        "speed": speed,
        "speed_data": embedded(speed.data),
        "levels": LEVELS,
        "counts": outcome.counts(),
        "statuses": STATUSES,
        "controls": outcome.controls(),
        "matrix": matrix(session, outcome, where),
        "findings": findings(outcome, where),
        "environment": session.environments[-1] if session.environments else None,
        "engines": _engines(session),
        "scores": material.scores,
        "maps": material.maps,
        "places": where,
    }


def _view(case: CaseResults, material: Material, place: CasePlace) -> CaseView:
    name = case.case.case
    return case_view(case, material.outcome, place, material.scores.cases.get(name), material.labels.subjects[name])


def _registration(case: CaseResults, material: Material, place: CasePlace) -> str:
    """A script that passes the case's data to the page."""
    data = payload(case, material.outcome.verdicts[case.case.case])
    return f"crosscheck.register({embedded(place.anchor)}, {embedded(data)});\n"


def clear_site(site: Path) -> bool:
    """Remove the files of an earlier report only; whether there was one."""
    try:
        listed = msgspec.json.decode((site / LISTING).read_bytes(), type=list[str])
    except (OSError, ValueError):
        return False
    for name in listed:
        file = site / name
        if file.resolve().is_relative_to(site.resolve()):
            file.unlink(missing_ok=True)
    return True


def _engines(session: Session) -> list[tuple[str, str]]:
    engines: dict[str, set[str]] = {}
    for case in session.cases:
        for (_, engine, _), result in case.results.items():
            engines.setdefault(engine, set()).update(run.version for run in result.runs)
    return [(engine, ", ".join(sorted(versions)) or "did not run") for engine, versions in sorted(engines.items())]
