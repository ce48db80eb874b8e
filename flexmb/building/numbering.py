"""Places of coordinates in q and of speeds in u."""

from __future__ import annotations

from typing import assert_never

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.building.models import wheels_by_body
from flexmb.hinges.catalogue import kind_of
from flexmb.scene import schema as s
from flexmb.scene.check.beams import mode_count
from flexmb.scene.modal_data import modal_arrays
from flexmb.tables.state import Layout


def speeds_at_least(scene: s.Scene) -> int:
    """The number of speeds of a scene that has been checked, without those of SID bodies: counted before it is built,
    which takes a minute for 100,000 bodies."""
    items = (*scene.hinges, *scene.point_masses)
    return sum(kind_of(item)[0].speeds for item in items) + sum(map(_modes, scene.bodies)) + len(scene.wheels)


def _modes(body: s.RigidBody | s.BeamBody | s.ModalBody | s.SidBody) -> int:
    match body:
        case s.RigidBody() | s.SidBody():
            return 0
        case s.BeamBody():
            return 0 if body.level == "rigid" else mode_count(body)
        case s.ModalBody():
            return 0 if body.level == "rigid" else int(modal_arrays(body).translation_modes.shape[2])
        case _:
            assert_never(body)


class Numbering:
    """Places of all coordinates in q and speeds in u, Jain & Rodriguez (3), (4): body by body hinge, modes, wheels."""

    def __init__(self, chain: list[BodyLink], scene: s.Scene) -> None:
        self.q: dict[str, slice] = {}
        self.u: dict[str, slice] = {}
        self.nq = self.nu = 0
        self.hinges: list[tuple[int, int]] = []  # by link, where its coordinates begin in q and its speeds in u
        self.modes: list[tuple[int, int]] = []  # likewise
        quaternions, wheels = list[int](), wheels_by_body(scene)
        for link in chain:
            if link.kind.quaternion >= 0:
                quaternions.append(self.nq + link.kind.quaternion)
            self.hinges.append((self.nq, self.nu))
            self._append(link.hinge.name, link.kind.coordinates, link.kind.speeds)
            self.modes.append((self.nq, self.nu))
            self._append(f"{link.name}.modes", link.mode_count, link.mode_count)
            for wheel in wheels.get(link.name, ()):
                self._append(wheel.name, 1, 1)
        for link in chain:
            self.q[f"{link.name}.hinge"] = self.q[link.hinge.name]
            self.u[f"{link.name}.hinge"] = self.u[link.hinge.name]
        self.layout = Layout(self.nq, self.nu, self.q, self.u, np.array(quaternions, np.int64))

    def _append(self, name: str, nq: int, nu: int) -> None:
        self.q[name] = slice(self.nq, self.nq + nq)
        self.u[name] = slice(self.nu, self.nu + nu)
        self.nq += nq
        self.nu += nu
