"""The hinges make a tree rooted at the ground: every body is the child of exactly one hinge, without cycles."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.check.walk import entries
from flexmb.scene.problems import Defect, Place
from flexmb.scene.schema import Scene
from flexmb.scene.tree import GROUND

CLOSE_THE_LOOP = "a loop is closed by a closure, not by a hinge: keep one inboard hinge per body"


def tree(scene: Scene) -> Iterator[Defect]:
    """Problems of the hinges' graph; references to unknown bodies are reported by the name checks."""
    if not scene.bodies:
        yield Defect("$.bodies", "the scene has no body", "add a body and the hinge that holds it")
    inboard: dict[str, list[tuple[Place, str, str]]] = {body.name: [] for body in scene.bodies}
    for place, hinge in entries(scene, "hinges"):
        if hinge.parent == hinge.child:
            yield Defect(str(place), f'the hinge joins body "{hinge.child}" to itself', "give two different bodies")
        if hinge.child in inboard:
            inboard[hinge.child].append((place, hinge.name, hinge.parent))
    for place, body in entries(scene, "bodies"):
        hinges = inboard[body.name]
        if not hinges:
            what = "the body is not the child of any hinge"
            yield Defect(str(place), what, f'add its inboard hinge: a free hinge from "{GROUND}" if it floats')
        for extra, name, _ in hinges[1:]:
            what = f'hinge "{name}" is a second inboard hinge of body "{body.name}", beside "{hinges[0][1]}"'
            yield Defect(str(extra), what, CLOSE_THE_LOOP)
    parents = {name: hinges[0][2] for name, hinges in inboard.items() if hinges}
    for cycle in _cycles(parents):
        place = inboard[cycle[0]][0][0]
        what = f"cycle: {' -> '.join([*cycle, cycle[0]])} never reaches the ground"
        yield Defect(str(place), what, f'hinge one of them to "{GROUND}"; {CLOSE_THE_LOOP}')


def _cycles(parents: dict[str, str]) -> list[list[str]]:
    """Cycles of two and more bodies, each once, from its parent to its child."""
    done: set[str] = set()
    cycles = []
    for start in parents:
        path: list[str] = []
        name = start
        while name in parents and name not in done and name not in path:
            path.append(name)
            name = parents[name]
        if name in path and len(path) - path.index(name) > 1:
            cycles.append(path[path.index(name) :][::-1])
        done.update(path)
    return cycles
