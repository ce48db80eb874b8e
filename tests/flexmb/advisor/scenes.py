"""Small scenes with one beam: driven, swinging, spinning."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

import flexmb as fm
from flexmb.scene.shapes import beam_section

LENGTH = 1.0
# EI = 12 N m^2, 0.27 kg/m: first clamped frequency 23.4 rad/s, Euler load 29.6 N
SECTION = beam_section(E=7.2e10, G=2.7e10, A=1e-4, Iy=12.0 / 7.2e10, Iz=12.0 / 7.2e10, rho=2700.0)


def beam(builder: fm.SceneBuilder, *, modes: int = 3, planes: tuple[str, ...] = ("bending_y",)) -> fm.SceneBuilder:
    """With a beam `arm` of `LENGTH`, 8 elements, inertia on the axis."""
    chosen = fm.Modes(count=modes, families=planes)
    return builder.beam("arm", length=LENGTH, elements=8, section=SECTION, modes=chosen, points="line")


def turned(angle: float, duration: float, planes: tuple[str, ...] = ("bending_y",)) -> fm.Scene:
    """An arm turned about z by a smooth step, at once: it bends back, and rings after."""
    profile = fm.SmoothStep(start_value=0.0, end_value=angle, start_s=0.0, duration_s=duration)
    scene = beam(fm.SceneBuilder("turned arm"), planes=planes).revolute("hub", "ground", "arm", prescribed=profile)
    return scene.marker("tip", "arm", node="tip").scene()


def spun(rate: float, duration: float) -> fm.Scene:
    """An arm spun up about z to `rate` (rad/s)."""
    profile = fm.SpinUp(rate=rate, duration_s=duration)
    scene = beam(fm.SceneBuilder("spun arm")).revolute("hub", "ground", "arm", prescribed=profile)
    return scene.marker("tip", "arm", node="tip").scene()


def loaded(function: fm.Function, direction: tuple[float, float, float]) -> fm.Scene:
    """A clamped arm with a force at its tip."""
    scene = beam(fm.SceneBuilder("loaded arm")).weld("mount", "ground", "arm").marker("tip", "arm", node="tip")
    return scene.force("push", "arm", node="tip", direction=direction, function=function).scene()


def stiff_and_soft(angle: float, duration: float) -> fm.Scene:
    """An arm as in `turned`, twenty times as stiff, with a soft one of half the length across its tip."""
    profile = fm.SmoothStep(start_value=0.0, end_value=angle, start_s=0.0, duration_s=duration)
    stiff = replace(SECTION, EIy_Nm2=20.0 * SECTION.EIy_Nm2, EIz_Nm2=20.0 * SECTION.EIz_Nm2)
    soft = replace(
        SECTION, EIy_Nm2=0.03 * SECTION.EIy_Nm2, EIz_Nm2=0.03 * SECTION.EIz_Nm2, GJ_Nm2=0.2, mass_per_length_kg_m=0.05,
    )  # fmt: skip
    modes = fm.Modes(count=2, families=("bending_y",))
    half = np.sqrt(0.5)
    return (
        fm.SceneBuilder("stiff and soft")
        .beam("arm", length=LENGTH, elements=8, section=stiff, modes=modes, points="line")
        .beam("whip", length=LENGTH / 2.0, elements=8, section=soft, modes=modes, points="line")
        .revolute("hub", "ground", "arm", prescribed=profile)
        .weld("wrist", "arm", "whip", parent_node="tip", parent_quaternion=(half, 0.0, 0.0, half))
        .marker("tip", "whip", node="tip")
        .scene()
    )
