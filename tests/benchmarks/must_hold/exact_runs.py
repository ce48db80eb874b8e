"""Level exact: whole runs at equal error against Exudyn's beam elements and stiffened pieces, in turns.

Errors are those of tips and markers. The elastica's truth is this level's own with ten modes, of beam K's 64 cable
elements of Exudyn, extrapolated, of the flying spaghetti 128 of its exact elements, extrapolated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np
from msgspec.structs import replace

import flexmb as fm
from flexmb.integrate.integrator import Method
from flexmb.scene.files import load_scene
from flexmb.scene.schema import StrainPolynomials
from flexmb.surrogate import substructured
from tests.benchmarks import exact_scenes as scenes
from tests.benchmarks.exudyn_runs import Newton, sections, solved
from tests.benchmarks.must_hold.row import Measured, Row
from tests.benchmarks.must_hold.tuning import Setting, equal_error, up_to
from tests.cases.test_spinning_beam import TRUTHS, minimum, rotating_frame

GROUP = "Beams of level exact: whole runs"
SWUNG, FLIGHT, SPIN_UP = np.linspace(0.0, 4.0, 81), np.linspace(0.0, 2.5, 41), np.linspace(0.0, 8.0, 161)
LOWEST = -0.533761  # m: 64 cable elements, extrapolated over three steps; the last digit is open
FLOWN = (0.0625 / 16.0, 0.0625 / 32.0)  # s: steps of 128 exact elements, extrapolated
HALVINGS = 9
USUAL_NEWTON = Newton(1e-6, True, True)
NEWTONS = tuple(product((1e-3, 1e-4, 1e-6, 1e-8), (True, False), (False, True)))
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
PARTS = {
    "coarse": (4, StrainPolynomials(bending_y=4)),
    "fine": (12, StrainPolynomials(bending_y=4, axial=1, shear_y=2)),
}
SEARCHED = (
    "native: `dop853` and `radau5` at relative tolerances of 1e-3 to 1e-8 by tenths, and for the spaghetti "
    "`generalised_alpha` with steps of 62.5, 31.25, 15.6 and 12.5 ms and Newton's tolerances of 1e-3 to 1e-6. Exudyn: "
    "`GeneralizedAlpha` and `TrapezoidalIndex2` with steps that divide the time between samples (50 and 62.5 ms) by "
    "powers of two, and at the longest of them that err little enough Newton and modified Newton to 1e-3, 1e-4, 1e-6 "
    "and 1e-8, dense and sparse linear solver."
)


def rows() -> list[Row]:
    """The rival's error is the one that its number of elements comes to; ours is what the row says."""
    at: Callable[..., Row] = partial(Row, searched=SEARCHED)
    return [
        at("exact_motion", GROUP, "Exudyn's 32 cable elements (4e-4 L), elastica, 4 modes, 3e-4 L", 10.0, _motion),
        Row(
            "exact_motion_8", GROUP, "elastica in motion, 4 s, 8 modes", 1e-7, partial(_refined_motion, 8),
            sense="at most", unit="L",
        ),
        at("exact_spin", GROUP, "8 stiffened pieces, beam K, 3 modes, 1.5e-5 of the tip minimum", 1.0, _spin),
        Row(
            "exact_spin_5", GROUP, "beam K, 5 modes, of the unstretchable beam's tip minimum", 1e-6, _spin_converged,
            sense="at most", unit="",
        ),
        at("exact_coarse", GROUP, "Exudyn's 8 elements (1e-2 m), spaghetti, 4 bodies of 4, 6e-3 m", 1.0, _coarse),
        at("exact_fine", GROUP, "Exudyn's 32 elements (1e-3 m), spaghetti, 12 bodies, 1e-3 m", 1.0 / 3.0, _fine),
    ]  # fmt: skip


def _motion() -> Measured:
    return _of_rivals(swung_native(4), swung_exudyn(32, 5e-4), 3e-4, 5e-4)


