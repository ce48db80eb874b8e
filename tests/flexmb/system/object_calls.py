"""What the objects can be asked that systems and runs give: each object is one for all who ask."""

from __future__ import annotations

import inspect
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import flexmb as fm
from flexmb.scene.shapes import beam_section
from tests.flexmb.control.scenes import rotor
from tests.flexmb.linear.truss import guided
from tests.flexmb.system.argument_kinds import (
    Calls,
    Variant,
    World,
    attributes,
    but_columns,
    but_none,
    chosen,
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
    wrong_only_number,
)  # fmt: skip

SEQUENCES = chosen(None, 5, "", "zy", "zyxz", "abc", "zzx", ["z", "y"])
NO_MAPPING = chosen("x", 5, [], [1.0], np.zeros(2), {"nobody": 1.0}, {"elbow"})


def of_objects(w: World) -> Calls:
    """Of all of them."""
    linear = _of_linear_models(w) | _of_sampled_loops(w)
    return Calls(_of_algorithms(w) | _of_parameters(w) | linear | _of_controlled(w) | _of_runs(w))


def _of_algorithms(w: World) -> Calls:
    """Factors, operators, the elimination of rigid motion."""
    tree, state, rates, found = w.tree, w.state, w.rates, Calls()
    nested, factors, operators = tree.nested(), tree.factorise(state), tree.operators(state)
    for name in ("accelerations", "motion", "reduced", "partitions", "relative_motion"):
        found.add(f"NestedSystem.{name}", getattr(nested, name), {"t": 0.5, "y": w.y}, t=numbers, y=quaternion_first)
    found.add("MassMatrixFactors, attributes", lambda: attributes(factors))
    for name in ("solve", "half_solve", "half_multiply", "multiply"):
        function = getattr(factors, name)
        argument, columns = next(iter(inspect.signature(function).parameters)), np.stack([rates, -rates], 1)
        found.add(f"MassMatrixFactors.{name}", function, {argument: rates}, **{argument: but_columns(vectors)})
        found.add(f"MassMatrixFactors.{name}, columns", function, {argument: columns}, **{argument: matrices})
    found.add("Operators, attributes", lambda: attributes(operators))
    for name in ("alpha_m", "f_m", "inverse_dynamics", "accelerations"):
        function = getattr(operators, name)
        argument = next(iter(inspect.signature(function).parameters))
        found.add(f"Operators.{name}", function, {argument: rates}, **{argument: vectors})
    found.add("Operators.driven", operators.driven, {"prescribed": rates < 2.0, "rates": rates}, lambda it: it.a_m,
              prescribed=chosen(None, rates, [True], np.ones(10**5, bool), "no", rates.astype(int)),
              rates=vectors)  # fmt: skip
    return found


def _of_parameters(w: World) -> Calls:
    """Derivatives by parameters, regressors of inertia."""
    tree, state, rates, found = w.tree, w.state, w.rates, Calls()
    by, regressor = tree.parameters(["gravity_m_s2.0"]), tree.inertia_regressor()
    of_rates = {"state": state, "accelerations": rates}
    for name in ("accelerations", "loads", "evaluate"):
        found.add(f"Parameters.{name}", getattr(by, name), {"state": state}, state=states)
    found.add("Parameters.slopes", by.slopes, {"t": 0.5, "y": w.y, "dy": np.ones((len(w.y), 1))}, t=numbers,
              y=quaternion_first, dy=matrices)  # fmt: skip
    found.add("Parameters.inverse_dynamics", by.inverse_dynamics, of_rates, state=states, accelerations=vectors)
    found.add("InertiaRegressor, attributes", lambda: attributes(regressor))
    for name in ("at", "rest"):
        found.add(f"InertiaRegressor.{name}", getattr(regressor, name), of_rates, state=states, accelerations=vectors)
    for name in ("stacked", "base"):
        found.add(f"InertiaRegressor.{name}", getattr(regressor, name),
                  {"states": [state], "accelerations": rates[None]},
                  states=chosen(None, [], 5, [None], [state, state], ["state"]),
                  accelerations=chosen(None, [], 5, [None], rates, [rates[:-1]], [rates + np.nan]))  # fmt: skip
    random = np.random.default_rng(0)
    many = [tree.state(state.q, random.normal(size=tree.nu), 0.5) for _ in range(12)]
    motions = random.normal(size=(len(many), tree.nu))
    base, Y = regressor.base(many, motions), single(regressor.stacked(many, motions))
    found.add("BaseParameters.reduced", base.reduced, {"Y": Y}, Y=_wide)
    tau = single(random.normal(size=len(Y)))
    found.add("BaseParameters.fit", base.fit, {"Y": Y, "tau": tau}, Y=matrices, tau=vectors)
    return found


