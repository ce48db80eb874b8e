"""Engines that may be missing here or decline a scene, and how far answers of two are apart."""

from functools import cache

import numpy as np
import pytest

from crosscheck.engines.contract import Engine, EngineMissing
from crosscheck.engines.registry import engine
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def installed(name: str) -> Engine:
    """The engine, or a skip that says what is missing."""
    if missing := _missing(name):
        pytest.skip(missing)
    return engine(name)


@cache
def _missing(name: str) -> str:
    """Asked once: a library that is missing is looked for in all folders."""
    try:
        engine(name).version()
    except EngineMissing as missing:
        return str(missing)
    return ""


def taking(name: str, scene: Scene) -> Engine:
    """The same, or a skip that says why it does not represent this scene exactly."""
    found = installed(name)
    support = found.supports(scene)
    if support.kind != "exact":
        pytest.skip(f"{name}: {support.reason}")
    return found


def off(ours: dict[str, Real], theirs: dict[str, Real]) -> float:
    """Largest difference of named arrays, relative to the largest number of all."""
    assert ours.keys() == theirs.keys()
    size = max((float(np.max(np.abs(values))) for values in ours.values()), default=1.0)
    return max((float(np.max(np.abs(ours[name] - theirs[name]))) for name in ours), default=0.0) / size
