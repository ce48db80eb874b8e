"""Derivatives of accelerations and eigenfrequencies: what an engine must answer that offers them.

Adapters often get the values right and the derivatives wrong: a matrix transposed, gravity or the springs held
constant, Coriolis terms of the other sign, displacements in the axes of another frame, eigenvalues in Hz. The right
numbers are differences of Kane's equations, and closed forms.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.conformance.clause import Chapter, NotOffered, allowance, ladder, offered, require, within
from crosscheck.conformance.tree_answers import KnownDerivatives, derivatives
from crosscheck.conformance.tree_scenes import AXES, bending, branched, chain, driven, loaded, placed, sprung
from crosscheck.engines.contract import Engine, LinearPart, Run, Trajectory
from crosscheck.engines.linear.coordinates import coordinate_names
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.typing import Real

LINEARISED = Chapter(physical=True)
TIMES = np.array([0.0, 0.01])
SHARE = 1e-7  # of the norm of a matrix: differences of Kane's equations are right to 1e-10
BALL: dict[str, Any] = {"quaternion": (0.5, -0.5, 0.5, 0.5), "angular_velocity": (1.2, -0.7, 0.5)}


@LINEARISED.clause(
    "Derivatives by displacements are those of gravity, of loads in World axes, of springs, and of all that moves."
)
def derivatives_by_displacements(engine: Engine) -> None:
    scene = loaded(sprung()).scene()
    _matrix(engine, scene, "by_displacement", derivatives(scene))


@LINEARISED.clause("Derivatives by speeds are those of Coriolis and centrifugal terms and of dampers, with signs.")
def derivatives_by_speeds(engine: Engine) -> None:
    scene = sprung().scene()
    _matrix(engine, scene, "by_speed", derivatives(scene))


@LINEARISED.clause("Derivatives by forces are the inverse of the mass matrix of the free coordinates.")
def derivatives_by_forces(engine: Engine) -> None:
    scene = branched().scene()
    _matrix(engine, scene, "by_force", derivatives(scene))


@LINEARISED.clause("Rows and columns are those of the hinges in the order of the scene, then of wheels.")
def derivatives_in_the_order_of_the_scene(engine: Engine) -> None:
    wheel: dict[str, Any] = {"axis": (0.6, 0.0, 0.8), "mass": 0.8, "axial_inertia": 0.05, "transverse_inertia": 0.03}
    scene = branched().wheel("wheel", "middle", node="port", speed=60.0, offset=(0.1, -0.2, 0.3), **wheel).scene()
    _all(engine, scene)


@LINEARISED.clause("Displacements of a ball joint are rotations about the axes of its child, as its speeds are.")
def derivatives_by_rotations_of_a_ball(engine: Engine) -> None:
    _all(engine, chain(last=False).spherical("to end", "middle", "end", **BALL, **placed("end", "middle")).scene())


@LINEARISED.clause("In free flight displacements and speeds are in the axes of the child, rotations before shifts.")
def derivatives_in_free_flight(engine: Engine) -> None:
    free = BALL | {"position": (0.3, -0.2, 0.5), "velocity": (0.6, 0.4, -0.9)}
    _all(engine, chain(last=False).free("to end", "middle", "end", **free, **placed("end", "middle")).scene())


@LINEARISED.clause("A prescribed coordinate has neither a row nor a column, and its motion is part of the others'.")
def derivatives_beside_a_prescribed_hinge(engine: Engine) -> None:
    _all(engine, driven(sprung()))


@LINEARISED.clause("Modal coordinates of a flexible body follow the others, with their stiffness and damping.")
def derivatives_of_a_flexible_body(engine: Engine) -> None:
    _all(engine, bending().scene())


@LINEARISED.clause("Frequencies are in rad/s and rise; one that occurs twice is listed twice.")
def frequencies_of_chains_of_springs(engine: Engine) -> None:
    """Two equal chains of three masses and springs: w = 2 sqrt(k/m) sin((2 j - 1) pi / 14), each twice."""
    stiffness, mass = 40.0, 0.7
    tree = SceneBuilder("two chains of springs", gravity=(0.0, 0.0, 0.0))
    for side in ("left", "right"):
        parent = "ground"
        for n in range(3):
            name = f"{side} {n}"
            tree.rigid_body(name, mass=mass, inertia=(0.01, 0.02, 0.03))
            tree.prismatic(f"to {name}", parent, name, axis=AXES[1], stiffness=stiffness)
            parent = name
    tree.marker("last", "right 2")
    chain_of_three = 2.0 * np.sqrt(stiffness / mass) * np.sin((2.0 * np.arange(1, 4) - 1.0) * np.pi / 14.0)
    _frequencies(engine, tree.scene(), np.repeat(chain_of_three, 2))


@LINEARISED.clause("Gravity is a spring of a hanging body; dampers lower a frequency.")
def frequency_of_a_damped_pendulum(engine: Engine) -> None:
    """I q'' + c q' + (m g l cos q0 + k) q = 0."""
    mass, arm, inertia, spring, damper = 2.0, 0.4, 0.5, 3.0, 0.9
    tree = SceneBuilder("damped pendulum", gravity=(0.0, -9.81, 0.0))
    tree.rigid_body("bar", mass=mass, com=(0.0, -arm, 0.0), inertia=(0.3, 0.2, inertia - mass * arm**2))
    tree.revolute("pivot", "ground", "bar", axis=(0.0, 0.0, 1.0), stiffness=spring, damping=damper)
    tree.marker("bar", "bar")
    square = (mass * 9.81 * arm + spring) / inertia - (0.5 * damper / inertia) ** 2
    _frequencies(engine, tree.scene(), np.sqrt([square]))


