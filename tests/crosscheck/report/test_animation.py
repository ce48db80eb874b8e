"""What an animation shows: every body of every shipped case, and wheels at the angle that mechanics gives them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.engines.native import NativeEngine
from crosscheck.engines.registry import PROVIDER
from crosscheck.judging.results import CaseResults, Result, collect
from crosscheck.library.find import Case, load_case, resolve
from crosscheck.records.archive import read
from crosscheck.records.kinds import FILM, RunRecord
from crosscheck.records.packing import pack
from crosscheck.report.animation import animations, wheel_angle
from crosscheck.running.execute import execute
from crosscheck.running.plan import plan, variant_scene
from flexmb.interchange.sid import sid_of, write_sid
from flexmb.scene.bodies import BeamStation, Modes, SidBody
from flexmb.scene.build import SceneBuilder
from flexmb.scene.connectors import HingeFriction
from flexmb.typing import Real
from flexmb.view.drawing import Drawing, DrawnWheel
from flexmb.view.film import film
from flexmb.view.store import Store
from tests.crosscheck.sessions import CASE, shipped
from tests.flexmb.interchange.made_bodies import beam, swinging


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=pytest.mark.slow if case.name == "chains/thousand_rods" else [], id=case.name)
        for case in shipped()
    ],
)
def test_every_body_wheel_mass_and_connector_is_drawn(case: Case) -> None:
    record, _ = plan(case, (), PROVIDER, films=True)
    for variant in record.run.variants:
        info = record.variants[variant.name]
        drawing = info.film or info.drawing
        if info.error or "native" not in variant.engines:
            continue
        scene = case.scene(variant)
        if variant.transform != "modal_points":
            scene = variant_scene(scene, variant)
        assert drawing is not None
        shown = (*scene.bodies, *scene.point_masses, *(x for x in scene.connectors if not isinstance(x, HingeFriction)))
        assert {line.body for line in drawing.lines} == {each.name for each in shown}, variant.name
        assert {wheel.name for wheel in drawing.wheels} == {wheel.name for wheel in scene.wheels}, variant.name


def test_what_is_drawn_in_whole_by_its_own_markers_needs_no_film() -> None:
    record, jobs = plan(load_case(CASE), (), "tests.crosscheck.fake_engines:engines", films=True)
    assert all(info.film is None for info in record.variants.values())
    assert FILM not in {job.role for job in jobs}


@pytest.fixture(scope="module")
def four_bar() -> tuple[CaseResults, Drawing]:
    """The rigid four-bar, run and filmed in this process."""
    (case,) = resolve(("closed_chains/four_bar",))
    record, jobs = plan(case, ("native",), PROVIDER, films=True)
    records: list[object] = [record]
    for job in jobs:
        if job.role in ("main", FILM):
            execute(job, lambda each: records.append(each) if isinstance(each, RunRecord) else None)
    (results,) = collect(records).cases  # type: ignore[arg-type]
    drawing = record.variants["rigid"].film
    assert drawing is not None
    return results, drawing


def placed(result: Result, marker: str, offset: Real) -> Real:
    """A carried point over time (T,3)."""
    turned = Rotation.from_quat(result.values(f"marker:{marker}.orientation")[:, [1, 2, 3, 0]])
    return result.values(f"marker:{marker}.position") + turned.apply(offset)


def test_a_film_is_the_motion_that_is_judged(four_bar: tuple[CaseResults, Drawing]) -> None:
    results, _ = four_bar
    main, film = results.get("rigid", "native"), results.get("rigid", "native", FILM)
    assert film.times[-1] == main.times[-1]
    for name in ("marker:joint.position", "marker:joint.orientation"):
        np.testing.assert_allclose(film.values(name)[-1], main.values(name)[-1], atol=1e-9)


def test_a_closed_loop_is_drawn_closed(four_bar: tuple[CaseResults, Drawing]) -> None:
    """Every joint of the mechanism is where arms of two bodies end, or of one body at the ground, at all times."""
    results, drawing = four_bar
    film = results.get("rigid", "native", FILM)
    arms = [line for line in drawing.lines if line.kind == "arm"]
    ends = [placed(film, line.points[1].marker, np.array(line.points[1].offset)) for line in arms]
    met = [sum(np.abs(one - other).max() < 1e-7 for other in ends) for one in ends]
    fixed = [np.ptp(one, axis=0).max() < 1e-7 for one in ends]
    assert len(ends) == 6 and sum(fixed) == 2
    assert all(count == 2 for count, still in zip(met, fixed, strict=True) if not still)


def test_the_film_is_shown_and_the_markers_where_there_is_none(four_bar: tuple[CaseResults, Drawing]) -> None:
    results, drawing = four_bar
    (shown,) = animations(Store(), results)
    assert {line["body"] for line in shown["lines"]} == {"crank", "coupler", "rocker"}
    without = CaseResults(results.case, {key: result for key, result in results.results.items() if key[2] != FILM})
    (shown,) = animations(Store(), without)
    assert {line["body"] for line in shown["lines"]} == {"coupler", "rocker"}
    assert drawing.gravity != (0.0, 0.0, 0.0)


def ridden(turning: Real, torque: Real, quaternions: Real, times: Real) -> Result:
    channels = {
        "marker:m.orientation": pack(quaternions),
        "marker:m.angular_velocity": pack(turning),
        "wheel_load:w.torque": pack(torque),
    }
    run = RunRecord(
        case="c", variant="v", role=FILM, engine="e", version="", scene="", status="finished", times=pack(times),
        channels=channels,
    )  # fmt: skip
    return Result("v", "e", "finished", "", (run,))


def test_a_wheel_keeps_its_axial_momentum_while_its_bearing_turns() -> None:
    """A free wheel whose body turns about the wheel's axis at the rate 0.3 t keeps its rate in World."""
    times = np.linspace(0.0, 2.0, 401)
    turning = np.stack([0.0 * times, 0.0 * times, 0.3 * times], axis=1)
    half = 0.5 * 0.15 * times**2
    quaternions = np.stack([np.cos(half), 0.0 * times, 0.0 * times, np.sin(half)], axis=1)
    result = ridden(turning, np.zeros((len(times), 3)), quaternions, times)
    angle = wheel_angle(result, wheel(speed=5.0))
    np.testing.assert_allclose(angle, 0.25 + 5.0 * times - 0.15 * times**2, atol=1e-5)


