"""Sampled attitude control: how much delay it stands, and how fast it may be beside the frequency of a panel."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.linalg import eigh, expm

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap, interpolated
from crosscheck.stability.maps.follower_force import LENGTH, MASS, STIFFNESS, matrices
from crosscheck.stability.runs import growth
from flexmb.run.simulate import simulate
from flexmb.scene.build import SceneBuilder
from flexmb.scene.events import EndRun
from flexmb.scene.functions import ControlSignal
from flexmb.scene.schema import BeamStation, Modes, Scene
from flexmb.system.compile import compile
from flexmb.typing import Real

HUB = 1.0  # kg m^2
RATIO = 0.7  # of the controller's damping
START, END = 1e-9, 1e-3  # rad: a run ends where the disturbance is no longer small
ATOL = 1e-18  # of a run: a disturbance may fade to a millionth
PERIODS, PARTS = 90, 4  # of sampling in a run, and outputs in each
MODES, ELEMENTS, LOSS = 2, 12, 0.01  # of the panel; damping ratio of its modes
PANEL = MASS * LENGTH**3 / 3.0  # kg m^2


def hub(bandwidth: float, period: float, delay: float, inertia: float, panel: bool) -> Scene:
    """A hub on one axis: torque -inertia (2 RATIO bandwidth rate + bandwidth^2 angle), sampled, held and delayed."""
    gains = [-inertia * bandwidth**2, -2.0 * RATIO * inertia * bandwidth]
    builder = (
        SceneBuilder("sampled attitude control")
        .rigid_body("hub", mass=1.0, inertia=(HUB, HUB, HUB))
        .revolute("attitude", "ground", "hub", axis=(0, 1, 0), angle=START)
        .sense_coordinate("angle", "attitude")
        .sense_coordinate("rate", "attitude", quantity="rate")
        .state_space("regulator", ["angle", "rate"], D=[gains], period=period, delay=delay)
        .torque("wheel", "hub", direction=(0, 1, 0), function=ControlSignal(source="regulator"))
        .event("large", "attitude.rotation", END, EndRun(), crossing="rising")
    )
    if panel:
        section = BeamStation(
            x_m=0.0, EA_N=1e6, EIy_Nm2=STIFFNESS, EIz_Nm2=STIFFNESS, GJ_Nm2=1.0, mass_per_length_kg_m=MASS
        )
        builder.beam(
            "panel", length=LENGTH, elements=ELEMENTS, section=section, level="linear", points="line",
            modes=Modes(count=MODES, families=("bending_z",), damping_ratio=LOSS),
        ).weld("root", "hub", "panel")  # fmt: skip
    return builder.scene()


def of_run(scene: Scene, bandwidth: float, period: float) -> Measurement:
    """Growth of the hub's motion in a period of sampling, from a run of `PERIODS`."""
    run = simulate(compile(scene), PERIODS * period, samples=PERIODS * PARTS + 1, atol=ATOL)
    found = growth(run, np.hypot(run.q[:, 0], run.u[:, 0] / bandwidth))
    return Measurement(found.value * period, found.status, found.message)


def held(A: Real, B: Real, time: Real) -> tuple[Real, Real]:
    """exp(A t) and its integral times B, for matrices A (n,n), B (n,1) and times (...,)."""
    n = len(A)
    both = np.zeros((n + 1, n + 1))
    both[:n, :n], both[:n, n:] = A, B
    moved = expm(both * np.asarray(time)[..., None, None])
    return moved[..., :n, :n], moved[..., :n, n:]


def radius(A: Real, B: Real, gains: Real, period: Real, delay: Real) -> Real:
    """Largest magnitude (...,) of the poles of x' = A x + B u in a period, u the held and delayed -gains x.

    gains (..., 1, n). The delay, in whole periods m and a part f of one: the torque of m + 1 periods ago acts for f of
    the period, that of m ago for the rest (Astrom, Wittenmark, Computer-Controlled Systems, 2.3).
    """
    n, most = len(A), int(np.max(np.floor(delay))) + 1
    whole, part = np.floor(delay).astype(int), delay - np.floor(delay)
    P, _ = held(A, B, period)
    late, newest = held(A, B, period * (1.0 - part))
    oldest = late @ held(A, B, period * part)[1]
    step = np.zeros((*np.shape(delay), n + most, n + most))
    step[..., :n, :n] = P
    for shift in range(1, most):  # the torques of 1, 2 ... periods ago
        step[..., n + shift, n + shift - 1] = 1.0
    step[..., n : n + 1, :n] = -gains
    for ago, gain in ((0, newest), (1, oldest)):
        for k in range(most + 1):
            acts = np.where(whole + ago == k, 1.0, 0.0)[..., None, None] * gain
            if k == 0:
                step[..., :n, :n] -= acts @ gains
            else:
                step[..., :n, n + k - 1 : n + k] += acts
    return np.asarray(np.max(np.abs(np.linalg.eigvals(step)), axis=-1))


# ---- Delay of a sampled controller


def delayed(sampling: float, delay: float) -> Scene:
    """A rigid hub and a bandwidth of 1 rad/s; both parameters as on the axes."""
    return hub(1.0, sampling, sampling * delay, HUB, panel=False)


