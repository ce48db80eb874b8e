"""What a scene contains, as names: kernels are compiled for these alone (see `flexmb.jit.features`).

A name stands for code that other scenes do without; that something is there in one body is enough. With the
environment variable FLEXMB_KERNELS=general kernels contain everything and are compiled once for all scenes: for who
runs many different ones for a moment each, as a suite of tests does.
"""

from __future__ import annotations

import os
from contextvars import ContextVar
from typing import TYPE_CHECKING

import numpy as np

from flexmb.jit.features import GENERAL
from flexmb.typing import Flags, Record

if TYPE_CHECKING:
    from flexmb.tables.arrays import Constants

KERNELS: ContextVar[str] = ContextVar("kernels", default="")
"""What this thread asks for, whatever the environment says; nothing: see there."""

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


def features(c: Constants) -> frozenset[str]:
    """Of the tables of a scene; GENERAL alone where this thread or the environment asks for it.

    Raises ValueError for a value of FLEXMB_KERNELS that means nothing.
    """
    asked = KERNELS.get() or os.environ.get("FLEXMB_KERNELS", "exact")
    if asked not in ("exact", GENERAL):
        raise ValueError(f'FLEXMB_KERNELS is {asked!r}: use "exact", which is meant if it is not set, or "{GENERAL}"')
    if asked == GENERAL:
        return frozenset({GENERAL})
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
