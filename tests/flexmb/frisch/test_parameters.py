"""Mode-dependent parameters: as printed against their sums, as corrected against the exact kinetic energy.

Each erratum of the paper that concerns them is shown here with its measured size.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexmb.frisch.parameters import ModeParameters, mode_parameters
from flexmb.modal.first_order import first_order
from flexmb.modal.flexible_model import FlexibleModel
from tests.bounds import gamma, observed_order, relative
from tests.flexmb.frisch import exact

BODIES = [exact.random_body(seed) for seed in range(3)] + [exact.random_body(3, particles=True)]
UNIT = np.eye(3)
EPS = [10.0**-k for k in range(1, 6)]


def printed_sums(model: FlexibleModel) -> dict[str, np.ndarray]:
    """(48)-(72) element by element, in the order and the words of the paper."""
    n = model.mode_count
    elements = []
    for i in range(len(model.mass)):
        c = model.com_offset[i]
        r = model.position[i] + c
        phiT = [model.translation[i, :, k] + np.cross(model.rotation[i, :, k], c) for k in range(n)]
        phiR = [model.rotation[i, :, k] for k in range(n)]
        elements.append((model.mass[i], r, model.inertia[i], phiT, phiR))
    m = sum(e[0] for e in elements)
    alpha = sum(mi * r for mi, r, *_ in elements) / m
    found = {"mass": m, "alpha": alpha}
    found["Phi"] = sum(
        I + mi * ((r - alpha) @ (r - alpha) * np.eye(3) - np.outer(r - alpha, r - alpha)) for mi, r, I, _, _ in elements
    )
    sums = {
        "A": lambda k: sum(mi * phiT[k] for mi, _, _, phiT, _ in elements) / m,
        "D": lambda k: sum(
            mi * ((r - alpha) @ phiT[k] * np.eye(3) - np.outer(r - alpha, phiT[k])) for mi, r, _, phiT, _ in elements
        ),
        "B": lambda k: sum(mi * np.cross(r, phiT[k]) for mi, r, _, phiT, _ in elements) / m,
        "C": lambda k: sum(I @ phiR[k] for _, _, I, _, phiR in elements),
        "J": lambda k: sum(np.cross(phiR[k], I, axisb=0, axisc=0) for _, _, I, _, phiR in elements),
    }
    found |= {name: np.array([f(k) for k in range(n)]) for name, f in sums.items()}
    found["E"] = np.array([D + D.T for D in found["D"]])
    found["H"] = found["D"] + found["J"]
    found["Q"] = found["C"] + m * (found["B"] - np.cross(alpha, found["A"]))
    pairs = {
        "F": lambda j, k: sum(
            mi * (phiT[j] @ phiT[k] * np.eye(3) - np.outer(phiT[j], phiT[k])) for mi, _, _, phiT, _ in elements
        ),
        "K": lambda j, k: sum(
            mi * np.cross(phiT[j], phiT[k]) + 0.5 * np.cross(I @ phiR[j], phiR[k]) for mi, _, I, phiT, phiR in elements
        ),
        "M1": lambda j, k: sum(mi * phiT[j] @ phiT[k] + phiR[j] @ I @ phiR[k] for mi, _, I, phiT, phiR in elements),
    }
    return found | {name: np.array([[f(j, k) for k in range(n)] for j in range(n)]) for name, f in pairs.items()}


@pytest.mark.parametrize("body", BODIES)
def test_printed_parameters_are_the_printed_sums(body):
    """(7), (8), (15), (17), (41), (48), (50)-(52), (54)-(56), (67), (68), (70), (72)."""
    p = mode_parameters(body, as_printed=True)
    for name, value in printed_sums(body).items():
        # A sum over the elements of products of at most ten numbers, twice; J of all orders is of order one here.
        assert relative(getattr(p, name), value, np.maximum(np.abs(value), 1.0)) <= 2 * gamma(10 + len(body.mass)), name
    assert not (np.any(p.A1) or np.any(p.Q1) or np.any(p.M1_slope))
    assert np.array_equal(p.stiffness, body.stiffness)


def origin(p: ModeParameters, n: int) -> dict[str, np.ndarray]:
    """What the parameters say about the body origin: coupling and inertia, and their slopes in mode n."""
    def arm(a, b):
        return a @ b * np.eye(3) - 0.5 * (np.outer(a, b) + np.outer(b, a))

    return {
        "C": p.Q + p.mass * np.cross(p.alpha, p.A),
        "C1": p.Q1[n] + p.mass * (np.cross(p.A[n], p.A) + np.cross(p.alpha, p.A1[n])),
        "J": p.Phi + p.mass * arm(p.alpha, p.alpha),
        "E": p.E[n] + 2.0 * p.mass * arm(p.alpha, p.A[n]),
    }


@pytest.mark.parametrize("body", BODIES)
def test_corrected_parameters_are_derivatives_of_the_kinetic_energy(body):
    """(47)-(49), (53), (55), (56), (171)-(173) and their slopes: modal mass, coupling and inertia to first order."""
    p, n = mode_parameters(body), body.mode_count
    M = exact.mass_matrix(body, np.zeros(n))
    angular, linear = slice(n, n + 3), slice(n + 3, n + 6)
    scale = M
    bound = exact.rounding(body)
    assert relative(p.M1, M[:n, :n], scale) <= bound
    assert relative(p.mass * p.A, M[:n, linear], scale) <= bound
    assert relative(origin(p, 0)["C"], M[:n, angular], scale) <= bound
    assert relative(origin(p, 0)["J"], M[angular, angular], scale) <= bound
    for k in range(n):
        dM = exact.slope(lambda eta: exact.mass_matrix(body, eta), UNIT[k])
        about = origin(p, k)
        bound = exact.rounding(body, order=1)
        assert relative(p.M1_slope[k], dM[:n, :n], scale) <= bound
        assert relative(p.mass * p.A1[k], dM[:n, linear], scale) <= bound
        assert relative(about["C1"], dM[:n, angular], scale) <= bound
        assert relative(about["E"], dM[angular, angular], scale) <= bound
        assert relative(p.mass * p.A[k], _axial(dM[angular, linear]), scale) <= bound


@pytest.mark.parametrize("body", BODIES)
def test_corrected_F_is_half_the_second_derivative_of_inertia(body):
    """(69), (70)."""
    p, n = mode_parameters(body), body.mode_count

    def inertia(eta):
        return exact.mass_matrix(body, eta)[n : n + 3, n : n + 3]

    for j in range(n):
        for k in range(n):
            half = 0.5 * exact.second(inertia, UNIT[j], UNIT[k])
            assert relative(p.F[j, k], half, inertia(0 * UNIT[j])) <= exact.rounding(body, order=2)
            assert relative(p.F[j, k], p.F[k, j].T) <= gamma(10 * len(body.mass))


def modal_bias(p: ModeParameters, a, adot, w) -> np.ndarray:
    """Velocity-dependent force on the modes, the right side of (77) with the sign of a left one, the origin at rest."""
    centrifugal = p.mass * p.A @ np.cross(w, np.cross(w, p.alpha))
    H = p.H + np.einsum("mnab,m->nab", p.F, a)
    return centrifugal - np.einsum("a,nab,b->n", w, H, w) + 2.0 * np.einsum("mna,m,a->n", p.K, adot, w)


def bias_errors(body: FlexibleModel, p: ModeParameters) -> tuple[list[float], float]:
    """Errors of the modal bias against Lagrange's equations with deformation and rates of size EPS, and round-off."""
    w, a, adot = np.random.default_rng(5).normal(size=(3, 3))
    exactly = [exact.coriolis(body, e * a, e * adot, w).real for e in EPS]
    errors = [np.max(np.abs(modal_bias(p, e * a, e * adot, w) - x)) for e, x in zip(EPS, exactly, strict=True)]
    return errors, exact.rounding(body, order=1) * np.max(np.abs(exact.mass_matrix(body, 0 * a))) * (w @ w)


