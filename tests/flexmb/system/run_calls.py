"""Scenes that are compiled, checked, simulated and fitted by one call."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import flexmb as fm
from tests.flexmb.system.argument_kinds import (
    NO_NUMBER,
    RUN,
    SAMPLES,
    Calls,
    World,
    chosen,
    seen,
    systems,
)  # fmt: skip


def of_scenes(w: World) -> Calls:
    """All of them."""
    return Calls(_compiled(w) | _simulated(w) | _sensitive(w))


def _compiled(w: World) -> Calls:
    state, chain, found = w.state, w.chain, Calls()
    wrong = chosen(None, "nonsense", 5)
    found.add("compile", fm.compile, {"scene": w.scene, "elimination": "fastest"},
              lambda system: system.accelerations(state), scene=chosen(None, "scene.toml", 1, w.tree),
              elimination=wrong)  # fmt: skip
    found.add("compile, closed", lambda elimination: fm.compile(chain.scene, elimination), {"elimination": "fastest"},
              lambda system: system.nu, elimination=wrong)  # fmt: skip
    found.add("check_scene", fm.check_scene, {"scene": w.scene, "t_end": 1.0}, scene=chosen(None, "scene", 1),
              t_end=chosen("1", 1j, np.nan, np.inf, 0.0, -1.0, [1.0], 10**400))  # fmt: skip
    return found


def _simulated(w: World) -> Calls:
    tree, state, found = w.tree, w.state, Calls()
    settings = {"t_end": 0.01, "method": "dop853", "rtol": 1e-6, "atol": 1e-8, "samples": 3, "max_steps": 100,
                "stabilise": 0.0}  # fmt: skip
    kinds = {
        "method": chosen(None, "euler", 5),
        "rtol": chosen(*NO_NUMBER, 0.0, -1e-3, 0.2, 1e-17, plain=((np.float64(1e-6), 1e-6),)),
        "atol": chosen(*NO_NUMBER, 0.0, -1e-3), "samples": SAMPLES, "stabilise": chosen(*NO_NUMBER, 1.0, -1.0),
        "max_steps": chosen(None, "5", 0, -1, 1e3, 10**30, True, np.nan, plain=((np.int32(100), 100),)), **RUN,
    }  # fmt: skip
    found.add("simulate", lambda **given: fm.simulate(tree, **given), settings, seen, **kinds)
    found.add("simulate, from", lambda **given: fm.simulate(tree, 0.01, samples=3, **given),
              {"t_start": 0.0, "state": state}, seen,
              t_start=chosen("0", 1j, np.nan, np.inf, 0.02, [0.0], plain=((0, 0.0), (np.float32(0.0), 0.0))),
              state=chosen("start", 5, w.y, {"nobody": 1.0}, {"elbow": "bent"}, {"elbow": np.nan}))  # fmt: skip
    found.add("simulate_stages", lambda **given: fm.simulate_stages(w.scene, **given),
              {"stages": [fm.RunStage(0.01, samples=3)], "t_start": 0.0}, seen,
              stages=chosen([], [fm.RunStage(-1.0)], [fm.RunStage(0.01, {"nobody": 1.0})], [fm.RunStage(np.nan)]),
              t_start=chosen("0", 1j, np.nan, np.inf, [0.0]))  # fmt: skip
    found.add("simulate, what", lambda scene: fm.simulate(scene, 0.01, samples=3), {"scene": tree}, seen,
              scene=systems)  # fmt: skip
    steps = chosen(*NO_NUMBER, 0.0, -1.0, 1e-300, 1e-320, plain=((np.float64(1e-3), 1e-3),))
    radius = chosen("1", 1j, np.nan, np.inf, -0.1, 1.5, True, plain=((1, 1.0), (np.float32(0.5), 0.5)))
    found.add("simulate, in steps",
              lambda **given: fm.simulate(tree, 0.01, "generalised_alpha", samples=3, **given),
              {"step": 1e-3, "spectral_radius": 0.5}, seen, step=steps, spectral_radius=radius)  # fmt: skip
    return found


def _sensitive(w: World) -> Calls:
    """Derivatives of runs, and what is found by many runs."""
    found = Calls()
    outputs, parameters = chosen(5, ["nobody"], [None], []), chosen(None, 5, "elbow", [], ["nobody"], [None])
    found.add("sensitivities", lambda **given: fm.sensitivities(w.scene, **given),
              {"t_end": 0.01, "by": ["gravity_m_s2.0"], "of": ["elbow.rotation"], "samples": 3},
              lambda it: it.derivatives, by=parameters, of=outputs, samples=SAMPLES, **RUN)  # fmt: skip
    found.add("gradient", lambda **given: fm.gradient(w.scene, **given),
              {"t_end": 0.01, "by": ["gravity_m_s2.0"], "of": fm.FinalValue("elbow.rotation")},
              lambda it: it.derivatives, by=parameters,
              of=chosen(5, [], None, fm.FinalValue("nobody")), **RUN)  # fmt: skip
    found.add("uncertainty", lambda given, of: fm.uncertainty(w.scene, 0.01, given, of, samples=3),
              {"given": {"gravity_m_s2.0": 0.1}, "of": ["elbow.rotation"]}, lambda it: it.sigma,
              given=chosen(None, 5, {}, {"nobody": 0.1}, {"gravity_m_s2.0": -1.0}, {"gravity_m_s2.0": np.nan}),
              of=outputs)  # fmt: skip
    measured = {"t": [0.0, 0.005, 0.01], "elbow.rotation": [0.3, 0.3, 0.3]}
    found.add("fit", lambda **given: fm.fit(w.scene, max_runs=3, **given),
              {"data": measured, "parameters": ["gravity_m_s2.0"], "sigma": 0.1}, lambda it: it.covariance,
              data=chosen(None, 5, {}, {"t": [0.0, 0.01]}, {"t": [0.0, np.nan], "elbow.rotation": [0.3, 0.3]}),
              parameters=chosen(None, 5, [], ["nobody"]),
              sigma=chosen("1", -1.0, 0.0, np.nan, {"nobody": 1.0}))  # fmt: skip
    found.add("advise", lambda **given: fm.advise(w.scene, **given),
              {"tolerance": 1e-2, "quantity": "marker:centre.position@1", "t_end": 0.01, "budget": 1.0},
              lambda it: replace(it, seconds=0.0), tolerance=chosen(*NO_NUMBER, 0.0, 1.0, -1.0),
              t_end=chosen(*NO_NUMBER, 0.0, -1.0), budget=chosen(*NO_NUMBER, 0.0, -1.0),
              quantity=chosen("nobody", 5, ("nobody",)))  # fmt: skip
    return found
