"""What a linear model gives away: responses, steps, marker shapes, exports, and the commands that print it."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.linalg import expm
from scipy.signal import lsim
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from tests.bounds import UNIT_ROUNDOFF, observed_order

ROUNDING = 2.0**10 * UNIT_ROUNDOFF
M, L, K, D, G = 2.0, 0.7, 30.0, 0.8, 9.81
INERTIA = 0.05 + M * L**2


def arm(torque: float | None = None, **more) -> fm.Scene:
    return (
        fm.SceneBuilder("arm", gravity=(0.0, 0.0, -G))
        .rigid_body("bob", mass=M, com=(L, 0.0, 0.0), inertia=(0.05, 0.05, 0.05))
        .revolute(
            "pivot", "ground", "bob", axis=(0.0, 1.0, 0.0), stiffness=K, damping=D,
            torque=None if torque is None else fm.Constant(value=torque), **more,
        )
        .marker("end", "bob", offset=(1.0, 0.0, 0.0))
        .scene()
    )  # fmt: skip


@pytest.fixture(scope="module")
def model() -> fm.LinearModel:
    system = fm.compile(arm())
    return fm.linearize(system, fm.equilibrium(system))


def test_frequency_response(model):
    """1 / (k - m g l sin(theta)... - I omega^2 + i omega d), exact at every omega; the speed is i omega times it."""
    omega, theta = np.array([0.0, 1.0, 5.0, 50.0]), model.state.q[0]
    stiffness = K + M * G * L * np.sin(theta)
    expected = 1.0 / (stiffness - INERTIA * omega**2 + 1j * omega * D)
    found = model.frequency_response("pivot.rotation", omega, ("pivot.rotation", "pivot.rotation.rate", "end.x"))
    np.testing.assert_allclose(found[:, 0], expected, rtol=ROUNDING)
    np.testing.assert_allclose(found[1:, 1], (1j * omega * expected)[1:], rtol=ROUNDING)
    np.testing.assert_allclose(found[:, 2], -np.sin(theta) * expected, rtol=ROUNDING)


def test_names_that_do_not_exist(model):
    with pytest.raises(KeyError, match="there are pivot.rotation"):
        model.frequency_response("elbow", 1.0)
    with pytest.raises(KeyError, match="end.x"):
        model.frequency_response("pivot.rotation", 1.0, ("tip.x",))


def test_a_row_is_undetermined_as_a_whole_or_not_at_all(model):
    """One NaN beside numbers, or a row of C beside numbers of D, is no undetermined load but a fault."""
    C, D = model.C.copy(), model.D.copy()
    C[-1], D[-1] = np.nan, np.nan
    assert np.isnan(replace(model, C=C, D=D).C[-1]).all()
    columns = np.where(np.arange(C.shape[1]) == 0, np.nan, model.C)
    for changes in ({"C": C}, {"D": D}, {"C": np.full_like(C, np.nan)}, {"C": columns}):
        with pytest.raises(ValueError, match="is nan: give finite numbers"):
            replace(model, **changes)


def test_undamped_resonance_has_no_response():
    scene = fm.SceneBuilder("oscillator").rigid_body("mass", mass=1.0, inertia=(1.0, 1.0, 1.0))
    model = fm.linearize(scene.prismatic("slide", "ground", "mass", stiffness=4.0).scene())
    with pytest.raises(ValueError, match="2 rad/s is an undamped resonance"):
        model.frequency_response("slide.translation", [1.0, 2.0])


def test_step_response_of_small_amplitude(model):
    """Runs under a step of the torque against x(t) = A^-1 (exp(A t) - 1) B f: what differs is of order f^2."""
    t_end, sizes, errors = 1.0, np.array([0.4, 0.2, 0.1, 0.05]), []
    response = np.linalg.solve(model.A, (expm(t_end * model.A) - np.eye(2)) @ model.B[:, 0])
    for size in sizes:
        run = fm.simulate(arm(size, angle=float(model.state.q[0])), t_end, rtol=1e-13, atol=1e-14, samples=2)
        errors.append(np.max(np.abs(np.array([run.q[-1, 0] - model.state.q[0], run.u[-1, 0]]) - size * response)))
    assert observed_order(sizes, errors, 1e-12) == pytest.approx(2.0, abs=0.05)


def test_shapes_for_display(model):
    mode = model.modes[0]
    theta = model.state.q[0]
    shape = model.marker_shape(mode, "end")
    np.testing.assert_allclose(shape, [-np.sin(theta), 0.0, -np.cos(theta), 0.0, 1.0, 0.0], atol=ROUNDING)
    assert model.displaced(mode, 0.1).q[0] == pytest.approx(theta + 0.1, rel=ROUNDING)
    assert model.displaced(mode, 0.1, np.pi / 2).q[0] == pytest.approx(theta, rel=ROUNDING)


def test_scipy_and_files(model, tmp_path):
    space = model.to_scipy()
    np.testing.assert_array_equal(space.A, model.A)
    t = np.linspace(0.0, 1.0, 11)
    expected = model.C @ np.linalg.solve(model.A, (expm(model.A) - np.eye(2)) @ model.B[:, 0])
    np.testing.assert_allclose(lsim(space, np.ones(11), t)[1][-1], expected, atol=ROUNDING)
    with np.load(model.save(tmp_path / "deep" / "arm.npz")) as kept:
        np.testing.assert_array_equal(kept["C"], model.C)
        assert kept["outputs"][2] == "end.x [m]"
    kept = loadmat(model.save(tmp_path / "arm.mat"), squeeze_me=True)
    np.testing.assert_array_equal(kept["A"], model.A)
    assert kept["outputs"][2] == "end.x [m]"
    with pytest.raises(ValueError, match=r"\.npz or \.mat"):
        model.save(tmp_path / "arm.txt")


def test_python_control_is_optional(model, monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ImportError, match="to_scipy"):
        model.to_control()


def test_python_control_gets_the_names(model, monkeypatch):
    """Its constructor is called as its documentation has it: matrices, then labels by keyword."""
    called = {}

    class Control:
        @staticmethod
        def ss(*matrices, **names):
            if any("." in name for name in (*names["inputs"], *names["outputs"])):
                raise ValueError("'.' not allowed")  # as python-control 0.10 says; names of states may have it
            called.update(names, matrices=matrices)
            return "system"

    monkeypatch.setitem(sys.modules, "control", Control)
    assert model.to_control() == "system"
    assert called["states"] == ["pivot.rotation", "pivot.rotation.rate"]
    assert len(called["matrices"]) == 4 and len(called["outputs"]) == len(model.C)


def invoke(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "arm.toml"
    fm.save_scene(arm(), path)
    return path


def test_command_prints_modes_and_writes_matrices(scene_file, tmp_path, model):
    result = invoke("linearize", scene_file, "--export", tmp_path / "arm.npz")
    assert result.exit_code == 0, result.output
    for word in ("pivot.rotation 100 %", "asymptotically stable", f"{model.modes[0].frequency_hz:.6g}", "arm.npz"):
        assert word in result.output
    result = invoke("linearize", scene_file, "--at", "initial")
    assert "not an equilibrium" in result.output


@pytest.mark.parametrize("words", [("--at", "rest"), ("--spin", "elbow", "--rate", 1), ("--export", "arm.txt")])
def test_command_names_what_is_wrong(scene_file, words):
    result = invoke("linearize", scene_file, *words)
    assert result.exit_code == 2
    assert "error:" in result.output and "Traceback" not in result.output


def test_command_says_where_nothing_rests(tmp_path):
    stone = fm.SceneBuilder("stone", gravity=(0.0, 0.0, -G)).rigid_body("stone", mass=2.0, inertia=(1.0, 1.0, 1.0))
    fm.save_scene(stone.free("fly", "ground", "stone").scene(), tmp_path / "stone.toml")
    result = invoke("linearize", tmp_path / "stone.toml")
    assert result.exit_code == 1
    assert "fly.position.z" in result.output


def test_campbell_command(tmp_path):
    scene = (
        fm.SceneBuilder("rail")
        .rigid_body("rail", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("drive", "ground", "rail")
        .rigid_body("bead", mass=1.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("slide", "rail", "bead", axis=(1, 0, 0), stiffness=9.0)
        .scene()
    )
    fm.save_scene(scene, tmp_path / "rail.toml")
    words = ("campbell", tmp_path / "rail.toml", "drive", "--picture", tmp_path / "rail.png")
    result = invoke(*words, "--rates", "0:4:5", "--csv", tmp_path / "rail.csv")
    assert result.exit_code == 0, result.output
    assert "unstable at 4 rad/s" in result.output
    assert (tmp_path / "rail.png").exists() and (tmp_path / "rail.csv").exists()
    for rates in ("0:4", "a:b:c", "0:4:1"):
        assert invoke(*words, "--rates", rates).exit_code == 2


def test_functions_of_time_go_on_or_are_held():
    """A mass on a radial spring, its rail driven: w^2 = k/m - Omega^2, or k/m where the drive stands still."""
    scene = (
        fm.SceneBuilder("rail")
        .rigid_body("rail", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("drive", "ground", "rail", prescribed=fm.Ramp(rate=3.0))
        .rigid_body("bead", mass=1.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("slide", "rail", "bead", axis=(1, 0, 0), stiffness=25.0, force=fm.Ramp(value=0.5, rate=2.0))
        .scene()
    )
    system = fm.compile(scene)
    moving, held = fm.linearize(system), fm.linearize(system, held=True)
    assert moving.displacements == held.displacements == ("slide.translation",)
    np.testing.assert_allclose([model.modes[0].frequency_rad_s for model in (moving, held)], [4.0, 5.0], rtol=ROUNDING)
    np.testing.assert_allclose([moving.rates[0], moving.drift[0], held.drift[0]], [0.5, 2.0, 0.0], rtol=ROUNDING)
    assert fm.equilibrium(system).q[1] == pytest.approx(0.5 / 25.0, rel=ROUNDING)
