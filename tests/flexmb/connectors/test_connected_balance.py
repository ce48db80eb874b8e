"""Energy and momentum with connectors: what they store and lose is all that the motion gains and loses."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.entry.tangent import tangent_workspace
from tests.bounds import observed_order
from tests.flexmb import spectral
from tests.flexmb.connectors.connected_scenes import everything, free_flying, started
from tests.flexmb.entry.dual_jacobian import jacobian

pytestmark = pytest.mark.filterwarnings("ignore:.*leaves out that this pulls it straight")  # fast turns are meant

END = 0.3  # s: some periods of the springs; modes and stop are faster
EXACT = {"method": "dop853", "rtol": 1e-12, "atol": 1e-13, "samples": 21}
BALANCED = 1e-10  # of the energies that change: the error of the integration at these tolerances
# Where the slope of a law jumps (a slack cable, a buffer, a stop, the knots of a table) a step is of second order in
# what is left of it; the error control finds that out, and leaves a hundred times its tolerance.
ACROSS_KINKS = 1e-8
KINKED = ("cable", "slack", "buffer", "curve", "brake")


@pytest.fixture(scope="module")
def flight():
    return fm.simulate(free_flying(), END, **EXACT)


@pytest.fixture(scope="module")
def lossy():
    return fm.simulate(free_flying(lossy=True), END, **EXACT)


def test_springs_conserve_energy(flight):
    assert flight.finished and np.max(np.abs(flight.work)) == 0.0
    assert np.ptp(flight.energy["spring"]) > 1.0
    assert np.max(np.abs(flight.energy_drift)) <= ACROSS_KINKS * flight.energy_scale


def test_smooth_ones_to_the_integrators_error():
    scene = free_flying()
    smooth = tuple(connector for connector in scene.connectors if connector.name not in KINKED)
    run = fm.simulate(msgspec.structs.replace(scene, connectors=smooth), END, **EXACT)
    assert np.ptp(run.energy["spring"]) > 1.0
    assert np.max(np.abs(run.energy_drift)) <= BALANCED * run.energy_scale


@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_losses_and_actuators_are_the_work(lossy):
    assert lossy.finished and np.max(np.abs(lossy.work)) > 0.1
    assert np.max(np.abs(lossy.energy_drift)) <= ACROSS_KINKS * lossy.energy_scale


@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_on_the_ground_too():
    run = fm.simulate(everything(), END, **EXACT)
    assert np.max(np.abs(run.energy_drift)) <= ACROSS_KINKS * run.energy_scale


def test_action_is_reaction(flight, lossy):
    """Of what flies freely both momenta stay, whatever acts between its parts."""
    for run in (flight, lossy):
        size = np.max(np.abs(run.momentum[0]))
        assert np.max(np.abs(run.momentum_drift)) <= 1e-11 * size


def test_a_lost_reaction_would_be_noticed(flight):
    """Negative control: one connector of the same law, but from the ground."""
    scene = free_flying()
    changed = tuple(
        msgspec.structs.replace(connector, body_a="ground") if connector.name == "spring" else connector
        for connector in scene.connectors
    )
    run = fm.simulate(msgspec.structs.replace(scene, connectors=changed), END, **EXACT)
    assert np.max(np.abs(run.momentum_drift)) > 1e-3 * np.max(np.abs(flight.momentum[0]))


@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_derivatives_are_exact():
    """d(dy/dt)/dy along directions, against collocation of dy/dt itself, which knows nothing of duals."""
    system, state = started(everything())
    y = np.concatenate([state.q, state.u, [0.0]])
    n, c = len(y), system.constants
    J, w = np.zeros((n, n)), system.workspace()
    assert jacobian(0.0, y, J, c, tangent_workspace(c, system.nq, system.nu)) == 0

    def slope(at: np.ndarray) -> np.ndarray:
        dy = np.empty(n)
        assert system.rhs(0.0, at, dy, c, w) == 0
        return dy

    rng, span = np.random.default_rng(5), 0.02
    for _ in range(3):
        direction = rng.normal(size=n) * (1.0 + np.abs(y)) * 0.1
        direction[3:7] = 0.0  # a quaternion's length means nothing
        rows = np.array([slope(y + x * direction) for x in spectral.times(span)])
        found, _ = spectral.at_zero(rows, span)
        assert np.max(np.abs(J @ direction - found)) <= 1e-10 * np.max(np.abs(rows))


@pytest.mark.parametrize("method", ["radau5", "exponential"])
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_implicit_methods_agree(method):
    """Their tangents hold connectors, friction and stops among them."""
    scene = free_flying(lossy=True)
    run = fm.simulate(scene, 0.05, method=method, samples=3, rtol=1e-9, atol=1e-11)
    exact = fm.simulate(scene, 0.05, method="dop853", samples=3, rtol=1e-12, atol=1e-13)
    assert run.finished and np.max(np.abs(run.q[-1] - exact.q[-1])) <= 1e-9


def test_fixed_implicit_steps_converge():
    """Of second order: a quarter of the error at half the step."""
    exact, errors = fm.simulate(free_flying(), 0.05, **(EXACT | {"samples": 2})), []
    for step in (1e-4, 5e-5, 2.5e-5):
        run = fm.simulate(free_flying(), 0.05, method="generalised_alpha", samples=2, step=step)
        errors.append(float(np.max(np.abs(run.q[-1] - exact.q[-1]))))
    assert abs(observed_order([4.0, 2.0, 1.0], errors, 1e-12) - 2.0) < 0.1


def test_linear_models_have_their_stiffness_and_damping():
    """Two bodies on a line: w^2 = k/m1 + k/m2, and the damper's share of -Re(lambda)."""
    k, d, m1, m2 = 40.0, 0.3, 2.0, 3.0
    builder = fm.SceneBuilder("two on a rail")
    for name, mass, at in (("a", m1, 0.0), ("b", m2, 1.0)):
        builder.rigid_body(name, mass=mass, inertia=(1, 1, 1))
        builder.prismatic(f"rail {name}", "ground", name, axis=(1, 0, 0), position=at)
    builder.spring_damper("spring", "a", "b", free_length=1.0, stiffness=k, damping=d)
    system = fm.compile(builder.scene())
    values = np.linalg.eigvals(fm.linearize(system, system.initial_state).A)
    mu = m1 * m2 / (m1 + m2)
    expected = -0.5 * d / mu + 1j * np.sqrt(k / mu - (0.5 * d / mu) ** 2)
    assert np.min(np.abs(values - expected)) <= 1e-12 * abs(expected)
