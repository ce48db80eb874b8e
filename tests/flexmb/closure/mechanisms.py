"""Mechanisms whose motion is known in closed form: four-bars, slider-cranks, Bennett's linkage."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

import flexmb
from flexmb.scene.build import SceneBuilder, s
from flexmb.scene.shapes import beam_section

STEEL = beam_section(E=2.0e11, G=8.0e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=7800.0)


class FourBar(NamedTuple):
    """Lengths of crank, coupler, rocker and ground (m)."""

    crank: float = 0.3
    coupler: float = 0.8
    rocker: float = 0.7
    ground: float = 1.0

    def angles(self, crank: float) -> tuple[float, float]:
        """Directions of coupler and rocker for the direction of the crank, coupler above the diagonal: two circles."""
        pin = self.crank * np.array([np.cos(crank), np.sin(crank)])
        pivot = np.array([self.ground, 0.0])
        diagonal = pivot - pin
        d = np.linalg.norm(diagonal)
        along = (self.coupler**2 - self.rocker**2 + d**2) / (2.0 * d)
        e = diagonal / d
        joint = pin + along * e + np.sqrt(self.coupler**2 - along**2) * np.array([-e[1], e[0]])
        return float(np.arctan2(*(joint - pin)[::-1])), float(np.arctan2(*(joint - pivot)[::-1]))


GRASHOF = FourBar()
RATE = 3.826937  # rad/s, of its crank; steps and tolerances of tests go by it


def gap(system: flexmb.System, state: flexmb.State) -> float:
    """The largest of all closures (m or rad)."""
    return max(max(gap) for gap in system.closure_gaps(state).values())


def largest_gap(system: flexmb.System, run: flexmb.Trajectory) -> float:
    """Of all closures and samples (m or rad)."""
    return max(gap(system, flexmb.State(*each)) for each in zip(run.q, run.u, run.t, strict=True))


def bar(scene: SceneBuilder, name: str, length: float, *, modes: int | s.Modes = 0, **beam: Any) -> SceneBuilder:
    """A slender bar along x with a node "tip": rigid, or a beam with modes."""
    if modes:
        return scene.beam(name, length=length, elements=4, section=STEEL, modes=modes, **{"points": "line", **beam})
    mass = 0.78 * length
    inertia = (1e-5, mass * length**2 / 12.0, mass * length**2 / 12.0)
    return scene.rigid_body(name, mass=mass, com=(0.5 * length, 0, 0), inertia=inertia, nodes={"tip": (length, 0, 0)})


def four_bar(
    lengths: FourBar = GRASHOF, *, crank: float = 1.0, rate: float = RATE, closure: str = "revolute",
    gravity: float = -9.81, modes: int = 0, off: float = 0.0, prescribed: s.Function | None = None, **place,
) -> s.Scene:  # fmt: skip
    """A four-bar in the x-y plane, cut at the pin between coupler and rocker; `off` spoils its initial angles (rad)."""
    motion = {"prescribed": prescribed} if prescribed else {"angle": crank, "rate": rate}
    settings = {"crank": crank, "closure": closure, "gravity": gravity, "off": off}
    return four_bar_builder(motion, {"modes": modes}, lengths, **settings, **place).scene()


def four_bar_builder(
    drive: dict[str, Any], bars: dict[str, Any], lengths: FourBar = GRASHOF, *, crank: float = 1.0,
    closure: str = "revolute", gravity: float = -9.81, off: float = 0.0, **place,
) -> SceneBuilder:  # fmt: skip
    """The same before it is a scene; `drive` is given to the crank's hinge, `bars` to `bar`."""
    coupler, rocker = lengths.angles(crank)
    scene = SceneBuilder("four-bar", gravity=(0.0, gravity, 0.0))
    for name, length in zip(("crank", "coupler", "rocker"), lengths[:3], strict=True):
        bar(scene, name, length, **bars)
    scene.revolute("drive", "ground", "crank", **drive)
    scene.revolute("pin", "crank", "coupler", parent_node="tip", angle=coupler - crank + off)
    scene.revolute("pivot", "ground", "rocker", parent_position=(lengths.ground, 0.0, 0.0), angle=rocker - off)
    scene.closure("loop", closure, "coupler", "rocker", node_a="tip", node_b="tip", **place)
    return scene.marker("joint", "coupler", node="tip")


