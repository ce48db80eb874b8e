"""A scene at given states, drawn in three dimensions: `View`, which is saved as one page or shown in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import msgspec
import numpy as np

from flexmb.interchange.sid.to_body import with_sid_bodies
from flexmb.output.printable import printable
from flexmb.scene.bodies import ZERO
from flexmb.scene.quaternions import quaternion_of
from flexmb.scene.schema import Scene
from flexmb.system.applied import applied_loads
from flexmb.system.compile import assembled
from flexmb.system.frames import hinge_frames, node_pose
from flexmb.system.observables import open_components, undetermined_loads
from flexmb.system.system import System
from flexmb.tables.state import State
from flexmb.typing import Real
from flexmb.view.draw import draw
from flexmb.view.drawing import CarriedPoint, Drawing, Line, carried_line, carried_wheel, carriers
from flexmb.view.film import marked
from flexmb.view.page import Page, page
from flexmb.view.store import Store
from flexmb.view.store import chosen as sampled

Loads = Mapping[str, Real]


class View(Page):
    """An animation of a scene as one HTML page, which needs no network: `save` it, or show it as the last value of a
    notebook's cell. `scene` is the name of the scene, `html` the page."""

    @property
    def kind(self) -> str:
        return "View"


class _Filmed:
    """A scene with markers on all that is drawn, and the poses of these at states of the scene.

    Nodes that are added along beams have no coordinates, so that the states of both scenes are the same.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = marked(with_sid_bodies(scene))
        self._system = assembled(self.scene)
        self._places = {
            marker.name: (marker.body, marker.node, np.array(marker.offset_m)) for marker in self.scene.markers
        }

    def poses(self, names: Iterable[str], state: State) -> dict[str, tuple[Real, Real]]:
        """Positions (3,) m and rotations (3,3) of markers, and of hinge points by `_joint`, World axes."""
        system = self._system
        t, y = system.layout.entering(state)
        system.inverse_at(t, y, np.zeros(system.nu))  # for the poses in the workspace
        w = system.own_workspace
        found = {_joint(name): (at.point, at.outboard) for name, at in hinge_frames(system, w).items()}
        for load in self.scene.loads:
            found[_acting(load.name)] = (node_pose(system, w, load.body, load.node)[1], np.eye(3))
        for name in names:
            if name in self._places:
                body, node, offset = self._places[name]
                rotation, position = node_pose(system, w, body, node)
                found[name] = (position + rotation @ offset, rotation)
        return found


def applied_at(systems: Iterable[System], states: Sequence[State]) -> dict[str, Real]:
    """The loads of a scene by name (T,6) [torque; force] about their nodes, World axes, at states (T); zero at those
    that a view leaves out. systems: that of each state, each used until the next one is asked for."""
    shown, found = set(sampled(len(states)).tolist()), {}
    for i, (system, state) in enumerate(zip(systems, states, strict=True)):
        if i not in shown or not system.scene.loads:
            continue
        t, y = system.layout.entering(state)
        system.inverse_at(t, y, np.zeros(system.nu))  # for the poses and functions of time in the workspace
        for name, load in applied_loads(system, system.own_workspace).items():
            found.setdefault(name, np.zeros((len(states), 6)))[i] = load
    return found


def scene_view(
    scenes: Sequence[Scene],
    states: Sequence[State],
    names: Sequence[str],
    title: str,
    loads: Loads | None = None,
    times: Real | None = None,
    applied: Loads | None = None,
    notes: Sequence[str] = (),
) -> View:
    """The view of a scene at states, which are frames in the order of time.

    scenes: that of each state, which events may have altered, of the same bodies and hinges. names: of the coordinates
    (nq,) of states. loads: by hinge or closure (T,6) [torque; force] about the hinge point, World axes, for arrows.
    times (T,) s: on the clock of the page, by default those of the states. applied: by load of the scene (T,6) about
    its node, World axes. notes: sentences for the page, which also names the loads that are not determined.
    ValueError without states or bodies; SidError or OSError if a body's file cannot be read.
    """
    if not states:
        raise ValueError("there is no state to draw: the run has no output times")
    chosen = sampled(len(states))
    films: dict[int, _Filmed] = {}
    for i in chosen:
        if id(scenes[i]) not in films:
            films[id(scenes[i])] = _Filmed(scenes[i])
    scene = films[id(scenes[0])].scene
    drawing = _with_joints(scene, draw(scene, trails=[marker.name for marker in scenes[0].markers]))
    if not drawing.lines:
        raise ValueError("there is nothing to draw: the scene has no bodies")
    arrows = {name: values[chosen] for name, values in (loads or {}).items()}
    pushes = {name: values[chosen] for name, values in (applied or {}).items()}
    carrying = list(dict.fromkeys((*carriers(drawing), *map(_joint, arrows), *map(_acting, pushes))))
    unknown = open_components(undetermined_loads(loads or {}, {}))
    notes = [*notes, *([f"No arrows where the motion does not determine a load: {unknown}."] if unknown else [])]
    frames = [films[id(scenes[i])].poses(carrying, states[i]) for i in chosen]
    store, number = Store(), {name: i for i, name in enumerate(carrying)}
    q = np.array([states[i].q for i in chosen])
    animation = {
        "title": title,
        "times": store.times(np.array([state.t for state in states]) if times is None else times),
        "markers": [
            {
                "name": name,
                "position": store.samples(np.array([frame[name][0] for frame in frames])),
                "orientation": store.samples(quaternion_of(np.array([frame[name][1] for frame in frames]))),
            }
            for name in carrying
        ],
        "lines": [carried_line(line, number) for line in drawing.lines],
        "wheels": [
            carried_wheel(wheel, number, store.samples(q[:, list(names).index(f"{wheel.name}.angle")]))
            for wheel in drawing.wheels
        ],
        "trails": [number[name] for name in drawing.trails],
        "gravity": drawing.gravity,
        "notes": [printable(note) for note in notes],
        "arrows": [
            {"name": name, "kind": f"{prefix}{kind}", "marker": number[at(name)], "values": store.samples(_drawn(part))}
            for prefix, group, at in (("", arrows, _joint), ("applied ", pushes, _acting))
            for name, load in group.items()
            for kind, part in (("force", load[:, 3:]), ("torque", load[:, :3]))
        ],
    }
    return View(scene.name, page(scene.name, animation, store.packed()))


def _joint(name: str) -> str:
    """The carrier that moves with the outboard frame of a hinge, point mass or closure."""
    return f"joint:{name}"


def _acting(name: str) -> str:
    """The carrier that moves with the node on which a load acts."""
    return f"load:{name}"


def _with_joints(scene: Scene, drawing: Drawing) -> Drawing:
    """The drawing with hinges and closures as marks, and with moving point masses."""
    moving = [mass.name for mass in scene.point_masses if mass.directions]
    joints = [each.name for each in (*scene.hinges, *scene.closures)]
    lines = [
        Line(body=name, kind=kind, points=(CarriedPoint(_joint(name), ZERO),))
        for kind, group in (("ball", moving), ("joint", joints))
        for name in group
    ]
    return msgspec.structs.replace(drawing, lines=(*drawing.lines, *lines))


def _drawn(load: Real) -> Real:
    """The load (T,3), without arrows where the motion does not determine it (NaN)."""
    return np.where(np.all(np.isfinite(load), axis=1, keepdims=True), load, 0.0)
