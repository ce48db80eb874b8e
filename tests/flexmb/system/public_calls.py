"""Every public call, and everything that can be wrong with its arguments. Run as a program: prints what is not right.

A call with one argument exchanged may raise one of the documented errors, or return what it returns for the same
numbers as plain floats; never crash, and never return numbers that are not finite. What is not to be had must raise.
After all that is wrong with an argument, the right call gives the same bits as before.
"""

from __future__ import annotations

import faulthandler
import inspect
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

import flexmb as fm
from flexmb.frisch.nested_system import NestedSystem
from flexmb.jain.operators import Operators
from flexmb.scene import schema
from flexmb.system.closed import ClosedSystem
from flexmb.system.factors import MassMatrixFactors
from tests.flexmb.control.scenes import rotor
from tests.flexmb.system.argument_kinds import (
    ALGORITHM,
    NO_NUMBER,
    RUN,
    SAMPLES,
    Call,
    W,
    but_columns,
    but_modal,
    but_none,
    chosen,
    closed_states,
    matrices,
    names,
    not_a_mode,
    numbers,
    quaternion_first,
    rows,
    series,
    states,
    systems,
    vectors,
    wrong_only,
    wrong_only_number,
)  # fmt: skip
from tests.flexmb.system.batch_calls import batch_calls

# SceneError, ClosureError, LinAlgError are among the former; KeyError is of names that do not exist.
DOCUMENTED = (ValueError, TypeError, KeyError, ArithmeticError, NotImplementedError)