@pytest.mark.parametrize(("as_printed", "order"), [(False, 2.0), (True, 1.0)])
def test_order_of_the_modal_bias(as_printed, order):
    """(65), (66), (69), (71), (73), (77): where points turn, the print's bias is wrong at first order already."""
    errors, floor = bias_errors(BODIES[0], mode_parameters(BODIES[0], as_printed=as_printed))
    assert observed_order(EPS, errors, floor) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("as_printed", [False, True])
def test_modal_bias_of_particles_is_exact_as_printed_too(as_printed):
    """(73), (77): masses move linearly with the modes, so nothing is left out."""
    errors, floor = bias_errors(BODIES[3], mode_parameters(BODIES[3], as_printed=as_printed))
    assert max(errors) <= floor


def test_print_takes_the_turning_of_inertia_for_second_order():
    """(12) against R Phi R': keeping the inertia as it is errs at first order, [theta~, Phi] at second."""
    theta, Phi = BODIES[0].rotation[0, :, 0], BODIES[0].inertia[0]
    errors = {"as printed": [], "corrected": []}
    for eps in EPS:
        R = exact.exponential(eps * theta)[0]
        S = exact.skew(eps * theta)
        turned = R @ Phi @ R.T
        errors["as printed"].append(np.max(np.abs(turned - Phi)))
        errors["corrected"].append(np.max(np.abs(turned - Phi - (S @ Phi - Phi @ S))))
    floor = gamma(100) * np.max(np.abs(Phi))
    assert observed_order(EPS, errors["as printed"], floor) == pytest.approx(1.0, abs=0.02)
    assert observed_order(EPS, errors["corrected"], floor) == pytest.approx(2.0, abs=0.02)


