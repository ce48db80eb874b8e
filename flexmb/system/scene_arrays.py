"""A scene turned into arrays: constants of the kernels, places of coordinates by the names of the scene, its states."""

from __future__ import annotations

from typing import Literal

import numpy as np

from flexmb.building.assemble import assemble
from flexmb.building.connector_arrays import along_hinges, between_nodes
from flexmb.building.links import links
from flexmb.building.models import wheels_by_body
from flexmb.building.numbering import Numbering
from flexmb.jain.elimination import Elimination, with_elimination
from flexmb.kept import kept
from flexmb.motion import coordinates
from flexmb.scene import schema as s
from flexmb.scene.sticking import Sticking, any_sticks, sticking
from flexmb.system.observables import Names
from flexmb.tables import arguments
from flexmb.tables.arrays import Constants
from flexmb.tables.features import DERIVATIVES, ITS_OWN, RECURSION, WITH_EVERYTHING, Choice
from flexmb.tables.state import DynamicsError, State
from flexmb.tables.status import Status
from flexmb.typing import Index, Real


class SceneArrays:
    """A checked scene as kernels take it; nothing is changed after construction.

    links: the bodies, each with its inboard hinge, base to tip. markers, closure_ports: (body, port) of each marker, by
    name, and of both sides of each closure. signals: the functions of time that controllers drive in a run, by their
    numbers; they are zero outside of runs.
    """

    def __init__(self, scene: s.Scene, elimination: Elimination, like: s.Scene | None = None) -> None:
        """like: the same scene with slightly other numbers; the tables are then smooth functions of the numbers around
        those of `like`: modes follow its modes, and equal functions of time are kept apart."""
        self.scene = scene
        self.links = links(scene, like)
        numbering = Numbering(self.links, scene)
        assembled = assemble(scene, self.links, numbering, like=like)
        self.constants, self.markers, self.closure_ports = assembled.constants, assembled.markers, assembled.closures
        self._elimination = elimination
        follows = assembled.shares or bool(assembled.signals) or any(link.mode_count for link in self.links)
        self.is_smooth = not follows
        """Whether tables of slightly other numbers are smooth functions of these around the present ones: there are no
        modes to follow others, no equal functions of time to keep apart, and none that a run sets."""
        if like is None:
            self.explicit_constants  # noqa: B018 - raises for an elimination that does not apply; decides on kernels
        self.signals = assembled.signals
        self.layout = numbering.layout
        self.nq, self.nu = self.layout.nq, self.layout.nu

    def state(self, q: Real, u: Real, t: float = 0.0) -> State:
        """State from q (nq,), u (nu,) and t (s), which are copied; quaternions are scaled to unit length.

        Raises ValueError where lengths do not fit, numbers are not finite or a quaternion is zero, and TypeError for
        anything but real numbers.
        """
        return self.layout.state(q, u, t)

    def scene_state(self, t: float) -> State:
        """The scene's initial values with prescribed motions at their values for time t (s); closures may be open."""
        t = arguments.number("t", t)
        return self.layout.known(t, self._projected(t, self._at_start))

    def _projected(self, t: float, y: Real) -> Real:
        """A copy of y with work zero, prescribed motions at their values for time t, and quaternions of unit length."""
        y = y.copy()
        y[-1] = 0.0
        coordinates.project(t, y, self.constants)
        return y

    @kept
    def is_rigid(self) -> bool:
        """Whether all bodies are rigid."""
        return all(link.is_rigid for link in self.links)

    @kept
    def _at_start(self) -> Real:
        """(nq+nu+1,) [q, u, 0] of the scene at t = 0."""
        q, u = np.zeros(self.nq), np.zeros(self.nu)
        for link in self.links:
            name = link.hinge.name
            q[self.coordinate(name)], u[self.speed(name)] = link.kind.state(link.hinge)
        for wheel in self.scene.wheels:
            q[self.coordinate(wheel.name)], u[self.speed(wheel.name)] = wheel.angle_rad, wheel.speed_rad_s
        for modal in self.scene.modal_states:
            name = f"{modal.body}.modes"
            if self.coordinate(name).stop > self.coordinate(name).start:
                q[self.coordinate(name)] = modal.coordinates
                u[self.speed(name)] = modal.rates or 0.0
        return self._projected(0.0, np.concatenate([q, u, [0.0]]))

    @kept
    def recursion_constants(self) -> Constants:
        """The same constants with bodies eliminated as chosen."""
        return with_elimination(self.constants, self._elimination)

    @kept
    def explicit_constants(self) -> Constants:
        """`recursion_constants` for accelerations, outputs and runs by explicit methods, whose kernels are ready for
        rigid trees too: they evaluate a chain of ten 1.4 times faster than general ones."""
        return self.recursion_constants.fastest(RECURSION)

    @kept
    def derivative_constants(self) -> Constants:
        """`constants` for derivatives of accelerations and of inverse dynamics, whose kernels are ready for rigid trees
        on single axes too: 1.3 times as fast."""
        return self.constants.fastest(DERIVATIVES)

    @property
    def kernels(self) -> Literal["general", "special"]:
        """The kernels of its accelerations and of runs by explicit methods: special ones, or those that came with the
        installation; see `flexmb.compile`."""
        return "special" if self.explicit_constants.kernels[0] == ITS_OWN else "general"

    @property
    def body_names(self) -> tuple[str, ...]:
        """Bodies in the order of the dynamics, point masses last."""
        return tuple(link.name for link in self.links)

    def coordinate(self, name: str) -> slice:
        """Place in q of a hinge, "<body>.hinge", "<body>.modes", wheel or point mass."""
        return _find(self.layout.q, name)

    def speed(self, name: str) -> slice:
        """Place in u of a hinge, "<body>.hinge", "<body>.modes", wheel or point mass."""
        return _find(self.layout.u, name)

    @property
    def observed_names(self) -> Names:
        """The names of everything that is observed at a state."""
        scene, wheels = self.scene, wheels_by_body(self.scene)
        hinges = [link.hinge.name for link in self.links]
        on_bodies = [wheel.name for link in self.links for wheel in wheels.get(link.name, ())]
        closures = [closure.name for closure in scene.constraints]
        between = [node.name for node in between_nodes(scene)]
        along = [connector.name for rows in along_hinges(scene) for connector in rows]
        driven = self._driven([*hinges, *on_bodies])
        return Names(self.markers, hinges, on_bodies, closures, driven, between, along, self._holding())

    @kept
    def has_friction_that_sticks(self) -> bool:
        """Whether the scene has any."""
        return any_sticks(self.scene)

    def refuse_undecided(self, t: float, y: Real) -> None:
        """DynamicsError where friction that sticks is at rest at y = [q, u, work] and no run has decided of it."""
        u = y[-1 - self.nu : -1]
        for friction in sticking(self.scene):
            if friction.connector.phase == "undecided" and u[self._along(friction)] == 0.0:
                raise DynamicsError(
                    f'at t = {t:g} s friction "{friction.name}" sticks (its smoothing is 0) and {friction.coordinate} '
                    "is at rest: whether it holds is decided in a run; use flexmb.simulate, or give it a smoothing "
                    "speed"
                )

    def _holding(self) -> dict[str, int]:
        """Places in u of the coordinates that friction holds, by its name."""
        return {each.name: self._along(each) for each in sticking(self.scene) if each.connector.phase == "sticking"}

    def _along(self, friction: Sticking) -> int:
        """The place in u of its coordinate."""
        return self.speed(friction.owner).start + friction.place

    def _driven(self, names: list[str]) -> dict[str, Index]:
        """Places in u of the prescribed coordinates, by hinge or wheel, but those that friction holds."""
        driven = self.constants.speed["prescribed"] >= 0
        driven[list(self._holding().values())] = False
        if not np.any(driven):
            return {}
        places = ((name, self.speed(name)) for name in names)
        return {name: at.start + np.flatnonzero(driven[at]) for name, at in places if np.any(driven[at])}

    def fault_name(self, status: int, fault: int) -> str:
        """Name of the body, connector or closure at which a failure occurred, from its number."""
        match status:
            case Status.CONNECTOR_OVERTURNED:
                return between_nodes(self.scene)[fault].name
            case Status.CLOSURE_SINGULAR | Status.CLOSURE_OPEN | Status.BRANCH_UNKNOWN:
                return self.scene.constraints[fault].name
        return self.links[fault].name


def _find(places: dict[str, slice], name: str) -> slice:
    if name not in places:
        raise KeyError(f"no coordinates of that name: {name!r}; there are {', '.join(sorted(places))}")
    return places[name]


def kernels_of(arrays: SceneArrays) -> Choice:
    """What to ask for so that other tables are run by the same kernels."""
    if arrays.constants.kernels[0] in WITH_EVERYTHING:
        return "beside" if arrays.kernels == "special" else "general"
    return "special"
