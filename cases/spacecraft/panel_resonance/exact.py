"""A hub that turns about a fixed axis, with a panel clamped to it, shaken by a wheel near the frequency of both.

To first order in the deflection w of the panel, v = (r + x) theta + w is the motion across. Rotation and x^2 times
Legendre polynomials are the basis; eighteen of them leave 1e-12. Each mode answers the reaction -T sin(W t) of the
wheel, which takes part in the rotation by nothing but that torque.
"""

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss
from scipy.linalg import eigh

HUB, ROOT = 20.0, 0.6  # kg m^2 about the axis, m from the axis to the clamp
LENGTH, STIFFNESS, MASS = 4.0, 160.0, 1.0  # m, N m^2, kg/m
TORQUE, DRIVE = 0.03, 4.261  # N m, rad/s
TERMS = 18


def exact(times):
    """Position (T, 3) of tip (m), and the strain energy (T, 1) (J)."""
    omega, vectors, terms, stiffness = modes()
    gain = -TORQUE * vectors[0]  # the torque turns the hub: the first coordinate of the basis
    phase, times = np.outer(times, omega), np.asarray(times)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        swing = (np.sin(DRIVE * times) - DRIVE / omega * np.sin(phase)) / (omega**2 - DRIVE**2)
    swing[:, 0] = (times[:, 0] - np.sin(DRIVE * times[:, 0]) / DRIVE) / DRIVE  # the rotation as one rigid body
    coordinates = (swing * gain) @ vectors.T
    turn = coordinates[:, 0]
    deflection = coordinates[:, 1:] @ np.array([term(LENGTH) for term in terms])
    reach = ROOT + LENGTH
    x, y = reach * np.cos(turn) - deflection * np.sin(turn), reach * np.sin(turn) + deflection * np.cos(turn)
    strain = 0.5 * np.einsum("ti,ij,tj->t", coordinates, stiffness, coordinates)
    return {"marker:tip.position": np.column_stack([x, y, np.zeros_like(x)]), "energy.strain": strain[:, None]}


def modes():
    """Frequencies (rad/s), vectors of unit mass in the basis, the basis of w (m), and the stiffness."""
    nodes, weights = leggauss(48)
    x, weights = 0.5 * LENGTH * (nodes + 1.0), 0.5 * LENGTH * weights
    lift = Polynomial([0.0, 0.0, 1.0 / LENGTH**2]).convert(kind=Legendre, domain=[0, LENGTH])
    terms = [lift * Legendre.basis(k, domain=[0, LENGTH]) for k in range(TERMS)]
    across = np.array([ROOT + x, *(term(x) for term in terms)])
    bend = np.array([0.0 * x, *(term.deriv(2)(x) for term in terms)])
    inertia = MASS * (across * weights) @ across.T
    inertia[0, 0] += HUB
    stiffness = STIFFNESS * (bend * weights) @ bend.T
    squares, vectors = eigh(stiffness, inertia)
    return np.sqrt(np.maximum(squares, 0.0)), vectors, terms, stiffness
