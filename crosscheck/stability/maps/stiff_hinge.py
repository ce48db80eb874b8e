"""Step against the stiffness of a damped hinge spring in a chain of two bodies, by RK4."""

from __future__ import annotations

import numpy as np

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from flexmb.run.simulate import simulate
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.typing import Real

SOFT = 1.0  # N m/rad, the first hinge's spring
MASS, LENGTH, CENTRE, INERTIA = 1.0, 1.0, 0.5, 0.1  # of both bodies: kg, m, m, kg m^2 about the mass centre
DAMPING_RATIO = 0.3  # of the stiff mode
START = 1e-6  # rad
STEPS, PARTS = 2048, 64
GROWTH = 1e-5  # of the amplitude's logarithm in a step
RK4 = (1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0)  # amplification R(z), highest power first


def mass_matrix() -> Real:
    """(2,2) of the straight chain in its hinge angles."""
    outer = INERTIA + MASS * CENTRE**2
    coupling = INERTIA + MASS * CENTRE * (LENGTH + CENTRE)
    inner = INERTIA + MASS * CENTRE**2 + INERTIA + MASS * (LENGTH + CENTRE) ** 2
    return np.array([[inner, coupling], [coupling, outer]])


def damping(stiffness: Real | float) -> Real:
    """Coefficient (N m s/rad) that gives the stiff mode its damping ratio; its inertia is 1/(M^-1)_22."""
    inertia = 1.0 / np.linalg.inv(mass_matrix())[1, 1]
    return np.asarray(2.0 * DAMPING_RATIO * np.sqrt(np.asarray(stiffness) * inertia))


def scene(step: float, stiffness: float) -> Scene:
    """Two equal bodies; the hinge between them is stiff and damped."""
    builder = SceneBuilder("stiff hinge")
    for name in ("inner", "outer"):
        builder.rigid_body(name, mass=MASS, com=(CENTRE, 0.0, 0.0), inertia=(INERTIA, INERTIA, INERTIA))
    return (
        builder.revolute("soft", "ground", "inner", stiffness=SOFT, angle=START)
        .revolute(
            "stiff", "inner", "outer", stiffness=stiffness, damping=float(damping(stiffness)), angle=START,
            parent_position=(LENGTH, 0.0, 0.0),
        )  # fmt: skip
        .scene()
    )


def measure(scene: Scene, step: float, stiffness: float) -> Measurement:
    """Growth of the logarithm of the hinge angles' size in a step, from the largest in each half of a run."""
    done = simulate(scene, step * STEPS, "rk4", step=step, samples=step * STEPS / PARTS * np.arange(PARTS + 1))
    if not done.finished:
        return Measurement(status="failed", message=done.message)
    size = np.max(np.abs(done.q), axis=1)
    return Measurement(float(np.log(np.max(size[PARTS // 2 :]) / np.max(size[: PARTS // 2])) / (STEPS / 2)))


def amplification(step: Real, stiffness: Real) -> Real:
    """log of the largest |R(h lambda)| over the eigenvalues of the linear chain; slow ones, |R| = 1, count as zero."""
    M, k = np.linalg.inv(mass_matrix()), np.ravel(stiffness)
    A = np.zeros((k.size, 4, 4))
    A[:, :2, 2:] = np.eye(2)
    K, C = np.zeros((2, k.size, 2, 2))
    K[:, 0, 0], K[:, 1, 1], C[:, 1, 1] = SOFT, k, damping(k)
    A[:, 2:, :2], A[:, 2:, 2:] = -M @ K, -M @ C
    z = np.ravel(step)[:, None] * np.linalg.eigvals(A)
    stiff = np.where(np.abs(z) > 1e-3 * np.max(np.abs(z), axis=1, keepdims=True), z, 0.0)
    return np.log(np.max(np.abs(np.polyval(RK4, stiff)), axis=1)).reshape(np.shape(step))


MAPS = (
    StabilityMap(
        name="stiff_hinge",
        title="Stiff damped hinge spring in a chain of two bodies, RK4",
        quantity="growth of the amplitude in a step",
        scene=scene,
        measure=measure,
        x=Axis("step", "s", 1e-4, 1e-1, 9, log=True),
        y=Axis("stiffness of the hinge spring", "N m/rad", 1e2, 1e8, 9, log=True),
        thresholds=(GROWTH,),
        overlay=Overlay(
            "|R(h lambda)| = 1",
            "Hairer, Wanner, Solving Ordinary Differential Equations II, IV.2, at the chain's own eigenvalues",
            amplification,
            levels=(1e-9,),
        ),
        shows="The stiffer a hinge spring, the shorter the steps that RK4 may take: by the square root.",
        failure=1,
    ),
)
