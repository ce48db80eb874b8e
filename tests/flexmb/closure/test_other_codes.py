"""Rigid loops against Exudyn, which closes them exactly too, and against MuJoCo, whose closures are springs by design.

Exudyn: every body by itself with its six freedoms, all hinges and the closure as constraints of one kind, solved for
accelerations and multipliers. MuJoCo: the same tree as in flexmb, its closure an equality constraint ("connect") that
minimises a regularised cost: what it leaves open is predicted from its regularisation.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexmb
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.tree import GROUND, node_frame, ordered
from flexmb.system.observables import MarkerMotion
from tests.bounds import UNIT_ROUNDOFF, algebra, gamma, observed_order, relative
from tests.flexmb.closure import mechanisms as m

GRAVITY = np.array([0.0, -9.81, 0.0])


def rssr() -> s.Scene:
    """A spatial four-bar: crank and rocker on skew axes, the coupler between two ball joints; one is the closure."""
    lengths, skew = m.GRASHOF, np.array([np.sin(0.5), 0.0, np.cos(0.5)])
    crank, rocker = Rotation.from_rotvec([0.0, 0.0, 1.0]), Rotation.from_rotvec(1.8 * skew)
    coupler = Rotation.from_rotvec([0.2, -0.4, -0.5])
    end = lengths.crank * crank.as_matrix()[:, 0] + lengths.coupler * (crank * coupler).as_matrix()[:, 0]
    scene = SceneBuilder("RSSR", gravity=GRAVITY)
    for name, length in zip(("crank", "coupler", "rocker"), lengths[:3], strict=True):
        m.bar(scene, name, length)
    scene.revolute("drive", "ground", "crank", angle=1.0, rate=2.0)
    scene.spherical(
        "pin", "crank", "coupler", parent_node="tip", quaternion=coupler.as_quat(scalar_first=True),
        angular_velocity=(3.0, -1.0, 0.5),
    )  # fmt: skip
    pivot = end - lengths.rocker * rocker.as_matrix()[:, 0]
    scene.revolute("pivot", "ground", "rocker", axis=skew, parent_position=pivot, angle=1.8)
    scene.closure("loop", "spherical", "coupler", "rocker", node_a="tip", node_b="tip")
    return scene.scene()


def with_markers(scene: s.Scene) -> s.Scene:
    """A marker at the origin of every body, named after it."""
    markers = tuple(s.Marker(name=body.name, body=body.name, node="origin") for body in scene.bodies)
    return s.Scene(**{name: getattr(scene, name) for name in scene.__struct_fields__} | {"markers": markers})


# ---- Exudyn


@dataclass
class Loop:
    """Bodies placed where flexmb's markers are and joined by constraints, in the terms of the Exudyn engine."""

    shop: object
    carriers: dict = field(default_factory=dict)
    links: dict = field(default_factory=dict)
    prescribed: tuple = ()


def in_exudyn(scene: s.Scene, markers: dict[str, MarkerMotion], *, closed: bool = True) -> Loop:
    """The scene of rigid bodies, revolute and ball joints at the state of its markers; `closed` with its closures."""
    from crosscheck.engines.exudyn.carriers import Workshop
    from crosscheck.engines.exudyn.motion import FrameMotion
    from flexmb.surrogate.lumping import Inertia

    loop = Loop(Workshop(np.array(scene.gravity_m_s2), explicit=False))
    for body in scene.bodies:
        at = markers[body.name]
        motion = FrameMotion(at.position, at.rotation, at.velocity[:3], at.velocity[3:])
        inertia = Inertia(body.mass_kg, np.array(body.com_m), np.array(body.inertia_kg_m2))
        loop.carriers[body.name] = loop.shop.rigid(motion, np.eye(3), inertia)
    nodes = {body.name: body for body in scene.bodies}

    def point(body: str, node: str, offset: tuple) -> np.ndarray:
        return np.array(offset) + (0.0 if body == GROUND else np.array(node_frame(nodes[body], node).position))

    for _, hinge in ordered(scene):
        sides = [
            (hinge.parent, point(hinge.parent, hinge.parent_node, hinge.parent_position_m)),
            (hinge.child, point(hinge.child, hinge.child_node, hinge.child_position_m)),
        ]
        _join(loop, hinge.name, isinstance(hinge, s.Spherical), sides, getattr(hinge, "axis", None))
    for closure in scene.closures if closed else ():
        sides = [
            (closure.body_a, point(closure.body_a, closure.node_a, closure.position_a_m)),
            (closure.body_b, point(closure.body_b, closure.node_b, closure.position_b_m)),
        ]
        _join(loop, closure.name, closure.type == "spherical", sides, closure.axis)
    loop.shop.mbs.Assemble()
    return loop