def _spin() -> Measured:
    scene = load_scene(scenes.SPUN)
    pieces = substructured(scene, None, 8, level="stiffened")
    return equal_error(list(_spun(scenes.bending(scene, 3))), list(_spun(pieces)), 1.5e-5)


def _coarse() -> Measured:
    return _of_rivals(flown_native("coarse"), flown_exudyn(8, 1e-2), 6e-3, 1e-2)


def _fine() -> Measured:
    return _of_rivals(flown_native("fine"), flown_exudyn(32, 1e-3), 1e-3, 1e-3)


def _refined_motion(count: int) -> Measured:
    """By Radau's method, whose own error is smaller."""
    done = _simulated(_strip(count), SWUNG, "radau5", 1e-9, None)
    value = _apart(done.markers["tip"].position, _swung_truth())
    return Measured(value, value, value, f"radau5 at rtol 1e-9, {done.statistics.run_s:.3f} s; of ten modes")


def _spin_converged() -> Measured:
    five, many = (_lowest(_simulated(_spinning(n), SPIN_UP, "radau5", 1e-9, None)) for n in (5, 9))
    value = abs(five / many - 1.0)
    return Measured(value, value, value, "radau5 at rtol 1e-9; of nine modes")


def _of_rivals(native: Sequence[Setting], rival: Sequence[Setting], own: float, its: float) -> Measured:
    """Each at its own level, in units of which its errors are then."""
    mine, other = [_in_units(each, own) for each in native], [_in_units(each, its) for each in rival]
    return equal_error(mine, other, 1.0)


def _in_units(setting: Setting, unit: float) -> Setting:
    return Setting(setting.run, f"{setting.label}, error {setting.error:.1e}", setting.error / unit)


@cache
def swung_native(count: int) -> list[Setting]:
    """The elastica in motion by `count` modes: error over L of the tip, largest over time."""
    return list(_tried(_strip(count), SWUNG, lambda done: _apart(done.markers["tip"].position, _swung_truth())))


@cache
def flown_native(parts: str) -> list[Setting]:
    """The flying spaghetti by bodies of level exact: error (m), rms over time of the farthest marker."""
    bodies, polynomials = PARTS[parts]
    system = fm.compile(scenes.welded(load_scene(scenes.THROWN), bodies, polynomials))

    def error(done: Any) -> float:
        return _farthest(np.array([done.markers[name].position[:, :2] for name in ("root", "middle", "tip")]))

    steps = [(step, rtol) for step in (0.0625, 0.03125, 0.015625, 0.0125) for rtol in TOLERANCES[:4]]
    explicit = [] if parts == "fine" else [("dop853", rtol, None) for rtol in TOLERANCES[:3]]
    return [
        _setting(system, FLIGHT, method, rtol, step, error)
        for method, rtol, step in [*explicit, *(("generalised_alpha", rtol, step) for step, rtol in steps)]
    ]


@cache
def swung_exudyn(elements: int, level: float) -> list[Setting]:
    """The elastica in motion by Exudyn's cable elements, to where they err by `level`."""
    beam = _meshed(load_scene(scenes.STRIP), elements)
    return list(_elements(beam, SWUNG, lambda at: _apart(at[-1], _swung_truth()[:, :2]), level))


@cache
def flown_exudyn(elements: int, level: float) -> list[Setting]:
    """The flying spaghetti by Exudyn's geometrically exact elements, to where they err by `level`."""
    return list(_elements(_meshed(load_scene(scenes.THROWN), elements), FLIGHT, _farthest, level))


def _spun(scene: fm.Scene) -> Iterator[Setting]:
    return _tried(fm.compile(scene), SPIN_UP, lambda done: abs(_lowest(done) / LOWEST - 1.0))


@cache
def _strip(count: int) -> fm.System:
    return fm.compile(scenes.bending(load_scene(scenes.STRIP), count))


@cache
def _spinning(count: int) -> fm.System:
    return fm.compile(scenes.bending(load_scene(scenes.SPUN), count))


