"""What the adapters of peers have in common: they declare what they take, and refuse a scene or compile it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from typing import NamedTuple

from crosscheck.engines.contract import USUAL_S, Effort, EngineMissing, Model, Support
from flexmb.scene.schema import Scene


class Library(NamedTuple):
    """A peer's name in words, the module that is imported, and the distribution that has it."""

    words: str
    module: str
    distribution: str


class PeerEngine:
    """Base of the adapters, which import their library only in `version` and `model`.

    Each declares its `library` and its `ladder`, and yields its `refusals` and `approximations`.
    """

    name: str
    takes: tuple[str, ...] = ()
    library: Library
    ladder: tuple[Effort, ...] = ()
    methods: tuple[str, ...] = ()
    """Integrators that efforts may name besides those of the ladder."""

    def version(self) -> str:
        """Version of the library; raises EngineMissing."""
        with needed(self.library.words, self.library.distribution):
            import_module(self.library.module)
            return version(self.library.distribution)

    def refusals(self, scene: Scene) -> Iterator[str]:
        """Why the engine cannot represent the scene, one thing after the other."""
        yield from ()

    def approximations(self, scene: Scene) -> Iterator[str]:
        """What of a scene that is not refused the engine represents by something else."""
        yield from ()

    def model(self, scene: Scene) -> Model:
        """The scene, which is supported, compiled."""
        raise NotImplementedError

    def obstacle(self, scene: Scene) -> str:
        """Why the engine cannot represent the scene, "" if it can."""
        return next(filter(None, self.refusals(scene)), "")

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


@contextmanager
def needed(library: str, distribution: str) -> Iterator[None]:
    """Around the import of a library: if it fails, EngineMissing says which distribution has it."""
    try:
        yield
    except ImportError as error:
        raise EngineMissing(f"{library} is not installed: pip install {distribution}") from error
