"""What is unusual but right passes the checks, and a scene's defects are reported together."""

import tracemalloc
import zipfile

import msgspec
import numpy as np
import pytest

from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder, angular
from flexmb.scene.check import SceneError, check_scene
from flexmb.scene.check.profiles import start_of
from flexmb.scene.modal_data import inertia_points, modal_arrays
from flexmb.scene.shapes import cuboid_inertia
from flexmb.scene.tree import ordered
from tests.flexmb.scene.bad_scenes import BALL, NONE, satellite

BOX = cuboid_inertia(1.0, (1.0, 2.0, 3.0))


def station(x, EA, EI, mass, rotary=0.0):
    return s.BeamStation(
        x_m=x, EA_N=EA, EIy_Nm2=EI, EIz_Nm2=EI, GJ_Nm2=EI, mass_per_length_kg_m=mass, rotary_y_kg_m=rotary,
        rotary_z_kg_m=rotary,
    )  # fmt: skip


def beam_scene(stations, modes=3, **more) -> s.Scene:
    length = stations[-1].x_m
    return (
        SceneBuilder("beam").beam("beam", length=length, elements=8, section=stations, modes=modes, **more)
        .revolute("hub", "ground", "beam").scene()
    )  # fmt: skip


@pytest.mark.parametrize(
    ("length", "EA", "EI", "mass"),
    [(8.0, 5.03e6, 566.6, 0.2019), (10.0, 2.8e7, 1.4e4, 1.2), (10.0, 1e4, 100.0, 1.0), (1.0, 73e6, 608.3, 2.68)],
    ids=["Kane 1987", "Simo and Vu-Quoc spin-up", "flying spaghetti", "lateral buckling"],
)
def test_benchmark_beams_of_the_literature(length, EA, EI, mass):
    beam_scene([station(0.0, EA, EI, mass), station(length, EA, EI, mass)])


def test_a_jump_in_section():
    thick, thin = (1e7, 1e3, 1.0), (5e6, 5e2, 0.5)
    beam_scene([station(0.0, *thick), station(1.0, *thick), station(1.0, *thin), station(3.0, *thin)])


@pytest.mark.parametrize("level", ["rigid", "ruthless", "linear", "full", "stiffened"])
def test_every_level(level):
    beam_scene([station(0.0, 1e7, 1e3, 1.0), station(3.0, 1e7, 1e3, 1.0)], level=level)


def test_one_damping_ratio_for_each_mode_attachment_modes_included():
    ends = [station(0.0, 1e7, 1e3, 1.0), station(3.0, 1e7, 1e3, 1.0)]
    modes = s.Modes(count=2, families=("bending_y",), static=True, damping_ratio=(0.01, 0.01, 0.02, 0.02))
    beam_scene(ends, modes)
    with pytest.raises(SceneError, match="2 damping ratios for 4 modes"):
        beam_scene(ends, msgspec.structs.replace(modes, damping_ratio=(0.01, 0.01)))


def test_sid_bodies_are_well_formed():
    SceneBuilder("panel").sid_body("panel", file="panel.sid").free("base", "ground", "panel").marker(
        "corner", "panel", node="n17"
    ).scene()


def ghost(builder: SceneBuilder, name: str, mass: float = 0.0) -> SceneBuilder:
    return builder.rigid_body(name, mass=mass, inertia=NONE)


def test_a_massless_frame_between_two_hinges():
    scene = (
        ghost(SceneBuilder("cross"), "cross").rigid_body("body", mass=1.0, inertia=BOX)
        .revolute("first", "ground", "cross", axis=(1, 0, 0)).revolute("second", "cross", "body", axis=(0, 1, 0))
    ).scene()  # fmt: skip
    assert [branch.body.name for branch in ordered(scene)] == ["cross", "body"]


def test_a_massless_body_on_a_prescribed_hinge():
    turn = s.SpinUp(rate=1.0, duration_s=2.0)
    ghost(SceneBuilder("table"), "table").revolute("drive", "ground", "table", prescribed=turn).scene()


def test_inertia_welded_on_counts():
    """A ball without inertia on an arm without mass: free to swing about z, but not about the arm itself."""
    arm = ghost(ghost(SceneBuilder("pendulum"), "arm"), "ball", mass=1.0)
    arm.weld("glue", "arm", "ball", parent_position=(0, -2, 0), parent_quaternion=(0.6, 0, 0.8, 0))
    swing = s.Revolute(name="swing", parent="ground", child="arm", axis=(0.0, 0.0, 1.0))
    arm.add(swing).scene()
    with pytest.raises(SceneError, match="no inertia about"):
        (
            ghost(ghost(SceneBuilder("pendulum"), "arm"), "ball", mass=1.0)
            .weld("glue", "arm", "ball", parent_position=(0, -2, 0))
            .revolute("twist", "ground", "arm", axis=(0, 1, 0)).scene()
        )  # fmt: skip