def calls() -> dict[str, Call]:
    """By name."""
    tree, chain, state, rates = W.tree, W.chain, W.state, W.rates
    found: dict[str, Call] = {}

    def add(called: str, function: Callable[..., Any], arguments: dict[str, Any], **kinds: Any) -> None:
        assert set(kinds) == set(arguments), called
        found[called] = Call(function, arguments, kinds)

    pointwise = (
        "mass_matrix", "bias", "applied", "energy", "momentum", "partitions", "digits_left", "precision", "admissible",
    )  # fmt: skip
    for name in pointwise:
        add(f"System.{name}", getattr(tree, name), {"state": state}, state=states)
    for algorithm in ("articulated", "unsplit", "composite", "frisch", "frisch_as_printed"):
        chosen_algorithm = {"state": state, "algorithm": algorithm}
        add(f"System.accelerations, {algorithm}", tree.accelerations, chosen_algorithm, state=states, **ALGORITHM)
        arguments = {"t": 0.5, "q": state.q.copy(), "u": state.u.copy(), "algorithm": algorithm}
        add(
            f"System.evaluate, {algorithm}",
            tree.evaluate,
            arguments,
            t=numbers,
            q=quaternion_first,
            u=vectors,
            **ALGORITHM,
        )
        arguments = {"t": 0.5, "q": state.q.copy(), "u": state.u.copy()}
        evaluator = _copying(tree.evaluator(algorithm))
        add(f"System.evaluator, {algorithm}", evaluator, arguments, t=numbers, q=quaternion_first, u=vectors)
    add("System.evaluator", lambda algorithm: tree.evaluator(algorithm).accelerations, {"algorithm": "articulated"},
        **ALGORITHM)  # fmt: skip
    of_rates = {"state": state, "accelerations": rates}
    for name, kind in {
        "inverse_dynamics": vectors, "modal_residual": vectors, "consistent_inverse_dynamics": but_modal,
    }.items():  # fmt: skip
        add(f"System.{name}", getattr(tree, name), of_rates, state=states, accelerations=kind)
    add("System.hinge_loads", tree.hinge_loads, of_rates, state=states, accelerations=but_none(vectors))
    of_body = {"state": state, "body": "arm"}
    add("System.mass_properties", tree.mass_properties, of_body, state=states, body=but_none(names))
    of_sections = {"state": state, "body": "arm", "x": np.array([0.25, 0.0])}
    add("System.section_loads", tree.section_loads, of_sections, state=states, body=names,
        x=chosen(None, "root", [0.6], [-0.1], [[0.1]], [np.nan], [0.1j], plain=(([0.25, 0], np.array([0.25, 0.0])),)),
    )  # fmt: skip
    add("System.section_load_derivatives", tree.section_load_derivatives, of_sections, state=states, body=names,
        x=chosen(None, "root", [0.6], [-0.1], [[0.1]], [np.nan], [0.1j], plain=(([0.25, 0], np.array([0.25, 0.0])),)),
    )  # fmt: skip
    found["System.section_load_derivatives, nowhere"] = Call(
        lambda: tree.section_load_derivatives(state, "arm", []).by_speed, {}, {}
    )
    in_axes = {"state": state, "axes": "outboard", "about": ("arm", "tip")}
    add("System.hinge_load_derivatives", tree.hinge_load_derivatives, in_axes, state=states,
        axes=chosen(None, "body", 5), about=chosen("tip", ("arm", "nowhere"), ("nobody", "tip"), 5))  # fmt: skip
    differentiating = _copying(tree.derivative_evaluator())
    add("System.derivative_evaluator", differentiating, {"t": 0.5, "q": state.q.copy(), "u": state.u.copy()},
        t=numbers, q=quaternion_first, u=vectors)  # fmt: skip
    add("System.acceleration_derivatives", tree.acceleration_derivatives, {"state": state, "forces": rates},
        state=states, forces=but_none(vectors))  # fmt: skip
    add("System.inverse_dynamics_derivatives", tree.inverse_dynamics_derivatives, of_rates, state=states,
        accelerations=vectors)  # fmt: skip
    add("System.evaluation_derivatives", tree.evaluation_derivatives, of_rates, state=states,
        accelerations=but_none(vectors))  # fmt: skip
    no_names = chosen(None, 5, "arm", [], ["nobody"], ["elbow"], [None], [1])
    for called, system, at in (("System", tree, state), ("ClosedSystem", chain, chain.initial_state)):
        numbers_of = {"names": ["gravity_m_s2.0", "gravity_m_s2.1"]}
        add(f"{called}.parameters", lambda names, system=system, at=at: system.parameters(names).accelerations(at),
            numbers_of, names=no_names)  # fmt: skip
        body = {"bodies": [system.scene.bodies[0].name]}
        add(f"{called}.inertia_regressor", lambda bodies, system=system: system.inertia_regressor(bodies).values,
            body, bodies=chosen(5, "arm", ["nobody"], [None], [1]))  # fmt: skip
    by = tree.parameters(["gravity_m_s2.0"])
    for name in ("accelerations", "loads"):
        add(f"Parameters.{name}", getattr(by, name), {"state": state}, state=states)
    add("Parameters.slopes", by.slopes, {"t": 0.5, "y": W.y, "dy": np.ones((len(W.y), 1))}, t=numbers,
        y=quaternion_first, dy=matrices)  # fmt: skip
    add("Parameters.inverse_dynamics", by.inverse_dynamics, of_rates, state=states, accelerations=vectors)
    add("Parameters.evaluate", by.evaluate, {"state": state}, state=states)
    regressor, many = tree.inertia_regressor(), {"states": [state], "accelerations": rates[None]}
    for name in ("at", "rest"):
        add(f"InertiaRegressor.{name}", getattr(regressor, name), of_rates, state=states, accelerations=vectors)
    for name in ("stacked", "base"):
        add(f"InertiaRegressor.{name}", getattr(regressor, name), many,
            states=chosen(None, [], 5, [None], [state, state], ["state"]),
            accelerations=chosen(None, [], 5, [None], rates, [rates[:-1]], [rates + np.nan]))  # fmt: skip
    add("MarkerPath.angles", lambda sequence: W.run.markers["centre"].angles(sequence).values, {"sequence": "zyx"},
        sequence=chosen(None, 5, "", "zy", "zyxz", "abc", "zzx", ["z", "y"]))  # fmt: skip
    add("System.factorise", lambda state: tree.factorise(state).log_determinant, {"state": state}, state=states)
    add("System.operators", lambda state: tree.operators(state).M, {"state": state}, state=states)
    add(
        "System.state",
        tree.state,
        {"q": state.q.copy(), "u": state.u.copy(), "t": 0.5},
        q=quaternion_first,
        u=vectors,
        t=numbers,
    )
    add("State", fm.State, {"q": state.q.copy(), "u": state.u.copy(), "t": 0.5}, q=rows, u=rows, t=numbers)
    add("System.scene_state", tree.scene_state, {"t": 0.5}, t=numbers)
    for name in ("coordinate", "speed"):
        add(f"System.{name}", getattr(tree, name), {"name": "elbow"}, name=names)
    asked = {"algorithm": "articulated", "stabilise": 0.0}
    add("System.route", lambda **given: tree.route(**given).rhs, asked, stabilise=wrong_only_number, **ALGORITHM)
    add(
        "System.nested",
        lambda algorithm: tree.nested(algorithm).reduced(0.0, W.y),
        {"algorithm": "frisch"},
        **ALGORITHM,
    )
    nested = tree.nested()
    for name in ("accelerations", "motion", "reduced", "partitions", "relative_motion"):
        add(f"NestedSystem.{name}", getattr(nested, name), {"t": 0.5, "y": W.y}, t=numbers, y=quaternion_first)
    factors = tree.factorise(state)
    for name in ("solve", "half_solve", "half_multiply", "multiply"):
        function = getattr(factors, name)
        argument = next(iter(inspect.signature(function).parameters))
        add(f"MassMatrixFactors.{name}", function, {argument: rates}, **{argument: but_columns(vectors)})
        add(
            f"MassMatrixFactors.{name}, columns",
            function,
            {argument: np.stack([rates, -rates], 1)},
            **{argument: matrices},
        )
    operators = tree.operators(state)
    for name, argument in {
        "alpha_m": "chi_dot",
        "f_m": "chi_dot",
        "inverse_dynamics": "chi_dot",
        "accelerations": "T",
    }.items():
        add(f"Operators.{name}", getattr(operators, name), {argument: rates}, **{argument: vectors})
    driven = {"prescribed": rates < 2.0, "rates": rates}
    add(
        "Operators.driven", lambda prescribed, rates: operators.driven(prescribed, rates).a_m, driven,
        prescribed=chosen(None, rates, [True], np.ones(10**5, bool), "no", rates.astype(int)), rates=vectors,
    )  # fmt: skip

    start = chain.initial_state
    for name in (
        "mass_matrix", "bias", "energy", "momentum", "determined_loads", "closure_gaps", "hinge_loads", "digits_left",
        "mass_properties", "precision", "admissible", "evaluation_derivatives", "hinge_load_derivatives",
    ):  # fmt: skip
        add(f"ClosedSystem.{name}", getattr(chain, name), {"state": start}, state=closed_states)
    add(
        "ClosedSystem.closure_operators", lambda state: chain.closure_operators(state).Lambda_inverse, {"state": start},
        state=closed_states,
    )  # fmt: skip
    for algorithm in ("articulated", "composite"):
        arguments = {"state": start, "algorithm": algorithm}
        add(
            f"ClosedSystem.accelerations, {algorithm}", chain.accelerations, arguments, state=closed_states, **ALGORITHM
        )
    arguments = {"t": 0.0, "q": start.q.copy(), "u": start.u.copy()}
    add("ClosedSystem.evaluate", chain.evaluate, arguments, t=numbers, q=wrong_only, u=wrong_only)
    add(
        "ClosedSystem.inverse_dynamics",
        chain.inverse_dynamics,
        {"state": start, "accelerations": np.arange(1.0, chain.nu + 1.0)},
        state=closed_states,
        accelerations=vectors,
    )
    along_speeds = np.arange(1.0, chain.nu + 1.0)
    add("ClosedSystem.acceleration_derivatives", chain.acceleration_derivatives,
        {"state": start, "forces": along_speeds}, state=closed_states, forces=but_none(vectors))  # fmt: skip
    add("ClosedSystem.derivative_evaluator", _copying(chain.derivative_evaluator()), arguments, t=numbers, q=wrong_only,
        u=wrong_only)  # fmt: skip
    add("ClosedSystem.inverse_dynamics_derivatives", chain.inverse_dynamics_derivatives,
        {"state": start, "accelerations": along_speeds}, state=closed_states, accelerations=vectors)  # fmt: skip
    add(
        "ClosedSystem.route",
        chain.route,
        {"algorithm": "articulated", "stabilise": 0.0},
        stabilise=wrong_only_number,
        **ALGORITHM,
    )

    add(
        "compile",
        lambda scene, elimination: fm.compile(scene, elimination).accelerations(state),
        {"scene": W.scene, "elimination": "fastest"},
        scene=chosen(None, "scene.toml", 1, W.tree),
        elimination=chosen(None, "nonsense", 5),
    )
    add(
        "compile, closed",
        lambda elimination: fm.compile(chain.scene, elimination).nu,
        {"elimination": "fastest"},
        elimination=chosen(None, "nonsense", 5),
    )
    add(
        "linearize",
        lambda system, state: fm.linearize(system, state).A,
        {"system": tree, "state": state},
        system=systems,
        state=but_none(states),
    )
    add("ControlledMotion", lambda system, state: fm.ControlledMotion(system).acceleration_derivatives(state).motion,
        {"system": tree, "state": state}, system=systems, state=states)  # fmt: skip
    controlled = fm.ControlledMotion(tree)
    no_mapping = chosen("x", 5, [], [1.0], np.zeros(2), {"nobody": 1.0}, {"elbow"})
    for name in ("acceleration_derivatives", "evaluation_derivatives", "initial_states"):
        add(f"ControlledMotion.{name}", getattr(controlled, name), {"state": state, "held": {}}, state=states,
            held=no_mapping)  # fmt: skip
    stresses = tree.section_loads(state, "arm", [0.25])
    add("SectionLoads.normal_stress", stresses.normal_stress, {"E": 7e10, "y": 0.1, "z": 0.1}, E=wrong_only_number,
        y=wrong_only_number, z=wrong_only_number)  # fmt: skip
    add("SectionLoads.torsion_stress", stresses.torsion_stress, {"G": 2.7e10, "r": 0.1}, G=wrong_only_number,
        r=wrong_only_number)  # fmt: skip
    add("ControlledMotion, states", _under_a_controller, {"x": np.array([0.5, -1.0])}, x=but_none(vectors))
    add(
        "equilibrium",
        lambda system, guess: fm.equilibrium(system, guess),
        {"system": tree, "guess": state},
        system=systems,
        guess=but_none(states),
    )
    arguments = {"system": tree, "hinge": "rotor", "rate": 0.5, "guess": state}
    add(
        "steady_spin",
        lambda **given: fm.steady_spin(**given).state,
        arguments,
        system=systems,
        hinge=names,
        rate=numbers,
        guess=but_none(states),
    )
    add("SteadySpin.linearize", lambda: fm.steady_spin(tree, "rotor", 0.5).linearize().A, {})
    arguments = {"system": tree, "hinge": "rotor", "rates": np.array([0.5, 1.0])}
    add(
        "campbell",
        lambda **given: fm.campbell(**given).eigenvalues,
        arguments,
        system=systems,
        hinge=names,
        rates=series,
    )
    model = W.model
    arguments = {"input": model.inputs[-1][0], "omega": np.array([2.0, 3.0]), "outputs": ("centre.x",)}
    add(
        "LinearModel.frequency_response",
        model.frequency_response,
        arguments,
        input=names,
        omega=series,
        outputs=chosen(("nobody",), (None,), 5),
    )
    add(
        "LinearModel.displacements_by",
        model.displacements_by,
        {"names": model.displacements[:2]},
        names=chosen(("nobody",), (None,), 5),
    )
    mode = model.modes[-1]
    add(
        "LinearModel.marker_shape",
        model.marker_shape,
        {"mode": mode, "marker": "centre"},
        mode=not_a_mode,
        marker=names,
    )
    arguments = {"mode": mode, "size": 0.5, "phase": 0.5}
    add("LinearModel.displaced", model.displaced, arguments, mode=not_a_mode, size=numbers, phase=numbers)
    settings = {
        "t_end": 0.01,
        "method": "dop853",
        "rtol": 1e-6,
        "atol": 1e-8,
        "samples": 3,
        "max_steps": 100,
        "stabilise": 0.0,
    }
    kinds = {
        "method": chosen(None, "euler", 5),
        "rtol": chosen(*NO_NUMBER, 0.0, -1e-3, 0.2, 1e-17, plain=((np.float64(1e-6), 1e-6),)),
        "atol": chosen(*NO_NUMBER, 0.0, -1e-3), "samples": SAMPLES, "stabilise": chosen(*NO_NUMBER, 1.0, -1.0),
        "max_steps": chosen(None, "5", 0, -1, 1e3, 10**30, True, np.nan, plain=((np.int32(100), 100),)), **RUN,
    }  # fmt: skip
    add("simulate", lambda **given: seen(fm.simulate(tree, **given)), settings, **kinds)
    begun = {"t_start": 0.0, "state": state}
    add("simulate, from", lambda **given: seen(fm.simulate(tree, 0.01, samples=3, **given)), begun,
        t_start=chosen("0", 1j, np.nan, np.inf, 0.02, [0.0], plain=((0, 0.0), (np.float32(0.0), 0.0))),
        state=chosen("start", 5, W.y, {"nobody": 1.0}, {"elbow": "bent"}, {"elbow": np.nan}))  # fmt: skip
    stages = {"stages": [fm.RunStage(0.01, samples=3)], "t_start": 0.0}
    add("simulate_stages", lambda **given: seen(fm.simulate_stages(W.scene, **given)), stages,
        stages=chosen([], [fm.RunStage(-1.0)], [fm.RunStage(0.01, {"nobody": 1.0})], [fm.RunStage(np.nan)]),
        t_start=chosen("0", 1j, np.nan, np.inf, [0.0]))  # fmt: skip
    add("simulate, what", lambda scene: seen(fm.simulate(scene, 0.01, samples=3)), {"scene": tree}, scene=systems)
    fixed = {"step": 1e-3, "spectral_radius": 0.5}
    steps = chosen(*(each for each in NO_NUMBER), 0.0, -1.0, 1e-300, 1e-320, plain=((np.float64(1e-3), 1e-3),))
    radius = chosen("1", 1j, np.nan, np.inf, -0.1, 1.5, True, plain=((1, 1.0), (np.float32(0.5), 0.5)))
    add(
        "simulate, in steps",
        lambda **given: seen(fm.simulate(tree, 0.01, "generalised_alpha", samples=3, **given)),
        fixed,
        step=steps,
        spectral_radius=radius,
    )
    outputs = chosen(5, ["nobody"], [None], [])
    by = {"t_end": 0.01, "by": ["gravity_m_s2.0"], "of": ["elbow.rotation"], "samples": 3}
    add("sensitivities", lambda **given: fm.sensitivities(W.scene, **given).derivatives, by,
        by=chosen(None, 5, "elbow", [], ["nobody"], [None]), of=outputs, samples=SAMPLES, **RUN)  # fmt: skip
    scalar = {"t_end": 0.01, "by": ["gravity_m_s2.0"], "of": fm.FinalValue("elbow.rotation")}
    add("gradient", lambda **given: fm.gradient(W.scene, **given).derivatives, scalar,
        by=chosen(None, 5, "elbow", [], ["nobody"], [None]),
        of=chosen(5, [], None, fm.FinalValue("nobody")), **RUN)  # fmt: skip
    doubt = {"given": {"gravity_m_s2.0": 0.1}, "of": ["elbow.rotation"]}
    add("uncertainty", lambda given, of: fm.uncertainty(W.scene, 0.01, given, of, samples=3).sigma, doubt,
        given=chosen(None, 5, {}, {"nobody": 0.1}, {"gravity_m_s2.0": -1.0}, {"gravity_m_s2.0": np.nan}),
        of=outputs)  # fmt: skip
    measured = {"t": [0.0, 0.005, 0.01], "elbow.rotation": [0.3, 0.3, 0.3]}
    measured = {"data": measured, "parameters": ["gravity_m_s2.0"], "sigma": 0.1}
    add("fit", lambda **given: fm.fit(W.scene, max_runs=3, **given).covariance, measured,
        data=chosen(None, 5, {}, {"t": [0.0, 0.01]}, {"t": [0.0, np.nan], "elbow.rotation": [0.3, 0.3]}),
        parameters=chosen(None, 5, [], ["nobody"]), sigma=chosen("1", -1.0, 0.0, np.nan, {"nobody": 1.0}))  # fmt: skip
    asked = {"tolerance": 1e-2, "quantity": "marker:centre.position@1", "t_end": 0.01}
    refused = chosen(*NO_NUMBER, 0.0, -1.0)
    found["advise"] = Call(lambda **given: replace(fm.advise(W.scene, **given), seconds=0.0), asked, {
        "tolerance": chosen(*NO_NUMBER, 0.0, 1.0, -1.0), "t_end": refused, "quantity": chosen("nobody", 5, ("nobody",)),
    })  # fmt: skip
    add(
        "check_scene",
        fm.check_scene,
        {"scene": W.scene, "t_end": 1.0},
        scene=chosen(None, "scene", 1),
        t_end=chosen("1", 1j, np.nan, np.inf, 0.0, -1.0, [1.0], 10**400),
    )
    return found | batch_calls()


