"""Loss of positive definiteness of the first-order (`linear`) mass matrix against the size of the deformation."""

from __future__ import annotations

from functools import cache

import msgspec
import numpy as np
from scipy.linalg import eigh

from crosscheck.stability.map import STABLE, UNSTABLE, Axis, Kind, Measurement, Overlay, StabilityMap
from flexmb.dense import DenseSystem
from flexmb.modal.flexible import beam_model
from flexmb.scene.bodies import BeamBody
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import BeamStation, ModalState, Modes, Scene
from flexmb.system.compile import compile
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

LENGTH, MASS, STIFFNESS = 1.0, 1.0, 1.0  # m, kg/m, N m^2
KNOTS = 25  # radii of gyration at which the overlay is computed; between them a power law is accurate enough


def scene(deflection: float, gyration: float) -> Scene:
    """A free beam of level `linear`, bent in its first clamped mode; both parameters over its length."""
    rotary = MASS * (gyration * LENGTH) ** 2
    section = BeamStation(
        x_m=0.0, EA_N=1e4, EIy_Nm2=STIFFNESS, EIz_Nm2=STIFFNESS, GJ_Nm2=1.0, mass_per_length_kg_m=MASS,
        rotary_y_kg_m=rotary, rotary_z_kg_m=rotary,
    )  # fmt: skip
    straight = (
        SceneBuilder("bent beam")
        .beam(
            "beam",
            length=LENGTH,
            elements=8,
            section=section,
            level="linear",
            modes=Modes(count=2, families=("bending_y",)),
        )  # fmt: skip
        .free("base", "ground", "beam")
        .scene()
    )
    (beam,) = straight.bodies
    assert isinstance(beam, BeamBody)
    amplitude = deflection * LENGTH / float(beam_model(beam).nodes["tip"].translation[1, 0])
    return msgspec.structs.replace(straight, modal_states=(ModalState(body="beam", coordinates=(amplitude, 0.0)),))


def measure(scene: Scene, deflection: float, gyration: float) -> Measurement:
    """Smallest eigenvalue of the mass matrix by composite bodies, scaled to a unit diagonal, with its sign changed.

    The recursion must refuse exactly the states where it is not positive; otherwise the cell has failed.
    """
    system = compile(scene)
    state = system.initial_state
    M = system.mass_matrix(state)
    scale = 1.0 / np.sqrt(np.abs(np.diag(M)))
    smallest = float(np.linalg.eigvalsh(M * np.outer(scale, scale))[0])
    refused = False
    try:
        system.accelerations(state)
    except DynamicsError:
        refused = True
    if refused != (smallest <= 0.0):
        message = f"refused: {refused}, but the smallest eigenvalue is {smallest:.3g}"
        return Measurement(status="failed", message=message)
    return Measurement(-smallest)


@cache
def limits() -> tuple[Real, Real]:
    """Radii of gyration, and the deflections where the mass matrix of the dense route becomes singular.

    It is M0 + deflection M1: singular where -1/deflection is an eigenvalue of M1 with respect to M0.
    """
    radii = np.geomspace(GYRATION.low, GYRATION.high, KNOTS)
    bounds = []
    for radius in radii:
        unit = scene(1.0, float(radius))
        dense = DenseSystem(unit)
        q = np.zeros(dense.nq)
        q[dense.tree.members[0].q_hinge] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        M0 = dense.mass_matrix(q)
        q[dense.tree.members[0].q_modes] = unit.modal_states[0].coordinates
        bounds.append(-1.0 / eigh(dense.mass_matrix(q) - M0, M0, eigvals_only=True)[0])
    return radii, np.array(bounds)


def excess(deflection: Real, gyration: Real) -> Real:
    """Positive beyond the deflection at which the dense route's mass matrix is singular."""
    radii, found = limits()
    limit = np.exp(np.interp(np.log(gyration), np.log(radii), np.log(found)))
    return np.asarray(deflection / limit - 1.0)


GYRATION = Axis("radius of gyration of the section over length", "", 1e-4, 1e-1, 9, log=True)
MAPS = (
    StabilityMap(
        name="definiteness",
        title="Mass matrix of a bent free beam at level linear",
        quantity="smallest eigenvalue",
        scene=scene,
        measure=measure,
        x=Axis("deflection of the tip over length", "", 1e-4, 1.0, 12, log=True),
        y=GYRATION,
        thresholds=(0.0,),
        kinds=(Kind("positive definite", STABLE), Kind("indefinite: refused with advice", UNSTABLE)),
        overlay=Overlay(
            "smallest eigenvalue of the dense route is zero",
            "sums over the inertia points by a complex step (flexmb.dense), M0 + deflection M1",
            excess,
        ),
        shows="A first-order mass matrix is indefinite at deflections of the size of the section, however small.",
    ),
)