def test_a_motor_spins_a_wheel_up_about_an_axis_that_is_turned() -> None:
    """On a body turned by 90 degrees about x, the wheel's z axis lies along -y of World."""
    times = np.linspace(0.0, 2.0, 401)
    quaternions = np.tile([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0], (len(times), 1))
    torque = np.tile([0.0, -0.4, 7.0], (len(times), 1))
    result = ridden(np.zeros((len(times), 3)), torque, quaternions, times)
    angle = wheel_angle(result, wheel(speed=0.0))
    np.testing.assert_allclose(angle, 0.25 + 0.5 * 0.4 / 0.1 * times**2, atol=1e-4)


def wheel(speed: float) -> DrawnWheel:
    return DrawnWheel(
        name="w", marker="m", centre=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), radius_m=0.1, width_m=0.02,
        axial_inertia_kg_m2=0.1, speed_rad_s=speed, angle_rad=0.25,
    )  # fmt: skip


def test_records_of_older_versions_are_drawn(tmp_path: Path) -> None:
    """Their points have no tangents, their boxes are edges, and there are no films."""
    line = (
        b'{"record":"case","case":"a/b","run":{"title":"t","duration_s":1,"samples":2,"variant":[{"name":"v",'
        b'"engines":["e"]}]},"provenance":null,"readme":"","variants":{"v":{"level":"rigid","drawing":{"lines":'
        b'[{"body":"x","kind":"box","points":[["m",[0,0,0]],["m",[1,0,0]]]}],"trails":["m"]}}}}\n'
    )
    (tmp_path / "records.jsonl").write_bytes(line)
    (record,) = read(tmp_path / "records.jsonl")
    drawing = record.variants["v"].drawing
    assert drawing.lines[0].points[1].tangent == (0.0, 0.0, 0.0) and drawing.wheels == ()