def single(x: np.ndarray) -> np.ndarray:
    """Numbers that single precision holds too."""
    return x.astype(np.float32).astype(float)


def _wide(Y: np.ndarray) -> Iterator[Variant]:
    """Of a regressor, which may have any number of rows."""
    yield from (matrix for matrix in matrices(Y) if matrix.name not in ("short", "very long", "3-D", "empty", "huge"))
    yield Variant("narrow", Y[:, :-1])
    yield Variant("one row", Y[0], Y[0])


def _of_linear_models(w: World) -> Calls:
    """Linear models, equilibria, steady spins and what they give."""
    tree, state, model, found = w.tree, w.state, w.model, Calls()
    found.add("linearize", fm.linearize, {"system": tree, "state": state}, lambda it: it.A, system=systems,
              state=but_none(states))  # fmt: skip
    found.add("equilibrium", fm.equilibrium, {"system": tree, "guess": state}, system=systems, guess=but_none(states))
    pushed = {"scene": guided(), "number": "loads.push.function.value", "values": np.array([0.0, 1.0])}
    found.add("equilibrium_path", fm.equilibrium_path, pushed, lambda it: (it.values, it.states), number=names,
              scene=chosen(None, "scene.toml", 1, fm.System, tree), values=series)  # fmt: skip
    found.add("EquilibriumPath.at", fm.equilibrium_path(**pushed).at, {"value": 1}, value=wrong_only_number)
    found.add("steady_spin", fm.steady_spin, {"system": tree, "hinge": "rotor", "rate": 0.5, "guess": state},
              lambda it: it.state, system=systems, hinge=names, rate=numbers, guess=but_none(states))  # fmt: skip
    found.add("campbell", fm.campbell, {"system": tree, "hinge": "rotor", "rates": np.array([0.5, 1.0])},
              lambda it: it.eigenvalues, system=systems, hinge=names, rates=series)  # fmt: skip
    _of_random_vibration(found)
    found.add("base_excitation", fm.base_excitation, {"system": tree, "state": state}, lambda it: it.model.A,
              system=systems, state=but_none(states))  # fmt: skip
    spin, diagram = fm.steady_spin(tree, "rotor", 0.5), fm.campbell(tree, "rotor", np.array([0.5, 1.0]))
    found.add("SteadySpin.linearize", spin.linearize, {}, lambda it: it.A)
    found.add("Campbell, attributes", lambda: attributes(diagram))
    found.add("Campbell.to_csv", lambda: written(diagram.to_csv, "diagram.csv"))
    found.add("LinearModel, attributes", lambda: attributes(model))
    asked = {"input": model.inputs[-1][0], "omega": np.array([2.0, 3.0]), "outputs": ("centre.x",)}
    found.add("LinearModel.frequency_response", model.frequency_response, asked, input=names, omega=series,
              outputs=chosen(("nobody",), (None,), 5))  # fmt: skip
    found.add("LinearModel.displacements_by", model.displacements_by, {"names": model.displacements[:2]},
              names=chosen(("nobody",), (None,), 5))  # fmt: skip
    mode = w.modes[-1]
    found.add("LinearModel.marker_shape", model.marker_shape, {"mode": mode, "marker": "centre"}, mode=not_a_mode,
              marker=names)  # fmt: skip
    found.add("LinearModel.displaced", model.displaced, {"mode": mode, "size": 0.5, "phase": 0.5}, mode=not_a_mode,
              size=numbers, phase=numbers)  # fmt: skip
    for name in ("to_scipy", "to_control"):
        found.add(f"LinearModel.{name}", installed(getattr(model, name)), {},
                  lambda it: it if isinstance(it, str) else (it.A, it.B, it.C, it.D))  # fmt: skip
    found.add("LinearModel.save", lambda: written(model.save, "model.npz"))
    return found