def slider_crank(
    crank: float, rod: float, *, angle: float, rate: float = 3.0, modes: int = 0, cut: str = "slider", off: float = 0.0,
) -> s.Scene:  # fmt: skip
    """A slider-crank in the x-y plane; cut between slider and ground ("slider") or between rod and slider ("pin")."""
    lean = -np.arcsin(crank * np.sin(angle) / rod)
    scene = SceneBuilder("slider-crank", gravity=(0.0, -9.81, 0.0))
    bar(scene, "crank", crank), bar(scene, "rod", rod, modes=modes)
    scene.rigid_body("slider", mass=0.4, inertia=(1e-3, 1e-3, 1e-3))
    scene.revolute("drive", "ground", "crank", angle=angle, rate=rate)
    scene.revolute("crankpin", "crank", "rod", parent_node="tip", angle=lean - angle + off)
    if cut == "slider":
        scene.revolute("wristpin", "rod", "slider", parent_node="tip", angle=-lean)
        scene.closure("guide", "prismatic", "ground", "slider", axis=(1, 0, 0))
    else:
        reach = crank * np.cos(angle) + rod * np.cos(lean)
        scene.prismatic("guide", "ground", "slider", axis=(1, 0, 0), position=reach)
        scene.closure("wristpin", "revolute", "rod", "slider", node_a="tip")
    scene.marker("piston", "slider")
    return scene.scene()


def bennett_ratio(a: float, b: float, alpha: float) -> tuple[float, float]:
    """The other twist, and the product of the tangents of two neighbouring half angles."""
    beta = float(np.arcsin(np.sin(alpha) * b / a))
    return beta, float(np.sin(0.5 * (alpha + beta)) / np.sin(0.5 * (alpha - beta)))


def bennett(a: float = 1.0, b: float = 0.7, alpha: float = 0.8, *, angle: float = 1.0, rate: float = 1.5) -> s.Scene:
    """Bennett's linkage: four skew axes, opposite links equal, sin(alpha)/a = sin(beta)/b; cut at its fourth axis.

    Links along x between axes z, each turned about x by its twist; joint angles theta, phi, -theta, -phi with
    tan(theta/2) tan(phi/2) = sin((alpha+beta)/2)/sin((alpha-beta)/2).
    """
    beta, ratio = bennett_ratio(a, b, alpha)
    other = 2.0 * np.arctan(ratio / np.tan(0.5 * angle))
    scene = SceneBuilder("Bennett", gravity=(0.0, -9.81, 1.0))
    links = [("one", b, beta), ("two", a, alpha), ("three", b, beta)]
    for name, length, twist in links:
        node = s.Node(name="tip", position_m=(length, 0, 0), quaternion=(np.cos(twist / 2), np.sin(twist / 2), 0, 0))
        scene.rigid_body(
            name, mass=length, com=(length / 2, 0.02, 0.01), inertia=np.diag([0.01, 0.1, 0.1]) * length, nodes=[node]
        )
    # the fourth link is the ground: length a, twist alpha, from the fourth axis to the first
    scene.revolute("first", "ground", "one", angle=angle, rate=rate)
    scene.revolute("second", "one", "two", parent_node="tip", angle=other)
    scene.revolute("third", "two", "three", parent_node="tip", angle=-angle)
    turn = (np.cos(alpha / 2), -np.sin(alpha / 2), 0.0, 0.0)
    scene.closure("fourth", "revolute", "three", "ground", node_a="tip", position_b=(-a, 0, 0), quaternion_b=turn)
    return scene.scene()


