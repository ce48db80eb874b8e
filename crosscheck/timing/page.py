"""The files of charts: for each case a folder with pictures, data as JSON and a page; and an index."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from jinja2 import Environment, PackageLoader

from crosscheck.records.machine import environment
from crosscheck.timing.chart import CaseCharts
from crosscheck.timing.picture import draw_chart
from flexmb.output.files import folder, write_whole
from flexmb.output.printable import printable

INDEX, DATA = "index.html", "charts.json"


def write_case(charts: CaseCharts, out: Path) -> Path:
    """Write the pictures, the data and the page of a case below `out`; returns the page."""
    place = folder(out / folder_name(charts.case))
    (place / INDEX).unlink(missing_ok=True)  # an old page must not remain beside new pictures
    pictures = [f"{folder_name(chart.observable)}.svg" for chart in charts.charts]
    for chart, name in zip(charts.charts, pictures, strict=True):
        draw_chart(charts, chart, place / name)
    machine = environment((charts.case,))
    write_whole(place / DATA, msgspec.json.format(msgspec.json.encode({"machine": machine, "charts": charts})))
    drawn = list(zip(charts.charts, pictures, strict=True))
    write_whole(place / INDEX, _page("case.html.j2", charts=charts, drawn=drawn, machine=machine))
    return place / INDEX


def write_index(cases: Sequence[CaseCharts], out: Path) -> Path:
    """Write the index of all cases; returns its path."""
    entries = [(case, folder_name(case.case)) for case in cases]
    write_whole(folder(out) / INDEX, _page("cases.html.j2", entries=entries, machine=environment()))
    return out / INDEX


def folder_name(name: str) -> str:
    """A name that is valid for files and folders on all systems."""
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "_"


def _page(template: str, **content: Any) -> bytes:
    return _templates().get_template(template).render(**content).encode()


@cache
def _templates() -> Environment:
    """The templates; their output is escaped and has no control characters."""
    return Environment(
        loader=PackageLoader("crosscheck.timing"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: printable(value) if type(value) is str else value,
    )