def rigid_radius(sampling: Real, delay: Real) -> Real:
    """Positive where a pole of the double integrator's loop is outside the unit circle."""
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / HUB]])
    gains = HUB * np.broadcast_to([1.0, 2.0 * RATIO], (*np.shape(sampling), 1, 2))
    return radius(A, B, gains, sampling, delay) - 1.0


PERIOD, LATE = Axis("period of sampling x bandwidth", "", 0.1, 1.5, 7), Axis("delay over the period", "", 0.0, 3.0, 6)
DELAY = StabilityMap(
    name="sampled_delay",
    title="How much delay a sampled controller stands",
    quantity="growth of the attitude in a period",
    scene=delayed,
    measure=lambda scene, sampling, delay: of_run(scene, 1.0, sampling),
    x=PERIOD,
    y=LATE,
    thresholds=(0.0,),
    overlay=Overlay(
        "a pole on the unit circle",
        "zero-order hold with delay: Astrom, Wittenmark, Computer-Controlled Systems (1997), 2.3",
        interpolated(PERIOD, LATE, rigid_radius),
    ),
    shows="A sampled attitude controller stands the less delay the slower it samples.",
    depth=2,
)

# ---- Controller against panel


@cache
def satellite() -> tuple[Real, Real, float]:
    """x' = A x + B torque of hub and panel, from independent beam elements clamped to the hub; the panel's lowest
    frequency (rad/s). x: angle, modes, and their rates."""
    M, K, _, _ = matrices()
    squares, shapes = eigh(K, M)
    squares, shapes = squares[:MODES], shapes[:, :MODES]
    places = LENGTH / ELEMENTS * np.arange(1, ELEMENTS + 1)
    rigid = np.column_stack([places, np.ones(ELEMENTS)]).ravel()  # deflections and slopes of a turn of the hub
    # The elements' mass matrix without its clamped end would lose the inertia of the first element's root: its motion
    # is zero in a turn about that end, so nothing is lost but the slope there, which a turn has.
    coupling = shapes.T @ M @ rigid + shapes.T @ _root_slope()
    n = MODES + 1
    mass = np.eye(n)
    mass[0, 0], mass[0, 1:], mass[1:, 0] = HUB + PANEL, coupling, coupling
    stiffness = np.diag([0.0, *squares])
    damping = np.diag([0.0, *(2.0 * LOSS * np.sqrt(squares))])
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:, :n], A[n:, n:] = -np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)
    B = np.zeros((2 * n, 1))
    B[n:, 0] = np.linalg.solve(mass, np.eye(n)[0])
    return A, B, float(np.sqrt(squares[0]))


def _root_slope() -> Real:
    """The column (n,) of the elements' mass matrix that belongs to the slope of the clamped end."""
    column, h = np.zeros(2 * ELEMENTS), LENGTH / ELEMENTS
    column[:2] = MASS * h / 420.0 * np.array([13.0 * h, -3.0 * h**2])
    return column


def with_panel(sampling: float, bandwidth: float) -> Scene:
    """Both parameters as on the axes, both over the frequency of the panel."""
    lowest = satellite()[2]
    return hub(bandwidth * lowest, 2.0 * np.pi / (sampling * lowest), 0.0, HUB + PANEL, panel=True)


def measure_panel(scene: Scene, sampling: float, bandwidth: float) -> Measurement:
    """Growth in a period."""
    lowest = satellite()[2]
    return of_run(scene, bandwidth * lowest, 2.0 * np.pi / (sampling * lowest))


def panel_radius(sampling: Real, bandwidth: Real) -> Real:
    """Positive where a pole of the loop with the panel is outside the unit circle."""
    A, B, lowest = satellite()
    gains = np.zeros((*np.shape(sampling), 1, len(A)))
    gains[..., 0, 0] = (HUB + PANEL) * (bandwidth * lowest) ** 2
    gains[..., 0, MODES + 1] = 2.0 * RATIO * (HUB + PANEL) * bandwidth * lowest
    return radius(A, B, gains, 2.0 * np.pi / (sampling * lowest), np.zeros(np.shape(sampling))) - 1.0


RATE = Axis("rate of sampling over the panel's frequency", "", 3.0, 24.0, 8, log=True)
BANDWIDTH = Axis("bandwidth over the panel's frequency", "", 0.2, 4.0, 8, log=True)
PANEL_MAP = StabilityMap(
    name="sampled_panel",
    title="A sampled controller beside the frequency of a panel",
    quantity="growth of the attitude in a period",
    scene=with_panel,
    measure=measure_panel,
    x=RATE,
    y=BANDWIDTH,
    thresholds=(0.0,),
    overlay=Overlay(
        "a pole on the unit circle",
        "zero-order hold of hub and beam elements: Astrom, Wittenmark 1997, 2.3; Likins 1970",
        interpolated(RATE, BANDWIDTH, panel_radius, knots=65),
    ),
    shows="A controller that is sampled too slowly for its bandwidth shakes the panel that it does not see.",
    depth=2,
)
MAPS = (DELAY, PANEL_MAP)
