"""The closed forms of beams, rotors and booms against routes that share nothing with them: elements, ODE solvers."""


import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, eigvals

from flexmb.typing import Real
from tests.cases.shipped import closed_form

ELEMENTS = 40


def beam_matrices(length: float, stiffness: float, mass: float) -> tuple[Real, Real, Real]:
    """Mass, stiffness and the geometric stiffness of a unit tension, of cubic elements without supports."""
    h, n = length / ELEMENTS, 2 * (ELEMENTS + 1)
    M, K, G = np.zeros((3, n, n))
    inertia = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2], [54, 13 * h, 156, -22 * h],
               [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]  # fmt: skip
    bend = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2]]  # fmt: skip
    slope = [[36, 3 * h, -36, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)], [-36, -3 * h, 36, -3 * h],
             [3 * h, -(h**2), -3 * h, 4 * h**2]]  # fmt: skip
    for e in range(ELEMENTS):
        place = np.ix_(range(2 * e, 2 * e + 4), range(2 * e, 2 * e + 4))
        M[place] += np.array(inertia) * mass * h / 420.0
        K[place] += np.array(bend) * stiffness / h**3
        G[place] += np.array(slope) / (30.0 * h)
    return M, K, G


def released(M: Real, K: Real, force: Real, times: Real) -> Real:
    """Coordinates (T, n) of a system that is let go from rest under a constant force."""
    squares, modes = eigh(K, M)
    return ((1.0 - np.cos(np.outer(times, np.sqrt(squares)))) * (modes.T @ force / squares)) @ modes.T


@pytest.mark.parametrize("case", ["cantilever", "tip_mass"])
def test_a_cantilever_let_go_moves_as_beam_elements_do(case: str) -> None:
    """Forty elements know the first three frequencies to 1e-7; the others have less than 1e-4 of the deflection."""
    form = closed_form(f"beams/{case}")
    times = np.linspace(0.0, 2.0, 41)
    M, K, _ = beam_matrices(form.LENGTH, form.STIFFNESS, form.MASS)
    M[-2, -2] += getattr(form, "TIP", 0.0)
    uniform = np.tile([form.GRAVITY, 0.0], ELEMENTS + 1)
    moved = released(M[2:, 2:], K[2:, 2:], (M @ uniform)[2:], times)
    channels = form.exact(times)
    for name, place in (("tip", -2), ("middle", ELEMENTS - 2)):
        found = channels[f"marker:{name}.position"][:, 1]
        assert found == pytest.approx(moved[:, place], abs=2e-4 * np.abs(moved[:, -2]).max())


