"""The command `flexmb`, run as a user runs it."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app, running
from flexmb.run.warm_up import pendulum
from flexmb.scene.shapes import beam_section


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "scene.toml"
    fm.save_scene(pendulum(), path)
    return path


def invoke(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_simulate_writes_a_csv_and_charts_and_tells_what_happened(scene_file, tmp_path):
    result = invoke("simulate", scene_file, "--t-end", 0.5, "--samples", 11, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert len((tmp_path / "out" / "trajectory.csv").read_text().splitlines()) == 12
    assert (tmp_path / "out" / "energy.png").exists()
    for word in ("finished at t = 0.5 s", "energy drift", "momentum change", "accepted", "compile", "trajectory.csv"):
        assert word in result.output


def test_a_run_ends_with_where_the_peaks_are_and_when(scene_file, tmp_path):
    words = ("simulate", scene_file, "--t-end", 3, "--samples", 3, "--out", tmp_path, "--no-plots")
    run = fm.simulate(pendulum(), 3.0, samples=3)
    force = run.envelope.loads["pivot"]
    axis = 3 + int(np.argmax(force.largest[3:]))
    peak = force.greatest[axis] if force.greatest[axis] == force.largest[axis] else force.least[axis]
    assert abs(peak) > 1.002 * np.abs(run.loads["pivot"][:, axis]).max()  # at the output times it is missed
    result = invoke(*words)
    table = result.output[result.output.index("Peaks of loads over all steps") :].splitlines()
    (row,) = [line for line in table if line.startswith(f"pivot.force.{'xyz'[axis - 3]}")]
    assert f"{peak:.6g} N" in row and max(map(len, table)) <= 80
    assert "zero but for rounding: pivot.torque" in result.output
    assert not (tmp_path / "envelope.csv").exists()
    result = invoke(*words, "--envelope")
    assert result.exit_code == 0, result.output
    rows = dict(line.split(",", 1) for line in (tmp_path / "envelope.csv").read_text().splitlines())
    assert float(rows[row.split()[0]].split(",")[3]) == force.greatest[axis]
    result = invoke(*words, "--no-envelope")  # an earlier run's does not stay beside another trajectory
    assert not (tmp_path / "envelope.csv").exists()
    sampled = run.loads["pivot"][:, axis]
    assert "over the 3 output times\n" in result.output
    assert f"{sampled[np.argmax(np.abs(sampled))]:.6g} N" in result.output and f"{peak:.6g} N" not in result.output


def test_long_runs_are_not_followed_unasked_and_a_quiet_one_tells_its_files(scene_file, tmp_path, monkeypatch):
    words = ("simulate", scene_file, "--t-end", 0.5, "--samples", 3, "--out", tmp_path, "--no-plots")
    monkeypatch.setattr(running, "SHORT", 10)
    assert "over the 3 output times; --envelope finds those between" in invoke(*words).output
    lines = invoke(*words, "--quiet").output.splitlines()
    assert [line.split()[0] for line in lines] == ["wrote"] and "trajectory.csv" in lines[0]


def test_peaks_that_cannot_be_followed_are_those_of_the_output_times(scene_file, tmp_path, monkeypatch):
    def fails(self):
        raise fm.DynamicsError("the motion cannot be followed")

    monkeypatch.setattr(fm.Trajectory, "envelope", property(fails))
    words = ("simulate", scene_file, "--t-end", 0.5, "--samples", 3, "--out", tmp_path, "--no-plots")
    result = invoke(*words)
    assert result.exit_code == 0 and "over the 3 output times: the motion cannot be followed" in result.output
    assert invoke(*words, "--envelope").exit_code == 1


def test_a_run_that_stops_early_writes_what_it_reached_and_exits_1(tmp_path):
    bead = (
        fm.SceneBuilder("centrifuge")
        .rigid_body("rail", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("bead", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("drive", "ground", "rail", prescribed=fm.Ramp(rate=1e3))
        .prismatic("slide", "rail", "bead", axis=(1.0, 0.0, 0.0), position=1.0)
        .scene()
    )
    fm.save_scene(bead, tmp_path / "bead.toml")
    result = invoke("simulate", tmp_path / "bead.toml", "--t-end", 2, "--out", tmp_path, "--no-plots")
    assert result.exit_code == 1
    assert "no longer finite" in result.output
    assert (tmp_path / "trajectory.csv").exists()
    assert not list(tmp_path.glob("*.png"))


def test_methods_for_stiff_scenes_tell_their_jacobians(scene_file, tmp_path):
    words = ("simulate", scene_file, "--t-end", 0.5, "--samples", 11, "--out", tmp_path, "--no-plots")
    result = invoke(*words, "--method", "radau5", "--rtol", 1e-6, "--atol", 1e-8)
    assert result.exit_code == 0, result.output
    assert " Jacobians, " in result.output
    result = invoke(*words, "--method", "radau5", "--spectral-radius", 0.5)
    assert result.exit_code == 2
    assert 'spectral_radius is for method "generalised_alpha"' in result.output


@pytest.mark.filterwarnings("default")  # what a command warns of is printed, no error
def test_a_doubtful_scene_is_warned_of_and_with_strict_an_error(scene_file, tmp_path):
    """By check and by simulate; not where the scene says that it is meant."""
    text = scene_file.read_text().replace("child = ", "rotation = { damping_Nms_rad = -0.1 }\nchild = ", 1)
    scene_file.write_text(text)
    for words in (("check", scene_file), ("simulate", scene_file, "--t-end", 0.1, "--out", tmp_path, "--no-plots")):
        result = invoke(*words)
        assert result.exit_code == 0, result.output
        for word in ("warning: ", "negative damping: -0.1", "-> give a damping", 'allow = ["negative_damping"]'):
            assert word in result.stderr
            assert word not in result.stdout
        assert "damping_Nms_rad" in result.stderr
        strictly = invoke(*words, "--strict")
        assert strictly.exit_code == 2
        assert "error: " in strictly.stderr and "negative damping" in strictly.stderr
    scene_file.write_text('allow = ["negative_damping"]\n' + text)
    result = invoke("check", scene_file, "--strict")
    assert (result.exit_code, result.stderr) == (0, "")


def test_errors_are_estimated_on_request(scene_file, tmp_path):
    words = ("simulate", scene_file, "--t-end", 0.5, "--samples", 11, "--out", tmp_path, "--no-plots", "--rtol", 1e-6)
    assert "largest error" not in invoke(*words).output
    result = invoke(*words, "--error-estimate")
    assert result.exit_code == 0, result.output
    for word in ("Errors by a tighter run", "marker:centre.position", "e-", "load:pivot.force"):
        assert word in result.output
    assert "nan" not in result.output


@pytest.fixture
def beam_file(tmp_path):
    strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700)
    scene = (
        fm.SceneBuilder("pendulum", gravity=(0, -9.81, 0))
        .beam("rod:1", length=1.0, elements=4, section=strip, modes=2)
        .revolute("pivot", "ground", "rod:1", angle=0.5)
        .scene()
    )
    fm.save_scene(scene, tmp_path / "rod.toml")
    return tmp_path / "rod.toml"


def test_section_loads_are_written(beam_file, tmp_path):
    """At given places, or at 21; a name may hold a colon; the root's shear is the hinge's force."""
    words = ("simulate", beam_file, "--t-end", 0.2, "--samples", 3, "--out", tmp_path, "--no-plots")
    assert invoke(*words, "--sections", "rod:1").exit_code == 0
    assert len((tmp_path / "sections-rod:1.csv").read_text().splitlines()) == 1 + 3 * 21
    result = invoke(*words, "--sections", "rod:1:0,0.5")
    assert result.exit_code == 0, result.output
    assert "sections-rod:1.csv" in result.output
    header, *rows = [line.split(",") for line in (tmp_path / "sections-rod:1.csv").read_text().splitlines()]
    assert header[:4] == ["t [s]", "x [m]", "axial [N]", "shear_y [N]"] and len(rows) == 6
    table = (tmp_path / "trajectory.csv").read_text().splitlines()
    first = dict(zip(table[0].split(","), table[1].split(","), strict=True))
    force = [float(first[f"pivot.force.{axis} [N]"]) for axis in "xy"]
    assert float(rows[0][2]) ** 2 + float(rows[0][3]) ** 2 == pytest.approx(force[0] ** 2 + force[1] ** 2)
    for wrong in ("bar", "rod:1:0,x", "rod:1:2.0"):
        result = invoke(*words, "--sections", wrong)
        assert result.exit_code == 2 and "--sections" in result.output


def test_mass_properties_are_printed(beam_file):
    result = invoke("mass", beam_file)
    assert result.exit_code == 0, result.output
    for word in ("Mass properties of pendulum", "scene", "rod:1", "0.27", "0.5, 0, 0", "0.0225"):
        assert word in result.output
    assert invoke("mass", beam_file, "--body", "bar").exit_code == 2


def test_check_finds_defects_with_place_and_remedy(scene_file, tmp_path):
    assert invoke("check", scene_file).exit_code == 0
    scene_file.write_text(scene_file.read_text().replace('child = "bob"', 'child = "bop"'))
    result = invoke("check", scene_file)
    assert result.exit_code == 2
    assert "hinges[0]" in result.output
    assert 'did you mean "bob"?' in result.output
    assert "Traceback" not in result.output


@pytest.mark.parametrize(
    "words",
    [
        ("-1",), ("nan",), ("inf",), ("1", "--method", "euler"), ("1", "--rtol", "1e-20"), ("1", "--rtol", "0.2"),
        ("1", "--samples", "1000000000"), ("1", "--samples", "1"), ("1", "--atol", "inf"),
        ("1", "--method", "rk4", "--step", "1e-300"), ("1", "--method", "rk4", "--step", "nan"),
        ("1", "--algorithm", "newton"),
    ],
)  # fmt: skip
def test_wrong_options_exit_2_with_a_remedy(scene_file, words, tmp_path):
    result = invoke("simulate", scene_file, "--out", tmp_path / "out", "--t-end", *words)
    assert result.exit_code == 2
    assert "error:" in result.output
    assert len(result.output.strip().splitlines()) <= 3  # of a scene: its name, what is wrong, the remedy
    assert "Traceback" not in result.output
    assert not (tmp_path / "out").exists()


def test_a_missing_file_is_no_traceback(tmp_path):
    result = invoke("check", tmp_path / "nowhere.toml")
    assert result.exit_code == 2
    assert "nowhere.toml" in result.output


def test_schema_is_json_schema():
    result = invoke("schema")
    assert result.exit_code == 0
    assert "Scene" in json.loads(result.output)["$defs"]


@pytest.mark.parametrize("words", [(), ("simulate",), ("check",), ("schema",)])
def test_help_teaches(words):
    result = invoke(*words, "--help")
    assert result.exit_code == 0
    assert "flexmb" in result.output


def test_advise_writes_the_reduced_scene_and_the_command_that_runs_it(tmp_path):
    profile = fm.SmoothStep(start_value=0.0, end_value=0.5, start_s=0.0, duration_s=1.0)
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=1.7e-10, Iz=1.7e-10, rho=2700.0)
    modes = fm.Modes(count=3, families=("bending_y",))
    arm = fm.SceneBuilder("arm").beam("arm", length=1.0, elements=8, section=section, modes=modes, points="line")
    arm = arm.revolute("hub", "ground", "arm", prescribed=profile).marker("tip", "arm", node="tip").scene()
    fm.save_scene(arm, tmp_path / "arm.toml")
    reduced = tmp_path / "new" / "small.toml"
    result = invoke("advise", tmp_path / "arm.toml", "--tol", 0.01, "--t-end", 1.2, "--out", reduced)
    assert result.exit_code == 0, result.output
    for word in ("Model of each flexible body", "predicted", "measured", "because", "Measured against", "adequate"):
        assert word in result.output
    command = result.output.strip().splitlines()[-1].split()
    assert command[:3] == ["flexmb", "simulate", str(reduced)]
    assert invoke(*command[1:], "--out", tmp_path, "--no-plots").exit_code == 0
    assert invoke("advise", tmp_path / "arm.toml", "--quantity", "marker:nose.position").exit_code == 2
    refused = invoke("advise", tmp_path / "arm.toml", "--tol", 1e-9, "--t-end", 1.2, "--out", tmp_path / "none.toml")
    assert refused.exit_code == 1 and "refused" in refused.output
    assert not (tmp_path / "none.toml").exists()


def test_simulate_sets_values_begins_later_and_goes_on(scene_file, tmp_path):
    """Two runs by the command line end as one does, to the last digit that is written."""
    words = ("simulate", scene_file, "--set", "bob.mass_kg=2.5", "--from-time", 1, "--no-plots", "--samples", 3)
    assert invoke(*words, "--t-end", 2, "--out", tmp_path / "whole").exit_code == 0
    assert invoke(*words, "--t-end", 1.5, "--out", tmp_path / "first").exit_code == 0
    restart = tmp_path / "first" / "restart.npz"
    on = ("simulate", scene_file, "--set", "bob.mass_kg=2.5", "--no-plots", "--samples", 2, "--out", tmp_path / "later")
    result = invoke(*on, "--t-end", 2, "--restart", restart)
    assert result.exit_code == 0 and "restart.npz" in result.output, result.output
    whole, later = ((tmp_path / name / "trajectory.csv").read_text().splitlines() for name in ("whole", "later"))
    assert whole[-1].startswith("2,") and later[-1] == whole[-1]
    (tmp_path / "cut.npz").write_bytes(restart.read_bytes()[:1000])  # as a run leaves it that is killed
    with np.load(restart) as file:
        np.savez(tmp_path / "nan.npz", **{name: file[name] for name in file} | {"numbers": np.full(11, np.nan)})
    wrong = ("--set", "bob.mass=1"), *(("--restart", tmp_path / name) for name in ("scene.toml", "cut.npz", "nan.npz"))
    for more, message in zip(wrong, ('did you mean "mass_kg"', *["no restart"] * 3), strict=True):
        result = invoke(*on, "--t-end", 2, *more)
        assert result.exit_code == 2 and message in result.output, result.output