def power_defect(p: ModeParameters, adot, w) -> float:
    """Power of the inertia loads of a deforming body that spins, beyond what its kinetic energy takes up.

    Torque dPhi/dt w on the frame and -w H_n w on the modes must together deliver 1/2 w dPhi/dt w.
    """
    rate = np.einsum("n,nab->ab", adot, p.E)
    return float(w @ rate @ w - adot @ np.einsum("a,nab,b->n", w, p.H, w) - 0.5 * w @ rate @ w)


def test_print_of_E_produces_power():
    """(52) with (68): the defect is sum adot_n w.J_n.w, none with E_n = H_n + H_n'.

    Its share of the power is 45, 12, 9 and 0 % in four random bodies, the last one of particles.
    """
    w, adot = np.random.default_rng(6).normal(size=(2, 3))
    shares = []
    for body in BODIES:
        printed, corrected = mode_parameters(body, as_printed=True), mode_parameters(body)
        defect = np.einsum("n,a,nab,b->", adot, w, printed.J, w)
        rounding = gamma(40 + len(body.mass)) * np.sum(np.abs(corrected.H)) * (w @ w) * np.sum(np.abs(adot))
        assert abs(power_defect(corrected, adot, w)) <= rounding
        assert abs(power_defect(printed, adot, w) + defect) <= rounding
        shares.append(defect / (np.abs(adot) @ np.abs(np.einsum("a,nab,b->n", w, corrected.H, w))))
    assert shares == pytest.approx([0.450, 0.115, -0.088, 0.0], abs=5e-4)


def test_print_of_K_produces_power():
    """(72): Coriolis forces do no work, so K_mn is antisymmetric; the print's is not where elements are anisotropic.

    Its symmetric part is 23, 59, 32 % of it in three bodies of anisotropic elements, none for particles.
    """
    shares = []
    for body in BODIES:
        printed, corrected = mode_parameters(body, as_printed=True).K, mode_parameters(body).K
        rounding = gamma(20 + len(body.mass)) * np.sum(np.abs(corrected))
        assert np.max(np.abs(corrected + np.swapaxes(corrected, 0, 1))) <= rounding
        shares.append(np.linalg.norm(printed + np.swapaxes(printed, 0, 1)) / (2.0 * np.linalg.norm(printed)))
    assert shares == pytest.approx([0.225, 0.588, 0.320, 0.0], abs=5e-4)


def test_K_of_one_turning_element():
    """(72): principal moments I1, I2, I3 and modes about axes 1, 2 give (I1 + I2 - I3) / 2 and its negative about 3.

    The print has I1 / 2 and -I2 / 2: the power-producing part is (I1 - I2) / 4. Only I1 = I2 = I3 makes both agree.
    """
    I1, I2, I3 = 1.0, 2.0, 2.5
    shapes = np.zeros((1, 3, 2))
    element = replace(
        BODIES[0], mass=np.ones(1), position=UNIT[:1], com_offset=np.zeros((1, 3)), translation=shapes,
        inertia=np.diag([I1, I2, I3])[None], rotation=np.eye(3)[None, :, :2], stiffness=np.eye(2), damping=np.eye(2),
        nodes={},
    )  # fmt: skip
    corrected, printed = mode_parameters(element).K, mode_parameters(element, as_printed=True).K
    assert np.array_equal(corrected[0, 1], (I1 + I2 - I3) / 2.0 * UNIT[2])
    assert np.array_equal(corrected[1, 0], -corrected[0, 1])
    assert np.array_equal(printed[0, 1], I1 / 2.0 * UNIT[2])
    assert np.array_equal(printed[1, 0], -I2 / 2.0 * UNIT[2])


