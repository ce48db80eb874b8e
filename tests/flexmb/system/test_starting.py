"""Sound means that a scene compiles and has accelerations at its start: else the check says why not."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.scene import check
from flexmb.scene.bodies import BeamStation, Modes
from flexmb.scene.files import load_scene, save_scene
from tests.trees import random_scene

ROOT = Path(__file__).parents[3]
SHIPPED = [file for file in sorted((ROOT / "cases").glob("*/*/*.toml")) if "[[hinges]]" in file.read_text()]
AXES = np.vstack([np.eye(3), -np.eye(3)])
LINE = np.diag([0.27, 0.27, 0.27, 1e-5, 5e-6, 5e-6])


def neck() -> fm.Scene:
    """A point mass on three hinges through one point: nothing has inertia about the line to the mass."""
    none = (0.0, 0.0, 0.0)
    builder = fm.SceneBuilder("neck", gravity=(0, 0, -9.81))
    for name, mass, com in (("n1", 0.0, none), ("n2", 0.0, none), ("head", 1.3, (0.02, -0.11, 0.0))):
        builder.rigid_body(name, mass=mass, inertia=none, com=com)
    for name, parent, child, axis in (("pitch", "ground", "n1", 0), ("roll", "n1", "n2", 1), ("yaw", "n2", "head", 2)):
        builder.revolute(name, parent, child, axis=np.eye(3)[axis])
    return builder.scene()


def chain(seed: int) -> fm.SceneBuilder:
    """Up to five bodies, many without mass or inertia, on hinges whose axes are often parallel or through one point."""
    rng = np.random.default_rng(seed)
    builder, bodies = fm.SceneBuilder(f"chain {seed}", gravity=(0, 0, -9.81)), int(rng.integers(1, 6))
    for k in range(bodies):
        kind = rng.choice(["massless", "point", "rod", "solid"], p=[0.35, 0.25, 0.2, 0.2])
        inertia = {"rod": (0.0, 0.1, 0.1), "solid": (0.1, 0.15, 0.2)}.get(kind, (0.0, 0.0, 0.0))
        com = (0.0, 0.0, 0.0) if kind == "massless" else rng.choice([0.0, 0.2], size=3)
        builder.rigid_body(f"b{k}", mass=0.0 if kind == "massless" else 1.0, inertia=inertia, com=com)
        parent = "ground" if k == 0 else f"b{k - 1}"
        place = {"parent_position": rng.choice([0.0, 0.3], size=3, p=[0.8, 0.2])}
        axis = AXES[rng.integers(6)]
        match rng.integers(5):
            case 0 | 1:
                builder.revolute(f"h{k}", parent, f"b{k}", axis=axis, **place)
            case 2:
                builder.prismatic(f"h{k}", parent, f"b{k}", axis=axis, **place)
            case 3:
                builder.spherical(f"h{k}", parent, f"b{k}", **place)
            case _:
                angles = [fm.AngularCoordinate(angle_rad=float(each)) for each in rng.choice([0.0, 0.4], size=2)]
                builder.gimbal(f"h{k}", parent, f"b{k}", sequence="xy", rotations=angles, **place)
    return builder


def starts(scene: fm.Scene) -> bool:
    try:
        system = fm.compile(scene)
        state = system.initial_state
        return bool(np.isfinite(system.evaluate(state.t, state.q, state.u).accelerations).all())
    except (ValueError, ArithmeticError, NotImplementedError):
        return False


def is_sound(scene: fm.Scene) -> bool:
    try:
        fm.check_scene(scene)
    except fm.SceneError as error:
        assert all(problem.what and problem.remedy for problem in error.problems)
        return False
    return True


def _agrees(seeds: range) -> tuple[int, int]:
    """How many drawn scenes start, and how many of the others nothing but an evaluation refuses."""
    good = late = 0
    for seed in seeds:
        try:
            scene = chain(seed).scene()
        except fm.SceneError:
            continue
        assert is_sound(scene) == starts(scene), seed
        good += starts(scene)
        late += not starts(scene)
    return good, late


def test_a_chain_is_sound_where_it_starts():
    good, late = _agrees(range(60))
    assert good > 5 and late > 5


@pytest.mark.slow
def test_many_chains_are_sound_where_they_start():
    good, late = _agrees(range(60, 2000))
    assert good > 200 and late > 200


def test_the_neck_is_refused_with_its_body_and_a_remedy(tmp_path):
    """As by the command line; what numbers alone show finds nothing wrong."""
    assert check.check_scene(neck()) == ()
    with pytest.raises(fm.SceneError, match="moves without mass") as error:
        fm.check_scene(neck())
    assert 'body "n1"' in error.value.problems[0].where
    save_scene(neck(), tmp_path / "neck.toml")
    result = CliRunner().invoke(app, ["check", str(tmp_path / "neck.toml")])
    assert result.exit_code == 2 and "moves without mass" in result.stderr


@pytest.mark.parametrize("points", ["line", "rotary", "section"])
@pytest.mark.parametrize("boundary", ["clamped-free", "free-free"])
def test_a_coupled_beam_is_sound_where_it_starts(points, boundary):
    """Sections given by matrices, whose twist is coupled or not; what fails is a SceneError of `compile` too."""
    for coupling in (0.0, 10.0):
        K = np.diag([7e6, 2e6, 2e6, 35.0, 56.0, 56.0])
        K[3, 4] = K[4, 3] = coupling
        section = {"stiffness": tuple(map(tuple, K.tolist())), "inertia": tuple(map(tuple, LINE.tolist()))}
        builder = fm.SceneBuilder("blade").beam(
            "b", length=1.0, elements=6, section=[BeamStation(x_m=x, **section) for x in (0.0, 1.0)],
            modes=Modes(count=4, boundary=boundary), points=points, theory="timoshenko",
        )  # fmt: skip
        try:
            scene = builder.weld("root", "ground", "b", child_node="root").scene()
        except fm.SceneError:
            continue
        assert is_sound(scene) == starts(scene)
        if not starts(scene):
            with pytest.raises(fm.SceneError):
                fm.compile(scene)


def test_closures_that_cannot_close_are_no_sound_start():
    builder = fm.SceneBuilder("gap").rigid_body("arm", mass=1.0, inertia=(0.1, 0.1, 0.1), nodes={"tip": (1, 0, 0)})
    builder.revolute("j", "ground", "arm", axis=(0, 0, 1))
    scene = builder.closure("far", "spherical", "arm", "ground", node_a="tip", position_b=(5, 0, 0)).scene()
    with pytest.raises(fm.SceneError, match='closure "far"'):
        fm.check_scene(scene)


def test_what_the_library_ships_is_sound():
    """A small scene of each group; all with `-m slow`."""
    for file in {file.parent.parent: file for file in reversed(SHIPPED) if file.stat().st_size < 5_000}.values():
        fm.check_scene(load_scene(file))


@pytest.mark.slow
def test_all_that_the_library_ships_is_sound():
    for file in SHIPPED:
        fm.check_scene(load_scene(file))


def test_random_trees_are_sound():
    for seed in range(3):
        fm.check_scene(random_scene(seed))