def _join(loop: Loop, name: str, ball: bool, sides: list[tuple[str, np.ndarray]], axis: tuple | None) -> None:
    """A joint whose markers' z is the axis, which has the same components on both sides."""
    from crosscheck.engines.exudyn.joints import ExudynLink

    shop = loop.shop
    turn = np.eye(3) if ball else Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].as_matrix()
    markers = [
        shop.marker(shop.ground if body == GROUND else loop.carriers[body], at, turn) for body, at in sides
    ]
    kind = shop.items.SphericalJoint if ball else shop.items.RevoluteJointZ
    joint = shop.mbs.AddObject(kind(markerNumbers=markers))
    loop.links[name] = ExudynLink(name, (), ((joint, True),), markers[1])


def solved(loop: Loop) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Accelerations (6,) of the bodies' origins and loads (6,) of all joints, as flexmb gives them."""
    from crosscheck.engines.exudyn.kkt import initial_state
    from crosscheck.engines.exudyn.state import carrier_path
    from crosscheck.engines.exudyn.wrench import link_wrenches

    states = initial_state(loop)
    paths = {name: carrier_path(loop, carrier, states) for name, carrier in loop.carriers.items()}
    rates = {name: np.concatenate([path.alpha[0], path.acceleration[0]]) for name, path in paths.items()}
    return rates, {name: load[0] for name, load in link_wrenches(loop, states, {}).items()}


def bound(scene: s.Scene, markers: dict[str, MarkerMotion]) -> float:
    """Relative difference that Exudyn's side may have.

    Its equations (7 coordinates and at most 6 rows for each of the bodies, and the closure's) are solved with a
    backward error of n roundings, which light axes of heavy bars amplify by the condition of their inertias. The rate
    of the constraints' Jacobian is a difference over 1e-3 of a coordinate: exact for its quartic joints, up to u / 1e-3
    of the rates.
    """
    n = 13 * len(scene.bodies) + 6
    moments = [np.linalg.eigvalsh(body.inertia_kg_m2) for body in scene.bodies]
    condition = max(body.mass_kg / least[0] for body, least in zip(scene.bodies, moments, strict=True))
    fastest = max(np.max(np.abs(at.velocity)) for at in markers.values())
    differences = UNIT_ROUNDOFF / 1e-3 * fastest**2 / largest(at.acceleration for at in markers.values())
    return gamma(n) * condition + differences


def largest(arrays: Iterable[np.ndarray]) -> float:
    return max(float(np.nanmax(np.abs(array))) for array in arrays)


