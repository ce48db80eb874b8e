"""What the adapters of peers have in common: they declare what they take, and refuse a scene or compile it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from typing import NamedTuple

import numpy as np

from crosscheck.engines.contract import Effort, EngineMissing, Model, Support
from crosscheck.engines.hybrid.refusals import refusal
from crosscheck.engines.links import Link, obstacle
from crosscheck.engines.steps import USUAL_S
from flexmb.scene.connectors import Connector
from flexmb.scene.schema import Scene

ROUND_OFF = 1e-12  # of the largest principal moment: by so much a disc's moments may miss the triangle inequality


class Library(NamedTuple):
    """A peer's name in words, the module that is imported, and the distribution that has it."""

    words: str
    module: str
    distribution: str


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


class PeerEngine:
    """Base of the adapters, which import their library only in `version` and `model`.

    Each declares its `library` and, where it is a code of rigid trees, `capabilities`; `refusals` are what it adds.
    """

    name: str
    takes: tuple[str, ...] = ()
    library: Library
    capabilities: TreeCapabilities | None = None
    ladder: tuple[Effort, ...] = ()

    def version(self) -> str:
        """Version of the library; raises EngineMissing."""
        with needed(self.library.words, self.library.distribution):
            import_module(self.library.module)
            return version(self.library.distribution)

    def refusals(self, scene: Scene) -> Iterator[str]:
        """Why the engine cannot represent the scene, beside what its capabilities say; one thing after the other."""
        yield from ()

    def approximations(self, scene: Scene) -> Iterator[str]:
        """What of a scene that is not refused the engine represents by something else."""
        yield from ()

    def model(self, scene: Scene) -> Model:
        """The scene, which is supported, compiled."""
        raise NotImplementedError

    def obstacle(self, scene: Scene) -> str:
        """Why the engine cannot represent the scene, "" if it can."""
        return next(filter(None, self._obstacles(scene)), "")

    def supports(self, scene: Scene) -> Support:
        """ "no" with the first reason, else "surrogate" with all that is approximated, else "exact"."""
        if reason := self.obstacle(scene):
            return Support("no", reason)
        weak = "; ".join(dict.fromkeys(self.approximations(scene)))
        return Support("surrogate", weak) if weak else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """The engine's ladder; of fixed steps that for a run of usual duration."""
        by_duration = getattr(self, "efforts_for", None)
        return self.ladder if by_duration is None else by_duration(scene, USUAL_S)

    def compile(self, scene: Scene) -> Model:
        """EngineMissing without the library; ValueError for a scene that the engine cannot represent."""
        self.version()
        if reason := self.obstacle(scene):
            raise ValueError(f'scene "{scene.name}": {reason}')
        return self.model(scene)

    def _obstacles(self, scene: Scene) -> Iterator[str]:
        takes = self.capabilities
        if takes is not None:
            if takes.loops and scene.closures:
                yield f'closure "{scene.closures[0].name}": {self.library.words} {takes.loops}'
            yield obstacle(scene, self.library.words, *takes[:-1])
        if "events" in self.takes:
            yield refusal(scene)
        yield from self.refusals(scene)


@contextmanager
def needed(library: str, distribution: str) -> Iterator[None]:
    """Around the import of a library: if it fails, EngineMissing says which distribution has it."""
    try:
        yield
    except ImportError as error:
        raise EngineMissing(f"{library} is not installed: pip install {distribution}") from error


def inertia_refusals(links: Iterable[Link], engine: str) -> Iterator[str]:
    """Why an engine that needs mass and a possible inertia on every link refuses some."""
    for link in links:
        if link.inertia.mass <= 0.0:
            yield f'{engine} needs a positive mass on every link ("{link.name}")'
        a, b, c = np.linalg.eigvalsh(link.inertia.inertia)
        if a < -ROUND_OFF * c or a + b < c * (1.0 - ROUND_OFF):
            yield f'{engine} refuses the inertia of "{link.name}": principal moments {a:g}, {b:g}, {c:g} kg m^2'
