"""A case folder made of anybody's scene or robot: markers at the frame of every body, usual goals, one variant."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from crosscheck.library.case_error import CaseError
from crosscheck.library.starting import RATE, is_welded, moves, started
from flexmb.output.files import write_whole
from flexmb.scene.bodies import Body, RigidBody
from flexmb.scene.files import inline, load_scene, save_scene
from flexmb.scene.hinges import Weld
from flexmb.scene.problems import SceneError
from flexmb.scene.schema import Marker, Scene
from flexmb.scene.tree import GROUND, node_names, ordered

SCENE = ".toml"
GOALS = {"marker": 1e-6, "energy": 1e-6, "load": 1e-5}


def is_model(word: str) -> bool:
    """Whether the word is the name of a scene or of a model that scenes are made from, not of a case."""
    from flexmb.interchange.models import ENDINGS

    path = Path(word)
    return path.suffix.lower() in (SCENE, *ENDINGS) and path.name != "run.toml" and not path.is_dir()


def scene_of(model: Path) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a model, with markers, and notes on what it omits of that.

    Of a robot, impossible inertia is repaired, so that all codes have the same. One that no joint moves flies freely;
    one that would rest gets rates, for results that never change tell nothing of a code. Notes say so. CaseError, which
    names the file, for a model that cannot be a scene.
    """
    from flexmb.interchange.sid import with_sid_bodies
    from flexmb.scene.check import check_scene

    try:
        if model.suffix.lower() == SCENE:
            scene, notes = load_scene(model), tuple[str, ...]()
            check_scene(scene)
        else:
            scene, notes = _moving(model)
        return with_markers(with_sid_bodies(scene)), notes
    except (ValueError, OSError, ImportError) as error:
        raise CaseError(str(error)) from None


def _moving(model: Path) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a model, in motion, and the notes."""
    from flexmb.interchange.models import MJCF, URDF, read_model

    ending = model.suffix.lower()
    found = read_model(model, repair=ending not in MJCF)
    if ending == URDF and is_welded(found.scene):
        try:
            free = read_model(model, repair=True, free_base=True)
        except SceneError:
            raise ValueError(
                f"{model}: no joint moves, and the links have not the inertia of one that flies freely: there is no "
                "motion to compare; give it joints, or its links inertia"
            ) from None
        return started(free.scene), (*free.notes, "no joint moves: the root link is free, and begins with a spin")
    if is_welded(found.scene) or found.scene.closures or moves(found.scene):
        return found.scene, found.notes
    return started(found.scene), (*found.notes, f"nothing would move: joints begin at {RATE:g} rad/s or m/s")


def write_case(scene: Scene, folder: Path, engines: tuple[str, str], t_end: float, samples: int) -> None:
    """Write scene.toml and run.toml of a scene's case into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    save_scene(scene, folder / "scene.toml")
    write_whole(folder / "run.toml", run_file(scene, engines, t_end, samples))


def with_markers(scene: Scene) -> Scene:
    """The scene with a marker at the frame of every body that can move and has none there, named after the body."""
    still = _still(scene)
    there = {(marker.body, marker.node) for marker in scene.markers if not any(marker.offset_m)}
    taken = {marker.name for marker in scene.markers}
    added = list[Marker]()
    for body in scene.bodies:
        node = _frame(body)
        if node and body.name not in still and (body.name, node) not in there:
            name = next(name for name in _names(body.name) if name not in taken)
            taken.add(name)
            added.append(Marker(name=name, body=body.name, node=node))
    return replace(scene, markers=(*scene.markers, *added))


def run_file(scene: Scene, engines: tuple[str, str], t_end: float, samples: int) -> str:
    """The run file: two engines, and whatever ones join them, over `t_end` s; a chart of the last marker."""
    goals = ", ".join(f"{key} = {goal!r}" for key, goal in GOALS.items())
    lines = [
        "# Written by crosscheck run; the next run of the model writes it anew: edit a copy of the folder.",
        f"title = {inline(scene.name or 'scene')}",
        f"duration_s = {t_end!r}",
        f"samples = {samples}",
        f'[[variant]]\nname = "given"\nengines = ["{engines[0]}", "{engines[1]}"]',
        f'[[comparison]]\nname = "all engines"\nvariant = "given"\ngoals = {{ {goals} }}',
    ]
    if scene.markers:
        channel = inline(f"marker:{scene.markers[-1].name}.position")
        lines.append(f'[[chart]]\nobservable = {channel}\nvariants = ["given"]\nreference = "given"')
    return "\n".join(lines) + "\n"


def _still(scene: Scene) -> set[str]:
    """The rigid bodies that are welded to the ground, by others too: there is no motion to compare."""
    still = {GROUND}
    for body, hinge in ordered(scene):
        if isinstance(body, RigidBody) and isinstance(hinge, Weld) and hinge.parent in still:
            still.add(body.name)
    return still


def _frame(body: Body) -> str:
    """The node at a body's frame, or its first one; "" if it has none."""
    names = node_names(body)
    return "origin" if "origin" in names else next(iter(names), "")


def _names(name: str) -> tuple[str, ...]:
    return (name, f"{name} frame", *(f"{name} frame {number}" for number in range(2, 99)))
