"""One contract for every engine found: signs, orders, frames and closed-form answers.

An engine whose library is missing is skipped with its reason, as is a scene an engine says it cannot represent.
"""

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.special import ellipj, ellipk

from crosscheck.engines.contract import Engine, EngineMissing, Run, Snapshot
from crosscheck.engines.registry import engines
from flexmb.scene.build import SceneBuilder, linear
from flexmb.scene.functions import Constant, Ramp, Sine
from tests.crosscheck.engines.newton_euler import body_residual, hinge_forces, with_markers
from tests.crosscheck.engines.random_scenes import KINDS, random_scene

ENGINES = engines()
G = 9.81
DOWN = (0.0, 0.0, -G)
MASS, ARM, INERTIA = 2.0, 0.6, (0.2, 0.3, 0.35)
SECOND = INERTIA[1] + MASS * ARM**2  # about a transverse hinge axis y
THIRD = INERTIA[2] + MASS * ARM**2  # about z

# Pointwise results are one linear solve away from the data. Minimal coordinates leave some 1e-14; redundant ones with
# Euler parameters (Exudyn) some 1e-11. A wrong sign or frame is wrong in the first digit.
POINTWISE = 1e-9


@pytest.fixture(params=list(ENGINES))
def engine(request) -> Engine:
    found = ENGINES[request.param]
    try:
        found.version()
    except EngineMissing as missing:
        pytest.skip(str(missing))
    return found


def compiled(engine: Engine, scene):
    support = engine.supports(scene)
    if support.kind != "exact":
        pytest.skip(f"{engine.name}: {support.reason}")
    return engine.compile(scene)


def evaluate(engine: Engine, scene) -> Snapshot:
    return compiled(engine, scene).evaluate()


def near(value, scale: float = 1.0):
    return pytest.approx(np.array(value, dtype=float), rel=POINTWISE, abs=POINTWISE * scale)


def arm(gravity=DOWN, com=(ARM, 0.0, 0.0)) -> SceneBuilder:
    """A body with its mass centre off the origin, a marker at the origin and one at the mass centre."""
    return (
        SceneBuilder("arm", gravity=gravity)
        .rigid_body("arm", mass=MASS, com=com, inertia=INERTIA)
        .marker("origin", "arm")
        .marker("com", "arm", offset=com)
    )


def test_engine_follows_the_protocol(engine):
    assert isinstance(engine, Engine)
    assert engine.version()
    efforts = engine.efforts(arm().revolute("pivot", "ground", "arm").scene())
    assert len(efforts) >= 3
    values = [effort.value for effort in efforts]
    assert values == sorted(values, reverse=True), "coarse to fine"
    assert min(values) > 0.0


def test_gravity_accelerates_along_its_vector(engine):
    snapshot = evaluate(engine, arm().free("free", "ground", "arm").scene())
    assert snapshot.markers["origin"].acceleration == near([0, 0, 0, 0, 0, -G])
    assert snapshot.loads["free"] == near(np.zeros(6))
    assert snapshot.energy["gravity"] == near(0.0)


def test_gravity_turns_a_level_arm_down(engine):
    snapshot = evaluate(engine, arm().revolute("pivot", "ground", "arm", axis=(0, 1, 0)).scene())
    alpha = MASS * G * ARM / SECOND  # about +y: +x turns towards -z
    assert snapshot.markers["origin"].acceleration == near([0, alpha, 0, 0, 0, 0])
    assert snapshot.markers["com"].acceleration[3:] == near([0, 0, -ARM * alpha])


def test_motor_torque_is_on_the_outboard_body(engine):
    scene = arm((0, 0, 0)).revolute("pivot", "ground", "arm", torque=Constant(value=1.5)).scene()
    snapshot = evaluate(engine, scene)
    assert snapshot.markers["com"].acceleration == near([0, 0, 1.5 / THIRD, 0, ARM * 1.5 / THIRD, 0])
    assert snapshot.loads["pivot"][:3] == near([0, 0, 1.5])


def test_motor_force_is_on_the_outboard_body(engine):
    scene = arm((0, 0, 0)).prismatic("slide", "ground", "arm", axis=(0, 1, 0), force=Constant(value=3.0)).scene()
    snapshot = evaluate(engine, scene)
    assert snapshot.markers["com"].acceleration == near([0, 0, 0, 0, 3.0 / MASS, 0])
    assert snapshot.loads["slide"] == near([0, 0, ARM * 3.0, 0, 3.0, 0])


def test_quaternions_are_scalar_first_and_map_outboard_to_inboard(engine):
    quaternion = np.array([0.8, 0.0, 0.0, 0.6])  # about z by 2 atan(3/4)
    scene = arm().free("free", "ground", "arm", quaternion=quaternion, position=(1, 2, 3)).scene()
    com = evaluate(engine, scene).markers["com"]
    assert com.position == near([1 + ARM * 0.28, 2 + ARM * 0.96, 3])
    assert com.quaternion * np.sign(com.quaternion[0]) == near(quaternion)


