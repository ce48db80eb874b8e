"""What a scene contains, as names: kernels are compiled for these alone (see `flexmb.jit.features`).

A name stands for code that other scenes do without; that something is there in one body is enough.

General kernels contain everything and serve all scenes. They come with the installation, so that nothing is compiled
before the first run; special ones, for the features of one scene, are faster by a tenth to a third and take seconds to
compile. Which of them a scene's tables ask for is decided once, when they are made, and kept in `Constants.kernels`:
all that is derived from them asks for the same.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Literal, Protocol, get_args

import numpy as np

from flexmb.jit.features import GENERAL
from flexmb.jit.installed import unfit
from flexmb.jit.warmed import is_warm
from flexmb.typing import Flags, Index, Real, Record

Kernels = Literal["auto", "general", "special"]
_VARIABLE = "FLEXMB_KERNELS"  # of the environment: what is asked for where nobody says otherwise
UNDECIDED, EVERYTHING, ITS_OWN = range(3)  # `Constants.kernels`
_ASKED: ContextVar[Kernels | None] = ContextVar("kernels", default=None)

HINGE = "hinge"  # "hinge 1": the number of a kind in flexmb.hinges.catalogue
LEVEL = "level"  # "level 1": the number of a level in flexmb.levels.body
AXIS = "axis"  # "axis 2": the number of BODY's `axis`
SEVERAL = "several"  # hinges of several speeds or none, prescribed, or with O on a deforming node
QUATERNIONS = "quaternions"
INBOARD_NODES = "inboard nodes"  # hinges whose inboard frame sits on a deforming node
OUTBOARD_NODES = "outboard nodes"  # hinges whose outboard frame does
MODES = "modes"
COUPLED_MODES = "coupled modes"  # modal stiffness or damping is not diagonal
SECOND_ORDER = "second order"  # shapes of ports and summed points change with the deformation
WHEELS = "wheels"
LOADS = "loads"
CONNECTORS = "connectors"  # between two nodes
ONE_SIDED = "one-sided connectors"
ACTUATORS = "actuators"
BUSHINGS = "bushings"
HINGE_SPRINGS = "hinge springs"
HINGE_ACTUATORS = "hinge actuators"
FRICTION = "friction"
FUNCTIONS = "functions"
MOTORS = "motors"
PRESCRIBED = "prescribed"
SPRINGS = "springs"
BALL_SPRINGS = "ball springs"
DAMPERS = "dampers"
MODAL_DAMPING = "modal damping"


class SceneTables(Protocol):
    """What of `flexmb.tables.arrays.Constants` says what a scene contains; this module stands below that one."""

    kernels: Index
    body: Record
    speed: Record
    second_shape: Real
    wheel: Record
    load: Record
    connector: Record
    bushing: Record
    hinge_spring: Record
    friction: Record
    function: Record
    damping: Real


@contextmanager
def asking(kernels: Kernels | None) -> Iterator[None]:
    """For the tables that this thread makes meanwhile, whatever the environment says; None: what it says."""
    before = _ASKED.set(kernels or _ASKED.get())
    try:
        yield
    finally:
        _ASKED.reset(before)


def asked() -> Kernels:
    """What this thread asks for, or the environment; ValueError for a value of FLEXMB_KERNELS that means nothing."""
    found = _ASKED.get() or os.environ.get(_VARIABLE, "auto")
    match found:
        case "auto" | "general" | "special":
            return found
        case "exact":  # as it was called before
            return "special"
        case _:
            names = ", ".join(f'"{name}"' for name in get_args(Kernels))
            raise ValueError(f"{_VARIABLE} is {found!r}: use one of {names}; auto is meant if it is not set")


def as_asked() -> Index:
    """(1,) For new tables: `Constants.kernels` as this thread asks."""
    return np.array([{"auto": UNDECIDED, "general": EVERYTHING, "special": ITS_OWN}[asked()]])


def features(c: SceneTables) -> frozenset[str]:
    """What kernels for these tables contain: GENERAL alone, or what is in them.

    Undecided tables are run by general kernels where these came with the installation, unless the special ones were
    compiled ahead (`flexmb.run.warm_up`); that is noted in them.
    """
    if c.kernels[0] == EVERYTHING:
        return frozenset({GENERAL})
    found = contained(c)
    if c.kernels[0] == UNDECIDED:
        c.kernels[0] = ITS_OWN if unfit() or is_warm(found) else EVERYTHING
        return features(c)
    return found


def contained(c: SceneTables) -> frozenset[str]:
    """What is in the tables of a scene."""
    body, speed = c.body, c.speed
    found = {
        SEVERAL: not np.all(_single(body, speed)),
        QUATERNIONS: np.any(body["quaternion"] >= 0),
        INBOARD_NODES: np.any(body["inboard_port"] >= 0),
        OUTBOARD_NODES: np.any(body["outboard_port"] >= 0),
        MODES: np.any(body["modes"] > 0),
        COUPLED_MODES: np.any(body["uncoupled"][body["modes"] > 0] == 0),
        SECOND_ORDER: len(c.second_shape) > 0,
        WHEELS: len(c.wheel) > 0,
        LOADS: len(c.load) > 0,
        CONNECTORS: len(c.connector) > 0,
        ONE_SIDED: np.any(c.connector["acts"] != 0),
        ACTUATORS: np.any(c.connector["function"] >= 0),
        BUSHINGS: len(c.bushing) > 0,
        HINGE_SPRINGS: len(c.hinge_spring) > 0,
        HINGE_ACTUATORS: np.any(c.hinge_spring["function"] >= 0),
        FRICTION: len(c.friction) > 0,
        FUNCTIONS: len(c.function) > 0,
        MOTORS: np.any(speed["motor"] >= 0),
        PRESCRIBED: np.any(speed["prescribed"] >= 0),
        SPRINGS: np.any(speed["stiffness"] != 0.0),
        BALL_SPRINGS: np.any(body["ball_spring"] != 0.0),
        DAMPERS: np.any(speed["damping"] != 0.0),
        MODAL_DAMPING: np.any(c.damping != 0.0),
    }
    numbered = {f"{HINGE} {n}" for n in set(body["hinge_kind"].tolist())}
    numbered |= {f"{AXIS} {n}" for n in set(body["axis"].tolist())}
    numbered |= {f"{LEVEL} {n}" for n in set(body["level"].tolist())}
    return frozenset(name for name, there in found.items() if there) | numbered


def _single(body: Record, speed: Record) -> Flags:
    """(N,) Whether a hinge has one speed, free, along z, and O is the body frame."""
    found = (body["axis"] >= 0) & (body["outboard_port"] < 0)
    found[found] = speed["prescribed"][body["u_index"][found]] < 0
    return found
