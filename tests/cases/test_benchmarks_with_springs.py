"""Andrews' mechanism against the equations that the IVP test set prints, to 12 digits; the flyball governor's sums."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.integrate import solve_ivp

import flexmb as fm
from crosscheck.engines.registry import engine
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Cylindrical, Revolute
from flexmb.typing import Real
from tests.cases.shipped import closed_form

CASES = Path(__file__).parents[2] / "cases"
ANDREWS = load_scene(CASES / "closed_chains" / "andrews" / "scene.toml")
GOVERNOR = load_scene(CASES / "connectors" / "flyball_governor" / "scene.toml")
END, ANGLES = 0.03, ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")

# The test set's names. Masses and inertias of K1 to K7, then lengths, in m.
M = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
J = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
XA, YA, XB, YB, XC, YC = -0.06934, -0.00227, -0.03635, 0.03273, 0.014, 0.072
D, DA, E, EA, RR, RA = 0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092
SS, SA, SB, SC, SD = 0.035, 0.01874, 0.01043, 0.018, 0.02
TA, TB, U, UA, UB, ZF, ZT, FA = 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421
TORQUE, STIFFNESS, FREE = 0.033, 4530.0, 0.07785
START = np.array(
    [-0.0617138900142764496, 0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550]
    + [-0.222668390165885885, 1.23054744454982119]
)
FIRST_ACCELERATIONS = (14222.4439199541138705911625887, -10666.8329399655854029433719415)
FIRST_MULTIPLIERS = np.array([98.5668703962410896057654982170, -6.12268834425566265503114393122, 0, 0, 0, 0])


def closing(q: Real) -> Real:
    """The Jacobian of the three loops' six equations: where K2 ends, less where K3, K4 and K6 end."""
    beta, theta, gamma, phi, delta, omega, epsilon = q
    G, sin, cos = np.zeros((6, 7), q.dtype), np.sin, np.cos
    rod = -D * np.array([-sin(beta + theta), cos(beta + theta)])
    for loop in (0, 2, 4):
        G[loop : loop + 2, 0] = RR * np.array([-sin(beta), cos(beta)]) + rod
        G[loop : loop + 2, 1] = rod
    G[0:2, 2] = -SS * cos(gamma), -SS * sin(gamma)
    G[2:4, 3] = -E * cos(phi + delta), -E * sin(phi + delta)
    G[2:4, 4] = G[2:4, 3] + np.array([ZT * sin(delta), -ZT * cos(delta)])
    G[4:6, 5] = ZF * sin(omega + epsilon), -ZF * cos(omega + epsilon)
    G[4:6, 6] = G[4:6, 5] + np.array([-U * cos(epsilon), -U * sin(epsilon)])
    return G


def mass(q: Real) -> Real:
    _, theta, _, phi, _, omega, _ = q
    A = np.diag([M[0] * RA**2 + J[0], 0, M[2] * (SA**2 + SB**2) + J[2], 0, M[4] * (TA**2 + TB**2) + J[4], 0, 0])
    A[6, 6] = M[6] * (UA**2 + UB**2) + J[6]
    for (i, j), m, inertia, near, far, lean in (
        ((0, 1), M[1], J[1], RR, DA, -np.cos(theta)),
        ((4, 3), M[3], J[3], ZT, E - EA, np.sin(phi)),
        ((6, 5), M[5], J[5], U, ZF - FA, -np.sin(omega)),
    ):
        A[i, i] += m * (near**2 + 2.0 * near * far * lean + far**2) + inertia
        A[j, j] += m * far**2 + inertia
        A[i, j] = A[j, i] = m * (far**2 + near * far * lean) + inertia
    return A


def forces(q: Real, v: Real) -> Real:
    beta_, theta_, _, phi_, delta_, omega_, epsilon_ = v
    _, theta, gamma, phi, _, omega, _ = q
    x = SD * np.cos(gamma) + SC * np.sin(gamma) + XB - XC
    y = SD * np.sin(gamma) - SC * np.cos(gamma) + YB - YC
    pull = -STIFFNESS * (1.0 - FREE / np.hypot(x, y))
    crank, lower, upper = M[1] * DA * RR * np.sin(theta), M[3] * ZT * (E - EA) * np.cos(phi), M[5] * U * (ZF - FA)
    upper *= np.cos(omega)
    f = np.zeros(7)
    f[0], f[1] = TORQUE - crank * theta_ * (theta_ + 2.0 * beta_), crank * beta_**2
    f[2] = pull * (y * (x + XC - XB) - x * (y + YC - YB))
    f[3], f[4] = lower * delta_**2, -lower * phi_ * (phi_ + 2.0 * delta_)
    f[5], f[6] = -upper * epsilon_**2, upper * omega_ * (omega_ + 2.0 * epsilon_)
    return f


def accelerations(q: Real, v: Real) -> Real:
    """Of the seven angles, then the six multipliers."""
    G = closing(q)
    bent = (closing(q + 1e-30j * v) @ v).imag / 1e-30
    return np.linalg.solve(np.block([[mass(q), G.T], [G, np.zeros((6, 6))]]), np.concatenate([forces(q, v), -bent]))


@pytest.fixture(scope="module")
def printed() -> tuple[Real, Real]:
    """Angles and rates (2, 7) at the end, and multipliers (6,), by the printed equations."""
    run = solve_ivp(
        lambda t, y: np.concatenate([y[7:], accelerations(y[:7], y[7:])[:7]]),
        (0.0, END), np.concatenate([START, np.zeros(7)]), "DOP853", rtol=3e-14, atol=1e-16,
    )  # fmt: skip
    assert run.success
    q, v = run.y[:, -1].reshape(2, 7)
    return np.stack([q, v]), accelerations(q, v)[7:]


