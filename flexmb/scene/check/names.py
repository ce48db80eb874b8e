"""Names: given, unique, and every reference to a body or node leads somewhere; and the tree that hinges make: every
body is the child of exactly one hinge, without cycles.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from flexmb.scene.bodies import BeamBody, Body, ModalBody, RigidBody, SidBody
from flexmb.scene.check.walk import entries
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.problems import Defect, Place, closest
from flexmb.scene.schema import Closure, Scene, TotalLoad
from flexmb.scene.tree import GROUND, joined_bodies, node_names

# Hinges, wheels, point masses, closures, couplings and connectors share tables of loads, drive loads and coordinates,
# hence one set of names; total loads have columns of the same form.
NAMESPACES = (
    ("bodies",), ("hinges", "wheels", "point_masses", "closures", "couplings", "connectors", "total_loads"),
    ("loads",), ("markers",), ("sensors", "controllers"), ("events",),
)  # fmt: skip
IMPLICIT: dict[type, tuple[str, ...]] = {RigidBody: ("origin",), BeamBody: ("origin", "root", "tip")}


def unique_names(scene: Scene) -> Iterator[Defect]:
    """Every item has a name of its own, "ground" is the inertial frame, implicit nodes are not listed again."""
    for collections in NAMESPACES:
        if not _are_names([item.name for collection in collections for item in getattr(scene, collection)]):
            yield from _unique(item for collection in collections for item in entries(scene, collection))
    with_nodes = [i for i, body in enumerate(scene.bodies) if body.name == GROUND or _nodes(body)]
    for place, body in entries(scene, "bodies", with_nodes):
        if body.name == GROUND:
            yield Defect(str(place), 'the name "ground" is taken: it is the inertial frame', "rename the body")
        if isinstance(body, SidBody):
            continue
        yield from _unique((place.key("nodes", i), node) for i, node in enumerate(body.nodes))
        for i, node in enumerate(body.nodes):
            if node.name in IMPLICIT.get(type(body), ()):
                what = f'node "{node.name}" exists without being listed'
                yield Defect(str(place.key("nodes", i)), what, "rename the node or leave it out")
    seen: dict[str, Place] = {}
    for place, state in entries(scene, "modal_states"):
        if state.body in seen:
            what = f"this body's modal state is already given at {seen[state.body].path}"
            yield Defect(str(place), what, "merge the two")
        seen.setdefault(state.body, place)


def references(scene: Scene) -> Iterator[Defect]:
    """Every body and node that something refers to exists."""
    bodies = Bodies(scene)
    others = [
        i
        for i, hinge in enumerate(scene.hinges)
        if not (bodies.have(hinge.parent, hinge.parent_node, GROUND) and bodies.have(hinge.child, hinge.child_node))
    ]
    for place, hinge in entries(scene, "hinges", others):
        yield from _attachment(place, bodies, ("parent", hinge.parent), ("parent_node", hinge.parent_node), ground=True)
        yield from _attachment(place, bodies, ("child", hinge.child), ("child_node", hinge.child_node), ground=False)
    for collection in ("wheels", "point_masses", "loads", "markers"):
        items = getattr(scene, collection)
        strange = [i for i, item in enumerate(items) if not bodies.have(item.body, item.node)]
        for place, item in entries(scene, collection, strange):
            yield from _attachment(place, bodies, ("body", item.body), ("node", item.node), ground=False)
    for place, item in (*entries(scene, "closures"), *entries(scene, "connectors")):
        for end in "ab" if isinstance(item, Closure | BetweenNodes) else ():
            body, node = f"body_{end}", f"node_{end}"
            ends = (body, getattr(item, body)), (node, getattr(item, node))
            yield from _attachment(place, bodies, *ends, ground=True)
        if isinstance(item, Closure) and item.body_a == item.body_b:
            yield Defect(str(place), f'the closure joins "{item.body_a}" to itself', "give two different bodies")
    for place, total in entries(scene, "total_loads"):
        yield from _attachment(place, bodies, ("body", total.body), ("node", total.node), ground=True)
        yield from _summed(place, scene, total)
    for place, state in entries(scene, "modal_states"):
        yield from _body(place.key("body"), bodies.named, state.body)


def _summed(place: Place, scene: Scene, total: TotalLoad) -> Iterator[Defect]:
    """What is wrong with the joints of a total load."""
    held = joined_bodies(scene)
    if not total.joints:
        yield Defect(str(place.key("joints")), "no joints are named", "name the hinges and closures whose loads to add")
    for i, name in enumerate(total.joints):
        at = str(place.key("joints", i))
        if name not in held:
            yield Defect(at, f'there is no hinge or closure "{name}"', closest(name, held))
        elif name in total.joints[:i]:
            yield Defect(at, f'"{name}" is named twice', "name each joint once")
        elif total.body not in held[name]:
            what = f'"{name}" joins "{held[name][0]}" and "{held[name][1]}", and exerts no load on "{total.body}"'
            yield Defect(at, what, "leave the joint out, or name a body that all of the joints hold")


def _nodes(body: Body) -> tuple[Any, ...]:
    return () if isinstance(body, SidBody) else body.nodes


def _are_names(names: list[str]) -> bool:
    """Whether all are names, no two of them the same."""
    return len(set(names)) == len(names) and all(name.strip() and name.isprintable() for name in names)


class Bodies:
    """The bodies of a scene by name, and their nodes, found when first asked for."""

    def __init__(self, scene: Scene) -> None:
        self.named: dict[str, Body] = {body.name: body for body in scene.bodies}
        self._nodes: dict[str, dict[str, None]] = {}

    def have(self, name: str, node: str, ground: str | None = None) -> bool:
        """Whether there is such a body, or `ground`, with such a node; True for all nodes of SID bodies."""
        if name == ground:
            return node == "origin"
        body = self.named.get(name)
        if body is None or isinstance(body, SidBody):
            return body is not None
        return node in IMPLICIT.get(type(body), ()) or node in self.nodes(name)

    def nodes(self, name: str) -> dict[str, None]:
        """Names of the nodes of a body, in their order."""
        if name not in self._nodes:
            self._nodes[name] = dict.fromkeys(node_names(self.named[name]))
        return self._nodes[name]


def _unique(items: Iterator[tuple[Place, Any]]) -> Iterator[Defect]:
    seen: dict[str, Place] = {}
    for place, item in items:
        if not item.name.strip() or not item.name.isprintable():
            yield Defect(str(place.key("name")), f"{item.name!r} is not a name", "give a name of printable characters")
        elif item.name in seen:
            what = f'duplicate name "{item.name}": already used by {seen[item.name].path}'
            yield Defect(str(place.key("name")), what, "rename one of the two")
        seen.setdefault(item.name, place)


def _attachment(
    place: Place, bodies: Bodies, to: tuple[str, str], at: tuple[str, str], *, ground: bool
) -> Iterator[Defect]:
    (body_key, body_name), (node_key, node) = to, at
    if body_name == GROUND and ground:
        if node != "origin":
            remedy = "leave the node out and give the offset of the hinge frame instead"
            yield Defect(str(place.key(node_key)), f'the ground has no node "{node}"', remedy)
    elif body_name not in bodies.named:
        yield from _body(place.key(body_key), bodies.named, body_name, ground=ground)
    elif not bodies.have(body_name, node):
        remedy = closest(node, bodies.nodes(body_name))
        if isinstance(bodies.named[body_name], ModalBody) and node == "origin":
            remedy = 'a free-free modal body has a node "origin" only where it is listed with its mode shapes: list it'
        yield Defect(str(place.key(node_key)), f'body "{body_name}" has no node "{node}"', remedy)


def _body(place: Place, bodies: dict[str, Body], name: str, *, ground: bool = False) -> Iterator[Defect]:
    if name == GROUND and not ground:
        yield Defect(str(place), "this cannot be the ground", "name a body")
    elif name not in bodies:
        yield Defect(str(place), f'there is no body "{name}"', closest(name, [*bodies, GROUND] if ground else bodies))


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
