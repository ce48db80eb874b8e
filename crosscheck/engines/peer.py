"""What the adapters of peers have in common: they refuse a scene or compile it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from crosscheck.engines.contract import EngineMissing, Model, Support
from crosscheck.engines.links import Link
from flexmb.scene.schema import Scene

ROUND_OFF = 1e-12  # of the largest principal moment: by so much a disc's moments may miss the triangle inequality


class PeerEngine:
    """Base of the adapters; each has its own `version`, `obstacle` and `model`, and imports its library only there."""

    def version(self) -> str:
        """Version of the library; raises EngineMissing."""
        raise NotImplementedError

    def obstacle(self, scene: Scene) -> str:
        """Why the engine cannot represent the scene, "" if it can."""
        raise NotImplementedError

    def model(self, scene: Scene) -> Model:
        """The scene, which is supported, compiled."""
        raise NotImplementedError

    def supports(self, scene: Scene) -> Support:
        reason = self.obstacle(scene)
        return Support("no", reason) if reason else Support("exact")

    def compile(self, scene: Scene) -> Model:
        """EngineMissing without the library; ValueError for a scene that the engine cannot represent."""
        self.version()
        if reason := self.obstacle(scene):
            raise ValueError(f'scene "{scene.name}": {reason}')
        return self.model(scene)


@contextmanager
def needed(library: str, distribution: str) -> Iterator[None]:
    """Around the import of a library: if it fails, EngineMissing says which distribution has it."""
    try:
        yield
    except ImportError as error:
        raise EngineMissing(f"{library} is not installed: pip install {distribution}") from error


def inertia_obstacle(links: Iterable[Link], engine: str) -> str:
    """Why an engine that needs mass and a possible inertia on every link refuses one, "" if it refuses none."""
    for link in links:
        if link.inertia.mass <= 0.0:
            return f'{engine} needs a positive mass on every link ("{link.name}")'
        a, b, c = np.linalg.eigvalsh(link.inertia.inertia)
        if a < -ROUND_OFF * c or a + b < c * (1.0 - ROUND_OFF):
            return f'{engine} refuses the inertia of "{link.name}": principal moments {a:g}, {b:g}, {c:g} kg m^2'
    return ""