@cache
def _swung_truth() -> np.ndarray:
    """Positions (T,3) of the tip by ten modes."""
    return _simulated(_strip(10), SWUNG, "radau5", 1e-10, None).markers["tip"].position


@cache
def _flown_truth() -> np.ndarray:
    """Positions (3, T, 2) of root, middle and tip by 128 of Exudyn's exact elements, extrapolated in the step."""
    beam = _meshed(load_scene(scenes.THROWN), 128)
    newton = Newton(1e-8, True, True)
    places = np.array([0.0, 5.0, 10.0])
    coarse, fine = (sections(beam, solved(beam, FLIGHT, "GeneralizedAlpha", newton, h), places) for h in FLOWN)
    return fine + (fine - coarse) / 3.0


def _lowest(done: Any) -> float:
    """Lowest point (m) of beam K's tip, seen from the hub."""
    rate = TRUTHS["beam_k_supercritical"].rate
    _, value = minimum(SPIN_UP, rotating_frame(rate, SPIN_UP, done.markers["tip"].position)[:, 1])
    return value


def _farthest(found: np.ndarray) -> float:
    """Of (markers, T, 2): the rms over time of the distance of the farthest marker; infinite for an unfinished run."""
    truth = _flown_truth()
    if found.shape != truth.shape or not np.all(np.isfinite(found)):
        return np.inf
    return float(np.sqrt(np.mean(np.max(np.linalg.norm(found - truth, axis=2), axis=0) ** 2)))


def _apart(found: np.ndarray, truth: np.ndarray) -> float:
    """Largest distance over time; infinite for a run that did not reach its end."""
    if found.shape != truth.shape or not np.all(np.isfinite(found)):
        return np.inf
    return float(np.max(np.linalg.norm(found - truth, axis=1)))


def _tried(system: fm.System, times: np.ndarray, error: Callable[[Any], float]) -> Iterator[Setting]:
    for method, rtol in product(("dop853", "radau5"), TOLERANCES):
        yield _setting(system, times, method, rtol, None, error)


def _setting(
    system: fm.System, times: np.ndarray, method: Method, rtol: float, step: float | None,
    error: Callable[[Any], float],
) -> Setting:  # fmt: skip
    run = partial(_simulated, system, times, method, rtol, step)
    label = f"{method}, rtol {rtol:g}" + ("" if step is None else f", step {1e3 * step:.3g} ms")
    done = run()
    return Setting(run, label, error(done) if done.finished else np.inf)


def _simulated(system: fm.System, times: np.ndarray, method: Method, rtol: float, step: float | None) -> fm.Trajectory:
    fixed = {} if step is None else {"step": step}
    return fm.simulate(system, times[-1], method, samples=times, rtol=rtol, atol=0.1 * rtol, **fixed)


def _meshed(scene: fm.Scene, elements: int) -> Any:
    from crosscheck.engines.exudyn.beams import assemble_beam

    return assemble_beam(replace(scene, bodies=(replace(scene.bodies[0], elements=elements),)), elements)


def _elements(beam: Any, times: np.ndarray, error: Callable[[np.ndarray], float], level: float) -> Iterator[Setting]:
    """Steps by halves until one errs by `level`, and with that one all settings of Newton's method."""
    places = np.array([0.0, 0.5, 1.0]) * beam.scene.bodies[0].length_m

    def setting(method: str, newton: Newton, step: float) -> Setting:
        run = partial(solved, beam, times, method, newton, step)
        states = run()
        found = error(sections(beam, states, places)) if len(states.times) == len(times) else np.inf
        return Setting(run, f"{method}, step {1e3 * step:.3g} ms, {newton}", found)

    halved = [float(times[1]) / 2.0**halvings for halvings in range(HALVINGS)]
    for method in ("GeneralizedAlpha", "TrapezoidalIndex2"):
        steps = list(up_to(level, (setting(method, USUAL_NEWTON, step) for step in halved)))
        yield from steps
        if steps[-1].error <= level:
            yield from (setting(method, Newton(*newton), halved[len(steps) - 1]) for newton in NEWTONS)
