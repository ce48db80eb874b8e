"""Places of coordinates in q and of speeds in u."""

from __future__ import annotations

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.building.models import wheels_by_body
from flexmb.scene import schema as s
from flexmb.tables.state import Layout


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
