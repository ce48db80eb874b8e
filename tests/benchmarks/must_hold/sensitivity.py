"""Derivatives of whole runs, in runs: the satellite by up to twelve numbers; one scalar of a chain by two hundred; fits
by exact derivatives, in fits by differences of runs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import least_squares

import flexmb as fm
from flexmb.parameters.numbers import numbers
from flexmb.scene.schema import Scene
from tests.benchmarks.must_hold.row import Measured, Row, measured
from tests.benchmarks.rivals import turns
from tests.repo.project import ROOT

T_END = 100.0
BY = (
    "hub.mass_kg", "hub.inertia_kg_m2.1.1", "left_hinge.rotation.stiffness_Nm_rad",
    "left_hinge.rotation.damping_Nms_rad", "right_hinge.rotation.stiffness_Nm_rad", "slosh.mass_kg",
    "slosh.coordinates.0.stiffness_N_m", "left.stations.*.EIy_Nm2", "left.stations.*.mass_per_length_kg_m",
    "attitude.parameters.3", "attitude.parameters.8", "left latches.level",
)  # fmt: skip
OF = ("left_tip.position.x", "right_tip.position.y", "left_hinge.torque.y", "tracker.quaternion.x", "wheel_y.speed")


GOALS = {1: 2.0, 4: 4.0, len(BY): 8.0}
"""Runs, by the count of numbers, that derivatives may cost with all caches of the scene empty."""


def rows() -> list[Row]:
    """Each pair in one process, in turns, kernels compiled."""
    what = "derivatives of spacecraft/deploy_and_slew by {} numbers, {:g} s, 2 latches, over the run"
    cold = "; beams are meshed anew in both"
    adjoint = (
        "gradient of a misfit of a chain of {} bodies by {} numbers (mass, inertia, centre of mass, place and spring "
        "of each), {:g} s, over the run"
    )
    fitted = "`fit` of {}, over `least_squares` of SciPy by two-point differences of `simulate`"
    return [
        Row("sensitivity", "Derivatives", what.format(len(BY), T_END), 8.0, partial(_satellite, BY), "at most"),
        *(Row(f"sensitivity_{n}", "Derivatives", what.format(n, T_END) + cold, goal,
              partial(_satellite, BY[:n], is_cold=True), "at most") for n, goal in GOALS.items()),
        Row("adjoint", "Derivatives", adjoint.format(BODIES, 10 * BODIES, CHAIN_END), 12.0, _chain, "at most"),
        Row("adjoint_50", "Derivatives", adjoint.format(BODIES, 50, CHAIN_END), 8.0, partial(_chain, 50), "at most"),
        *(Row(f"fit_{name}", "Derivatives", fitted.format(what), 0.5, partial(_fit, make), "at most")
          for name, (what, make) in FITS.items()),
    ]  # fmt: skip


BODIES, CHAIN_END = 20, 100.0
OWN = (
    "{body}.mass_kg", "{body}.inertia_kg_m2.0.0", "{body}.inertia_kg_m2.1.1", "{body}.inertia_kg_m2.2.2",
    "{body}.com_m.0", "{body}.com_m.1", "{body}.com_m.2", "{hinge}.parent_position_m.0",
    "{hinge}.rotation.stiffness_Nm_rad", "{hinge}.rotation.damping_Nms_rad",
)  # fmt: skip


def _emptied() -> None:
    """What scenes keep for the next one with the same bodies is forgotten."""
    for name, module in list(sys.modules.items()):
        if name.startswith(("flexmb.building.", "flexmb.modal.", "flexmb.scene.rest_curve")):
            for each in vars(module).values():
                if hasattr(each, "cache_clear"):
                    each.cache_clear()


def _satellite(by: tuple[str, ...], is_cold: bool = False) -> Measured:
    scene = fm.load_scene(ROOT / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
    found: list[fm.Sensitivities] = []

    def derivatives() -> None:
        if is_cold:
            _emptied()
        found[:] = [fm.sensitivities(scene, T_END, by, OF)]

    def run() -> None:
        if is_cold:
            _emptied()
        fm.simulate(scene, T_END)

    seconds = turns(derivatives, run, rounds=7)
    if not (len(found[0].events) == 2 and np.isfinite(found[0].derivatives).all()):
        raise ArithmeticError(f"{len(found[0].events)} latches, and derivatives that are not finite")
    whole, alone = np.median(seconds, axis=0)
    kept = "" if is_cold else "; beams that a call has meshed are kept for the next"
    return measured(
        seconds[:, 0] / seconds[:, 1],
        f"{whole:.2f} s over {alone:.3f} s, {len(OF)} outputs at 201 times{kept}",
    )


def _swinging() -> fm.SceneBuilder:
    """Rigid bodies on hinges with springs and dampers, whose axes alternate, in gravity."""
    builder, parent = fm.SceneBuilder("chain", gravity=(0.0, 0.0, -9.81)), "ground"
    for i in range(BODIES):
        builder.rigid_body(f"b{i}", mass=1.0 + 0.01 * i, inertia=(0.01, 0.1, 0.1), com=(0.3, 0.01, 0.02))
        builder.revolute(
            f"h{i}", parent, f"b{i}", axis=(0, 1, 0) if i % 2 else (0, 0, 1), angle=0.1, stiffness=200.0, damping=1.0,
            parent_position=(0.6, 0.0, 0.0),
        )  # fmt: skip
        parent = f"b{i}"
    return builder.marker("tip", parent, offset=(0.6, 0.0, 0.0))


def _chain(count: int = 10 * BODIES) -> Measured:
    """The whole call: compiling the scene with other numbers, and both passes over the run."""
    scene = _swinging().scene()
    by = [name.format(body=f"b{i}", hinge=f"h{i}") for i in range(BODIES) for name in OWN][:count]
    t = np.linspace(0.0, CHAIN_END, 21)[1:]
    of = fm.Misfit({"t": t, "tip.position.z": np.full(len(t), -5.0)})
    found: list[fm.Gradient] = []

    def derivatives() -> None:
        found[:] = [fm.gradient(scene, CHAIN_END, by, of)]

    def run() -> None:
        fm.simulate(scene, CHAIN_END)

    seconds = turns(derivatives, run, rounds=7)
    few = by[:: -(-count // 3)]
    other = fm.sensitivities(scene, CHAIN_END, few, ["tip.position.z"], samples=np.r_[0.0, t])
    exact = 2.0 * (other.values[1:, 0] + 5.0) @ other.derivatives[1:, 0]
    off = np.max(np.abs([found[0].derivative(name) for name in few] / exact - 1.0))
    if not off < 1e-6:
        raise ArithmeticError(f"the gradient is {off:.1g} from forward sensitivities")
    whole, alone = np.median(seconds, axis=0)
    return measured(
        seconds[:, 0] / seconds[:, 1], f"{whole:.2f} s over {alone:.3f} s, {found[0].steps} steps; "
        f"{off:.0e} from forward sensitivities",
    )  # fmt: skip


Problem = tuple[Scene, list[str], list[str], float]
"""A scene, the numbers that are identified, the channels that are measured, and the end of the run, s."""


def _boom() -> Problem:
    builder = fm.SceneBuilder("boom", gravity=(0.0, 0.0, 0.0)).rigid_body("boom", mass=4.0, inertia=(0.1, 5.0, 5.0))
    builder.revolute("root", "ground", "boom", axis=(0, 0, 1), angle=-1.5, stiffness=0.6, damping=0.5, rest=0.3)
    scene = builder.marker("tip", "boom", offset=(2.0, 0.0, 0.0)).scene()
    return scene, ["root.rotation.stiffness_Nm_rad", "root.rotation.damping_Nms_rad"], ["tip.position.x"], 10.0


def _six() -> Problem:
    builder, parent = fm.SceneBuilder("arm", gravity=(0.0, 0.0, -9.81)), "ground"
    for i in range(6):
        builder.rigid_body(f"l{i}", mass=1.0, com=(0.25, 0.0, 0.0), inertia=(0.01, 0.03, 0.03))
        builder.revolute(f"j{i}", parent, f"l{i}", axis=(0, 1, 0), angle=0.1, stiffness=20.0, damping=0.5,
                         parent_position=(0.5 if i else 0.0, 0.0, 0.0))  # fmt: skip
        parent = f"l{i}"
    scene = builder.marker("tip", parent, offset=(0.5, 0.0, 0.0)).scene()
    return scene, [f"l{i}.mass_kg" for i in range(6)], ["tip.position.x", "tip.position.z"], 2.0


FITS: dict[str, tuple[str, Callable[[], Problem]]] = {
    "boom": ("two numbers of a boom on a spring, 10 s", _boom),
    "six": ("the six masses of a chain, 2 s", _six),
}
NOISE = 1e-4  # m


def _fit(make: Callable[[], Problem]) -> Measured:
    """Both from the same start, to the same measurements, by runs of the same accuracy."""
    scene, by, of, t_end = make()
    start = np.array([number.value for number in numbers(scene, by)])
    true = scene.with_values(dict(zip(by, start * (1.0 + 0.08 * np.cos(np.arange(len(by)))), strict=True)))
    settings = {"rtol": 1e-8, "atol": 1e-10}

    def seen(of_scene: Scene) -> np.ndarray:
        run = fm.simulate(of_scene, t_end, samples=101, **settings)
        channels = {name: values for name, _, values in run.columns()}
        return np.column_stack([channels[name] for name in of])

    noise = NOISE * np.random.default_rng(0).standard_normal((101, len(of)))
    values = seen(true) + noise
    data = {"t": np.linspace(0.0, t_end, 101), **dict(zip(of, values.T, strict=True))}
    found: list[np.ndarray] = [start, start]

    def exact() -> None:
        found[0] = fm.fit(scene, data, by, sigma=NOISE, **settings).values

    def off(x: np.ndarray) -> np.ndarray:
        return (seen(scene.with_values(dict(zip(by, (x * start).tolist(), strict=True)))) - values).ravel() / NOISE

    def two_point() -> None:
        found[1] = (
            start
            * least_squares(off, np.ones(len(by)), x_scale="jac", ftol=1e-8, xtol=1e-8, gtol=None, diff_step=1e-6).x
        )

    seconds = turns(exact, two_point, rounds=7)
    apart = float(np.max(np.abs(found[0] / found[1] - 1.0)))
    if not apart < 1e-5:
        raise ArithmeticError(f"the numbers are {apart:.1g} from those of differences")
    one, other = np.median(seconds, axis=0)
    return measured(seconds[:, 0] / seconds[:, 1], f"{one:.3f} s over {other:.3f} s, values {apart:.0e} apart")
