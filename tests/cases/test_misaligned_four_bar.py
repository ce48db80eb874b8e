"""The misaligned four-bar before its fold: a linear frame, and rods without modes."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.run.simulate import simulate
from flexmb.scene.files import load_scene
from flexmb.scene.functions import SmoothStep
from flexmb.scene.schema import BeamBody, Revolute, Scene

CASE = Path(__file__).parents[2] / "cases" / "flexible_mechanisms" / "misaligned_four_bar"
UNTIL = 2.4  # s; the fold is at 3.118 s
TILT = np.deg2rad(5.0)
ACROSS, UP = np.array([1.0, 0.0]), np.array([0.0, 1.0])  # directions of coupler and crank in the plane at the start


def loaded() -> Scene:
    return load_scene(CASE / "exact.toml")


def run(scene: Scene, until: float) -> fm.Trajectory:
    result = simulate(scene, until, samples=np.linspace(0.0, until, 7), method="radau5", rtol=1e-7, atol=1e-9)
    assert result.finished, result.message
    return result


def cantilever(bar: BeamBody, along: np.ndarray) -> np.ndarray:
    """Flexibility (3, 3) of the end of a clamped bar: [deflection along z, rotations about x and y] under [force along
    z, moments about x and y], where `along` is the direction of the bar in the plane of x and y."""
    root, L = bar.stations[0], bar.length_m
    assert root.EIz_Nm2 and root.GJ_Nm2 and root.GAz_N
    x, y = along
    turned = np.array([[1.0, 0.0, 0.0], [0.0, x, y], [0.0, -y, x]])  # to [along the bar, beside it]
    EI, GJ, GA = root.EIz_Nm2, root.GJ_Nm2, root.GAz_N
    local = np.array([
        [L**3 / (3.0 * EI) + L / GA, 0.0, -(L**2) / (2.0 * EI)],
        [0.0, L / GJ, 0.0],
        [-(L**2) / (2.0 * EI), 0.0, L / EI],
    ])  # fmt: skip
    return turned.T @ local @ turned


def carried(along: np.ndarray, length: float) -> np.ndarray:
    """Wrench (3, 3) at the root of a bar for a wrench [Fz, Mx, My] at its end."""
    x, y = length * along
    return np.array([[1.0, 0.0, 0.0], [y, 1.0, 0.0], [-x, 0.0, 1.0]])


def linear_frame(scene: Scene) -> np.ndarray:
    """Force along z, moments about x and y in pin C over the angle by which the crank turns (N/rad, N m/rad).

    Out of the plane the bars are one frame, clamped at A and D. Crank and follower turn by the angle and the coupler
    does not; the pin takes this turn about its axis up to the angle times tan(tilt) about x, which bends the frame. As
    no moment acts about the pin's axis, there is one in the plane too, -tan(tilt) times that about x, which turns each
    bar.
    """
    crank, coupler, follower = (body for body in scene.bodies if isinstance(body, BeamBody))
    at_b = carried(ACROSS, coupler.length_m)
    flexibility = cantilever(coupler, ACROSS) + at_b.T @ cantilever(crank, UP) @ at_b + cantilever(follower, UP)
    flexibility[1, 1] += np.tan(TILT) ** 2 * sum(in_plane(bar) for bar in (crank, coupler, follower))
    return np.linalg.solve(flexibility, [0.0, np.tan(TILT), 0.0])


def in_plane(bar: BeamBody) -> float:
    """Rotation of a bar's pinned end in the plane under a moment of 1 N m there."""
    root, L = bar.stations[0], bar.length_m
    assert root.EIz_Nm2 and root.GAy_N
    return L / (3.0 * root.EIz_Nm2) + 1.0 / (root.GAy_N * L)


def transmitted(scene: Scene, angle: float) -> np.ndarray:
    """Force along z, moments about x and y in pin C after the crank has turned by `angle` (rad) within a second."""
    drive = scene.hinges[0]
    assert isinstance(drive, Revolute)
    turn = SmoothStep(start_value=0.0, end_value=angle, start_s=0.0, duration_s=0.8)
    slow = replace(drive, rotation=replace(drive.rotation, prescribed_rad=turn))
    load = run(replace(scene, hinges=(slow, *scene.hinges[1:])), 1.0).loads["c"][-1]
    return load[[5, 0, 1]]


def test_pin_c_transmits_what_a_linear_frame_does_at_a_small_angle() -> None:
    """The mean over both directions: what the frame leaves out is then of the order of the angle's square, 1.6e-4.

    With the sine of the tilt instead of its tangent the frame is 4e-3 off.
    """
    scene, angle = loaded(), 0.0125
    found = (transmitted(scene, angle) - transmitted(scene, -angle)) / (2.0 * angle)
    assert found == pytest.approx(linear_frame(scene), rel=2.0 * angle**2)


def test_rods_without_modes_confirm_it_before_the_fold() -> None:
    """To the truncation error of four Runge-Kutta steps along each bar, which 20 ms in time do not add to."""
    spec = importlib.util.spec_from_file_location("misaligned_four_bar_equations", CASE / "equations.py")
    assert spec and spec.loader
    rods = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(rods)
    result = run(loaded(), UNTIL)
    found = rods.exact(result.t, ((UNTIL, 0.02),))
    errors = {name: np.max(np.abs(values - measured(result, name))) for name, values in found.items()}
    for name, error in errors.items():
        assert error < (2e-7 if name.startswith("marker:") else 1e-3), name  # of 0.1 m; of 540 N, 120 N m
    stiff = run(stiffer(loaded(), "follower", 1.01), UNTIL)  # the negative control
    assert np.max(np.abs(found["load:c.force"] - measured(stiff, "load:c.force"))) > 1.0


def measured(result: fm.Trajectory, channel: str) -> np.ndarray:
    """Values (T, 3) of `load:NAME.force`, `load:NAME.torque` or `marker:NAME.position`."""
    kind, _, rest = channel.partition(":")
    name, _, part = rest.partition(".")
    if kind == "marker":
        return result.markers[name].position
    return result.loads[name][:, slice(3, 6) if part == "force" else slice(0, 3)]


def stiffer(scene: Scene, name: str, factor: float) -> Scene:
    (body,) = (body for body in scene.bodies if body.name == name)
    assert isinstance(body, BeamBody)
    stations = tuple(replace(station, EIy_Nm2=factor * (station.EIy_Nm2 or 0.0)) for station in body.stations)
    return replace(scene, bodies=tuple(replace(body, stations=stations) if b is body else b for b in scene.bodies))
