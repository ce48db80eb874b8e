"""Names and units of the entries of q and u of a system, from its scene."""

from __future__ import annotations

from flexmb.system.scene_arrays import SceneArrays

Names = tuple[tuple[str, str], ...]


def names_of_states(arrays: SceneArrays) -> tuple[Names, Names]:
    """((name, unit) of every entry of q, the same of u)."""
    scene = arrays.scene
    q, u = [("", "")] * arrays.nq, [("", "")] * arrays.nu
    for link in arrays.links:
        hinge = link.hinge.name
        in_q, in_u = link.kind.names(link.hinge)
        q[arrays.coordinate(hinge)] = [(f"{hinge}.{name}", unit) for name, unit in in_q]
        u[arrays.speed(hinge)] = [(f"{hinge}.{name}", unit) for name, unit in in_u]
    for body in scene.bodies:
        place = arrays.coordinate(f"{body.name}.modes")
        modes = range(place.stop - place.start)
        q[place] = [(f"{body.name}.mode[{n}]", "1") for n in modes]
        u[arrays.speed(f"{body.name}.modes")] = [(f"{body.name}.mode_rate[{n}]", "1/s") for n in modes]
    for wheel in scene.wheels:
        q[arrays.coordinate(wheel.name)] = [(f"{wheel.name}.angle", "rad")]
        u[arrays.speed(wheel.name)] = [(f"{wheel.name}.speed", "rad/s")]
    return tuple(q), tuple(u)
