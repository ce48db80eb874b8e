"""Charts of a run mark its events, and do not draw rounding as if it were a signal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

import flexmb as fm
from flexmb.run import plots


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


def test_events_are_marked_in_every_panel(drawn: dict[str, list[Axes]], tmp_path: Any) -> None:
    run = fm.simulate(sliding(), 2.0, samples=201)
    (latch,) = run.events
    run.plot(tmp_path)
    assert set(drawn) == {"markers", "energy", "momentum", "loads", "drives"}
    for panels in drawn.values():
        for axes in panels:
            (marks,) = axes.collections
            assert [path.vertices[0, 0] for path in marks.get_paths()] == [latch.t]
            assert axes.get_legend() is not None


def test_rounding_is_drawn_as_a_straight_line(drawn: dict[str, list[Axes]], tmp_path: Any) -> None:
    """Of momenta that are zero but for rounding, of a coordinate that stays."""
    run = fm.simulate(sliding(), 2.0, samples=201)
    assert 0.0 < np.abs(run.momentum).max() < 1e-12
    run.plot(tmp_path)
    for panel in (*drawn["momentum"], drawn["markers"][2]):
        curves = np.concatenate([line.get_ydata() for line in panel.lines])
        low, high = panel.get_ylim()
        assert np.ptp(curves) < 0.6 * (high - low) and low < curves.min() and curves.max() < high
    low, high = drawn["momentum"][1].get_ylim()
    assert high - low > 10.0 * np.ptp(run.momentum[:, 3:])
    above = drawn["loads"][1]
    assert above.get_ylim()[1] > np.abs(run.loads["rail"]).max() * 0.99  # what is a signal fills its panel
    assert above.get_ylim()[1] < 1.2 * np.linalg.norm(run.loads["rail"][:, 3:], axis=1).max()


def test_a_constant_that_is_not_zero_keeps_its_place(drawn: dict[str, list[Axes]], tmp_path: Any) -> None:
    scene = (
        fm.SceneBuilder("still", gravity=(0.0, 0.0, -9.81)).rigid_body("block", mass=3.0, inertia=(1.0, 1.0, 1.0))
        .weld("foot", "ground", "block").rigid_body("wheel", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("axle", "block", "wheel", rate=3.0).scene()
    )  # fmt: skip
    fm.simulate(scene, 1.0, samples=11).plot(tmp_path)
    low, high = drawn["loads"][1].get_ylim()
    assert low < 9.81 < 39.24 < high
