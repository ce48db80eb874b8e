"""The hinges make a tree rooted at the ground: every body is the child of exactly one hinge, without cycles."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.check.walk import entries
from flexmb.scene.problems import Defect
from flexmb.scene.schema import Scene
from flexmb.scene.tree import GROUND

CLOSE_THE_LOOP = "a loop is closed by a closure, not by a hinge: keep one inboard hinge per body"


def tree(scene: Scene) -> Iterator[Defect]:
    """Problems of the hinges' graph; references to unknown bodies are reported by the name checks."""
    if not scene.bodies:
        yield Defect("$.bodies", "the scene has no body", "add a body and the hinge that holds it")
    inboard: dict[str, list[int]] = {body.name: [] for body in scene.bodies}
    for i, hinge in enumerate(scene.hinges):
        if hinge.parent == hinge.child:
            what = f'the hinge joins body "{hinge.child}" to itself'
            yield Defect(_where(scene, "hinges", i), what, "give two different bodies")
        if hinge.child in inboard:
            inboard[hinge.child].append(i)
    for i, body in enumerate(scene.bodies):
        hinges = inboard[body.name]
        if not hinges:
            what, remedy = "the body is not the child of any hinge", f'a free hinge from "{GROUND}" if it floats'
            yield Defect(_where(scene, "bodies", i), what, f"add its inboard hinge: {remedy}")
        for extra in hinges[1:]:
            second, first = scene.hinges[extra].name, scene.hinges[hinges[0]].name
            what = f'hinge "{second}" is a second inboard hinge of body "{body.name}", beside "{first}"'
            yield Defect(_where(scene, "hinges", extra), what, CLOSE_THE_LOOP)
    parents = {name: scene.hinges[hinges[0]].parent for name, hinges in inboard.items() if hinges}
    for cycle in _cycles(parents):
        place = _where(scene, "hinges", inboard[cycle[0]][0])
        what = f"cycle: {' -> '.join([*cycle, cycle[0]])} never reaches the ground"
        yield Defect(place, what, f'hinge one of them to "{GROUND}"; {CLOSE_THE_LOOP}')


def _where(scene: Scene, collection: str, number: int) -> str:
    (place, _), = entries(scene, collection, [number])
    return str(place)


def _cycles(parents: dict[str, str]) -> list[list[str]]:
    """Cycles of two and more bodies, each once, from its parent to its child."""
    done: set[str] = set()
    cycles = []
    for start in parents:
        path: dict[str, int] = {}  # for each body, the number of bodies before it
        name = start
        while name in parents and name not in done and name not in path:
            path[name] = len(path)
            name = parents[name]
        if name in path and len(path) - path[name] > 1:
            cycles.append(list(path)[path[name] :][::-1])
        done.update(path)
    return cycles
