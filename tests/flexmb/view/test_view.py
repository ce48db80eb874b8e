"""A view shows where things are: its page is unpacked as the browser unpacks it, and compared with the run."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.linear.mode_view import AMPLITUDE, mode_view
from flexmb.scene.shapes import beam_section
from flexmb.typing import Real
from tests.flexmb.view.pages import unpacked

WIDE = {"COLUMNS": "200"}
SECTION = beam_section(E=7e10, G=2.7e10, A=2e-4, Iy=1.7e-9, Iz=1.7e-9, rho=2700.0)


def boom() -> fm.Scene:
    """A flexible beam on a hinge that turns, with a marker at its tip."""
    made = fm.SceneBuilder("boom <one>", gravity=(0.0, -9.81, 0.0))
    made.beam("boom", length=2.0, modes=3, elements=8, section=SECTION)
    made.revolute("shoulder", "ground", "boom", axis=(0, 0, 1), angle=0.3)
    return made.marker("end", "boom", node="tip").scene()


def read(html: str) -> tuple[dict, list[Real]]:
    """The animation of a page, and its series (T,k)."""
    data, series = unpacked(html)
    (animation,) = data["animations"]
    return animation, series


def line_of(animation: dict, body: str, kind: str) -> dict:
    (line,) = [each for each in animation["lines"] if (each["body"], each["kind"]) == (body, kind)]
    return line


def end_of(animation: dict, series: list[Real], point: list[float]) -> Real:
    """Positions (T,3) of a carried point."""
    marker = animation["markers"][point[0]]
    w, u = series[marker["orientation"]][:, :1], series[marker["orientation"]][:, 1:]
    across = 2.0 * np.cross(u, point[1:4])
    return series[marker["position"]] + point[1:4] + w * across + np.cross(u, across)


@pytest.fixture(scope="module")
def run() -> fm.Trajectory:
    return fm.simulate(boom(), 1.0, samples=51)


def test_the_tip_of_a_bent_beam_is_where_the_marker_is(run: fm.Trajectory) -> None:
    animation, series = read(run.view().html)
    drawn = end_of(animation, series, line_of(animation, "boom", "beam")["points"][-1])
    there = run.markers["end"].position
    np.testing.assert_allclose(drawn, there, atol=1e-6)  # the page has float32
    np.testing.assert_allclose(series[animation["times"]][:, 0], run.t, rtol=1e-6)
    turn = run.q[:, 0]
    straight = 2.0 * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    assert np.max(np.abs(drawn - straight)) > 1e-3  # it bends, and a straight beam would fail


def test_points_along_a_bent_beam_are_where_markers_there_would_be(run: fm.Trajectory) -> None:
    """The nodes that a view adds change no coordinate: a scene that has the middle one itself moves it alike."""
    animation, series = read(run.view().html)
    points = line_of(animation, "boom", "beam")["points"]
    scene = boom()
    made = fm.SceneBuilder("other", gravity=(0.0, -9.81, 0.0))
    made.beam("boom", length=2.0, modes=3, elements=8, section=SECTION, nodes={"middle": 1.0})
    made.revolute("shoulder", "ground", "boom", axis=(0, 0, 1), angle=0.3)
    other = fm.compile(made.marker("middle", "boom", node="middle").scene())
    assert scene.bodies[0].nodes != other.scene.bodies[0].nodes
    states = zip(run.t, run.q, run.u, strict=True)
    there = np.array([other.evaluate(t, q, u).markers["middle"].position for t, q, u in states])
    nearest = min(np.max(np.abs(end_of(animation, series, point) - there)) for point in points)
    assert nearest < 1e-6


def test_arrows_are_the_loads_at_the_hinge_points(run: fm.Trajectory) -> None:
    animation, series = read(run.view().html)
    by_kind = {arrow["kind"]: arrow for arrow in animation["arrows"]}
    load = run.loads["shoulder"]
    np.testing.assert_allclose(series[by_kind["force"]["values"]], load[:, 3:], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(series[by_kind["torque"]["values"]], load[:, :3], rtol=1e-6, atol=1e-6)
    assert np.max(np.abs(load[:, 3:])) > 1.0
    at = animation["markers"][by_kind["force"]["marker"]]
    np.testing.assert_allclose(series[at["position"]], 0.0, atol=1e-12)  # the hinge on the ground


def test_a_moving_point_mass_and_a_wheel_are_drawn_where_they_are() -> None:
    made = fm.SceneBuilder("carrier").rigid_body("hub", mass=10, inertia=(1, 1, 1)).free("base", "ground", "hub")
    made.point_mass("slosh", "hub", mass=1.0, offset=(0.5, 0, 0), directions=((0, 1, 0),),
                    coordinates=[fm.LinearCoordinate(position_m=0.1, rate_m_s=0.4)])  # fmt: skip
    made.wheel("rw", "hub", axis=(0, 0, 1), axial_inertia=0.1, transverse_inertia=0.06, mass=1.0, speed=5.0)
    run = fm.simulate(made.scene(), 0.5, samples=6)
    animation, series = read(run.view().html)
    ball = line_of(animation, "slosh", "ball")["points"][0]
    place = [name for name, _ in run.q_names].index("slosh.coordinates[0]")
    np.testing.assert_allclose(end_of(animation, series, ball)[:, 1], run.q[:, place], atol=1e-6)
    angle = run.q[:, [name for name, _ in run.q_names].index("rw.angle")]
    np.testing.assert_allclose(series[animation["wheels"][0]["angle"]][:, 0], angle, rtol=1e-6)
    assert angle[-1] > 1.0


def test_a_mode_moves_with_its_amplitude_and_period() -> None:
    scene = boom()
    model = fm.linearize(fm.compile(scene), fm.equilibrium(fm.compile(scene)), held=True)
    mode = model.modes[1]
    animation, series = read(mode_view(scene, 2).html)
    drawn = end_of(animation, series, line_of(animation, "boom", "beam")["points"][-1])
    times = series[animation["times"]][:, 0]
    assert times[-1] - times[0] == pytest.approx(1.0 / mode.frequency_hz, rel=1e-5)
    half = len(times) // 2
    there = fm.compile(scene).evaluate(0.0, model.displaced(mode, AMPLITUDE).q, model.state.u).markers["end"].position
    np.testing.assert_allclose(drawn[0], there, atol=1e-6)
    assert np.max(np.abs(drawn[half] - drawn[0])) > 1e-3
    np.testing.assert_allclose(drawn[-1], drawn[0], atol=1e-6)
    with pytest.raises(ValueError, match="there is no mode 99: the scene has the modes 1 to"):
        mode_view(scene, 99)


def test_a_page_is_whole_and_says_names_as_text(run: fm.Trajectory, tmp_path: Path) -> None:
    view = run.view(tmp_path / "new" / "boom.html")
    text = (tmp_path / "new" / "boom.html").read_text(encoding="utf-8")
    assert text == view.html
    assert not re.search(r'(src|href)="(?!data:)', text)
    assert "boom <one>" not in text and "boom &lt;one&gt;" in text
    assert "srcdoc" in view._repr_html_() and "<html" not in view._repr_html_()
    assert "boom" in repr(view) and len(repr(view)) < 200


def test_what_cannot_be_drawn_is_refused(run: fm.Trajectory, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"ends in \.html"):
        run.view(tmp_path / "boom.png")
    assert not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match="as simulate made it"):
        run.then(fm.simulate(boom(), 2.0, t_start=1.0, state=run.last_state, samples=5)).view()


def test_the_command_writes_a_start_a_run_and_a_mode(tmp_path: Path) -> None:
    scene = tmp_path / "boom.toml"
    fm.save_scene(boom(), scene)
    for number, words in enumerate(([], ["--t-end", "0.1"], ["--mode", "1"])):
        out = tmp_path / f"{number}.html"
        done = CliRunner().invoke(app, ["view", str(scene), *words, "--out", str(out)], env=WIDE)
        assert done.exit_code == 0, done.output
        assert read(out.read_text(encoding="utf-8"))[0]["lines"]
    for words, said in (
        (["--mode", "1", "--t-end", "1"], "exclude each other"),
        (["--out", str(tmp_path / "a.png")], "ends in .html"),
        (["--mode", "99"], "there is no mode 99"),
    ):
        done = CliRunner().invoke(app, ["view", str(scene), *words], env=WIDE)
        assert done.exit_code == 2 and said in done.output, done.output
