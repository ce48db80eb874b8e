"""Everything that public calls give and take, with a part of it altered. Run as a program: prints what is not right.

An object that is made by the library can be altered by `dataclasses.replace`, or its arrays in place. What works with
it must raise one of the documented errors, or give what the sound object gives (it does not look at that part); of a
part that is not finite the result may not be finite either. It must never crash, nor give other finite numbers.
"""

from __future__ import annotations

import faulthandler
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import flexmb as fm
from tests.flexmb.system.argument_kinds import W, closed_states, seen, states
from tests.flexmb.system.public_calls import DOCUMENTED, calls, finite, same

Change = Callable[[Any], Any]
"""From a sound object to one that is not, or an error where it cannot be had."""


@dataclass
class Kind:
    """A kind of objects: a sound one, what may be wrong with one by name, and what works with one by name."""

    sound: Any
    changes: dict[str, Change]
    uses: dict[str, Callable[[Any], Any]]


# Alterations


def arrays(v: np.ndarray) -> Iterator[tuple[str, Any]]:
    """What may stand in the place of an array."""
    yield from {
        "short": v[:-1], "long": np.concatenate([v, v]), "very long": np.zeros((10**4, *v.shape[1:])), "empty": v[:0],
        "a column": v[..., None], "in a list": v[None], "complex": v + 1j, "objects": v.astype(object),
        "text": v.astype(str), "masked": np.ma.array(v, mask=True), "NaN": v + np.nan, "infinite": v + np.inf,
        "one number": 1.0, "None": None, "a list": [[1.0], [1.0, 2.0]],
    }.items()  # fmt: skip
    if v.ndim > 1:
        yield "narrow", v[..., :-1]
        yield "wide", np.concatenate([v, v], axis=-1)
        if v.shape[0] != v.shape[1]:
            yield "transposed", v.T


IN_PLACE: dict[str, Callable[[np.ndarray], None]] = {
    "as a column": lambda v: setattr(v, "shape", (*v.shape, 1)),
    "in a row": lambda v: setattr(v, "shape", (1, *v.shape)),
    "of halves": lambda v: setattr(v, "dtype", np.float32),
}


def of_array(name: str) -> dict[str, Change]:
    """Of a field of a dataclass."""

    def other(value: Any) -> Change:
        return lambda found: replace(found, **{name: value(getattr(found, name))})

    def in_place(alter: Callable[[np.ndarray], None]) -> Change:
        def change(found: Any) -> Any:
            found = replace(found, **{name: getattr(found, name).copy()})
            alter(getattr(found, name))
            return found

        return change

    def variant(kind: str) -> Callable[[np.ndarray], Any]:
        return lambda v: dict(arrays(v))[kind]

    kinds = [kind for kind, _ in arrays(np.zeros((2, 3)))]
    changes = {f"{name}: {kind}": other(variant(kind)) for kind in kinds}
    return changes | {f"{name}: {kind}, in place": in_place(alter) for kind, alter in IN_PLACE.items()}


def of_arrays(*names: str) -> dict[str, Change]:
    return {kind: change for name in names for kind, change in of_array(name).items()}


def of_entries(field: str) -> dict[str, Change]:
    """Of the first array of a field that holds arrays by name: the dictionary itself is altered too."""

    def other(kind: str) -> Change:
        def change(found: Any) -> Any:
            held = getattr(found, field)
            name = next(iter(held))
            return replace(found, **{field: held | {name: dict(arrays(held[name]))[kind]}})

        return change

    def in_place(kind: str) -> Change:
        def change(found: Any) -> Any:
            found = replace(found, **{field: dict(getattr(found, field))})
            held = getattr(found, field)
            name = next(iter(held))
            held[name] = dict(arrays(held[name]))[kind]
            return found

        return change

    kinds = [kind for kind, _ in arrays(np.zeros((2, 3)))]
    changes = {f"{field}: {kind}": other(kind) for kind in kinds}
    changes |= {f"{field}: {kind}, in place": in_place(kind) for kind in kinds}
    return changes | {f"{field}: None": lambda found: replace(found, **{field: None})}


def of_values(name: str, *values: Any) -> dict[str, Change]:
    def other(value: Any) -> Change:
        return lambda found: replace(found, **{name: value})

    return {f"{name}: {str(value)[:40]}": other(value) for value in values}