def test_a_body_in_a_sid_file_is_drawn_by_the_nodes_of_the_file(tmp_path: Path) -> None:
    write_sid(sid_of(beam()), tmp_path / "rod.sid")
    scene = swinging(SidBody(name="rod", file=str(tmp_path / "rod.sid")), "root", "tip")
    filmed = film(scene)
    assert filmed is not None
    assert {line.body for line in filmed[1].lines} == {"rod", "load"}
    (rod,) = (line for line in filmed[1].lines if line.kind == "beam")
    assert len(rod.points) >= 2
    assert film(swinging(SidBody(name="rod", file=str(tmp_path / "none.sid")), "root", "tip")) is None


def test_a_point_mass_that_moves_is_filmed_as_a_body_on_slides() -> None:
    """And arrives where the native code has it: the carrier's motion stays what it was."""
    (case,) = resolve(("spacecraft/slosh",))
    scene = case.scene(case.run.variants[0])
    filmed = film(scene)
    assert filmed is not None
    (ball,) = (line for line in filmed[1].lines if line.kind == "ball")
    assert ball.body == "liquid" and ball.points[0].marker == "liquid origin drawn"
    before, after = (NativeEngine().compile(each).evaluate() for each in (scene, filmed[0]))
    for name, marker in before.markers.items():
        np.testing.assert_allclose(after.markers[name].acceleration, marker.acceleration, rtol=1e-9, atol=1e-12)


def test_a_film_climbs_no_ladder_and_is_found_all_the_same() -> None:
    """Where the case prescribes efforts, the coarsest of them is enough for a drawing."""
    (case,) = resolve(("deploying_boom/flexible",))
    record, jobs = plan(case, ("native",), PROVIDER, films=True)
    own = (job for job in jobs if job.engine == "native" and job.variant == "segments")
    main, film_job = (job for job in own if job.role in ("main", FILM))
    assert film_job.role == FILM and film_job.efforts == main.efforts[:1] != ()
    records: list[object] = [record]
    execute(film_job, lambda each: records.append(each) if isinstance(each, RunRecord) else None)
    (results,) = collect(records).cases  # type: ignore[arg-type]
    assert results.get("segments", "native", FILM).status == "finished"


def test_a_beam_curved_to_a_ring_is_drawn_along_its_axis() -> None:
    """Its tip is nearer to its root than its middle is; tangents are those of the circle."""
    section = BeamStation(
        x_m=0.0, EA_N=1e6, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0,
        curvature_1_m=(0.0, 0.0, 1.8 * np.pi),
    )  # fmt: skip
    modes = Modes(count=3, families=("bending_y",))
    builder = SceneBuilder("ring").beam("ring", length=1.0, elements=1, section=section, modes=modes, level="exact")
    filmed = film(builder.weld("clamp", "ground", "ring").marker("end", "ring", node="tip").scene())
    assert filmed is not None
    (line,) = filmed[1].lines
    seen = NativeEngine().compile(filmed[0]).evaluate().markers
    _, *inner, tip = (point for point in line.points if point.marker)  # the frame's origin is the root
    assert tip.marker == "end" and len(inner) == 12
    radius = 1.0 / (1.8 * np.pi)
    for i, point in enumerate((*inner, tip)):
        marker, angle = seen[point.marker], 1.8 * np.pi * i / 12
        expected = radius * np.array([np.sin(angle), 1.0 - np.cos(angle), 0.0])
        np.testing.assert_allclose(marker.position, expected, atol=1e-12)
        turn = Rotation.from_quat(marker.quaternion, scalar_first=True)
        np.testing.assert_allclose(turn.apply(point.tangent), [np.cos(angle), np.sin(angle), 0.0], atol=1e-12)
