"""Names and units of the entries of q and u of a system, from its scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flexmb.system.tree_system import System

Names = tuple[tuple[str, str], ...]


def names_of_states(system: System) -> tuple[Names, Names]:
    """((name, unit) of every entry of q, the same of u)."""
    scene = system.scene
    q, u = [("", "")] * system.nq, [("", "")] * system.nu
    for link in system._links:
        hinge = link.hinge.name
        in_q, in_u = link.kind.names(link.hinge)
        q[system.coordinate(hinge)] = [(f"{hinge}.{name}", unit) for name, unit in in_q]
        u[system.speed(hinge)] = [(f"{hinge}.{name}", unit) for name, unit in in_u]
    for body in scene.bodies:
        place = system.coordinate(f"{body.name}.modes")
        modes = range(place.stop - place.start)
        q[place] = [(f"{body.name}.mode[{n}]", "1") for n in modes]
        u[system.speed(f"{body.name}.modes")] = [(f"{body.name}.mode_rate[{n}]", "1/s") for n in modes]
    for wheel in scene.wheels:
        q[system.coordinate(wheel.name)] = [(f"{wheel.name}.angle", "rad")]
        u[system.speed(wheel.name)] = [(f"{wheel.name}.speed", "rad/s")]
    return tuple(q), tuple(u)