# Objects


def state_kinds(thorough: bool) -> dict[str, Kind]:
    """Every call that takes a state, with every state that is half right."""
    other = W.chain.layout
    changes = of_arrays("q", "u") | of_values("t", np.nan, np.inf, None, "1", 1j, [0.0]) | of_values("layout", other, 5)
    changes |= {
        "both short": lambda state: replace(state, q=np.zeros(1), u=np.zeros(1)),
        "both long": lambda state: replace(state, q=np.zeros(10**5), u=np.zeros(10**5)),
        "y: in place": lambda state: _altered(state.y, state),
        "base: in place": lambda state: _altered(state.q.base, state),
        "no orientation": lambda state: _filled(state, 0.0), "NaN in place": lambda state: _filled(state, np.nan),
    }  # fmt: skip
    found = {}
    for sound, kind in ((W.state, states), (W.chain.initial_state, closed_states)):
        uses = {}
        for name, call in calls().items():
            for argument in ("state", "guess"):
                if argument in call.kinds and call.arguments[argument].layout is sound.layout:
                    uses[name] = _with(call, argument)
        found["State" if kind is states else "State of a chain"] = Kind(sound, changes, uses)
    if not thorough:
        for kind in found.values():
            kind.uses = {name: use for name, use in kind.uses.items() if name.split(",")[0] not in SLOW}
    return found


SLOW = {"equilibrium", "steady_spin", "linearize", "simulate"}


def _with(call: Any, argument: str) -> Callable[[Any], Any]:
    return lambda state: call.function(**call.arguments | {argument: state})


def _altered(array: np.ndarray, state: fm.State) -> fm.State:
    array.shape = (1, -1)
    return state


def _filled(state: fm.State, value: float) -> fm.State:
    state = replace(state)
    state.q[:] = value
    return state


def trajectory_kind(thorough: bool) -> Kind:
    run = fm.simulate(W.tree, 0.01, samples=3)
    later = fm.simulate(W.tree, 0.02, samples=3, state=run.last_state)
    others = fm.simulate(W.chain, 0.01, samples=3)
    uses: dict[str, Callable[[Any], Any]] = {
        "columns": lambda each: [values for _, _, values in each.columns()],
        "then": lambda each: _numbers(each.then(later)), "after": lambda each: _numbers(run.then(each)),
        "loads_in": lambda each: each.loads_in("inboard"),
        "section_loads": lambda each: each.section_loads("arm", [0.1]).load,
        "state_at": lambda each: each.state_at(1), "values_at": lambda each: each.values_at(1),
        "last_state": lambda each: W.tree.momentum(each.last_state), "total_energy": lambda each: each.total_energy,
        "energy_drift": lambda each: each.energy_drift, "energy_scale": lambda each: each.energy_scale,
        "momentum_drift": lambda each: each.momentum_drift,
        "to_csv": lambda each: _written(each.to_csv, "run.csv"),
        "to_npz": lambda each: _written(each.to_npz, "run.npz"),
    }  # fmt: skip
    if thorough:
        uses |= {
            "error_estimate": lambda each: each.error_estimate(), "plot": lambda each: _written(each.plot, "charts"),
            "envelope": lambda each: each.envelope.u.greatest,
            "to_pandas": lambda each: each.to_pandas().values, "to_xarray": lambda each: each.to_xarray().sizes["t"],
        }  # fmt: skip
    changes = of_arrays("t", "q", "u", "momentum", "work")
    for field in ("loads", "wheel_loads", "energy"):
        changes |= of_entries(field)
    for part in ("position", "quaternion", "velocity", "acceleration"):
        for kind, change in of_array(part).items():
            changes[f"markers, {kind}"] = _in_marker(change)
    changes |= of_values("q_names", run.q_names[:-1], ()) | of_values("u_names", run.u_names * 2)
    changes |= of_values("made_by", others.made_by, None, 5, replace(run.made_by, system=W.renamed))
    changes |= of_values("markers", {"centre": None}, None) | of_values("drives", {"arm": np.zeros(7)})
    return Kind(run, changes, uses)


def _in_marker(change: Change) -> Change:
    return lambda run: replace(run, markers={name: change(path) for name, path in run.markers.items()})


def _numbers(run: fm.Trajectory) -> tuple[Any, ...]:
    return run.t, run.q, run.u, run.momentum, run.work, run.energy, run.loads, run.markers


