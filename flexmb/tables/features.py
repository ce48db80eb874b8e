"""The features of a scene, for which its kernels are compiled (see `flexmb.jit.features`).

A feature is a name for code that not all scenes need. A scene has it if any of its bodies does.

General kernels contain all features and run every scene. They are compiled at installation, so that nothing needs to be
compiled before the first run; so are smaller sets for rigid trees, for what is asked most often (`READY`). Special
kernels contain the features of one scene; they are faster by a tenth to a third and take seconds to compile. The choice
is made once, when the tables of a scene are first used, and recorded in `Constants.kernels`, so that all tables derived
from them use the same kernels.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Literal, NamedTuple, Protocol, get_args

import numpy as np

from flexmb.jit.features import GENERAL
from flexmb.jit.installed import unfit
from flexmb.jit.warmed import is_warm
from flexmb.typing import Flags, Index, Real, Record

Kernels = Literal["auto", "general", "special"]
_VARIABLE = "FLEXMB_KERNELS"  # environment variable with the default choice
Choice = Kernels | Literal["beside"]
"""With "beside", a choice of general kernels, and of special ones for what the recursion alone does."""
# `Constants.kernels`; BY_ITSELF are general ones where nobody asked for these
UNDECIDED, EVERYTHING, BY_ITSELF, BESIDE, ITS_OWN, RIGID_TREES, SINGLE_AXES = range(7)
WITH_EVERYTHING = EVERYTHING, BY_ITSELF, BESIDE
RECURSION = "the recursion alone"  # accelerations, outputs and runs of explicit methods; in the note of what is warm
BATCHES = "batches"  # likewise
DERIVATIVES = "derivatives"  # of accelerations and of inverse dynamics; none of these are compiled beside
_ASKED: ContextVar[Choice | None] = ContextVar("kernels", default=None)

HINGE = "hinge"  # "hinge 1" is the kind with number 1 in flexmb.hinges.catalogue
LEVEL = "level"  # "level 1" is the level with number 1 in flexmb.levels.body
AXIS = "axis"  # "axis 2" is a hinge with `axis` = 2 in BODY
SEVERAL = "several"  # hinges of several speeds or none, prescribed, or with O on a deforming node
QUATERNIONS = "quaternions"
INBOARD_NODES = "inboard nodes"  # hinges whose inboard frame sits on a deforming node
OUTBOARD_NODES = "outboard nodes"  # hinges whose outboard frame does
MODES = "modes"
COUPLED_MODES = "coupled modes"  # modal stiffness or damping is not diagonal
SECOND_ORDER = "second order"  # shapes of ports and summed points change with the deformation
SECTIONS = "sections"  # of beams of level exact
BENT_IN_PLANE = "bent in a plane"  # those whose sections turn about one axis
BENT_IN_SPACE = "bent in space"  # all others of them
WHEELS = "wheels"
LOADS = "loads"
CONNECTORS = "connectors"  # between two nodes
ONE_SIDED = "one-sided connectors"
ACTUATORS = "actuators"
FRAME_LAWS = "laws between frames"  # that have parameters
FRAME_LAW = "law between frames"  # "law between frames 0": the number of a law in flexmb.connectors.catalogue
HINGE_SPRINGS = "hinge springs"
HINGE_ACTUATORS = "hinge actuators"
COORDINATE_LAWS = "laws along coordinates"  # that are no springs
LAW = "law along coordinates"  # "law along coordinates 0": the number of a law in flexmb.connectors.catalogue
FUNCTIONS = "functions"
MOTORS = "motors"
PRESCRIBED = "prescribed"
SPRINGS = "springs"
BALL_SPRINGS = "ball springs"
DAMPERS = "dampers"
ARMATURES = "armatures"
MODAL_DAMPING = "modal damping"

_KINDS = range(-1, 64)  # of hinges, axes and laws, more than there are
OF_RIGID_TREES = frozenset({
    SEVERAL, QUATERNIONS, WHEELS, LOADS, CONNECTORS, ONE_SIDED, ACTUATORS, FRAME_LAWS, HINGE_SPRINGS, HINGE_ACTUATORS,
    COORDINATE_LAWS, FUNCTIONS, MOTORS, PRESCRIBED, SPRINGS, BALL_SPRINGS, DAMPERS, ARMATURES, f"{LEVEL} 0",
    *(f"{name} {n}" for name in (HINGE, AXIS, FRAME_LAW, LAW) for n in _KINDS),
})  # fmt: skip
OF_SINGLE_AXES = OF_RIGID_TREES - {
    SEVERAL, QUATERNIONS, WHEELS, LOADS, CONNECTORS, ONE_SIDED, ACTUATORS, FRAME_LAWS, PRESCRIBED, BALL_SPRINGS,
    f"{AXIS} -1", *(f"{FRAME_LAW} {n}" for n in _KINDS),
}  # fmt: skip


class Ready(NamedTuple):
    """The features of kernels that are compiled at installation beside the general ones, and what they serve for."""

    features: frozenset[str]
    serves: tuple[str, ...]


READY = {
    SINGLE_AXES: Ready(OF_SINGLE_AXES, (RECURSION, BATCHES, DERIVATIVES)),
    RIGID_TREES: Ready(OF_RIGID_TREES, (RECURSION, BATCHES)),
}
"""By `Constants.kernels`, the smallest first: of rigid bodies on free revolute and prismatic hinges that carry nothing,
and of all trees of rigid bodies, whose derivatives gain too little to be worth their compilation."""


class SceneTables(Protocol):
    """The tables of `flexmb.tables.arrays.Constants` from which features follow; that module imports this one."""

    kernels: Index
    body: Record
    speed: Record
    second_shape: Real
    section: Record
    wheel: Record
    load: Record
    connector: Record
    frame_law: Record
    hinge_spring: Record
    coordinate_law: Record
    function: Record
    damping: Real


@contextmanager
def asking(kernels: Choice | None) -> Iterator[None]:
    """Choose the kernels of tables that this thread makes within the context; None leaves the choice as it is."""
    before = _ASKED.set(kernels or _ASKED.get())
    try:
        yield
    finally:
        _ASKED.reset(before)


def asked() -> Choice:
    """The choice of this thread, or of the environment; ValueError for an unknown value of FLEXMB_KERNELS."""
    kind = _ASKED.get() or os.environ.get(_VARIABLE, "auto")
    match kind:
        case "auto" | "general" | "special":
            return kind
        case "beside" if _ASKED.get():
            return kind
        case "exact":  # the former name
            return "special"
        case _:
            names = ", ".join(f'"{name}"' for name in get_args(Kernels))
            raise ValueError(f"{_VARIABLE} is {kind!r}: use one of {names}; auto is meant if it is not set")


def as_asked() -> Index:
    """`Constants.kernels` (1,) for new tables, by the choice of this thread."""
    return np.array([{"auto": UNDECIDED, "general": EVERYTHING, "special": ITS_OWN, "beside": BESIDE}[asked()]])


def features(c: SceneTables) -> frozenset[str]:
    """The features of the kernels for these tables: GENERAL alone, those of READY, or those of the scene.

    Undecided tables get general kernels if these are installed and the special ones were not compiled ahead
    (`flexmb.run.warm_up`); the decision is recorded in the tables.
    """
    if c.kernels[0] in WITH_EVERYTHING:
        return frozenset({GENERAL})
    if c.kernels[0] in READY:
        return READY[int(c.kernels[0])].features
    found = contained(c)
    if c.kernels[0] == UNDECIDED:
        c.kernels[0] = ITS_OWN if unfit() or is_warm(found) else BY_ITSELF
        return features(c)
    return found


def fastest_at_hand(c: SceneTables, what: str) -> int:
    """`Constants.kernels` of tables for RECURSION, BATCHES or DERIVATIVES: where others have general kernels, special
    ones that a process beside has compiled (`flexmb.run.beside`), or else the smallest of READY that serve."""
    general, found = GENERAL in features(c), contained(c)
    chosen = int(c.kernels[0])
    if not general:
        return chosen
    if what != DERIVATIVES and (chosen == BESIDE or (chosen == BY_ITSELF and is_warm(found | {what}))):
        return ITS_OWN
    fit = (number for number, ready in READY.items() if found <= ready.features and what in ready.serves)
    return next(fit, chosen)


def contained(c: SceneTables) -> frozenset[str]:
    """The features of a scene, from its tables."""
    body, speed = c.body, c.speed
    features = {
        SEVERAL: not np.all(_single(body, speed)),
        QUATERNIONS: np.any(body["quaternion"] >= 0),
        INBOARD_NODES: np.any(body["inboard_port"] >= 0),
        OUTBOARD_NODES: np.any(body["outboard_port"] >= 0),
        MODES: np.any(body["modes"] > 0),
        COUPLED_MODES: np.any(body["uncoupled"][body["modes"] > 0] == 0),
        SECOND_ORDER: len(c.second_shape) > 0,
        SECTIONS: len(c.section) > 0,
        BENT_IN_PLANE: np.any(body["planar"] != 0),
        BENT_IN_SPACE: np.any((body["section_stop"] > body["section_start"]) & (body["planar"] == 0)),
        WHEELS: len(c.wheel) > 0,
        LOADS: len(c.load) > 0,
        CONNECTORS: len(c.connector) > 0,
        ONE_SIDED: np.any(c.connector["acts"] != 0),
        ACTUATORS: np.any(c.connector["function"] >= 0),
        FRAME_LAWS: len(c.frame_law) > 0,
        HINGE_SPRINGS: len(c.hinge_spring) > 0,
        HINGE_ACTUATORS: np.any(c.hinge_spring["function"] >= 0),
        COORDINATE_LAWS: len(c.coordinate_law) > 0,
        FUNCTIONS: len(c.function) > 0,
        MOTORS: np.any(speed["motor"] >= 0),
        PRESCRIBED: np.any(speed["prescribed"] >= 0),
        SPRINGS: np.any(speed["stiffness"] != 0.0),
        BALL_SPRINGS: np.any(body["ball_spring"] != 0.0),
        DAMPERS: np.any(speed["damping"] != 0.0),
        ARMATURES: np.any(speed["armature"] != 0.0),
        MODAL_DAMPING: np.any(c.damping != 0.0),
    }
    numbered = {f"{HINGE} {n}" for n in set(body["hinge_kind"].tolist())}
    numbered |= {f"{AXIS} {n}" for n in set(body["axis"].tolist())}
    numbered |= {f"{LEVEL} {n}" for n in set(body["level"].tolist())}
    numbered |= {f"{FRAME_LAW} {n}" for n in set(c.connector["kind"].tolist())}
    numbered |= {f"{LAW} {n}" for n in set(c.coordinate_law["kind"].tolist())}
    return frozenset(name for name, there in features.items() if there) | numbered


def _single(body: Record, speed: Record) -> Flags:
    """(N,) Whether a hinge has one speed, free, along z, and O is the body frame."""
    is_single = (body["axis"] >= 0) & (body["outboard_port"] < 0)
    is_single[is_single] = speed["prescribed"][body["u_index"][is_single]] < 0
    return is_single
