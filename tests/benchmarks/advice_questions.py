"""Ten questions of the study of the advice whose truths come from outside flexmb: plane chains of links, closed forms.

A truth is a function of the times: the values (T,3) of the one channel that the question asks for, and how uncertain
they are, in its unit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

import flexmb as fm
from flexmb.typing import Real
from tests.benchmarks.planar_rods import Corner, Pull, Rods, Signal, extrapolated

GRAVITY = 9.81
MASS, EI, EA = 0.2, 0.5, 2e4
"""Of a soft strip (kg/m, N m², N); its stretch matters where EA is given anew."""
LENGTH = 1.0
UP = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
LINKS = 24

Truth = Callable[[Real], tuple[Real, float]]


@dataclass(frozen=True)
class Question:
    """Ask for `quantity` of the scene to `tolerance` up to `t_end` (s)."""

    scene: fm.Scene
    quantity: str
    t_end: float
    truth: Truth
    tolerance: float = 1e-2

    @property
    def name(self) -> str:
        return self.scene.name


def questions() -> tuple[Question, ...]:
    """All of them; no truth is run yet."""
    return (
        stretching_pendulum(), t_frame(), falling_rod(), pushed_inside(), quarter_bow(),
        twisted_bar(), four_bar(), geared_arm(), hinge_load(), wheel_pulse(),
    )  # fmt: skip


def section(**other: object) -> fm.BeamStation:
    """The soft strip, stiff about its other axis."""
    numbers = {
        "EA_N": EA, "EIy_Nm2": 10.0 * EI, "EIz_Nm2": EI, "GJ_Nm2": EI, "mass_per_length_kg_m": MASS
    }  # fmt: skip
    return fm.BeamStation(x_m=0.0, **(numbers | other))  # type: ignore[arg-type]


def polynomials(**counts: int) -> fm.Modes:
    return fm.Modes(count=0, polynomials=fm.StrainPolynomials(**counts))


def strip(made: fm.SceneBuilder, name: str = "strip", **other: object) -> fm.SceneBuilder:
    """With a beam of level exact in the plane, of four polynomials unless said otherwise."""
    given = {
        "length": LENGTH, "elements": 8, "section": section(), "modes": polynomials(bending_y=4), "level": "exact",
        "points": "line",
    }  # fmt: skip
    return made.beam(name, **(given | other))  # type: ignore[arg-type]


def rising(size: float, seconds: float) -> fm.SmoothStep:
    return fm.SmoothStep(start_value=0.0, end_value=size, start_s=0.0, duration_s=seconds)


def risen(size: float, seconds: float) -> Signal:
    """`rising`, written anew."""

    def value(t: Real) -> Real:
        x = np.clip(t / seconds, 0.0, 1.0)
        return size * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)

    return value


def stays(x: float, y: float) -> Pull:
    return lambda t: (np.full_like(t, x), np.full_like(t, y))


def tracked(made: Callable[[int], tuple[Rods, int]]) -> Truth:
    """The path of one mass of a net, without its error of second order."""

    def truth(times: Real) -> tuple[Real, float]:
        def path(count: int) -> Real:
            net, node = made(count)
            return net.run(times)[0][:, node]

        found, off = extrapolated(path, LINKS)
        return np.column_stack([found, np.zeros(len(times))]), float(off.max())

    return truth


def stretching_pendulum() -> Question:
    """Released horizontally, EA 60 N: it hangs 3 % longer, and swings by more. Four and three polynomials are given."""
    soft = section(EA_N=60.0, mass_per_length_kg_m=0.4)
    made = strip(
        fm.SceneBuilder("stretching pendulum", allow=("wave_speed",), gravity=(0.0, -GRAVITY, 0.0)),
        section=soft, modes=polynomials(axial=3, bending_y=4),
    )  # fmt: skip
    scene = made.revolute("pivot", "ground", "strip").marker("tip", "strip", node="tip").scene()

    def net(count: int) -> tuple[Rods, int]:
        rods = Rods((0.0, -GRAVITY))
        root = rods.mass(0.0, 0.0, held=stays(0.0, 0.0))
        return rods, rods.rod(root, 0.0, LENGTH, count, EA=60.0, EI=EI, m=0.4)[-1]

    return Question(scene, "marker:tip.position", 1.2, tracked(net))


def t_frame() -> Question:
    """A clamped strip with a branch at its middle, which is pulled along it: the curvature jumps inside the strip."""
    pull = rising(-4.0, 0.3)
    made = strip(fm.SceneBuilder("T frame"), nodes={"mid": 0.5})
    strip(made, "branch", length=0.5).weld("mount", "ground", "strip")
    made.weld("joint", "strip", "branch", parent_node="mid", parent_quaternion=UP).marker("end", "branch", node="tip")
    scene = made.force("pull", "branch", node="tip", direction=(1.0, 0.0, 0.0), function=pull).scene()

    def net(count: int) -> tuple[Rods, int]:
        rods, clamp = Rods(), Corner(given=np.zeros_like)
        rods.corners.append(clamp)
        chain = rods.rod(rods.mass(0.0, 0.0, held=stays(0.0, 0.0)), 0.0, 1.0, count, EA=EA, EI=EI, m=MASS, clamp=clamp)
        joint = rods.corners[count // 2]  # the first is the clamp
        branch = rods.rod(chain[count // 2], np.pi / 2, 0.5, count // 2, EA=EA, EI=EI, m=MASS, clamp=joint)
        rods.forces.append((branch[-1], lambda t: (risen(-4.0, 0.3)(t), 0.0 * t)))
        return rods, branch[-1]

    return Question(scene, "marker:end.position", 0.6, tracked(net))


def falling_rod() -> Question:
    """A rod that can only stretch, let go from its length without load; its tip is on d'Alembert's waves."""
    made = strip(
        fm.SceneBuilder("rod let go", allow=("wave_speed",), gravity=(GRAVITY, 0.0, 0.0)),
        section=section(EA_N=60.0, mass_per_length_kg_m=0.4), modes=polynomials(axial=3),
    )  # fmt: skip
    scene = made.weld("mount", "ground", "strip").marker("tip", "strip", node="tip").scene()
    speed = np.sqrt(60.0 / 0.4)

    def truth(times: Real) -> tuple[Real, float]:
        s = (LENGTH - speed * times + 2.0 * LENGTH) % (4.0 * LENGTH) - 2.0 * LENGTH  # odd about 0, even about LENGTH
        hung = GRAVITY / speed**2 * np.sign(s) * (LENGTH * np.abs(s) - s**2 / 2.0)
        moved = GRAVITY / speed**2 * LENGTH**2 / 2.0 - hung
        return np.column_stack([LENGTH + moved, np.zeros((len(times), 2))]), 0.0

    return Question(scene, "marker:tip.position", 0.6, truth)


def pushed_inside() -> Question:
    """A clamped strip pushed at a node inside, until its tip hangs over."""
    push = rising(12.0, 0.3)
    made = strip(fm.SceneBuilder("pushed inside"), nodes={"port": 0.5}).weld("mount", "ground", "strip")
    made.force("push", "strip", node="port", direction=(0.0, 1.0, 0.0), function=push)
    scene = made.marker("tip", "strip", node="tip").scene()

    def net(count: int) -> tuple[Rods, int]:
        rods, clamp = Rods(), Corner(given=np.zeros_like)
        rods.corners.append(clamp)
        chain = rods.rod(rods.mass(0.0, 0.0, held=stays(0.0, 0.0)), 0.0, 1.0, count, EA=EA, EI=EI, m=MASS, clamp=clamp)
        rods.forces.append((chain[count // 2], lambda t: (0.0 * t, risen(12.0, 0.3)(t))))
        return rods, chain[-1]

    return Question(scene, "marker:tip.position", 0.5, tracked(net))


def quarter_bow() -> Question:
    """A quarter of a circle at rest, clamped, pulled at its tip."""
    pull, bend = rising(2.0, 0.3), np.pi / 2.0
    bow = section(curvature_1_m=(0.0, 0.0, bend))
    made = strip(fm.SceneBuilder("quarter bow"), section=bow).weld("mount", "ground", "strip")
    made.force("pull", "strip", node="tip", direction=(1.0, 0.0, 0.0), function=pull)
    scene = made.marker("tip", "strip", node="tip").scene()

    def net(count: int) -> tuple[Rods, int]:
        rods, clamp = Rods(), Corner(given=np.zeros_like)
        rods.corners.append(clamp)
        root = rods.mass(0.0, 0.0, held=stays(0.0, 0.0))
        chain = rods.rod(root, 0.0, 1.0, count, EA=EA, EI=EI, m=MASS, curvature=bend, clamp=clamp)
        rods.forces.append((chain[-1], lambda t: (risen(2.0, 0.3)(t), 0.0 * t)))
        return rods, chain[-1]

    return Question(scene, "marker:tip.position", 0.6, tracked(net))


def twisted_bar() -> Question:
    """A clamped bar with two polynomials of twist under a torque; the rotation of its tip by waves along it."""
    GJ, J = 2.0, 5e-3
    torque = rising(0.4, 0.1)
    bar = section(GJ_Nm2=GJ, rotary_y_kg_m=J / 2.0, rotary_z_kg_m=J / 2.0)
    made = strip(fm.SceneBuilder("twisted bar"), section=bar, modes=polynomials(torsion=2), points="section")
    made.weld("mount", "ground", "strip").marker("tip", "strip", node="tip")
    scene = made.torque("twist", "strip", node="tip", direction=(1.0, 0.0, 0.0), function=torque).scene()
    speed = np.sqrt(GJ / J)

    def impulse(t: float) -> float:
        """The integral of the torque from 0 to t."""
        x = min(max(t, 0.0) / 0.1, 1.0)
        return 0.4 * (0.1 * x**5 * (7.0 - 14.0 * x + 10.0 * x**2 - 2.5 * x**3) + max(t - 0.1, 0.0))

    def truth(times: Real) -> tuple[Real, float]:
        echoes = range(int(times[-1] * speed / (2.0 * LENGTH)) + 1)
        parts = [(1.0 if k == 0 else 2.0 * (-1) ** k, 2.0 * k * LENGTH / speed) for k in echoes]
        angle = speed / GJ * np.array([sum(size * impulse(t - late) for size, late in parts) for t in times])
        return np.column_stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle]), 0.0

    return Question(scene, "marker:tip.orientation", 0.5, truth)


def four_bar() -> Question:
    """A driven crank, a soft coupler and a rocker. The given angles do not close the loop: hinges must, and no bend.

    Its EA is so large that the stretch, which the coupler's polynomials hold, is nothing in the truth either: near the
    fold of coupler and rocker, EA moves the middle by 1.5e-3 of its way.
    """
    crank, rocker, inertia, base = 0.3, 0.6, 0.05, (1.0, -0.6)
    stiff = 20.0 * EA
    turned = rising(1.2, 0.5)
    made = fm.SceneBuilder("four-bar that does not close")
    made.rigid_body("crank", mass=1.0, inertia=(0.1, 0.1, 0.1), nodes={"tip": (crank, 0.0, 0.0)})
    strip(made, "coupler", length=0.7, section=section(EA_N=stiff))
    made.rigid_body("rocker", mass=1e-3, inertia=(inertia, inertia, inertia), nodes={"tip": (rocker, 0.0, 0.0)})
    made.revolute("drive", "ground", "crank", prescribed=turned)
    made.revolute("knee", "crank", "coupler", parent_node="tip", angle=0.2)
    made.revolute("stand", "ground", "rocker", parent_position=(*base, 0.0), angle=1.3)
    made.closure("pin", "revolute", "coupler", "rocker", node_a="tip", node_b="tip")
    scene = made.marker("middle", "coupler", node="tip").scene()

    def net(count: int) -> tuple[Rods, int]:
        rods = Rods()
        angle = risen(1.2, 0.5)
        root = rods.mass(crank, 0.0, held=lambda t: (crank * np.cos(angle(t)), crank * np.sin(angle(t))))
        foot = rods.mass(*base, held=stays(*base))
        # the tip of a straight coupler and the rocker meet here: crank at rest along x
        tip = rods.mass(1.0, 0.0, inertia / rocker**2)
        rods.link(foot, tip, rocker, 10.0 * stiff)
        rods.rod(root, 0.0, 0.7, count, EA=stiff, EI=EI, m=MASS, end=tip)
        return rods, tip

    return Question(scene, "marker:middle.position", 0.8, tracked(net))


def geared_arm() -> Question:
    """An arm geared to a shaft that a torque turns; the given angles contradict the gear, and the arm is straight."""
    torque, ratio, shaft = rising(1.0, 0.2), -2.0, 0.02
    made = fm.SceneBuilder("geared arm").rigid_body("shaft", mass=1.0, inertia=(shaft, shaft, shaft))
    strip(made).revolute("turn", "ground", "shaft", given=True).revolute("shoulder", "ground", "strip", angle=0.5)
    made.coupling("gear", "shoulder", {"turn": ratio}).marker("tip", "strip", node="tip")
    scene = made.torque("motor", "shaft", direction=(0.0, 0.0, 1.0), function=torque).scene()

    def net(count: int) -> tuple[Rods, int]:
        # the arm's angle is ratio times the shaft's: inertia J / ratio², torque T / ratio
        hub = Corner(inertia=shaft / ratio**2, torque=lambda t: risen(1.0, 0.2)(t) / ratio)
        rods = Rods(corners=[hub])
        root = rods.mass(0.0, 0.0, held=stays(0.0, 0.0))
        return rods, rods.rod(root, 0.0, LENGTH, count, EA=EA, EI=EI, m=MASS, clamp=hub)[-1]

    return Question(scene, "marker:tip.position", 0.6, tracked(net))


def hinge_load() -> Question:
    """The force in the pivot of an arm that is let go under gravity: an ordinary question, of a load that jumps."""
    stiff = section(EIz_Nm2=12.0, EIy_Nm2=12.0, mass_per_length_kg_m=0.27)
    made = strip(
        fm.SceneBuilder("arm let go", gravity=(0.0, -GRAVITY, 0.0)), section=stiff, level="full",
        modes=fm.Modes(count=3, families=("bending_y",)),
    )  # fmt: skip
    scene = made.revolute("pivot", "ground", "strip").marker("tip", "strip", node="tip").scene()

    def force(times: Real) -> Callable[[int], Real]:
        def of(count: int) -> Real:
            rods = Rods((0.0, -GRAVITY))
            root = rods.mass(0.0, 0.0, held=stays(0.0, 0.0))
            rods.rod(root, 0.0, LENGTH, count, EA=EA, EI=12.0, m=0.27)
            loads = rods.run(times)[2][:, root]
            return -loads - np.array([0.0, -GRAVITY]) * rods.masses[root]

        return of

    def truth(times: Real) -> tuple[Real, float]:
        found, off = extrapolated(force(times), LINKS)
        return np.column_stack([found, np.zeros(len(times))]), float(off.max())

    return Question(scene, "load:pivot.force", 1.0, truth)


def wheel_pulse() -> Question:
    """The torque in the mount of a panel after the pulse of a wheel on its hub: the pulse begins and ends at once."""
    size, begins, lasts, hub = 0.5, 0.1, 0.1, 0.2
    pulse = fm.Pulse(value=size, start_s=begins, duration_s=lasts)
    made = fm.SceneBuilder("wheel's pulse").rigid_body("hub", mass=2.0, inertia=(hub, hub, hub))
    made.revolute("bearing", "ground", "hub")
    z = (0.0, 0.0, 1.0)
    made.wheel("wheel", "hub", axis=z, mass=0.1, axial_inertia=1e-2, transverse_inertia=1e-2, torque=pulse)
    panel = section(EIz_Nm2=12.0, EIy_Nm2=12.0, mass_per_length_kg_m=0.27)
    modes = fm.Modes(count=3, families=("bending_y",))
    strip(made, section=panel, level="full", modes=modes).weld("mount", "hub", "strip")
    scene = made.marker("tip", "strip", node="tip").scene()

    def torque(times: Real) -> Callable[[int], Real]:
        def of(count: int) -> Real:
            squares, part = hub_with_panel(hub, LENGTH, count, 12.0, 0.27)
            waves = np.sqrt(np.maximum(squares, 0.0))
            late = [times[:, None] - at for at in (begins, begins + lasts)]
            on, off = ((t >= 0.0) * np.cos(t * waves) for t in late)
            turning = -size * (on - off) @ part**2
            return -hub * turning - np.where((times >= begins) & (times < begins + lasts), size, 0.0)

        return of

    def truth(times: Real) -> tuple[Real, float]:
        found = torque(times)(400)
        apart = float(np.abs(found - torque(times)(200)).max())
        return np.column_stack([np.zeros((len(times), 2)), found]), apart

    return Question(scene, "load:mount.torque", 1.0, truth)


def hub_with_panel(inertia: float, length: float, count: int, EI: float, m: float) -> tuple[Real, Real]:
    """Squares of the frequencies and the hub's part in the modes of a hub that turns with a clamped beam of `count`
    cubic elements: what turns the hub by little is linear, and its modes answer a pulse in closed form."""
    h = length / count
    bend = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
    bend = np.vstack([bend, [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) * EI / h**3
    move = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]])
    move = np.vstack([move, [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]) * m * h / 420.0
    K, M = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for i in range(0, 2 * count, 2):
        K[i : i + 4, i : i + 4] += bend
        M[i : i + 4, i : i + 4] += move
    M[1, 1] += inertia
    squares, modes = eigh(K[1:, 1:], M[1:, 1:])
    return squares, modes[0]