LOOPS = {
    "four-bar, revolute": m.four_bar, "four-bar, spherical": lambda: m.four_bar(closure="spherical"), "RSSR": rssr,
}  # fmt: skip


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_accelerations_and_loads_equal_those_of_exudyn(loop):
    pytest.importorskip("exudyn")
    scene = with_markers(LOOPS[loop]())
    system = flexmb.compile(scene)
    start = system.initial_state
    ours = system.evaluate(0.0, start.q, start.u)
    rates, loads = solved(in_exudyn(scene, ours.markers))
    within = bound(scene, ours.markers)
    assert within < 1e-9
    size = largest(at.acceleration for at in ours.markers.values())
    for name, found in rates.items():
        assert np.max(np.abs(ours.markers[name].acceleration - found)) <= within * size
    size, determined = largest(ours.loads.values()), system.determined_loads(start)
    assert {"loop"} < set(loads) == set(ours.loads)
    for name, found in loads.items():
        assert np.max(np.abs(ours.loads[name] - found)[determined[name]]) <= within * size
    # three forces in a plane, all six components in space
    assert np.sum(determined["drive"]) == (6 if loop == "RSSR" else 3)


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_exudyn_without_the_closure_has_the_accelerations_of_the_tree():
    """The control: the closure is what both agree on, and leaving it out is seen."""
    pytest.importorskip("exudyn")
    scene = with_markers(rssr())
    system = flexmb.compile(scene)
    start = system.initial_state
    tree, closed = (each.evaluate(0.0, start.q, start.u).markers for each in (flexmb.System(scene), system))
    rates, _ = solved(in_exudyn(scene, closed, closed=False))
    size = largest(at.acceleration for at in tree.values())
    for name, found in rates.items():
        assert np.max(np.abs(tree[name].acceleration - found)) <= bound(scene, tree) * size
        assert np.max(np.abs(closed[name].acceleration - found)) > 0.1 * size


# ---- MuJoCo

STEP, SPAN = 1e-4, 0.5
DEFAULT = (0.02, 0.9)
LEAST_OPEN = 0.9999  # what MuJoCo takes for an impedance above it


def in_mujoco(start: flexmb.State, time_constant: float = 0.02, impedance: float | None = 0.9):
    """(model, data) of the four-bar at a state; no closure where `impedance` is None.

    The loop closes between two sites: with a body and an anchor, MuJoCo puts the anchor's other end where it is at zero
    coordinates, where this loop is open.
    """
    mujoco = pytest.importorskip("mujoco")
    off = mujoco.mjtDisableBit
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = GRAVITY
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.timestep, spec.option.tolerance = STEP, 0.0
    spec.option.disableflags = int(off.mjDSBL_CONTACT) | int(off.mjDSBL_AUTORESET)

    def bar(parent, name: str, length: float, x: float):
        body = parent.add_body(name=name, pos=(x, 0.0, 0.0))
        body.explicitinertial, body.mass = True, 0.78 * length
        across = body.mass * length**2 / 12.0
        body.ipos, body.inertia = (0.5 * length, 0.0, 0.0), (1e-5, across, across)
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0.0, 0.0, 1.0))
        body.add_site(name=name, pos=(length, 0.0, 0.0))
        return body

    crank, coupler, rocker, ground = m.GRASHOF
    bar(bar(spec.worldbody, "crank", crank, 0.0), "coupler", coupler, crank)
    bar(spec.worldbody, "rocker", rocker, ground)
    if impedance is not None:
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE, name1="coupler", name2="rocker",
            solref=(time_constant, 1.0), solimp=(impedance, impedance, 1e-3, 0.5, 2.0),
        )  # fmt: skip
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start.q, start.u  # drive, pin, pivot in both
    mujoco.mj_forward(model, data)
    return model, data


@pytest.fixture(scope="module")
def four_bar() -> flexmb.System:
    return flexmb.compile(m.four_bar(closure="spherical"))


