"""A view shows where things are: its page is unpacked as the browser unpacks it, and compared with the run."""

import re
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from typer.testing import CliRunner

import flexmb as fm
from crosscheck.library.find import shipped_folder
from flexmb.cli import app
from flexmb.linear.mode_view import AMPLITUDE, mode_view
from flexmb.run.stored import stored_view
from flexmb.scene.shapes import beam_section
from flexmb.typing import Real
from flexmb.view.draw import _faces
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


def pushed() -> fm.Scene:
    """A boom that a force in World and a torque in the axes of its tip act upon."""
    made = fm.SceneBuilder("pushed").beam("boom", length=2.0, modes=3, elements=8, section=SECTION)
    made.revolute("shoulder", "ground", "boom", axis=(0, 0, 1), angle=0.3)
    made.force(
        "wind", "boom", node="tip", direction=(0, 1, 0), function=fm.Sine(amplitude=2.0, angular_frequency_rad_s=6.0)
    )
    made.torque("motor", "boom", node="tip", direction=(0, 1, 0), frame="node", function=fm.Constant(value=0.3))
    return made.marker("end", "boom", node="tip").scene()


def test_loads_from_outside_are_arrows_at_their_nodes() -> None:
    run = fm.simulate(pushed(), 0.5, samples=26)
    animation, series = read(run.view().html)
    by_name = {(arrow["name"], arrow["kind"]): arrow for arrow in animation["arrows"]}
    wind = by_name["wind", "applied force"]
    expected = np.outer(2.0 * np.sin(6.0 * run.t), [0.0, 1.0, 0.0])
    np.testing.assert_allclose(series[wind["values"]], expected, atol=1e-6)
    at = animation["markers"][wind["marker"]]
    np.testing.assert_allclose(series[at["position"]], run.markers["end"].position, atol=1e-6)
    turned = series[by_name["motor", "applied torque"]["values"]]
    w, x, y, z = run.markers["end"].quaternion.T
    second = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)  # of the tip's axes
    np.testing.assert_allclose(turned, 0.3 * second, atol=1e-6)
    assert np.ptp(turned, axis=0).max() > 1e-3  # it turns with the tip


def test_loads_that_a_controller_sets_are_drawn_as_they_were() -> None:
    made = fm.SceneBuilder("held").rigid_body("arm", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    made.revolute("pivot", "ground", "arm", angle=0.4)
    made.torque("motor", "arm", direction=(0, 0, 1), function=fm.ControlSignal(source="servo"))
    made.sense_coordinate("angle", "pivot").pid("servo", "angle", kp=20.0, period=0.05)
    run = fm.simulate(made.scene(), 0.3, samples=31)
    animation, series = read(run.view().html)
    (motor,) = [arrow for arrow in animation["arrows"] if (arrow["name"], arrow["kind"]) == ("motor", "applied torque")]
    np.testing.assert_allclose(series[motor["values"]][:, 2], run.signals["servo"][:, 0], rtol=1e-6)
    assert np.ptp(run.signals["servo"]) > 1.0


def test_the_page_says_which_loads_are_not_determined(run: fm.Trajectory) -> None:
    tree = fm.SceneBuilder("door", gravity=(0.0, 0.0, -9.81))
    tree.rigid_body("door", mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.2, 0.3), nodes={"top": (0.0, 0.0, 1.0)})
    tree.revolute("lower", "ground", "door", angle=0.4, rate=1.5)
    tree.closure("upper", "revolute", "door", "ground", node_a="top", position_b=(0.0, 0.0, 1.0))
    animation, _ = read(fm.simulate(tree.scene(), 0.1, samples=3).view().html)
    (note,) = animation["notes"]
    assert note.startswith("No arrows where the motion does not determine a load: lower (torque x, y; force")
    assert read(run.view().html)[0]["notes"] == []


def test_a_beam_has_the_widths_of_its_sections() -> None:
    """0.2 m along y and 0.05 m along z at the root, half of that at the tip."""
    made = fm.SceneBuilder("plank")

    stations = [
        structs.replace(beam_section(E=7e10, G=2.7e10, A=y * z, Iy=y * z**3 / 12, Iz=z * y**3 / 12, rho=2700.0), x_m=x)
        for x, y, z in ((0.0, 0.2, 0.05), (2.0, 0.1, 0.025))
    ]
    made.beam("plank", length=2.0, modes=2, elements=8, section=stations)
    made.weld("root", "ground", "plank")
    line = line_of(read(fm.simulate(made.scene(), 0.01, samples=2).view().html)[0], "plank", "beam")
    assert len(line["widths"]) == len(line["across"]) == len(line["points"])
    np.testing.assert_allclose(line["widths"][0], (0.2, 0.05), rtol=1e-12)
    np.testing.assert_allclose(line["widths"][-1], (0.1, 0.025), rtol=1e-12)
    np.testing.assert_allclose(line["across"], np.tile([0.0, 1.0, 0.0], (len(line["points"]), 1)), atol=1e-12)


def test_nodes_that_span_a_surface_are_drawn_as_one() -> None:
    """Nodes of a plate, of a box and of a line, of a body with modal data."""
    plate = [(x, y, 0.0) for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0)]
    box = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
    line = [(x, 0.0, 0.0) for x in (0.0, 1.0, 2.0)]
    assert [len(_faces(np.array(points))) for points in (plate, box, line, line[:2], line[:1])] == [4, 12, 0, 0, 0]
    assert {i for face in _faces(np.array(plate)) for i in face} == set(range(6))


