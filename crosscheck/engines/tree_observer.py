"""From the state of a tree of links in a peer to what engines exchange."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from crosscheck.engines.connections import WORLD, Along, Exerted
from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import Frame, cross, quaternion_of
from crosscheck.engines.links import Link, attachment
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class BodyMotion(NamedTuple):
    """A frame in World axes: position (3,), rotation (3,3), and velocities and accelerations (3,) of both."""

    position: Real
    rotation: Real
    angular: Real
    linear: Real
    alpha: Real
    acceleration: Real

    def carrying(self, inner: Frame) -> BodyMotion:
        """The motion of a frame fixed in this one."""
        arm, w = self.rotation @ inner.position, self.angular
        turning = cross(w, arm)
        return BodyMotion(
            self.position + arm, self.rotation @ inner.rotation, w, self.linear + turning, self.alpha,
            self.acceleration + cross(self.alpha, arm) + cross(w, turning),
        )  # fmt: skip

    @property
    def marker(self) -> MarkerSnapshot:
        return MarkerSnapshot(
            position=self.position,
            quaternion=quaternion_of(self.rotation),
            velocity=np.concatenate([self.angular, self.linear]),
            acceleration=np.concatenate([self.alpha, self.acceleration]),
        )


STILL = BodyMotion(WORLD.position, WORLD.rotation, *(np.zeros(3) for _ in range(4)))


class Energies(NamedTuple):
    """J; that of springs without connectors."""

    kinetic: float
    spring: float
    gravity: float


class TreeObserver:
    """Base of what reads a tree of links in a peer: puts together what engines exchange."""

    def __init__(self, scene: Scene, links: tuple[Link, ...]) -> None:
        self._links = links
        self.gravity = np.array(scene.gravity_m_s2, dtype=float)
        self._places = {marker.name: attachment(scene, links, marker) for marker in scene.markers}

    def body_motion(self, link: int) -> BodyMotion:
        """How the frame of a link moves in the state that is observed."""
        raise NotImplementedError

    def snapshot(
        self, loads: Iterable[Real] | None, drives: Mapping[str, Real], energies: Energies, momentum: Real, *,
        closed: Mapping[str, Real] | None = None, exerted: Mapping[str, Exerted] | None = None,
        along: Mapping[str, tuple[int, Along]] | None = None,
    ) -> Snapshot:  # fmt: skip
        """From [torque; force] (6,) on every link about its frame's origin, World axes, None if they are not known, and
        of closures and couplings by name."""
        known = [] if loads is None else zip(self._links, loads, strict=True)
        named = [(link.kind, link.joint, load) for link, load in known]
        between, held = exerted or {}, {name: each for name, (_, each) in (along or {}).items()}
        stored = sum(each.energy for each in (*between.values(), *held.values()))
        return Snapshot(
            markers={name: self.body_motion(at.link).carrying(at.frame).marker for name, at in self._places.items()},
            loads={name: load for kind, name, load in named if kind != "wheel"} | dict(closed or {}),
            wheel_loads={name: load for kind, name, load in named if kind == "wheel"},
            drives=dict(drives),
            energy={
                "kinetic": float(energies.kinetic),
                "strain": 0.0,
                "spring": energies.spring + stored,
                "gravity": float(energies.gravity),
            },
            momentum=momentum,
            connectors={name: each.on_b for name, each in between.items()},
            hinge_forces={name: np.array([each.load]) for name, each in held.items()},
        )