def coupling_errors(body: FlexibleModel, p: ModeParameters) -> tuple[list[float], float]:
    """Errors of the coupling of modes with the frame's motion at deformations of size EPS, and their round-off."""
    n = body.mode_count
    a = np.random.default_rng(7).normal(size=n)
    errors = []
    for eps in EPS:
        A, alpha = p.A + eps * np.einsum("mna,m->na", p.A1, a), p.alpha + eps * a @ p.A
        Q = p.Q + eps * np.einsum("mna,m->na", p.Q1, a)
        M = exact.mass_matrix(body, eps * a)
        errors.append(np.max(np.abs(np.hstack([Q + p.mass * np.cross(alpha, A), p.mass * A]) - M[:n, n:])))
    return errors, exact.rounding(body) * np.max(np.abs(M))


@pytest.mark.parametrize(("body", "as_printed", "order"), [(0, False, 2.0), (0, True, 1.0), (3, True, 1.0)])
def test_print_drops_the_slopes_of_the_couplings(body, as_printed, order):
    """(64), (96): without wdot x eps the mass matrix errs at first order, for particles too."""
    errors, floor = coupling_errors(BODIES[body], mode_parameters(BODIES[body], as_printed=as_printed))
    assert observed_order(EPS, errors, floor) == pytest.approx(order, abs=0.1)


def test_couplings_of_particles_are_exact():
    """(47), (53): with the slopes Q1, what masses have is complete at any deformation."""
    errors, floor = coupling_errors(BODIES[3], mode_parameters(BODIES[3]))
    assert max(errors) <= floor


def slabs(count: int) -> FlexibleModel:
    """A bending bar of length 1 and mass 1 cut into thin rigid slabs, with the mode x^2 and its slope."""
    x = (np.arange(count) + 0.5) / count
    translation, rotation, inertia = np.zeros((count, 3, 1)), np.zeros((count, 3, 1)), np.zeros((count, 3, 3))
    translation[:, 1, 0], rotation[:, 2, 0] = x**2, 2.0 * x
    inertia[:, 1, 1] = inertia[:, 2, 2] = 1.0 / count / 12.0 / count**2
    return replace(
        BODIES[3], mass=np.full(count, 1.0 / count), position=np.outer(x, UNIT[0]), com_offset=np.zeros((count, 3)),
        inertia=inertia, translation=translation, rotation=rotation, stiffness=np.eye(1), damping=np.eye(1),
    )  # fmt: skip


def test_rotary_part_of_the_normalisation_vanishes_as_elements_shrink():
    """(42): with elements of length h, as h^2; (41) tends to the integral of x^4."""
    counts = [4, 8, 16, 32, 64]
    bars = [slabs(count) for count in counts]
    still = [replace(bar, rotation=np.zeros_like(bar.rotation)) for bar in bars]
    whole, masses = ([mode_parameters(bar).M1[0, 0] for bar in group] for group in (bars, still))
    steps, part = 1.0 / np.array(counts), np.array(whole) - masses
    assert observed_order(steps, part, gamma(64)) == pytest.approx(2.0, abs=0.01)
    assert observed_order(steps, np.abs(np.array(whole) - 0.2), gamma(64)) == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize("body", BODIES)
def test_first_order_tables_of_the_recursion_say_the_same(body):
    """(48)-(72), corrected, about the body origin: a second derivation, by products of truncated series."""
    p, tables = mode_parameters(body), first_order(body)
    bound = 4 * gamma(20 + len(body.mass)) * np.max(np.abs(p.Phi))
    for k in range(body.mode_count):
        about = origin(p, k)
        assert np.max(np.abs(about["C1"] - tables.C1[k])) <= bound
        assert np.max(np.abs(about["E"] - tables.E[k])) <= bound
        assert np.max(np.abs(p.M1_slope[k] - tables.M1[k])) <= bound
        assert np.max(np.abs(p.mass * p.A1[k] - tables.L1[k])) <= bound
    assert np.max(np.abs(p.F - tables.G)) <= bound
    assert np.max(np.abs(2.0 * p.K - tables.C1 + np.swapaxes(tables.C1, 0, 1))) <= bound


def test_printed_parameters_refuse_free_modes_and_corrected_ones_do_not():
    """(46)."""
    free = replace(BODIES[0], clamped=False)
    assert np.array_equal(mode_parameters(free).Q, mode_parameters(BODIES[0]).Q)
    with pytest.raises(ValueError, match="wing: its modes are free-free"):
        mode_parameters(free, as_printed=True, name="wing")


def _axial(matrix: np.ndarray) -> np.ndarray:
    """v of v~."""
    return np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]])