@pytest.fixture(scope="module")
def ours() -> fm.Trajectory:
    return fm.simulate(ANDREWS, END, samples=[0.0, END], rtol=1e-13, atol=1e-15)


def multipliers(run: fm.Trajectory, at: int) -> Real:
    """Loads of the closures in the plane, on K3, K4 and K6."""
    return np.concatenate([run.loads[closure.name][at, 3:5] for closure in ANDREWS.closures])


def test_andrews_begins_with_the_printed_accelerations_and_multipliers(ours: fm.Trajectory) -> None:
    first = engine("native").compile(ANDREWS).evaluate().markers
    alpha, theta = FIRST_ACCELERATIONS
    assert abs(first["K1"].acceleration[2] - alpha) < 1e-12 * alpha
    assert abs(first["K2"].acceleration[2] - alpha - theta) < 1e-12 * alpha
    assert np.max(np.abs(multipliers(ours, 0) - FIRST_MULTIPLIERS)) < 1e-12 * FIRST_MULTIPLIERS[0]


def test_andrews_to_twelve_digits_of_the_printed_equations(ours: fm.Trajectory, printed: tuple[Real, Real]) -> None:
    (angles, rates), pushes = printed
    found = {name: ours.q[-1, i] for i, (name, _) in enumerate(ours.q_names)}
    for name, angle in zip(ANGLES, angles, strict=True):
        assert abs(found[f"{name}.rotation"] - angle) < 1e-12 * angles[0], name
    assert abs(ours.markers["K1"].velocity[-1, 2] - rates[0]) < 1e-12 * rates[0]
    assert np.max(np.abs(multipliers(ours, -1) - pushes)) < 1e-11 * np.max(np.abs(pushes))


def test_andrews_to_thirteen_digits_of_the_closed_form(ours: fm.Trajectory) -> None:
    angle = closed_form("closed_chains/andrews").turned(np.array([END]))[0] + START[0]
    assert abs(ours.q[-1, 0] - angle) < 1e-13 * angle
    assert abs(angle - 15.81077119629904) < 1.2e-9  # what the test set prints, see the case's provenance


def test_andrews_with_nothing_but_revolutes_moves_alike(ours: fm.Trajectory) -> None:
    """Three of the nine equations of the closures are then said twice."""
    fields = set(Revolute.__struct_fields__)
    hinges = tuple(
        Revolute(**{f: getattr(h, f) for f in h.__struct_fields__ if f in fields}) if isinstance(h, Cylindrical) else h
        for h in ANDREWS.hinges
    )
    plain = replace(ANDREWS, hinges=hinges)
    system = fm.compile(plain)
    known = system.determined_loads(system.initial_state)
    assert (system.closures.rank, system.closures.mobility) == (6, 1)
    assert not all(np.all(components) for components in known.values())
    run = fm.simulate(plain, END, samples=[0.0, END], rtol=1e-13, atol=1e-15)
    assert abs(run.q[-1, 0] - ours.q[-1, 0]) < 1e-13 * ours.q[-1, 0]


def test_a_stiffer_spring_is_noticed(ours: fm.Trajectory) -> None:
    stiffer = ANDREWS.with_values({"spring.stiffness_N_m": STIFFNESS * (1.0 + 1e-9)})
    off = fm.simulate(stiffer, END, samples=[0.0, END], rtol=1e-13, atol=1e-15)
    assert abs(off.q[-1, 0] - ours.q[-1, 0]) > 1e-11 * ours.q[-1, 0]


def test_the_equations_of_the_governor_lose_what_the_dampers_take() -> None:
    """The derivative of the energy along the equations of motion, by a complex step, at arbitrary states."""
    m = closed_form("connectors/flyball_governor")
    for y in np.random.default_rng(5).normal([0.6, 0.5, 0.0, 0.0, 0.0], [0.2, 0.1, 1.0, 1.0, 1.0], (5, 5)):
        along = m.rates(0.0, y)
        gain = sum(m.energies(*(y[:4] + 1e-30j * along[:4]))[:3]).imag / 1e-30
        _, _, by_lean, by_height = m.coupler(*y[:4])
        loss = 2.0 * m.DAMPING * (by_lean * y[2] + by_height * y[3]) ** 2
        assert abs(gain + loss) < 1e-11 * loss


def test_the_governor_keeps_its_symmetry_its_momentum_and_its_energy_less_work() -> None:
    run = fm.simulate(GOVERNOR, 1.0, "radau5", samples=21, rtol=1e-11, atol=1e-13)
    right, left = run.markers["right ball"].position, run.markers["left ball"].position
    assert np.max(np.abs(right * [-1, -1, 1] - left)) < 1e-12
    spin = run.momentum[:, 2]
    assert np.ptp(spin) < 1e-9 * spin[0]
    assert run.work[-1] < -1e-3
    assert np.max(np.abs(run.energy_drift)) < 1e-9


def test_an_implicit_method_takes_fewer_steps_of_the_stiff_governor() -> None:
    explicit, implicit = (
        fm.simulate(GOVERNOR, 1.0, method, samples=2, rtol=1e-6, atol=1e-8).statistics
        for method in ("dop853", "radau5")
    )
    assert explicit.accepted_steps > 8 * implicit.accepted_steps
