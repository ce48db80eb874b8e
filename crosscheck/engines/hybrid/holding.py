"""Links whose coordinates events hold or let go: what is held is prescribed to be constant, its motor off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from crosscheck.engines.links import Link, Scalar
from crosscheck.engines.rigid_tree import Slot
from flexmb.scene.functions import Function


def _is_of(link: Link, slot: Slot) -> bool:
    return (link.kind, link.joint) == (slot.link.kind, slot.link.joint)


def _scalar(chain: tuple[Link, ...], slot: Slot) -> Scalar:
    """The only scalar freedom of the link of a slot."""
    (scalar,) = (each for link in chain if _is_of(link, slot) for each in link.freedoms if isinstance(each, Scalar))
    return scalar


def _with_scalar(chain: tuple[Link, ...], slot: Slot, **changes: Function | None) -> tuple[Link, ...]:
    """Links with changes of that freedom."""
    changed: Any = replace(_scalar(chain, slot), **changes)  # type: ignore[arg-type]  # of its two functions
    return tuple(
        replace(link, freedoms=tuple(changed if isinstance(each, Scalar) else each for each in link.freedoms))
        if _is_of(link, slot)
        else link
        for link in chain
    )


def driven(chain: tuple[Link, ...], slot: Slot, motion: Function) -> tuple[Link, ...]:
    """Links with a coordinate that follows a function of time, its motor off."""
    return _with_scalar(chain, slot, prescribed=motion, effort=None)


def freed(chain: tuple[Link, ...], slot: Slot, given: tuple[Link, ...]) -> tuple[Link, ...]:
    """Links with a coordinate that is free, with the motor that it is given."""
    return _with_scalar(chain, slot, prescribed=None, effort=_scalar(given, slot).effort)


def as_held(chain: tuple[Link, ...], fresh: tuple[Link, ...], held: Sequence[Slot]) -> tuple[Link, ...]:
    """Fresh links, in which what is held stays held."""
    for slot in held:
        motion = _scalar(chain, slot).prescribed
        assert motion is not None
        fresh = driven(fresh, slot, motion)
    return fresh