def test_free_velocities_are_in_outboard_axes(engine):
    quarter = np.sqrt(0.5)
    scene = (
        arm((0, 0, 0))
        .free(
            "free", "ground", "arm", quaternion=(quarter, 0, 0, quarter), angular_velocity=(1, 0, 0), velocity=(2, 0, 3)
        )
        .scene()
    )
    snapshot = evaluate(engine, scene)
    assert snapshot.markers["origin"].velocity == near([0, 1, 0, 0, 2, 3])


def test_spherical_speeds_are_in_outboard_axes(engine):
    quarter = np.sqrt(0.5)
    scene = (
        arm((0, 0, 0))
        .spherical("ball", "ground", "arm", quaternion=(quarter, 0, 0, quarter), angular_velocity=(0, 0, 2))
        .scene()
    )
    snapshot = evaluate(engine, scene)
    assert snapshot.markers["com"].velocity == near([0, 0, 2, -2 * ARM, 0, 0])
    turned = replace(scene.hinges[0], angular_velocity_rad_s=(1.0, 0.0, 0.0))
    snapshot = evaluate(engine, replace(scene, hinges=(turned,)))
    assert snapshot.markers["origin"].velocity[:3] == near([0, 1, 0])


def test_hanging_mass_is_held_up_by_its_hinge(engine):
    scene = arm(com=(0, 0, -ARM)).revolute("pivot", "ground", "arm", axis=(0, 1, 0)).scene()
    assert evaluate(engine, scene).loads["pivot"] == near([0, 0, 0, 0, 0, MASS * G], MASS * G)


def test_weld_carries_moment_about_the_outboard_hinge_point(engine):
    scene = arm().weld("weld", "ground", "arm", child_position=(-0.4, 0, 0)).scene()
    load = evaluate(engine, scene).loads["weld"]
    assert load == near([0, -(ARM + 0.4) * MASS * G, 0, 0, 0, MASS * G], MASS * G)


def test_free_asymmetric_body_with_offset_mass_centre(engine):
    w = np.array([0.4, -0.7, 1.1])
    v = np.array([0.3, 0.2, -0.5])
    com = np.array([0.2, -0.1, 0.3])
    scene = arm((0, 0, 0), com).free("free", "ground", "arm", angular_velocity=w, velocity=v).scene()
    model = compiled(engine, scene)
    snapshot = model.evaluate()
    J = np.diag(INERTIA)
    alpha = -np.linalg.solve(J, np.cross(w, J @ w))
    a = -np.cross(alpha, com) - np.cross(w, np.cross(w, com))
    assert snapshot.markers["origin"].acceleration == near([*alpha, *a])
    p = MASS * (v + np.cross(w, com))
    momentum = np.array([*(J @ w + np.cross(com, p)), *p])
    assert snapshot.energy["kinetic"] == near(0.5 * (w @ J @ w + p @ p / MASS))
    if snapshot.momentum is not None:
        assert snapshot.momentum == near(momentum)
        efforts = engine.efforts(scene)
        paths = [model.simulate(Run(np.linspace(0.0, 2.0, 5)), effort).momentum for effort in efforts[-2:]]
        refinement = np.abs(paths[0] - paths[1]).max()
        # The finest error is below the change by the last refinement; with two efforts at round-off, only that is left.
        assert np.abs(paths[-1] - momentum).max() <= refinement + 1e-10


def test_pendulum_swings_as_the_elliptic_functions_say(engine):
    """theta = 2 asin(k sn(K - omega t | k^2)) from rest at theta0; k = sin(theta0/2), omega^2 = m g l / I."""
    theta0 = 1.2
    # The hinge axis is -y: from the arm hanging along -z, a positive angle turns it towards +x.
    scene = arm(com=(0, 0, -ARM)).revolute("pivot", "ground", "arm", axis=(0, -1, 0), angle=theta0).scene()
    times = np.linspace(0.0, 3.0, 13)
    k = np.sin(theta0 / 2)
    sn = ellipj(ellipk(k**2) - np.sqrt(MASS * G * ARM / SECOND) * times, k**2)[0]
    theta = 2 * np.arcsin(k * sn)
    exact = ARM * np.column_stack([np.sin(theta), np.zeros_like(theta), -np.cos(theta)])
    model = compiled(engine, scene)
    runs = [model.simulate(Run(times), effort) for effort in engine.efforts(scene)[-2:]]
    assert all(run.status == "finished" for run in runs), runs[-1].message
    paths = [run.markers["com"].position for run in runs]
    refinement = np.abs(paths[0] - paths[1]).max()
    assert np.abs(paths[-1] - exact).max() <= refinement + 1e-10
    assert refinement < 1e-3 * ARM