def test_a_freely_spinning_wheel_is_no_inertia_about_its_axis():
    def body(**wheel):
        return (
            ghost(SceneBuilder("disc"), "frame").revolute("axle", "ground", "frame", axis=(0, 0, 1))
            .wheel("disc", "frame", axis=(0, 0, 1), mass=1.0, axial_inertia=0.1, transverse_inertia=0.06, **wheel)
        )  # fmt: skip

    body(prescribed=s.Ramp(rate=10.0)).scene()
    with pytest.raises(SceneError, match="no inertia about"):
        body().scene()


def test_a_curved_axis_is_inertia_about_its_root():
    """Masses on the axis have none about a straight one, and all of it about one that bends away."""
    ends = [station(0.0, 1e7, 1e3, 1.0), station(3.0, 1e7, 1e3, 1.0)]

    def twisted(curvature):
        curved = [msgspec.structs.replace(end, curvature_1_m=(0.0, 0.0, curvature)) for end in ends]
        beam = SceneBuilder("hook").beam(
            "hook", length=3.0, elements=8, section=curved, modes=2, level="exact", points="line"
        )
        return beam.revolute("twist", "ground", "hook", axis=(1, 0, 0))

    twisted(0.5).scene()
    with pytest.raises(SceneError, match="no inertia about"):
        twisted(0.0).scene()


def test_a_gimbal_away_from_its_lock():
    (
        SceneBuilder("top").rigid_body("top", mass=1.0, inertia=BALL)
        .gimbal("tip", "ground", "top", sequence="zxz", rotations=[angular(), angular(angle=0.1), angular()]).scene()
    )  # fmt: skip


def blend(t):
    """The septic of SmoothStep from 1 to 2 over [-0.7, 1.3]."""
    x = (t + 0.7) / 2.0
    return 1.0 + 35.0 * x**4 - 84.0 * x**5 + 70.0 * x**6 - 20.0 * x**7


def quintic(t):
    return 0.3 - 0.7 * t + 0.2 * t**2 + 0.5 * t**3 - 0.1 * t**4 + 0.04 * t**5


def spin_up(t):
    return 4.0 / 15.0 * (t**2 / 2.0 + (15.0 / (2.0 * np.pi)) ** 2 * (np.cos(2.0 * np.pi * t / 15.0) - 1.0))


SAMPLES = (-1.0, -0.4, 0.3, 1.0, 1.8, 2.0, 3.0)
PROFILES = {
    "constant": (s.Constant(value=2.0), lambda t: 2.0 + 0.0 * t),
    "ramp": (s.Ramp(value=1.0, rate=3.0, start_s=0.5), lambda t: 1.0 + 3.0 * (t - 0.5)),
    "sine": (s.Sine(amplitude=2.0, angular_frequency_rad_s=3.0, phase_rad=0.4, offset=-1.0),
             lambda t: -1.0 + 2.0 * np.sin(3.0 * t + 0.4)),
    "step to come": (s.SmoothStep(start_value=1.0, end_value=2.0, start_s=1.0, duration_s=2.0),
                     lambda t: 1.0 + 0.0 * t),
    "step under way": (s.SmoothStep(start_value=1.0, end_value=2.0, start_s=-0.7, duration_s=2.0), blend),
    "step done": (s.SmoothStep(start_value=1.0, end_value=2.0, start_s=-3.0, duration_s=2.0), lambda t: 2.0 + 0.0 * t),
    "spin-up": (s.SpinUp(rate=4.0, duration_s=15.0), spin_up),
    # a quintic spline through samples of a quintic is that quintic
    "table": (s.Table(times_s=SAMPLES, values=tuple(map(quintic, SAMPLES))), quintic),
}  # fmt: skip


@pytest.mark.parametrize(("function", "law"), PROFILES.values(), ids=PROFILES)
def test_value_and_rate_at_the_start(function, law):
    """Rates by complex step, exact to round-off; the spline's collocation matrix amplifies it by its condition."""
    expected = (law(0.0), np.imag(law(1e-20j)) / 1e-20)
    np.testing.assert_allclose(start_of(function), expected, rtol=0.0, atol=1e3 * np.finfo(float).eps)


@pytest.mark.parametrize(
    "function", [s.Pulse(value=1.0, start_s=0.0, duration_s=1.0), s.SpinUp(rate=1.0, duration_s=0.0)]
)
def test_a_function_that_cannot_be_followed_has_no_start(function):
    assert start_of(function) is None


def test_all_problems_are_reported_together():
    scene = satellite().scene()
    bodies = (msgspec.structs.replace(scene.bodies[0], mass_kg=-1.0), *scene.bodies[1:])
    hinges = (*scene.hinges[:4], msgspec.structs.replace(scene.hinges[4], axis=(0.0, 0.0, 2.0), parent="nowhere"))
    with pytest.raises(SceneError) as error:
        check_scene(msgspec.structs.replace(scene, bodies=bodies, hinges=hinges), t_end=-1.0)
    assert [problem.where for problem in error.value.problems] == [
        "t_end",
        '$.bodies[0].mass_kg (body "hub")',
        '$.hinges[4].axis (hinge "rail")',
        '$.hinges[4].parent (hinge "rail")',
    ]
    assert 'scene "satellite" has 4 problems' in str(error.value)