def test_the_torsion_bar_twists_as_a_chain_of_discs() -> None:
    """Linear elements with lumped inertia, 400 of them: the error falls with the square of their length."""
    form = closed_form("beams/torsion_bar")
    n, times = 400, np.linspace(0.0, 3.0, 31)
    h = form.LENGTH / n
    inertia = np.full(n, form.INERTIA * h)
    inertia[-1] = 0.5 * form.INERTIA * h + form.DISC
    K = form.STIFFNESS / h * (np.diag(np.r_[np.full(n - 1, 2.0), 1.0]) - np.eye(n, k=1) - np.eye(n, k=-1))
    squares, modes = eigh(K, np.diag(inertia))
    omega = np.sqrt(squares)
    ring = np.sin(form.DRIVE * times)[:, None] - form.DRIVE / omega * np.sin(np.outer(times, omega))
    twist = (ring * form.TORQUE * modes[-1] / (squares - form.DRIVE**2)) @ modes.T
    channels = form.exact(times)
    for name, place in (("disc", -1), ("middle", n // 2 - 1)):
        found = 2.0 * channels[f"marker:{name}.orientation"][:, 1]
        assert found == pytest.approx(twist[:, place], abs=1e-3 * np.abs(twist).max())


def test_the_spinning_cantilever_has_the_published_frequency() -> None:
    """Wright and others: 7.360373 at a spin of 6; and 3.516015 without, which polynomials must give as well."""
    form = closed_form("beams/spinning_cantilever")
    assert form.first_mode()[0] / form.UNIT == pytest.approx(7.360373, abs=5e-7)
    form.SPIN = 0.0
    assert form.first_mode()[0] / form.UNIT == pytest.approx(3.516015, abs=5e-7)


def test_becks_column_has_the_frequency_of_beam_elements_under_a_follower_force() -> None:
    """The force leaves the shear -P w' at the tip to the element there; a force of fixed direction does not."""
    form = closed_form("beams/becks_column")
    M, K, G = beam_matrices(1.0, 1.0, 1.0)
    follower = np.zeros_like(K)
    follower[-2, -1] = 1.0
    found = form.lower_mode()[0]
    squares = eigvals((K - form.LOAD * (G - follower))[2:, 2:], M[2:, 2:])
    assert found == pytest.approx(np.sqrt(np.min(squares.real)), rel=1e-6)
    assert np.min(eigvals((K - form.LOAD * G)[2:, 2:], M[2:, 2:]).real) < 0.0  # a dead load buckles it


def test_hub_and_panel_swing_at_the_frequency_of_beam_elements() -> None:
    """The first node turns with the hub: w = r theta, w' = theta. Cubic elements of length h raise a frequency of wave
    number b by (b h)^4/1440: 1.0e-6 of the third, b = 7.8 over the length."""
    form = closed_form("spacecraft/panel_resonance")
    M, K, _ = beam_matrices(form.LENGTH, form.STIFFNESS, form.MASS)
    carried = np.zeros((len(M), len(M) - 1))
    carried[:2, 0] = form.ROOT, 1.0
    carried[2:, 1:] = np.eye(len(M) - 2)
    inertia = carried.T @ M @ carried
    inertia[0, 0] += form.HUB
    squares = eigh(carried.T @ K @ carried, inertia, eigvals_only=True)
    assert form.modes()[0][1:4] == pytest.approx(np.sqrt(squares[1:4]), rel=1.1e-6)
    assert pytest.approx(np.sqrt(squares[1]), abs=1e-3) == form.DRIVE


def test_the_rotor_whirls_as_integrated() -> None:
    form = closed_form("rotors/unbalanced")

    def rates(t: float, y: Real) -> Real:
        force = form.MASS * form.ECCENTRICITY * form.SPIN**2 * np.array([np.cos(form.SPIN * t), np.sin(form.SPIN * t)])
        return np.concatenate([y[2:], (force - form.STIFFNESS * y[:2] - form.DAMPING * y[2:]) / form.MASS])

    times = np.linspace(0.0, 3.0, 31)
    whirl = solve_ivp(rates, (0.0, 3.0), np.zeros(4), "DOP853", times, rtol=1e-11, atol=1e-14).y
    channels = form.exact(times)
    assert channels["marker:centre.position"][:, :2] == pytest.approx(whirl[:2].T, abs=1e-11)
    assert channels["marker:centre.velocity"][:, :2] == pytest.approx(whirl[2:].T, abs=1e-9)


def test_the_telescoping_boom_turns_as_integrated() -> None:
    """The hub's equation with its Coriolis load, J psi'' + m s^2 psi'' + 2 m s s' psi' = 0, instead of the momentum."""
    form = closed_form("spacecraft/telescoping_boom")

    def rates(t: float, y: Real) -> list[float]:
        s, ds, _ = form.slide(t)
        return [y[1], -2.0 * form.MASS * s * ds * y[1] / (form.INERTIA + form.MASS * s**2)]

    times = np.linspace(0.0, 7.0, 29)
    angle = solve_ivp(rates, (0.0, 7.0), [0.0, 1.5], "DOP853", times, rtol=1e-11, atol=1e-13, max_step=0.1).y[0]
    hub = form.exact(times)["marker:hub.position"]
    assert hub[:, :2] == pytest.approx(0.5 * np.column_stack([np.cos(angle), np.sin(angle)]), abs=1e-9)


def test_the_rolled_strip_keeps_its_length_and_closes() -> None:
    """By a sum over straight chords of the arc, whose turn is the moment's."""
    form = closed_form("frames/roll_up")
    times = np.array([0.0, 3.0, 6.0])
    tip = form.exact(times)["marker:tip.position"]
    middles = (np.arange(20000) + 0.5) / 20000 * form.LENGTH
    for place, turn in zip(tip, (0.0, np.pi, 2.0 * np.pi), strict=True):  # the blend is a half at half time
        chain = [np.cos(turn * middles).mean(), np.sin(turn * middles).mean(), 0.0]
        assert place == pytest.approx(chain, abs=1e-8)
