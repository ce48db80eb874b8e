"""Scenes unlike those of the warm-up, one of each kind."""

from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.scene.shapes import beam_section

SECTION = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=1.7e-10, Iz=1.7e-10, rho=2700.0)


def _hub() -> SceneBuilder:
    builder = SceneBuilder("hub", gravity=(0.0, 0.0, -9.81))
    return builder.rigid_body("hub", mass=2.0, inertia=(0.1, 0.1, 0.1)).wheel(
        "rotor", "hub", axis=(0.0, 0.0, 1.0), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3
    )


def tree() -> Scene:
    """A hub with a wheel and two flexible beams of different levels."""
    builder = _hub().spherical("ball", "ground", "hub")
    for name, level in (("left", "full"), ("right", "linear")):
        builder.beam(name, length=0.5, elements=2, section=SECTION, modes=2, level=level)
        builder.revolute(f"{name} hinge", "hub", name, angle=0.3)
    return builder.scene()


def condensed() -> Scene:
    """A hub with a beam of many modes."""
    builder = _hub().spherical("ball", "ground", "hub")
    builder.beam("panel", length=0.5, elements=8, section=SECTION, modes=16, level="ruthless")
    return builder.weld("root", "hub", "panel").scene()


def closed() -> Scene:
    """A hub that hangs on a ball."""
    at = (0.2, 0.0, 0.0)
    hub = _hub().free("float", "ground", "hub")
    return hub.closure("ball", "spherical", "ground", "hub", position_a=at, position_b=at).scene()


SCENES = {"tree": tree, "condensed": condensed, "closed": closed}
