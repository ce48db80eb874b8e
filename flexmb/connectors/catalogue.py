"""The list of all laws along coordinates but springs. The number of a law is its place in the list."""

from __future__ import annotations

from flexmb.connectors import friction
from flexmb.connectors.law import CoordinateLaw
from flexmb.jit.numbered import numbered
from flexmb.scene.connectors import AlongHinge
from flexmb.tables.features import LAW

LAWS: tuple[CoordinateLaw, ...] = (friction.LAW,)

load = numbered("load", LAW, [law.load for law in LAWS])


def law_of(connector: AlongHinge) -> tuple[int, tuple[float, ...]]:
    """The number of the law that a connector has, and its parameters."""
    for number, law in enumerate(LAWS):
        parameters = law.parameters(connector)
        if parameters is not None:
            return number, parameters
    raise TypeError(f"no law of flexmb.connectors takes a {type(connector).__name__}: {connector.name}")
