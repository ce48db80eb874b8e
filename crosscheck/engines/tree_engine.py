"""What adapters of codes of rigid trees declare, and the refusals that follow from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from crosscheck.engines.hybrid.refusals import refusal
from crosscheck.engines.links import Link, obstacle
from crosscheck.engines.peer import PeerEngine
from flexmb.scene.connectors import Connector
from flexmb.scene.schema import Scene

ROUND_OFF = 1e-12  # of the largest principal moment: by so much a disc's moments may miss the triangle inequality


class TreeCapabilities(NamedTuple):
    """What an adapter of a code of rigid trees takes: types of closures and connectors, and what joints may have.

    `loops`: why it closes none, where there is more to say than that.
    """

    closed_by: tuple[str, ...] = ()
    connected_by: tuple[type[Connector], ...] = ()
    screws: bool = False
    couplings: bool = False
    armatures: bool = False
    loops: str = ""


class TreeEngine(PeerEngine):
    """Base of the adapters of codes of rigid trees; `own_refusals` is what its capabilities do not say."""

    capabilities: TreeCapabilities

    def refusals(self, scene: Scene) -> Iterator[str]:
        takes, words = self.capabilities, self.library.words
        if takes.loops and scene.closures:
            yield f'closure "{scene.closures[0].name}": {words} {takes.loops}'
        yield obstacle(
            scene, words, takes.closed_by, takes.connected_by,
            screws=takes.screws, couplings=takes.couplings, armatures=takes.armatures,
        )  # fmt: skip
        if "events" in self.takes:
            yield refusal(scene)
        yield from self.own_refusals(scene)

    def own_refusals(self, scene: Scene) -> Iterator[str]:
        """Why this adapter cannot represent the scene, one thing after the other."""
        yield from ()


def inertia_refusals(links: Iterable[Link], engine: str) -> Iterator[str]:
    """Why an engine that needs mass and a possible inertia on every link refuses some."""
    for link in links:
        if link.inertia.mass <= 0.0:
            yield f'{engine} needs a positive mass on every link ("{link.name}")'
        a, b, c = np.linalg.eigvalsh(link.inertia.inertia)
        if a < -ROUND_OFF * c or a + b < c * (1.0 - ROUND_OFF):
            yield f'{engine} refuses the inertia of "{link.name}": principal moments {a:g}, {b:g}, {c:g} kg m^2'
