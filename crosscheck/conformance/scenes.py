"""The small scenes of the clauses: one body with its mass centre off its origin, with the items of the clause."""

from __future__ import annotations

from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.scene.shapes import beam_section

G = 9.81
DOWN = (0.0, 0.0, -G)
NONE = (0.0, 0.0, 0.0)
MASS, ARM, INERTIA = 2.0, 0.6, (0.2, 0.3, 0.35)  # kg, m, kg m^2 about the mass centre
SECOND = INERTIA[1] + MASS * ARM**2  # about a transverse hinge axis y
THIRD = INERTIA[2] + MASS * ARM**2  # about z
QUARTER = (0.5**0.5, 0.0, 0.0, 0.5**0.5)  # a quarter turn about z


def arm(
    gravity: tuple[float, float, float] = DOWN, com: tuple[float, float, float] = (ARM, 0.0, 0.0)
) -> SceneBuilder:
    """A body with its mass centre at `com` (m), a marker at its origin and one at its mass centre; no hinge yet."""
    return (
        SceneBuilder("arm", gravity=gravity)
        .rigid_body("arm", mass=MASS, com=com, inertia=INERTIA)
        .marker("origin", "arm")
        .marker("com", "arm", offset=com)
    )


def pendulum(rate: float = 0.4) -> Scene:
    """The simplest scene: one body on a hinge about World z, its mass centre on its x, gravity along -y, a marker."""
    return (
        SceneBuilder("pendulum", gravity=(0.0, -G, 0.0))
        .rigid_body("rod", mass=MASS, com=(ARM, 0.0, 0.0), inertia=INERTIA, nodes={"tip": (1.0, 0.0, 0.0)})
        .revolute("pivot", "ground", "rod", axis=(0.0, 0.0, 1.0), angle=-0.3, rate=rate)
        .marker("tip", "rod", node="tip")
        .scene()
    )


def simple_scenes(rate: float = 0.4) -> tuple[Scene, ...]:
    """Scenes of one body with a marker "tip", from which every engine can represent one: what is about the form of an
    answer is tried on the first that it does. None moves so simply that efforts would not matter. `rate` in rad/s."""
    rod = SceneBuilder("tumbling").rigid_body("rod", mass=MASS, inertia=INERTIA, nodes={"tip": (1.0, 0.0, 0.0)})
    tumbling = rod.free("flight", "ground", "rod", angular_velocity=(rate, 2.0, 1.0)).marker("tip", "rod", node="tip")
    rod = SceneBuilder("sprung").rigid_body("rod", mass=MASS, inertia=INERTIA, nodes={"tip": (1.0, 0.0, 0.0)})
    sprung = rod.prismatic("rail", "ground", "rod", position=0.3, rate=rate, stiffness=40.0)
    return pendulum(rate), tumbling.scene(), sprung.marker("tip", "rod", node="tip").scene(), flexible(rate)


def flexible(rate: float = 0.0) -> Scene:
    """A flexible beam on a hinge, which many codes refuse."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    return (
        SceneBuilder("flexible pendulum", gravity=DOWN)
        .beam("rod", length=1.0, elements=4, section=section, modes=2)
        .revolute("pivot", "ground", "rod", axis=(0.0, 1.0, 0.0), rate=rate)
        .marker("tip", "rod", node="tip")
        .scene()
    )


def hub() -> SceneBuilder:
    """A body for wheels; no hinge yet."""
    return SceneBuilder("wheel").rigid_body("hub", mass=5.0, inertia=(1.0, 1.2, 1.5)).marker("hub", "hub")