def test_accelerations_of_mujoco_differ_by_its_regularisation(four_bar):
    """With A = J inv(M) J', its force is inv(A + R) A f where the exact one is f; R goes as 1 - impedance."""
    start = four_bar.initial_state
    ours = four_bar.evaluate(0.0, start.q, start.u)
    M = four_bar.mass_matrix(start)
    # rounding of either side, amplified by the equations
    rounding = 2.0 * algebra(3, 2) * np.linalg.cond(M)
    _, tree = in_mujoco(start, impedance=None)
    assert relative(tree.qacc, flexmb.System(four_bar.scene).accelerations(start)) < rounding
    errors, openness = [], [0.1, 1e-2, 1e-3, 1e-4]
    for least in openness:
        _, data = in_mujoco(start, impedance=1.0 - least)
        J = data.efc_J.reshape(3, 3)[:2]  # x and y: z is the plane's
        R = np.diag(data.efc_R[:2])
        A = J @ np.linalg.solve(M, J.T)
        f = -ours.loads["loop"][3:5]  # on the coupler
        expected = ours.accelerations + np.linalg.solve(M, J.T @ (np.linalg.solve(A + R, A @ f) - f))
        assert relative(data.qacc, expected) < rounding * np.linalg.cond(A)
        errors.append(relative(data.qacc, ours.accelerations))
        # the time constant acts on what is open: rounding here, which it divides by its square
        _, stiff = in_mujoco(start, time_constant=0.01, impedance=1.0 - least)
        assert relative(stiff.qacc, data.qacc) < rounding * np.linalg.cond(A)
    assert errors[0] > 1e-3
    assert errors[-1] > 1e3 * rounding
    assert observed_order(openness, errors, 0.0) == pytest.approx(1.0, abs=0.05)


def opened(start: flexmb.State, time_constant: float, impedance: float) -> tuple[float, float]:
    """Largest distance (m) of the two sites within SPAN, of 100 samples, and the regularisation R (1/kg)."""
    mujoco = pytest.importorskip("mujoco")
    model, data = in_mujoco(start, time_constant, impedance)
    R, gap = float(data.efc_R[0]), 0.0
    sites = [model.site(name).id for name in ("coupler", "rocker")]
    steps = round(SPAN / STEP / 100)
    for _ in range(100):
        mujoco.mj_step(model, data, steps)
        mujoco.mj_kinematics(model, data)
        gap = max(gap, float(np.linalg.norm(np.subtract(*data.site_xpos[sites]))))
    assert not any(warning.number for warning in data.warning)
    return gap, R


def test_mujoco_opens_the_loop_and_flexmb_does_not(four_bar):
    """Its gap under a steady force f is R f times the squared time constant times the impedance."""
    start = four_bar.initial_state
    run = flexmb.simulate(four_bar, SPAN, samples=51, rtol=1e-10, atol=1e-12)
    assert run.finished
    states = [four_bar.state(q, u, t) for q, u, t in zip(run.q, run.u, run.t, strict=True)]
    ours = max(four_bar.closure_gaps(state)["loop"][0] for state in states)
    force = max(np.linalg.norm(four_bar.hinge_loads(state)["loop"][3:5]) for state in states)
    assert ours < 1e-11
    settings = [DEFAULT, (0.02, 0.99), (0.02, LEAST_OPEN), (0.002, LEAST_OPEN)]
    gaps = []
    for time_constant, impedance in settings:
        gap, R = opened(start, time_constant, impedance)
        steady = R * force * time_constant**2 * impedance
        # the force changes within 0.02 s: less than the steady gap at its peak, but its size
        assert 0.2 * steady < gap < 2.0 * steady
        gaps.append(gap)
    assert gaps[0] > 1e-5
    assert gaps[0] > 1e6 * ours
    assert np.all(np.diff(gaps) < 0.0)
    assert gaps[-1] > 100.0 * ours


def test_mujoco_cannot_be_stiffened_to_a_closed_loop(four_bar):
    """An impedance above 0.9999 is 0.9999, a time constant below two steps is two steps, and those two leave a gap."""
    start = four_bar.initial_state
    stiffest, _ = opened(start, 2.0 * STEP, LEAST_OPEN)
    assert opened(start, 0.1 * STEP, 0.9999999)[0] == stiffest
    assert 1e-10 < stiffest < 1e-6