@pytest.mark.parametrize("suffix", ["csv", "npz"])
def test_a_stored_run_is_drawn_as_the_run_itself(tmp_path: Path, suffix: str) -> None:
    scene = fm.load_scene(shipped_folder() / "spacecraft" / "deploy_and_slew" / "scene.toml")
    run = fm.simulate(scene, 14.0, samples=29)  # one panel has latched
    assert len(run.events) == 1
    getattr(run, f"to_{suffix}")(tmp_path / f"trajectory.{suffix}")
    for place in (tmp_path, tmp_path / f"trajectory.{suffix}"):
        stored, there = read(stored_view(scene, place).html)
        own, here = read(run.view().html)
        for a, b in zip(own["markers"], stored["markers"], strict=True):
            np.testing.assert_array_equal(here[a["position"]], there[b["position"]])
            np.testing.assert_array_equal(here[a["orientation"]], there[b["orientation"]])
        for a, b in zip(own["arrows"], stored["arrows"], strict=True):
            assert (a["name"], a["kind"]) == (b["name"], b["kind"])
            np.testing.assert_array_equal(here[a["values"]], there[b["values"]])
        assert stored["title"] == "stored run to t = 14 s"


def test_files_that_are_no_run_of_the_scene_are_refused(run: fm.Trajectory, tmp_path: Path) -> None:
    run.to_csv(tmp_path / "trajectory.csv")
    run.restart.save(tmp_path / "restart.npz")
    (tmp_path / "torn.csv").write_text("t [s],a\n0,1\n1\n")
    (tmp_path / "empty.csv").write_text("")
    for place, said in (
        ("restart.npz", "perhaps a restart"), ("torn.csv", "a number for every column"), ("empty.csv", "no column `t"),
        ("view.html", "a stored run is a .csv or .npz"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            stored_view(boom(), tmp_path / place)
    with pytest.raises(ValueError, match="it is a run of another scene"):
        stored_view(fm.load_scene(shipped_folder() / "pendulums" / "double" / "scene.toml"), tmp_path)
    with pytest.raises(OSError):
        stored_view(boom(), tmp_path / "none.csv")


def test_a_stored_run_says_which_arrows_it_lacks(tmp_path: Path) -> None:
    made = fm.SceneBuilder("held").rigid_body("arm", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    made.revolute("pivot", "ground", "arm", angle=0.4)
    made.torque("motor", "arm", direction=(0, 0, 1), function=fm.ControlSignal(source="servo"))
    made.sense_coordinate("angle", "pivot").pid("servo", "angle", kp=20.0, period=0.05)
    fm.simulate(made.scene(), 0.3, samples=7).to_csv(tmp_path / "trajectory.csv")
    animation, _ = read(stored_view(made.scene(), tmp_path).html)
    assert animation["notes"] == ["No arrows of loads that a controller sets, as a stored run has none: motor."]
    assert not [arrow for arrow in animation["arrows"] if arrow["name"] == "motor"]


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


def test_a_mode_of_a_spin_is_one_of_the_campbell_diagram() -> None:
    """The frequency that the page plays is that of the diagram, which the spin has raised."""
    made = fm.SceneBuilder("blade").beam("blade", length=2.0, modes=3, elements=8, section=SECTION, level="stiffened")
    scene = made.revolute("shaft", "ground", "blade", axis=(0, 0, 1)).marker("end", "blade", node="tip").scene()
    diagram = fm.campbell(scene, "shaft", [0.0, 20.0])
    lowest = diagram.frequencies_hz[1].min()
    assert lowest > 1.05 * diagram.frequencies_hz[0].min()
    animation, series = read(mode_view(scene, 1, spin="shaft", rate=20.0).html)
    times = series[animation["times"]][:, 0]
    assert 1.0 / (times[-1] - times[0]) == pytest.approx(lowest, rel=1e-5)
    assert animation["title"].endswith("shaft at 20 rad/s, in the rotating frame")


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
    done = CliRunner().invoke(app, ["simulate", str(scene), "--t-end", "0.1", "--out", str(tmp_path / "run")], env=WIDE)
    assert done.exit_code == 0, done.output
    out = tmp_path / "stored.html"
    done = CliRunner().invoke(app, ["view", str(scene), str(tmp_path / "run"), "--out", str(out)], env=WIDE)
    assert done.exit_code == 0 and read(out.read_text(encoding="utf-8"))[0]["title"].startswith("stored run")
    for words, said in (
        (["--mode", "1", "--t-end", "1"], "exclude each other"),
        ([str(tmp_path), "--t-end", "1"], "exclude each other"),
        ([str(tmp_path / "none")], "a stored run is a .csv or .npz"),
        (["--spin", "shoulder", "--rate", "3"], "name one by --mode"),
        (["--mode", "1", "--rate", "3"], "name its hinge or wheel by --spin"),
        (["--out", str(tmp_path / "a.png")], "ends in .html"),
        (["--mode", "99"], "there is no mode 99"),
    ):
        done = CliRunner().invoke(app, ["view", str(scene), *words], env=WIDE)
        assert done.exit_code == 2 and said in done.output, done.output