def _copying(evaluator: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """Of a function that writes one array: its results are compared."""
    return lambda t, q, u: evaluator(t, q, u).copy()


def seen(run: fm.Trajectory) -> tuple[Any, ...]:
    """Of a run that finished."""
    if not run.finished:
        raise ArithmeticError(run.message)
    return run.q, run.u, run.momentum



# What takes no numbers, and why. Whatever else is public must be among the calls.
INSIDE = {  # of the mechanics, for numbers that have been examined
    "nested_system", "precision_if_doubtful", "observe_recursion", "observe_rates", "observe_motion", "observe_row",
    "check_status", "check_precision", "all_loads", "referred_loads", "with_numbers",
}  # fmt: skip
EXEMPT = {
    *(f"{system}.{name}" for system in ("System", "ClosedSystem") for name in INSIDE),
    "System.workspace", "System.recursion_workspace", "System.composite_workspace", "NestedSystem.workspace",  # nothing
    "Parameters.workspace",  # of a block
    "System.fault_name", "ClosedSystem.fault_name",  # of the status of a kernel
    "Trajectory.columns", "LinearModel.to_scipy", "LinearModel.to_control",  # nothing
    "Trajectory.to_csv", "Trajectory.plot", "Trajectory.to_npz", "Trajectory.to_parquet",  # a path
    "Trajectory.to_rerun",  # a path
    "Trajectory.to_pandas", "Trajectory.to_xarray", "Trajectory.error_estimate",  # nothing
    "Trajectory.section_loads", "Trajectory.loads_in",  # the system's
    "Trajectory.state_at", "Trajectory.values_at", "Trajectory.then",  # a place in a list; a trajectory
    "ControlledDerivatives", "RunStage", "Restart", "EventRecord",  # what runs are given, or give
    "open_loop", "user_function", "no_user_code",  # a scene; a function; nothing
    "ClosedSystem.section_loads", "ClosedSystem.section_load_derivatives",  # the closed chain here has no beam
    "LinearModel.save", "Campbell.plot", "Campbell.to_csv",  # a path
    "ClosedSystem.consistent_inverse_dynamics", "ClosedSystem.modal_residual", "ClosedSystem.applied",  # the tree's
    "ClosedSystem.factorise",
    "ClosedSystem.operators", "ClosedSystem.partitions", "ClosedSystem.nested",  # always refused
    "ClosedSystem.coordinate", "ClosedSystem.speed", "ClosedSystem.state", "ClosedSystem.scene_state",
    "ClosedSystem.evaluator",  # always refused
    "ClosedSystem.workspace", "ClosedSystem.recursion_workspace", "ClosedSystem.composite_workspace",
    "load_scene", "save_scene", "SceneBuilder",  # files and data, checked where they are compiled
    "AccelerationDerivatives", "EvaluationDerivatives", "InverseDynamicsDerivatives",  # results
    "EventSensitivity", "Fit", "Gradient", "Sensitivities", "Uncertainties",  # results
    "FinalValue", "Misfit", "TimeIntegral",  # data, checked by the call of `gradient` and in tests of it
    "Advice", "Campbell", "Evaluation", "LinearModel", "SteadySpin", "System", "Trajectory", "Status",  # results
    "Batch.initial_states", "Batch.tables", "Batch.constants",  # nothing; of those who fill lanes
    "BatchTrajectory",  # a result
    "ClosureError", "DynamicsError", "EquilibriumError", "EventError", "Interrupted",
    "NotDifferentiableError", "PrecisionWarning", "SceneError", "SceneWarning",
}  # fmt: skip
CLASSES = (
    fm.System,
    ClosedSystem,
    NestedSystem,
    MassMatrixFactors,
    Operators,
    fm.Trajectory,
    fm.LinearModel,
    fm.Campbell,
    fm.SteadySpin,
    fm.Batch,
    fm.BatchTrajectory,
)


def _under_a_controller(x: Any) -> Any:
    """Derivatives at states (2,) of a controller."""
    law = fm.Pid(name="law", inputs=("angle",), kp=4.0, ki=2.0, kd=1.0, filter_s=0.1)
    scene = rotor(law)
    found = fm.ControlledMotion(scene).acceleration_derivatives(fm.compile(scene).initial_state, x)
    return found.accelerations, found.rates, found.of_accelerations.by_states


INNER = {  # classes of the mechanics and of runs, which users meet only behind what they are given
    "Closures", "ClosureConstants", "NestedConstants", "DualConstants", "Constants", "Layout", "Timing", "Integration",
    "BodyLink", "FlexibleNode", "HingeKind", "Models", "Observation", "Settings", "Integrator",
    "Restart",  # its files: tests/flexmb/run/test_damaged_restarts.py
}  # fmt: skip
DEEP = 4  # attributes in a row


def reached() -> set[type]:
    """The classes of this library, with public methods, of all that attributes of public objects lead to."""
    tree, state = W.tree, W.state
    roots = (
        tree, W.chain, W.run, W.model, tree.parameters(["gravity_m_s2.0"]), tree.inertia_regressor(),
        tree.factorise(state), tree.operators(state), tree.nested(), tree.evaluator(), tree.derivative_evaluator(),
        tree.section_loads(state, "arm", [0.25]), fm.ControlledMotion(tree),
    )  # fmt: skip
    found: set[type] = set()
    for root in roots:
        _follow(root, found, 0)
    return {each for each in found if _methods(each)}


def _follow(thing: Any, found: set[type], depth: int) -> None:
    if type(thing) in (list, tuple) or isinstance(thing, dict):
        for each in list(thing.values() if isinstance(thing, dict) else thing)[:DEEP]:
            _follow(each, found, depth)
    kind = type(thing)
    inside = kind.__module__.startswith(("flexmb.scene", "flexmb.jit"))  # data; kernels
    if kind in found or inside or not kind.__module__.startswith("flexmb") or depth > DEEP:
        return
    found.add(kind)
    for name in {*dir(kind), *getattr(thing, "__dict__", ())}:
        if not name.startswith("_") and not inspect.isroutine(getattr(kind, name, None)):
            try:
                part = getattr(thing, name)
            except DOCUMENTED:
                continue  # what this object has not
            _follow(part, found, depth + 1)


def _methods(kind: type) -> list[str]:
    return [name for name, _ in inspect.getmembers(kind, inspect.isfunction) if not name.startswith("_")]


def public() -> set[str]:
    """Names of everything public that can be called; of a class, and of those that it leads to, its methods too."""
    found = set(fm.__all__) - set(schema.__all__)
    for each in {*CLASSES, *(kind for kind in reached() if kind.__name__ not in INNER)}:
        found |= {f"{each.__name__}.{name}" for name in _methods(each)}
    return found


def unlisted() -> set[str]:
    """Public names that are neither called nor exempt."""
    return public() - EXEMPT - {name.split(",")[0] for name in calls()}


def arrays_of(result: Any) -> Iterator[np.ndarray]:
    """All numbers in a result."""
    if isinstance(result, np.ndarray | float | int | complex):
        yield np.asarray(result)
    elif isinstance(result, dict):
        for each in result.values():
            yield from arrays_of(each)
    elif isinstance(result, tuple | list):
        for each in result:
            yield from arrays_of(each)
    elif isinstance(result, fm.State):
        yield from (result.q, result.u, np.asarray(result.t))
    elif is_dataclass(result):
        for field in fields(result):
            yield from arrays_of(getattr(result, field.name))


def same(a: Any, b: Any) -> bool:
    """Whether two results hold equal numbers: up to the rounding of what is scaled again."""
    pairs = list(zip(arrays_of(a), arrays_of(b), strict=True))
    return all(x.shape == y.shape and np.allclose(x, y, rtol=1e-9, atol=1e-12) for x, y in pairs)


def finite(result: Any) -> bool:
    return all(np.isfinite(each).all() for each in arrays_of(result))


def faults(name: str, call: Call) -> Iterator[str]:
    """What is not right about a call."""
    first = call.function(**call.arguments)
    if not finite(first):
        yield f"{name}: sound arguments give numbers that are not finite"
    before = bits(first)
    for argument, kind in call.kinds.items():
        for variant in kind(call.arguments[argument]):
            where = f"{name}({argument}: {variant.name})"
            try:
                with np.errstate(all="ignore"):
                    result = call.function(**call.arguments | {argument: variant.value})
            except DOCUMENTED as error:
                if variant.plain is not None and not raises(call, argument, variant.plain):
                    yield f"{where}: refused, {type(error).__name__}: {error}"
            except BaseException as error:  # an error of another kind
                yield f"{where}: {type(error).__name__}: {error}"
            else:
                if variant.plain is None and not variant.open:
                    yield f"{where}: no error"
                elif not finite(result) and not (isinstance(result, tuple) and is_status(result)):
                    yield f"{where}: not finite"
                elif variant.plain is not None and not same(
                    result, call.function(**call.arguments | {argument: variant.plain})
                ):
                    yield f"{where}: another result than that of floats"
        try:
            if bits(call.function(**call.arguments)) != before:
                yield f"{name}: after wrong values of {argument} the right ones give other numbers"
        except Exception as error:
            yield f"{name}: after wrong values of {argument} the right ones give {type(error).__name__}: {error}"


def bits(result: Any) -> list[bytes]:
    """All numbers in a result, to be compared to the bit."""
    return [each.tobytes() for each in arrays_of(result)]


def is_status(result: tuple[Any, ...]) -> bool:
    """A status that is not OK says that numbers mean nothing."""
    return isinstance(result[0], int) and result[0] != 0


def raises(call: Call, argument: str, value: Any) -> bool:
    try:
        call.function(**call.arguments | {argument: value})
    except DOCUMENTED:
        return True
    return False


def main() -> None:
    faulthandler.enable()
    found = [f"{name}: public, and not called" for name in sorted(unlisted())]
    count = 0
    for name, call in calls().items():
        print(name, file=sys.stderr, flush=True)
        found += faults(name, call)
        count += sum(len(list(kind(call.arguments[argument]))) for argument, kind in call.kinds.items())
    print("\n".join(found))
    print(f"{count} calls, {len(found)} faults")


if __name__ == "__main__":
    main()
