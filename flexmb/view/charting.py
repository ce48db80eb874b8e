"""Charts of curves over time as data: what is drawn, whoever draws it (pictures by matplotlib, a page by plotly)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from flexmb.typing import Real
from flexmb.view.page import PLOTLY, Page, filled
from flexmb.view.store import Store

SCRIPTS = (PLOTLY, "unpack.js", "plotting.js", "curves.js")


@dataclass(frozen=True)
class Curve:
    """One curve: values (T,), NaN where there is none. Of many curves only those that are `shown` at first are drawn;
    `kind` "sum" is drawn black, "applied" dashed."""

    name: str
    values: Real
    kind: str = ""
    shown: bool = True


@dataclass(frozen=True)
class Panel:
    """Curves over one time axis; `label` is the quantity with its unit."""

    label: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True)
class RunChart:
    """Panels in rows and columns with common times; `note` says what is left out, in words."""

    name: str
    rows: tuple[tuple[Panel, ...], ...]
    note: str = ""

    @property
    def panels(self) -> list[Panel]:
        """All panels, row by row."""
        return [panel for row in self.rows for panel in row]


@dataclass(frozen=True)
class EventMark:
    """What happened at t (s)."""

    name: str
    t: float


@dataclass(frozen=True)
class Charts:
    """All charts of one run: times t (T,) s, and the events that every panel marks."""

    title: str
    t: Real
    charts: tuple[RunChart, ...]
    events: tuple[EventMark, ...] = ()


class ChartPage(Page):
    """Charts of a run that a browser zooms and reads values from, as one page without network."""

    @property
    def kind(self) -> str:
        return "Charts"


def chart_page(scene: str, drawn: Charts) -> ChartPage:
    """The page of charts. Values are single-precision numbers: seven digits."""
    store = Store()
    data = {
        "title": drawn.title,
        "times": store.whole(drawn.t),
        "events": [{"name": event.name, "t": event.t} for event in drawn.events],
        "charts": [
            {"name": chart.name, "note": chart.note, "rows": [_row(store, row) for row in chart.rows]}
            for chart in drawn.charts
        ],
    }
    return ChartPage(scene, filled("charts.html", drawn.title, SCRIPTS, {**data, "series": store.packed()}))


def _row(store: Store, row: Sequence[Panel]) -> list[dict[str, Any]]:
    return [
        {
            "label": panel.label,
            "curves": [
                {"name": curve.name, "values": store.whole(curve.values), "kind": curve.kind, "shown": curve.shown}
                for curve in panel.curves
            ],
        }
        for panel in row
    ]