@LINEARISED.clause("What does not oscillate has the frequency 0: rigid-body motion, and motion damped beyond that.")
def frequencies_of_what_does_not_oscillate(engine: Engine) -> None:
    """A slide without a spring, one with so strong a damper that both its eigenvalues are real, and one that swings."""
    tree = SceneBuilder("three slides", gravity=(0.0, 0.0, 0.0))
    for name, stiffness, damping in (("free", 0.0, 0.0), ("slow", 3.0, 9.0), ("quick", 8.0, 0.0)):
        tree.rigid_body(name, mass=2.0, inertia=(0.01, 0.02, 0.03))
        tree.prismatic(f"to {name}", "ground", name, axis=AXES[0], stiffness=stiffness, damping=damping)
    tree.marker("quick", "quick")
    _frequencies(engine, tree.scene(), np.array([0.0, 0.0, 2.0]))


def _asked(engine: Engine, scene: Scene, part: LinearPart) -> Trajectory:
    """The finest run of a scene over next to no time, with what was asked at its samples."""
    model = offered(engine, scene)
    run = model.simulate(Run(TIMES, (part,)), ladder(engine, scene, float(TIMES[-1]))[-1])
    require(run.status == "finished", f"the run ended as {run.status}: {run.message}")
    return run


def _all(engine: Engine, scene: Scene) -> None:
    """All derivatives that the engine offers, at least one."""
    right, run = derivatives(scene), _asked(engine, scene, "derivatives")
    there = [name for name in right._fields if name in run.derivatives]
    if not there:
        raise _lacking("derivatives")
    for name in there:
        _compare(run, scene, name, getattr(right, name))


def _matrix(engine: Engine, scene: Scene, name: str, right: KnownDerivatives) -> None:
    run = _asked(engine, scene, "derivatives")
    if name not in run.derivatives:
        raise _lacking(f"derivatives {name}")
    _compare(run, scene, name, getattr(right, name))


def _compare(run: Trajectory, scene: Scene, name: str, right: Real) -> None:
    """The derivative of the initial state with the right one (n,n), entry by entry."""
    names = coordinate_names(scene)
    answer, known = run.derivatives[name][0].reshape(right.shape), float(run.known_to[name][0])
    apart = np.abs(answer - right)
    row, column = np.unravel_index(int(np.argmax(apart)), apart.shape)
    what = f"the derivative {name} of the acceleration of {names[row]}, by {names[column]}, {answer[row, column]:.6g}"
    size = float(np.linalg.norm(right))
    require(known <= 1e-2 * size, f"derivatives {name} are known to {known:.2g} by the engine, of {size:.3g}")
    within(what, float(apart[row, column]), known + allowance(SHARE) * size)


def _frequencies(engine: Engine, scene: Scene, right: Real) -> None:
    """The frequencies of the initial state with the right ones, each within what the engine knows."""
    run = _asked(engine, scene, "frequencies")
    if run.frequencies is None:
        raise _lacking("frequencies")
    answer, known, size = run.frequencies[0], float(run.known_to["frequencies"][0]), float(right[-1])
    require(answer.shape == right.shape, f"there are {len(answer)} frequencies, and {len(right)} coordinates")
    require(known <= 1e-2 * size, f"frequencies are known to {known:.2g} rad/s by the engine, of {size:.3g}")
    worst = int(np.argmax(np.abs(answer - right)))
    what = f"frequency {worst + 1} of {len(right)}, {answer[worst]:.6g} rad/s,"
    within(what, float(np.abs(answer - right)[worst]), known + allowance(SHARE) * size)


def _lacking(what: str) -> NotOffered:
    return NotOffered(f"it does not offer {what}", f"give {what} where a run asks for them")