def _written(write: Callable[[Path], Any], name: str) -> float:
    """Whether it could; what is in the file is for other tests."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
    return 1.0


def restart_kind(_: bool) -> Kind:
    first = fm.simulate(W.tree, 0.01, samples=3).restart
    assert first is not None
    changes = of_values("t", np.nan, -1.0, None, "1") | of_values("method", "euler", "rk4", None)
    changes |= of_values("scene", None, W.chain.scene) | of_values("controllers", (), 5) | of_values("memory", None, ())
    for part in ("numbers", "y"):
        for kind, _ in arrays(np.zeros(2)):
            changes[f"{part}: {kind}"] = _in_memory(part, kind)
        for kind, alter in IN_PLACE.items():
            changes[f"{part}: {kind}, in place"] = _in_memory_in_place(part, alter)
    return Kind(first, changes, {
        "simulate": lambda each: seen(fm.simulate(W.tree, 0.02, samples=3, state=each)),
        "save, load": lambda each: _saved(each),
    })  # fmt: skip


def _in_memory(part: str, kind: str) -> Change:
    def change(restart: fm.Restart) -> fm.Restart:
        value = dict(arrays(getattr(restart.memory, part)))[kind]
        return replace(restart, memory=restart.memory._replace(**{part: value}))

    return change


def _in_memory_in_place(part: str, alter: Callable[[np.ndarray], None]) -> Change:
    def change(restart: fm.Restart) -> fm.Restart:
        own = getattr(restart.memory, part).copy()
        alter(own)
        return replace(restart, memory=restart.memory._replace(**{part: own}))

    return change


def _saved(restart: fm.Restart) -> tuple[Any, ...]:
    with tempfile.TemporaryDirectory() as folder:
        restart.save(Path(folder) / "restart.npz")
        return seen(fm.simulate(W.tree, 0.02, samples=3, state=fm.Restart.load(Path(folder) / "restart.npz")))


def linear_kinds(thorough: bool) -> dict[str, Kind]:
    model = W.model
    mode = model.modes[-1]
    name = model.inputs[0][0]
    uses = {
        "displacements_by": lambda each: each.displacements_by(model.displacements[:2]),
        "eigenvalues": lambda each: each.eigenvalues, "modes": lambda each: [m.shape for m in each.modes],
        "stability": lambda each: each.stability.tolerance, "rigid_body_shapes": lambda each: each.rigid_body_shapes,
        "frequency_response": lambda each: each.frequency_response(name, [2.0, 3.0]),
        "marker_shape": lambda each: each.marker_shape(mode, "centre"),
        "displaced": lambda each: each.displaced(mode, 0.5), "to_scipy": lambda each: each.to_scipy().A,
        "save": lambda each: _written(each.save, "model.npz"),
    }  # fmt: skip
    changes = of_arrays("A", "B", "C", "D", "mass", "motion", "rates", "drift")
    changes |= of_values("states", model.states[:-1], ()) | of_values("outputs", model.outputs * 2)
    changes |= of_values("inputs", ()) | of_values("state", None, 5, fm.State([], []))
    by_mode = {
        "marker_shape": lambda each: model.marker_shape(each, "centre"),
        "displaced": lambda each: model.displaced(each, 0.5),
    }
    spin = fm.steady_spin(W.tree, "rotor", 0.5)
    of_spin = of_values("state", None, W.chain.initial_state, W.renamed.initial_state, fm.State([], []), 5)
    of_spin |= of_values("equations", None, W.tree)
    of_spin |= {f"state, {kind}": _in_state(change) for kind, change in of_arrays("q", "u").items()}
    found = {
        "LinearModel": Kind(model, changes, uses),
        "Mode": Kind(mode, _but_complex(of_arrays("shape")), by_mode),
        "SteadySpin": Kind(spin, of_spin, {"linearize": lambda each: each.linearize().A}),
    }
    if thorough:
        diagram = fm.campbell(W.tree, "rotor", [0.5, 1.0])
        found["Campbell"] = Kind(diagram, _but_complex(of_arrays("rates", "eigenvalues", "mac")), {
            "to_csv": lambda each: _written(each.to_csv, "spins.csv"),
            "plot": lambda each: _written(each.plot, "spins.png"),
        })  # fmt: skip
    return found


def _in_state(change: Change) -> Change:
    return lambda spin: replace(spin, state=change(spin.state))


def _but_complex(changes: dict[str, Change]) -> dict[str, Change]:
    """Of arrays that are complex."""
    return {kind: change for kind, change in changes.items() if "complex" not in kind and "halves" not in kind}


def other_kinds(_: bool) -> dict[str, Kind]:
    loads = W.tree.section_loads(W.state, "arm", [0.1, 0.2])
    runs = fm.simulate_batch(W.tree, 0.01, "rk4", step=5e-3, samples=2, q=np.array([W.state.q] * 3))
    path = fm.simulate(W.tree, 0.01, samples=3).markers["centre"]
    of_runs = of_arrays("t", "q", "u", "work")
    of_runs |= {kind: change for kind, change in of_array("stopped_at").items() if not _is_not_finite(kind)}
    of_runs |= {kind: change for kind, change in of_arrays("status", "fault").items() if "infinite" not in kind}
    of_runs |= of_values("status", np.full(3, 99), np.full(3, -1)) | of_values("batch", None, W.tree, W.chain.batch)
    of_runs |= of_values("fault", np.full(3, 99)) if runs.failed.size else {}
    of_loads = of_arrays("x", "load", "EA", "EIy", "EIz", "GJ")
    for kind in ("load: in a list", "load: in a row, in place"):  # loads of one time are loads too
        del of_loads[kind]
    return {
        "SectionLoads": Kind(loads, of_loads, {
            "normal_stress": lambda each: each.normal_stress(7e10, 0.01, 0.02),
            "torsion_stress": lambda each: each.torsion_stress(3e10, 0.01),
        }),
        "BatchTrajectory": Kind(runs, of_runs, {"message": lambda each: len(each.message(1))}),
        "MarkerPath": Kind(path, of_arrays("quaternion"), {"angles": lambda each: each.angles("zyx").values}),
    }  # fmt: skip


class Kinds:
    """All of them; `thorough` with what takes its time."""

    def __init__(self, thorough: bool) -> None:
        self._thorough = thorough

    @cached_property
    def all(self) -> dict[str, Kind]:
        return {
            **state_kinds(self._thorough), "Trajectory": trajectory_kind(self._thorough),
            "Restart": restart_kind(self._thorough), **linear_kinds(self._thorough), **other_kinds(self._thorough),
        }  # fmt: skip


SHARE = 3
"""Unless there is time, one in so many of the uses of what is altered in one way is tried."""


def faults(name: str, kind: Kind, thorough: bool = True) -> Iterator[str]:
    """What is not right about objects of a kind."""
    expected = {use: work(kind.sound) for use, work in kind.uses.items()}
    for i, (altered, change) in enumerate(kind.changes.items()):
        for use, work in tried(kind, i, thorough).items():
            where = f"{use}({name}, {altered})"
            print(where, file=sys.stderr, flush=True)
            try:
                with np.errstate(all="ignore"):
                    result = work(change(kind.sound))
            except DOCUMENTED as error:
                if not str(error).strip():
                    yield f"{where}: refused without a word"
                continue
            except BaseException as error:  # an error of another kind
                yield f"{where}: {type(error).__name__}: {error}"
                continue
            if not _agree(result, expected[use]) and (finite(result) or not _is_not_finite(altered)):
                yield f"{where}: another result than that of the sound one"


def tried(kind: Kind, i: int, thorough: bool) -> dict[str, Callable[[Any], Any]]:
    """Uses that the change of this number is tried with."""
    return kind.uses if thorough else dict(list(kind.uses.items())[i % SHARE :: SHARE])


def _is_not_finite(altered: str) -> bool:
    return "NaN" in altered or "infinite" in altered


def _agree(result: Any, expected: Any) -> bool:
    try:
        return same(result, expected)
    except ValueError:  # another number of arrays
        return False


def main() -> None:
    faulthandler.enable()
    found, count, thorough = list[str](), 0, "--thorough" in sys.argv
    for name, kind in Kinds(thorough).all.items():
        found += faults(name, kind, thorough)
        count += sum(len(tried(kind, i, thorough)) for i in range(len(kind.changes)))
    print("\n".join(found))
    print(f"{count} calls, {len(found)} faults")


if __name__ == "__main__":
    main()
