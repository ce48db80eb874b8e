"""Lateral buckling: a deep cantilever, under a force at its tip in its stiff plane, gives way sideways."""

from __future__ import annotations

import numpy as np

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from flexmb.linear.equilibrium import equilibrium
from flexmb.linear.linearize import linearize
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.schema import BeamStation, Modes, Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

LENGTH, WEAK, MASS = 1.0, 1.0, 1.0  # m, N m^2, kg/m
STIFF = 1e5  # N m^2: in the plane of the force it bends by 1e-5 of its length, which raises the load by as much
POLYNOMIALS = 6  # the load is then known to 1e-6
CRITICAL = 4.0126  # P L^2 / sqrt(EI GJ): the first zero of J_-1/4(P / 2)
NEUTRAL = 1e-4  # 1/s; growth rates of a neutral motion are roots of rounding errors


def scene(load: float, ratio: float) -> Scene:
    """The cantilever with GJ = `ratio` x EI of its weak plane, under `load` x sqrt(EI GJ) / L^2 downwards."""
    twist = ratio * WEAK
    section = BeamStation(
        x_m=0.0, EA_N=1e8, EIy_Nm2=STIFF, EIz_Nm2=WEAK, GJ_Nm2=twist, mass_per_length_kg_m=MASS, rotary_y_kg_m=1e-2,
        rotary_z_kg_m=1e-7,
    )  # fmt: skip
    modes = Modes(count=POLYNOMIALS, families=("torsion", "bending_y", "bending_z"))
    force = Constant(value=load * np.sqrt(WEAK * twist) / LENGTH**2)
    return (
        SceneBuilder("lateral buckling")
        .beam("beam", length=LENGTH, elements=1, section=section, modes=modes, level="exact")
        .weld("clamp", "ground", "beam")
        .force("push", "beam", node="tip", direction=(0, 0, -1), function=force)
        .scene()
    )


def measure(scene: Scene, load: float, ratio: float) -> Measurement:
    """Growth rate (1/s) about the equilibrium in the plane of the force."""
    system = compile(scene)
    model = linearize(system, equilibrium(system))
    return Measurement(float(np.max(model.eigenvalues.real)))


def excess(load: Real, ratio: Real) -> Real:
    """Positive beyond the critical load, whatever the ratio."""
    return load - CRITICAL + 0.0 * ratio


MAPS = (
    StabilityMap(
        name="lateral_buckling",
        title="Lateral buckling of a deep cantilever, level exact",
        quantity="growth rate",
        scene=scene,
        measure=measure,
        x=Axis("load P L^2 / sqrt(EI GJ)", "", 2.0, 6.0, 8),
        y=Axis("GJ over EI of the weak plane", "", 0.1, 10.0, 5, log=True),
        thresholds=(NEUTRAL,),
        overlay=Overlay("P L^2 = 4.013 sqrt(EI GJ)", "Prandtl 1899, Michell 1899; Timoshenko, Gere 1961, 6.4", excess),
        shows="A deep beam buckles sideways and twists under a load that it carries easily in its stiff plane.",
        depth=2,
    ),
)
