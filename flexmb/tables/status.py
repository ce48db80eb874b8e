"""Status codes, which kernels return in place of exceptions, and advice for each."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Why a run, or one evaluation of its right-hand side, ended. Kernels return the plain integers."""

    OK = 0
    NOT_POSITIVE_DEFINITE = 1
    NONFINITE = 2
    STEP_TOO_SMALL = 3
    MAX_STEPS = 4
    OUT_OF_RANGE = 5
    CLOSURE_SINGULAR = 6
    CLOSURE_OPEN = 7
    NOT_CONVERGED = 8
    INTERRUPTED = 9
    BRANCH_UNKNOWN = 10
    CHATTERING = 11
    CONNECTOR_OVERTURNED = 16

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        """Its name; its number for formats of integers."""
        return format(int(self), spec) if spec.endswith(tuple("bcdoxXn")) else format(self.name, spec)

    @property
    def advice(self) -> str:
        """What happened, and what to try."""
        return _ADVICE[self]


_ADVICE = {
    Status.OK: "finished",
    Status.NOT_POSITIVE_DEFINITE: (
        "the inertia of body {body} with all it carries is not positive definite: it moves without mass, hinges and "
        "modes move the same mass twice, its gimbal is at its singular angle, or its first-order mass matrix left its "
        'range of validity; give it mass, leave out a freedom, use a spherical hinge, or use level "full"'
    ),
    Status.NONFINITE: (
        "the state is no longer finite: the motion diverged; look for an instability (level, negative stiffness or "
        "damping, loads), or use a smaller step"
    ),
    Status.STEP_TOO_SMALL: (
        "the step became too small to advance time: the motion is singular or diverging there (a gimbal at its "
        "singular angle, a flexible body beyond its range), or rtol and atol ask for more than double precision gives"
    ),
    Status.OUT_OF_RANGE: (
        "the deflection of body {body} grew beyond ten times its size: its modes mean nothing there (a beam of level "
        '"exact" is wound up by a turn from one of its points to the next); look for an instability (an unstiffened '
        "beam spun above its first frequency, loads that grow, equal steps that are too long), give the beam more "
        "points, or divide the body into segments"
    ),
    Status.CLOSURE_SINGULAR: (
        "closure {body} is singular: here the closures suppress fewer motions than at neighbouring places, and the "
        "mechanism is too slow, or started too close, for its speed to say along which branch it goes on, or a "
        "function switches or a controller samples just there; start elsewhere, move that instant, or give a body "
        "flexibility"
    ),
    Status.CLOSURE_OPEN: (
        "closure {body} cannot be kept closed: the closures and prescribed motions contradict each other there; the "
        "mechanism is locked, started at a singular configuration, or is driven beyond its reach; a method of equal "
        'steps may only have stepped too far: use a shorter step, or "dop853"'
    ),
    Status.BRANCH_UNKNOWN: (
        "closure {body} went close to a singular position in too long a step: branches of the motion nearly meet "
        'there, and which one the mechanism takes is not known; use a shorter step, or "dop853"'
    ),
    Status.CONNECTOR_OVERTURNED: (
        "bushing {body} is turned by more than 170 degrees: close to half a turn its rotation vector jumps, and its "
        "load with it; turn one of its frames so that it is near rest, or use a hinge with springs"
    ),
    Status.NOT_CONVERGED: (
        "the implicit equations of a step were not solved by Newton's method: use a smaller step, or a method that "
        'adapts its step, "radau5"'
    ),
    Status.CHATTERING: (
        "events follow each other faster and faster without end: let an `Impact` come to rest (`rests`) or become a "
        "`Latch`, or take a stiff spring with a damper in place of the stop; where it may rest already, a load pulls "
        "at rest and presses in motion: let it change smoothly"
    ),
    Status.INTERRUPTED: "interrupted from the keyboard",
    Status.MAX_STEPS: "the step limit was reached: raise max_steps, loosen rtol and atol, or lengthen the fixed step",
}

OK = int(Status.OK)
NOT_POSITIVE_DEFINITE = int(Status.NOT_POSITIVE_DEFINITE)
NONFINITE = int(Status.NONFINITE)
STEP_TOO_SMALL = int(Status.STEP_TOO_SMALL)
MAX_STEPS = int(Status.MAX_STEPS)
OUT_OF_RANGE = int(Status.OUT_OF_RANGE)
CLOSURE_SINGULAR = int(Status.CLOSURE_SINGULAR)
CLOSURE_OPEN = int(Status.CLOSURE_OPEN)
NOT_CONVERGED = int(Status.NOT_CONVERGED)
INTERRUPTED = int(Status.INTERRUPTED)
BRANCH_UNKNOWN = int(Status.BRANCH_UNKNOWN)
CONNECTOR_OVERTURNED = int(Status.CONNECTOR_OVERTURNED)