def test_energy_of_a_pendulum_is_kept(engine):
    scene = arm(com=(0, 0, -ARM)).revolute("pivot", "ground", "arm", axis=(0, 1, 0), angle=1.0, stiffness=2.0).scene()
    model = compiled(engine, scene)
    run = Run(np.linspace(0.0, 2.0, 9))
    totals = [sum(model.simulate(run, effort).energy.values()) for effort in engine.efforts(scene)[-2:]]
    exact = 0.5 * 2.0 * 1.0**2 - MASS * G * ARM * np.cos(1.0)
    assert totals[-1][0] == near(exact)
    assert np.abs(totals[-1] - exact).max() <= np.abs(totals[0] - totals[1]).max() + 1e-9


def test_wheel_motor_reacts_on_its_body(engine):
    scene = (
        SceneBuilder("wheel")
        .rigid_body("hub", mass=5.0, inertia=(1.0, 1.2, 1.5))
        .free("free", "ground", "hub")
        .wheel("wheel", "hub", axis=(0, 0, 1), mass=0.5, axial_inertia=0.04, transverse_inertia=0.025,
               torque=Constant(value=0.6), speed=10.0, friction=0.01)
        .marker("hub", "hub")
        .scene()
    )  # fmt: skip
    snapshot = evaluate(engine, scene)
    torque = 0.6 - 0.01 * 10.0
    assert snapshot.markers["hub"].acceleration == near([0, 0, -torque / 1.5, 0, 0, 0])
    assert snapshot.wheel_loads["wheel"] == near([0, 0, torque, 0, 0, 0])


def test_spinning_wheel_needs_a_gyroscopic_bearing_torque(engine):
    """Precession at w about x of a wheel with spin s about z: torque on the wheel w x (J s z) = -w J s y."""
    scene = (
        SceneBuilder("precession", gravity=DOWN)
        .rigid_body("yoke", mass=5.0, inertia=(1.0, 1.2, 1.5))
        .revolute("drive", "ground", "yoke", axis=(1, 0, 0), prescribed=Ramp(rate=0.5))
        .wheel("wheel", "yoke", axis=(0, 0, 1), mass=0.5, axial_inertia=0.04, transverse_inertia=0.025, speed=100.0)
        .scene()
    )
    snapshot = evaluate(engine, scene)
    assert snapshot.wheel_loads["wheel"] == near([0, -0.5 * 0.04 * 100.0, 0, 0, 0, 0.5 * G])
    assert snapshot.loads["drive"][:3] == near([0, -0.5 * 0.04 * 100.0, 0])


def test_prescribed_hinge_reports_its_drive_load(engine):
    A, w, phase = 0.4, 2.0, 0.7
    motion = Sine(amplitude=A, angular_frequency_rad_s=w, phase_rad=phase)
    scene = arm().revolute("drive", "ground", "arm", axis=(0, 1, 0), prescribed=motion, stiffness=3.0).scene()
    snapshot = evaluate(engine, scene)
    theta, rate, alpha = A * np.sin(phase), A * w * np.cos(phase), -A * w * w * np.sin(phase)
    assert snapshot.markers["origin"].velocity[:3] == near([0, rate, 0])
    assert snapshot.markers["origin"].acceleration[:3] == near([0, alpha, 0])
    total = SECOND * alpha - MASS * G * ARM * np.cos(theta)
    assert snapshot.loads["drive"][1] == near(total)
    assert snapshot.drives["drive"] == near([total + 3.0 * theta])


def test_prescribed_wheel_reports_its_drive_torque(engine):
    motion = Sine(amplitude=0.4, angular_frequency_rad_s=2.0, phase_rad=0.7)
    scene = (
        SceneBuilder("wheel")
        .rigid_body("hub", mass=5.0, inertia=(1.0, 1.2, 1.5))
        .weld("weld", "ground", "hub")
        .wheel("wheel", "hub", axis=(0, 0, 1), mass=0.5, axial_inertia=0.04, transverse_inertia=0.025,
               prescribed=motion, friction=0.1)
        .scene()
    )  # fmt: skip
    snapshot = evaluate(engine, scene)
    rate, alpha = 0.8 * np.cos(0.7), -1.6 * np.sin(0.7)
    assert snapshot.drives["wheel"] == near([0.04 * alpha + 0.1 * rate])
    assert snapshot.loads["weld"][2] == near(0.04 * alpha)


