"""Constants of a scene that a test may spoil in place: negative controls."""

from __future__ import annotations

from dataclasses import fields
from typing import TypeVar

from flexmb.jit.features import GENERAL
from flexmb.tables.arrays import Constants

Tables = TypeVar("Tables", bound=Constants)


def unlocked(constants: Tables) -> Tables:
    """The same with writable arrays. Its kernels must be general ones: others leave out what is not there yet."""
    assert constants.features() == {GENERAL}
    for field in fields(constants):
        getattr(constants, field.name).setflags(write=True)
    return constants
