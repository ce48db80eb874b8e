"""Small scenes with one beam: driven, swinging, spinning."""

from __future__ import annotations

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
