"""The models that can replace a flexible body, as transformations of scenes.

A `BodyModel` is one model of one body, a rung of its ladder; a `Model` has one for every flexible body.
`flexmb.advisor.ladder` predicts their errors and costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.advisor.modes import with_modes, with_strains
from flexmb.advisor.sprung import spring_hinged
from flexmb.levels import body as fidelity
from flexmb.scene.bodies import BeamBody, Level, ModalBody
from flexmb.scene.check.second_order import second_order
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.problems import Place
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.schema import Scene
from flexmb.surrogate import finite_segments, substructured

LEVELS: tuple[Level, ...] = tuple(level.name for level in fidelity.LEVELS if level.flexible and not level.by_strain)
"""Levels of modes, each of which neglects less than the one before."""
EXACT: Level = "exact"
COUNTS = (1, 2, 3, 4, 6, 8)
SEGMENTS = (2, 4, 8)
PIECES = (2, 4, 8, 16)
STRAINS = (*((1, n) for n in COUNTS), (2, 3), (2, 4), (2, 6), (4, 3), (4, 4), (4, 6), (8, 3), (8, 4))
"""Pieces of level exact, and polynomials of each curvature along one."""
PLURAL = {1: "mode"}

Kind = Literal["rigid", "sprung", "modes", "segments", "pieces", "strains"]


@dataclass(frozen=True)
class BodyModel:
    """One model of a flexible body.

    "rigid"; "sprung": rigid on a spring hinge; "modes": its `modes` lowest of `families` (all if empty), at `level`,
    with attachment modes if `static`; "segments": `pieces` rigid pieces on sprung hinges; "pieces": flexible ones, with
    `modes` eigenmodes; "strains": `pieces` of level exact with that many `polynomials` of each curvature of `families`,
    and of stretch and shear, as far as the body has them, if `stretching`.
    """

    kind: Kind
    modes: int = 0
    level: Level = "rigid"
    static: bool = False
    families: tuple[str, ...] = ()
    pieces: int = 0
    polynomials: int = 0
    stretching: bool = False

    def __str__(self) -> str:
        if self.kind == "rigid":
            return "rigid"
        if self.kind == "sprung":
            return "rigid on a spring hinge"
        if self.kind == "segments":
            return f"{self.pieces} rigid segments"
        if self.kind == "pieces":
            more = f" and {self.modes} eigenmodes" if self.modes else ""
            return f"{self.pieces} pieces with static shapes{more}, {self.level}"
        of = f" of {', '.join(self.families)}" if self.families else ""
        if self.kind == "strains":
            pieces = f"{self.pieces} pieces with " if self.pieces > 1 else ""
            number = "1 polynomial" if self.polynomials == 1 else f"{self.polynomials} polynomials"
            more = " and stretch and shear" if self.stretching else ""
            return f"{pieces}{number}{of or ' of each curvature'}{more}, {self.level}"
        static = " and static shapes" if self.static else ""
        return f"{self.modes} {PLURAL.get(self.modes, 'modes')}{of}{static}, {self.level}"


Model = tuple[tuple[str, BodyModel], ...]
"""(body, rung) of every flexible body, in the scene's order."""


def flexible_bodies(scene: Scene) -> tuple[BeamBody | ModalBody, ...]:
    """Bodies with modes whose level is not "rigid"."""
    return tuple(b for b in scene.bodies if isinstance(b, BeamBody | ModalBody) and b.level != "rigid")


def undamped(body: BeamBody | ModalBody) -> bool:
    """Whether a body has no damping of its own."""
    if isinstance(body, ModalBody):
        return not np.any(np.array(body.damping))
    return not np.any(body.modes.damping_ratio) and body.modes.viscosity_s == 0.0


def levels(body: BeamBody | ModalBody) -> tuple[Level, ...]:
    """Levels for which the body has the data: raw bodies seldom have a second-order field, and only beams have
    strains, in which alone those with a curved axis can be expressed."""
    if isinstance(body, BeamBody):
        return (EXACT,) if is_curved(body) else (*LEVELS, EXACT)
    stiffened = replace(body, level="stiffened")
    return LEVELS[:-1] if any(second_order(Place(), stiffened, modal_arrays(body))) else LEVELS


def built(scene: Scene, model: Model) -> Scene:
    """The scene with every body modelled by its rung. Raises ValueError if a rung is not possible for its body."""
    for name, rung in model:
        match rung.kind:
            case "rigid":
                scene = rigid(scene, name)
            case "sprung":
                scene = spring_hinged(scene, name)
            case "segments":
                scene = finite_segments(scene, name, rung.pieces)
            case "pieces":
                scene = substructured(scene, name, rung.pieces, level=rung.level, eigenmodes=rung.modes)
            case "strains":
                scene = with_strains(scene, name, rung.polynomials, rung.pieces, rung.stretching, rung.families)
            case "modes":
                scene = with_modes(scene, name, rung.modes, rung.level, rung.static, rung.families)
            case _:
                assert_never(rung.kind)
    return scene


def rigid(scene: Scene, name: str) -> Scene:
    """The scene with that body at level "rigid" and without its modal state; nothing else changes."""
    bodies = tuple(replace(b, level="rigid") if b.name == name else b for b in scene.bodies)
    return replace(scene, bodies=bodies, modal_states=tuple(s for s in scene.modal_states if s.body != name))