def tilted_four_bar(*, flexible: bool, drive: s.Function | None, tilt: float = np.deg2rad(5.0)) -> s.Scene:
    """The four-bar of Bauchau et al., Multibody Syst. Dyn. 37 (2016) 29: a parallelogram with one pin tilted.

    Bars of 0.12, 0.24 and 0.12 m; rigid bars cannot move, flexible ones have five attachment modes each: loops load the
    tips of bars, which eigenmodes follow slowly. `drive` is the crank's angle. Sections are square: rho I is known.
    """
    stiff = {"EA_N": 5.2992e7, "GJ_Nm2": 733.488, "EIy_Nm2": 1130.5, "EIz_Nm2": 1130.5, "mass_per_length_kg_m": 1.9968}
    soft = {"EA_N": 1.3248e7, "GJ_Nm2": 45.843, "EIy_Nm2": 70.656, "EIz_Nm2": 70.656, "mass_per_length_kg_m": 0.4992}
    scene = SceneBuilder("four-bar with a tilted pin")
    for name, length, data in (("one", 0.12, stiff), ("two", 0.24, stiff), ("three", 0.12, soft)):
        rotary = data["mass_per_length_kg_m"] * data["EIy_Nm2"] / data["EA_N"]
        section = s.BeamStation(x_m=0.0, rotary_y_kg_m=rotary, rotary_z_kg_m=rotary, **data)
        scene.beam(
            name, length=length, elements=4, section=section, level="full" if flexible else "rigid",
            modes=s.Modes(count=0, static=True, families=("torsion", "bending_y", "bending_z")),
        )  # fmt: skip
    quarter = 0.5 * np.pi
    scene.revolute("a", "ground", "one", **({"prescribed": drive} if drive else {"angle": quarter}))
    scene.revolute("b", "one", "two", parent_node="tip", angle=-quarter)
    scene.revolute("d", "ground", "three", parent_position=(0.24, 0.0, 0.0), angle=quarter)
    back = (np.cos(0.5 * quarter), 0.0, 0.0, -np.sin(0.5 * quarter))
    scene.closure(
        "c", "revolute", "two", "three", node_a="tip", node_b="tip", quaternion_b=back,
        axis=(0.0, np.sin(tilt), np.cos(tilt)),
    )  # fmt: skip
    scene.marker("pin", "two", node="tip")
    return scene.scene()


def windows(count: int, speed: float, gravity: float = -9.81) -> s.Scene:
    """`count` four-bars in a row that share their uprights: A02 of the IFToMM library of benchmark problems.

    Uniform bars of 1 m and 1 kg, upright at the start, the upper ones moving at `speed` (m/s) along x. All uprights
    stay parallel: T = 1/2 ((count + 1)/3 + count) turn'^2. Twice a turn all bars lie on one line.
    """
    scene = SceneBuilder("windows", gravity=(0.0, gravity, 0.0))
    inertia, nodes = (1e-6, 1.0 / 12.0, 1.0 / 12.0), {"tip": (1.0, 0.0, 0.0)}
    for i in range(count + 1):
        scene.rigid_body(f"upright {i}", mass=1.0, com=(0.5, 0, 0), inertia=inertia, nodes=nodes)
        scene.revolute(
            f"foot {i}", "ground", f"upright {i}", parent_position=(i, 0, 0), angle=0.5 * np.pi, rate=-speed
        )  # fmt: skip
    for i in range(count):
        scene.rigid_body(f"sill {i}", mass=1.0, com=(0.5, 0, 0), inertia=inertia, nodes=nodes)
        scene.revolute(
            f"corner {i}", f"upright {i}", f"sill {i}", parent_node="tip", angle=-0.5 * np.pi, rate=speed
        )  # fmt: skip
        scene.closure(f"window {i}", "revolute", f"sill {i}", f"upright {i + 1}", node_a="tip", node_b="tip")
    return scene.scene()


def windows_turn(count: int, speed: float, times: np.ndarray, gravity: float = -9.81) -> np.ndarray:
    """Angle of the uprights of `windows` while they stay parallel."""
    inertia, weight = (count + 1) / 3.0 + count, gravity * (0.5 * (count + 1) + count)
    found = solve_ivp(
        lambda t, y: [y[1], weight / inertia * np.cos(y[0])], (0.0, times[-1] or 1e-9), [0.5 * np.pi, -speed],
        "DOP853", times, rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    return found.y[0]
