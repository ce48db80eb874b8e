"""Speed against accuracy of every native integrator on the stiff cases, rivals in turns."""

from __future__ import annotations

from time import perf_counter

import numpy as np

import flexmb as fm
from crosscheck.library.find import shipped_folder
from flexmb.scene.files import load_scene

CASES = ("beam_with_axial_modes", "stiff_hinge_springs")
RELEASES = {"smooth": "scene.toml", "damped": "damped.toml", "ringing": "ringing.toml"}
T_END, SAMPLES, ROUNDS = 2.0, 101, 2
TOLERANCES = tuple(10.0**-k for k in (2, 4, 6, 8))
LADDERS: dict[str, tuple[dict[str, float], ...]] = {
    "dop853": tuple({"rtol": tol, "atol": 1e-2 * tol} for tol in TOLERANCES),
    "rk4": tuple({"step": h} for h in (2.5e-4, 1.25e-4, 6e-5)),
    "radau5": tuple({"rtol": tol, "atol": 1e-2 * tol} for tol in TOLERANCES),
    "exponential": tuple({"rtol": tol, "atol": 1e-2 * tol} for tol in TOLERANCES),
    "generalised_alpha": tuple({"step": h} for h in (8e-3, 4e-3, 2e-3, 1e-3)),
}


def work_precision(case: str, release: str, slowest_s: float = 0.7) -> dict[str, np.ndarray]:
    """(runs, 2) by method: largest error of the tip's position (m), seconds of the fastest of ROUNDS turns.

    Errors are distances from DOP853 at rtol 1e-12. A ladder ends with the first run slower than `slowest_s`; a run that
    does not finish is left out.
    """
    system = fm.compile(load_scene(shipped_folder() / "stiff" / case / RELEASES[release]))
    exact = _tip(fm.simulate(system, T_END, rtol=1e-12, atol=1e-14, samples=SAMPLES))
    rivals, errors = [], []
    for method, ladder in LADDERS.items():
        for settings in ladder:
            start = perf_counter()
            done = fm.simulate(system, T_END, method, samples=SAMPLES, **settings)
            if done.finished:
                rivals.append((method, settings))
                errors.append(np.abs(_tip(done) - exact).max())
            if perf_counter() - start > slowest_s:
                break
    seconds = np.full(len(rivals), np.inf)
    for _ in range(ROUNDS):
        for i, (method, settings) in enumerate(rivals):
            cost = fm.simulate(system, T_END, method, samples=SAMPLES, **settings).statistics
            seconds[i] = min(seconds[i], cost.run_s)
    points = np.transpose([errors, seconds])
    return {method: points[[name == method for name, _ in rivals]] for method in LADDERS}


def fastest(points: dict[str, np.ndarray], error: float) -> dict[str, float]:
    """Seconds of each method's fastest run that errs by at most `error`; methods without one are left out."""
    found = {}
    for method, runs in points.items():
        good = runs[runs[:, 0] <= error, 1]
        if len(good):
            found[method] = float(good.min())
    return found


def _tip(done: fm.Trajectory) -> np.ndarray:
    return done.markers["tip"].position
