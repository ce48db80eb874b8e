"""Charts of a run show loads with their signs, mark its events, and do not draw rounding as if it were a signal."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

import flexmb as fm
from flexmb.run import plots
from flexmb.run.charts import charts_of
from flexmb.view.charting import RunChart
from tests.flexmb.view.pages import unpacked


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Axes]]:
    """The panels of each chart, by its name, instead of files."""
    found: dict[str, list[Axes]] = {}

    def keep(figure: Any, path: Any, **_: Any) -> Any:
        found[path.stem] = list(figure.axes)
        return path

    monkeypatch.setattr(plots, "save_figure", keep)
    return found


def sliding() -> fm.Scene:
    """Two masses that push each other apart in free space until they latch; across x nothing happens."""
    return (
        fm.SceneBuilder("sliding")
        .rigid_body("a", mass=400.0, inertia=(1.0, 1.0, 1.0)).rigid_body("b", mass=0.7, inertia=(1.0, 1.0, 1.0))
        .free("flight", "ground", "a").prismatic("rail", "a", "b", axis=(0.6, 0.8, 0.0), position=-0.3, stiffness=7.0)
        .event("latch", "rail.translation", 0.0, fm.Latch(coordinate="rail.translation"))
        .marker("end", "b").scene()
    )  # fmt: skip


def swinging() -> fm.Scene:
    made = fm.SceneBuilder("swinging", gravity=(0.0, 0.0, -9.81))
    made.rigid_body("bob", mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    return made.revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0)).scene()


def test_events_are_marked_in_every_panel(drawn: dict[str, list[Axes]], tmp_path: Any) -> None:
    run = fm.simulate(sliding(), 2.0, samples=201)
    (latch,) = run.events
    run.plot(tmp_path)
    assert set(drawn) == {"markers", "energy", "momentum", "loads", "drives"}
    for panels in drawn.values():
        for axes in panels:
            (marks,) = axes.collections
            assert [path.vertices[0, 0] for path in marks.get_paths()] == [latch.t]
            assert axes.get_legend() is not None or axes.figure.legends
    assert [event.t for event in charts_of(run).events] == [latch.t]


def test_loads_are_drawn_by_components_with_their_signs() -> None:
    run = fm.simulate(swinging(), 1.0, samples=51)
    panels = {panel.label: panel for panel in chart(run, "loads").panels}
    assert list(panels)[:2] == ["torque x (N m)", "force x (N)"] and len(panels) == 6
    (along,) = [curve.values for curve in panels["force x (N)"].curves if curve.name == "pivot"]
    np.testing.assert_array_equal(along, run.loads["pivot"][:, 3])
    assert along.min() < -1.0 and along.max() > 1.0  # a magnitude would hide it


def test_rounding_is_drawn_as_zero_and_a_signal_as_it_is() -> None:
    """Momenta are zero but for rounding, as is what happens across the rail; what is a thousand times more is drawn."""
    run = fm.simulate(sliding(), 2.0, samples=201)
    assert 0.0 < np.abs(run.momentum).max() < 1e-12
    for panel in chart(run, "momentum").panels:
        for curve in panel.curves:
            assert not np.any(curve.values)
    z = chart(run, "markers").panels[2].curves[0]
    assert not np.any(z.values)
    more = replace(run, momentum=run.momentum + 1e-9)  # no rounding of momenta of about one
    assert all(np.all(curve.values != 0.0) for panel in chart(more, "momentum").panels for curve in panel.curves)


def test_the_bound_grows_with_the_size_of_what_is_added_up() -> None:
    """A momentum of 1e-10 N s is a signal of light bodies, and rounding of heavy ones that move against each other."""
    run = fm.simulate(sliding(), 2.0, samples=21)
    small = replace(run, momentum=np.full_like(run.momentum, 1e-10))
    heavy = replace(small, energy={kind: 1e12 * values for kind, values in small.energy.items()})
    assert all(np.all(curve.values == 1e-10) for panel in chart(small, "momentum").panels for curve in panel.curves)
    assert not any(np.any(curve.values) for panel in chart(heavy, "momentum").panels for curve in panel.curves)


def test_a_constant_that_is_not_zero_keeps_its_place() -> None:
    scene = (
        fm.SceneBuilder("still", gravity=(0.0, 0.0, -9.81)).rigid_body("block", mass=3.0, inertia=(1.0, 1.0, 1.0))
        .weld("foot", "ground", "block").rigid_body("wheel", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("axle", "block", "wheel", rate=3.0).scene()
    )  # fmt: skip
    panel = chart(fm.simulate(scene, 1.0, samples=11), "loads").panels[5]
    assert panel.label == "force z (N)"
    drawn = {curve.name: curve.values for curve in panel.curves}
    for name, size in (("foot", 39.24), ("axle", 9.81)):
        assert np.ptp(drawn[name]) == 0.0 and drawn[name][0] == pytest.approx(size)


def test_of_many_curves_the_largest_are_shown_first_and_the_others_are_told(tmp_path: Path) -> None:
    made = fm.SceneBuilder("many", gravity=(0.0, 0.0, -9.81))
    for i in range(12):
        made.rigid_body(f"b{i}", mass=1.0 + i, inertia=(1.0, 1.0, 1.0)).weld(f"w{i}", "ground", f"b{i}")
    run = fm.simulate(made.marker("m", "b0").scene(), 0.1, samples=3)
    loads = chart(run, "loads")
    shown = [curve.name for curve in loads.panels[0].curves if curve.shown]
    assert shown == [f"w{i}" for i in range(2, 12)] and len(loads.panels[0].curves) == 12
    assert loads.note == "10 of 12: those with the largest loads"
    assert "10 of 12" in run.plot().html
    many = {f"w{i}": np.full((3, 6), float(i)) for i in range(70)}
    far = chart(replace(run, loads=many), "loads")
    assert len(far.panels[0].curves) == 50 and "a page can show 50 of them, the CSV file has all" in far.note


def test_what_the_motion_does_not_determine_is_named(tmp_path: Path) -> None:
    tree = fm.SceneBuilder("door", gravity=(0.0, 0.0, -9.81))
    tree.rigid_body("door", mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.2, 0.3), nodes={"top": (0.0, 0.0, 1.0)})
    tree.revolute("lower", "ground", "door", angle=0.4, rate=1.5)
    tree.closure("upper", "revolute", "door", "ground", node_a="top", position_b=(0.0, 0.0, 1.0))
    run = fm.simulate(tree.scene(), 0.1, samples=3)
    assert run.undetermined
    note = chart(run, "loads").note
    assert note.startswith("not determined: lower (") and "upper (" in note and "force x, y, z" in note
    assert not chart(fm.simulate(swinging(), 0.1, samples=3), "loads").note
    run.plot(tmp_path)
    assert (tmp_path / "loads.png").stat().st_size > 1000


def test_the_page_has_all_curves_and_needs_no_network(tmp_path: Path) -> None:
    run = fm.simulate(sliding(), 2.0, samples=301)  # more than a view has frames
    (path,) = run.plot(tmp_path / "new" / "charts.html")
    text = path.read_text(encoding="utf-8")
    assert text == run.plot().html and not re.search(r'<(script|link|img)[^>]* (src|href)="(?!data:)', text)
    data, series = unpacked(text)
    np.testing.assert_allclose(series[data["times"]][:, 0], run.t, rtol=1e-6)
    loads = next(found for found in data["charts"] if found["name"] == "loads")
    rail = next(curve for curve in loads["rows"][0][1]["curves"] if curve["name"] == "rail")
    np.testing.assert_allclose(series[rail["values"]][:, 0], run.loads["rail"][:, 3], rtol=1e-6, atol=1e-40)
    assert data["events"] == [{"name": "latch", "t": run.events[0].t}]
    assert "srcdoc" in run.plot()._repr_html_() and repr(run.plot()).startswith("<Charts of 'sliding'")


def chart(run: fm.Trajectory, name: str) -> RunChart:
    (found,) = [chart for chart in charts_of(run).charts if chart.name == name]
    return found