@pytest.mark.parametrize("frame", ["world", "node"])
def test_force_at_a_node_acts_on_the_body_in_its_frame(engine, frame):
    quarter = np.sqrt(0.5)
    scene = (
        SceneBuilder("pushed")
        .rigid_body("body", mass=MASS, inertia=INERTIA, nodes={"side": (0, 0.5, 0)})
        .free("free", "ground", "body", quaternion=(quarter, 0, 0, quarter))
        .force("push", "body", node="side", direction=(1, 0, 0), function=Constant(value=4.0), frame=frame)
        .marker("body", "body")
        .scene()
    )
    acceleration = evaluate(engine, scene).markers["body"].acceleration
    if frame == "node":  # the turned body feels its own x, which is World y, at World (-0.5, 0, 0)
        assert acceleration == near([0, 0, -2.0 / INERTIA[2], 0, 4.0 / MASS, 0])
    else:
        assert acceleration == near([0, 0, 0, 4.0 / MASS, 0, 0])


def test_torque_at_a_node_acts_on_the_body(engine):
    scene = (
        SceneBuilder("turned")
        .rigid_body("body", mass=MASS, inertia=INERTIA, nodes={"side": (0, 0.5, 0)})
        .free("free", "ground", "body")
        .torque("turn", "body", node="side", direction=(0, 1, 0), function=Constant(value=0.9))
        .marker("body", "body")
        .scene()
    )
    assert evaluate(engine, scene).markers["body"].acceleration == near([0, 0.9 / INERTIA[1], 0, 0, 0, 0])


def test_moving_point_mass_pulls_on_its_carrier(engine):
    """Carrier M and mass m on a spring along x, both free to move along x: M a = k s, m (a + s'') = -k s."""
    spring = linear(position=0.1, stiffness=20.0)
    scene = (
        SceneBuilder("slosh")
        .rigid_body("tank", mass=MASS, inertia=INERTIA)
        .prismatic("rail", "ground", "tank", axis=(1, 0, 0))
        .point_mass("slug", "tank", mass=0.5, directions=[(1, 0, 0)], coordinates=[spring])
        .marker("tank", "tank")
        .scene()
    )
    snapshot = evaluate(engine, scene)
    assert snapshot.markers["tank"].acceleration[3:] == near([20.0 * 0.1 / MASS, 0, 0])
    assert snapshot.energy["spring"] == near(0.5 * 20.0 * 0.1**2)


@pytest.mark.parametrize("kind", KINDS)
def test_every_hinge_kind_obeys_newton_and_euler(engine, kind):
    """A chain ground - kind - revolute - kind at a random state: every body's equations and every hinge's forces."""
    rng = np.random.default_rng(KINDS.index(kind))
    kinds = ("free" if kind == "weld" else kind, "revolute", kind)
    scene = with_markers(random_scene(rng, kinds, extras=False, nodes=False))
    snapshot = evaluate(engine, scene)
    scale = max(np.abs(load).max() for load in snapshot.loads.values())
    for body in scene.bodies:
        assert body_residual(scene, snapshot, body.name) == near(np.zeros(6), scale), body.name
    for hinge in scene.hinges:
        across, given = hinge_forces(scene, snapshot, hinge)
        assert across == near(given, scale), hinge.name


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_is_the_rate_of_position(engine, kind):
    """Positions of short runs forth and the initial velocity: x(h) = x + h v + h^2/2 a + O(h^3)."""
    rng = np.random.default_rng(50 + KINDS.index(kind))
    scene = random_scene(rng, (kind, "revolute"), extras=False)
    model = compiled(engine, scene)
    start = model.evaluate()
    h = 1e-3
    run = model.simulate(Run(np.array([0.0, h])), engine.efforts(scene)[-1])
    assert run.status == "finished"
    for name, marker in start.markers.items():
        predicted = marker.position + h * marker.velocity[3:] + 0.5 * h * h * marker.acceleration[3:]
        # The jerk of these scenes is of the order of 1e2 m/s^3: h^3/6 of it, with a factor of ten in hand.
        assert np.abs(run.markers[name].position[1] - predicted).max() < 2e-7
        assert np.abs(run.markers[name].velocity[1] - marker.velocity - h * marker.acceleration).max() < 1e-3


def test_work_balances_energy_where_an_engine_integrates_it(engine):
    scene = random_scene(np.random.default_rng(3), ("free", "revolute", "spherical"), driven=True)
    model = compiled(engine, scene)
    run = Run(np.linspace(0.0, 1.0, 6))
    balances = []
    for effort in engine.efforts(scene)[-2:]:
        path = model.simulate(run, effort)
        if path.work is None:
            pytest.skip(f"{engine.name} does not integrate work")
        balances.append(sum(path.energy.values()) - path.work)
    refinement = np.abs(balances[0] - balances[1]).max()
    assert np.ptp(balances[-1]) <= 2.0 * refinement + 1e-9 * np.abs(balances[-1]).max()