def _of_random_vibration(found: Calls) -> None:
    """Of a beam on the ground, which is damped: only such has a response that is stationary."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    modes = fm.Modes(count=2, families=("bending_y",), damping_ratio=0.02)
    builder = fm.SceneBuilder("mast").beam("mast", length=2.0, elements=4, section=section, modes=modes)
    scene = builder.weld("root", "ground", "mast").scene()
    shaken, points = fm.base_excitation(scene), np.array([[1.0, 2.0], [30.0, 1.0]])
    asked = {"model": shaken.model, "densities": {"base.y": points}, "outputs": ("load:root.force.y",)}
    density, response = fm.SpectralDensity.of(points), fm.random_response(**asked)
    found.add("BaseExcitation, attributes", lambda: attributes(shaken))
    found.add("BaseModes, attributes", lambda: attributes(shaken.modes))
    found.add("BaseModes.factors_about", shaken.modes.factors_about, {"point": np.array([0.0, 1.0, 2.0])},
              point=vectors)  # fmt: skip
    found.add("random_response", fm.random_response, asked, lambda it: it.rms,
              model=chosen(None, "x", 5), densities=NO_MAPPING, outputs=chosen(("nobody",), (None,), 5))  # fmt: skip
    for name in ("of", "in_g"):
        found.add(f"SpectralDensity.{name}", getattr(fm.SpectralDensity, name), {"points": points},
                  lambda it: it.values, points=chosen(None, "x", 5, points[:, 0], points[:1], -points))  # fmt: skip
    found.add("SpectralDensity.at", density.at, {"frequencies_hz": np.array([2.0, 3.0])}, frequencies_hz=series)
    found.add("SpectralDensity, attributes", lambda: attributes(density))
    found.add("RandomResponse, attributes", lambda: attributes(response))
    found.add("RandomResponse.density", response.density, {"frequencies_hz": np.array([2.0, 3.0])},
              frequencies_hz=series)  # fmt: skip
    found.add("RandomResponse.plot", lambda: written(response.plot, "response.png"))
    found.add("RandomResponse.to_csv", lambda: written(response.to_csv, "response.csv"))


def _of_sampled_loops(w: World) -> Calls:
    """Models over a period, the loops that they open, and maps of stability."""
    tree, state, found = w.tree, w.state, Calls()
    found.add("linearize_sampled", fm.linearize_sampled, {"system": tree, "period": 0.5, "state": state},
              lambda it: it.A, system=systems, period=numbers, state=but_none(states))  # fmt: skip
    law = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-3.0, -4.0),), period_s=0.25, delay_s=0.125)
    scene = rotor(law)
    model = fm.linearize_sampled(scene)
    loop, values = model.opened("law"), {"law.delay_s": np.array([0.0, 0.125]), "law.period_s": np.array([0.25])}
    found.add("SampledModel, attributes", lambda: attributes(model))
    found.add("SampledModel.opened", model.opened, {"signal": "law"}, lambda it: it.A, signal=names)
    found.add("SampledModel.to_control", installed(model.to_control), {},
              lambda it: it if isinstance(it, str) else (it.A, it.B, it.C, it.D))  # fmt: skip
    found.add("SampledModel.save", lambda: written(model.save, "model.npz"))
    found.add("LoopTransfer, attributes", lambda: (loop.grid, loop.gain_crossings, loop.gain_margin))
    found.add("LoopTransfer, called", loop, {"omega": np.array([2.0, 3.0])}, omega=series)
    asked = {"scene": scene, "values": values}
    found.add("stability_map", fm.stability_map, asked, lambda it: it.size,
              scene=chosen(None, "scene.toml", 1, fm.System, tree), values=NO_MAPPING)  # fmt: skip
    diagram = fm.stability_map(**asked)
    found.add("MultiplierMap, attributes", lambda: (diagram.size, diagram.stable))
    found.add("MultiplierMap.to_csv", lambda: written(diagram.to_csv, "map.csv"))
    return found


def _of_controlled(w: World) -> Calls:
    """Motion under controllers, and what stays without one."""
    tree, state, found = w.tree, w.state, Calls()
    motion = fm.ControlledMotion(tree)
    found.add("ControlledMotion", fm.ControlledMotion, {"system": tree},
              lambda it: it.acceleration_derivatives(state).motion, system=systems)  # fmt: skip
    for name in ("acceleration_derivatives", "evaluation_derivatives", "initial_states"):
        found.add(f"ControlledMotion.{name}", getattr(motion, name), {"state": state, "held": {}}, state=states,
                  held=NO_MAPPING)  # fmt: skip
    law = fm.Pid(name="law", inputs=("angle",), kp=4.0, ki=2.0, kd=1.0, filter_s=0.1)
    scene = rotor(law)
    start, controlled = fm.compile(scene).initial_state, fm.ControlledMotion(scene)
    found.add("ControlledMotion.acceleration_derivatives, states",
              lambda x: controlled.acceleration_derivatives(start, x), {"x": np.array([0.5, -1.0])},
              lambda it: (it.accelerations, it.rates, it.of_accelerations.by_states), x=but_none(vectors))  # fmt: skip
    return found


def _of_runs(w: World) -> Calls:
    """Runs, what they are written to, and loads in sections."""
    tree, state, run, found = w.tree, w.state, w.run, Calls()
    found.add("Trajectory, attributes", lambda: attributes(run))
    found.ask(run, "columns", "error_estimate", "loads_in")
    found["Trajectory.columns"].look = list
    found.add("Trajectory.envelope", lambda: run.envelope, {},
              lambda it: [each.greatest for name, _, each in it.channels if not name.endswith("]")])  # fmt: skip
    found.add("Envelope.to_csv", lambda: written(run.envelope.to_csv, "envelope.csv"))
    found.add("Trajectory.loads_in, outboard", lambda: run.loads_in("outboard"))
    hinge = tree.scene.hinges[0]
    found.add("Trajectory.total_load", lambda: run.total_load([hinge.name], hinge.child))
    found.add("Trajectory.section_loads", lambda: run.section_loads("arm", [0.0, 0.25]))
    found.add("Trajectory.state_at", lambda: run.state_at(1))
    found.add("Trajectory.values_at", lambda: run.values_at(1))
    later = fm.simulate(tree, 0.02, t_start=0.01, state=run.last_state, samples=3)
    found.add("Trajectory.then", lambda: run.then(later), {}, lambda it: (it.t, it.q, it.u, it.energy))
    for name, file in {"to_csv": "run.csv", "to_npz": "run.npz", "to_parquet": "run.parquet"}.items():
        write = installed(getattr(run, name))
        found.add(f"Trajectory.{name}", lambda write=write, file=file: written(write, file))
    found.add("Trajectory.to_pandas", installed(run.to_pandas), {},
              lambda it: it if isinstance(it, str) else it.to_numpy())  # fmt: skip
    found.add("Trajectory.to_xarray", installed(run.to_xarray), {},
              lambda it: it if isinstance(it, str) else {name: it[name].to_numpy() for name in it})  # fmt: skip
    path = run.markers["centre"]
    found.add("MarkerPath.angles", path.angles, {"sequence": "zyx"}, lambda it: it.values,
              sequence=SEQUENCES)  # fmt: skip
    stresses = tree.section_loads(state, "arm", [0.25])
    found.add("SectionLoads.normal_stress", stresses.normal_stress, {"E": 7e10, "y": 0.1, "z": 0.1},
              E=wrong_only_number, y=wrong_only_number, z=wrong_only_number)  # fmt: skip
    found.add("SectionLoads.torsion_stress", stresses.torsion_stress, {"G": 2.7e10, "r": 0.1}, G=wrong_only_number,
              r=wrong_only_number)  # fmt: skip
    sensed = fm.sensitivities(w.scene, 0.01, by=["gravity_m_s2.0"], of=["elbow.rotation"], samples=3)
    found.add("Sensitivities.derivative", sensed.derivative,
              {"output": "elbow.rotation", "parameter": "gravity_m_s2.0"}, output=names, parameter=names)  # fmt: skip
    gradient = fm.gradient(w.scene, 0.01, by=["gravity_m_s2.0"], of=fm.FinalValue("elbow.rotation"))
    found.add("Gradient.derivative", gradient.derivative, {"parameter": "gravity_m_s2.0"}, parameter=names)
    mass, evaluation = tree.mass_properties(state), tree.evaluate(state.t, state.q, state.u)
    found.add("MassProperties, attributes", lambda: attributes(mass))
    found.add("MassProperties.about", mass.about, {"point": np.array([0.25, 0.5, 1.0])}, point=vectors)
    found.add("MarkerMotion.angles", evaluation.markers["centre"].angles, {"sequence": "zyx"}, lambda it: it.values,
              sequence=SEQUENCES)  # fmt: skip
    of_state: dict[str, Any] = {"q": state.q.copy(), "u": state.u.copy(), "t": 0.5}
    found.add("State", fm.State, of_state, q=rows, u=rows, t=numbers)
    return found


def installed(function: Callable[..., Any]) -> Callable[..., Any]:
    """What it gives, or what it says where a library is not installed."""

    def asked(*given: Any) -> Any:
        try:
            return function(*given)
        except ImportError as missing:
            return str(missing)

    return asked


def written(write: Callable[[Path], Any], name: str) -> bytes:
    """A file in a folder that nobody else has."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, name)
        write(file)
        return file.read_bytes() if file.exists() else b""
