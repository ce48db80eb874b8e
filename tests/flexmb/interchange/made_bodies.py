"""Flexible bodies and scenes with one, for tests of what goes to files and comes back."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

import flexmb as fm
from flexmb.scene.bodies import BeamBody, Body, Modes, TipMass
from flexmb.scene.build import angular
from flexmb.scene.schema import Scene
from flexmb.scene.shapes import beam_section

STRIP = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=5e-10, rho=2700)
LUMP = TipMass(
    x_m=0.5,
    mass_kg=0.1,
    com_m=(0.0, 0.02, 0.03),
    inertia_kg_m2=((1e-4, 1e-5, 0.0), (1e-5, 1.2e-4, 0.0), (0.0, 0.0, 1.5e-4)),
)


def beam(**options: object) -> BeamBody:
    """A beam of 1 m with a lump in its middle; `options` as of SceneBuilder.beam."""
    chosen = {"modes": 5, "tip_masses": (LUMP,)} | options
    builder = fm.SceneBuilder("made").beam("rod", length=1.0, elements=8, section=STRIP, **chosen)
    (body,) = builder.revolute("pivot", "ground", "rod", axis=(0, 1, 0)).scene().bodies
    return body


def free_beam() -> BeamBody:
    return beam(modes=Modes(count=5, boundary="free-free"), nodes={"middle": 0.4})


def swinging(body: Body, inner: str, outer: str) -> Scene:
    """The body between a hinge at its node `inner` and a rigid body at `outer`, moving fast, its modes excited."""
    return (
        fm.SceneBuilder("swinging", gravity=(0.3, -9.81, 0.2))
        .add(body)
        .rigid_body("load", mass=0.3, com=(0.02, 0.0, 0.01), inertia=(1e-3, 2e-3, 2.5e-3))
        .universal(
            "pivot",
            "ground",
            body.name,
            child_node=inner,
            first=angular(angle=0.3, rate=5.0),
            second=angular(angle=0.5, rate=-3.0),
        )
        .revolute("wrist", body.name, "load", parent_node=outer, axis=(0, 0, 1), angle=0.4, rate=7.0)
        .modal_state(body.name, coordinates=0.003 * np.cos(np.arange(5.0)), rates=np.sin(np.arange(5.0)))
        .marker("end", body.name, node=outer)
        .scene()
    )


def at_level(body: BeamBody, level: str) -> BeamBody:
    return replace(body, level=level)