def test_a_struct_with_a_value_of_a_wrong_type_is_refused():
    scene = satellite().scene()
    bodies = (msgspec.structs.replace(scene.bodies[0], mass_kg="heavy"), *scene.bodies[1:])
    with pytest.raises(SceneError, match=r"\$\.bodies\[0\]\.mass_kg \(body \"hub\"\)"):
        check_scene(msgspec.structs.replace(scene, bodies=bodies))


ARRAYS = {"mass": np.ones(2), "position": np.eye(3)[:2], "translation_modes": np.ones((2, 3, 1)), "stiffness": [[9.0]]}
NPZ = {
    "array missing": ({"position": None}, '"position" is missing'),
    "wrong shape": ({"rotation_modes": np.ones((2, 3, 2))}, r"\(2, 3, 2\), expected \(2, 3, 1\)"),
    "unknown array": ({"inertias": np.ones(2)}, '"inertias" is not one of'),
    "NaN": ({"mass": np.array([1.0, np.nan])}, '"mass" holds a NaN'),
    "text": ({"mass": np.array(["a", "b"])}, '"mass" holds numbers of type <U1'),
    "complex": ({"mass": np.ones(2) + 0j}, '"mass" holds numbers of type complex128'),
    "objects": ({"mass": np.array([1.0, None])}, '"mass" holds numbers of type object'),
    "truth values": ({"mass": np.ones(2, bool)}, '"mass" holds numbers of type bool'),
    "beyond all powers": ({"mass": np.array([1.0, 1e300])}, "at most 1e\\+60"),
    "no points": (
        {name: values[:0] for name, values in ARRAYS.items()},
        r'\$\.bodies\[0\]\.file \(body "panel"\): "mass" has no points',
    ),
    "more modes than matrices can have": (
        {"translation_modes": np.zeros((2, 3, 2001))}, '"translation_modes" has 2001 modes, and a body may have 2000',
    ),
    "bomb": ({"second_translation": np.zeros((2, 3, 2200, 2200))}, "would take 222 MiB of memory, more than a file"),
}


def npz_scene(file) -> SceneBuilder:
    return SceneBuilder("panel").modal_body("panel", file=str(file)).weld("mount", "ground", "panel")


def test_an_npz_is_read(tmp_path):
    np.savez(tmp_path / "panel.npz", **ARRAYS)
    scene = npz_scene(tmp_path / "panel.npz").scene()
    arrays = modal_arrays(scene.bodies[0])
    np.testing.assert_array_equal(arrays.translation_modes, ARRAYS["translation_modes"])
    np.testing.assert_array_equal(arrays.rotation_modes, np.zeros((2, 3, 1)))


@pytest.mark.parametrize(("change", "message"), NPZ.values(), ids=NPZ)
def test_a_bad_npz_is_refused(tmp_path, change, message):
    arrays = {name: array for name, array in (ARRAYS | change).items() if array is not None}
    np.savez_compressed(tmp_path / "panel.npz", **arrays)
    tracemalloc.start()
    with pytest.raises(SceneError, match=message):
        npz_scene(tmp_path / "panel.npz").scene()
    assert tracemalloc.get_traced_memory()[1] < 1e7
    tracemalloc.stop()


def test_a_doubled_array_is_refused(tmp_path):
    np.savez(tmp_path / "panel.npz", **ARRAYS)
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(tmp_path / "panel.npz", "a") as archive:
        archive.writestr("mass.npy", archive.read("mass.npy"))
    with pytest.raises(SceneError, match='"mass" is there twice'):
        npz_scene(tmp_path / "panel.npz").scene()


def test_arrays_in_columns_and_of_other_real_types_are_read(tmp_path):
    modes = np.arange(6.0).reshape(2, 3, 1)
    given = {"mass": np.array([1, 2]), "translation_modes": np.asfortranarray(modes)}
    np.savez(tmp_path / "panel.npz", **(ARRAYS | given))
    arrays = modal_arrays(npz_scene(tmp_path / "panel.npz").scene().bodies[0])
    np.testing.assert_array_equal(arrays.mass, [1.0, 2.0])
    np.testing.assert_array_equal(arrays.translation_modes, modes)


def test_complex_numbers_are_refused_wherever_arrays_are_given():
    with pytest.raises(ValueError, match='"mass" is complex'):
        inertia_points(np.ones(2) + 1j, np.eye(3)[:2], np.ones((2, 3, 1)))


def test_a_file_that_is_no_npz_is_refused(tmp_path):
    (tmp_path / "panel.npz").write_text("not an archive")
    with pytest.raises(SceneError, match="not begin as an .npz archive"):
        npz_scene(tmp_path / "panel.npz").scene()
    np.savez(tmp_path / "panel.npz", **ARRAYS)
    data = (tmp_path / "panel.npz").read_bytes()
    (tmp_path / "panel.npz").write_bytes(b"PP" + data)  # zip readers take what stands in front, numpy.load does not
    with pytest.raises(SceneError, match="does not begin as an .npz archive"):
        npz_scene(tmp_path / "panel.npz").scene()
    np.save(tmp_path / "panel.npy", np.ones(3))
    with pytest.raises(SceneError, match="holds one array"):
        npz_scene(tmp_path / "panel.npy").scene()
