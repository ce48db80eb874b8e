"""Every public call, and everything that can be wrong with its arguments. Run as a program: prints what is not right.

A call with one argument exchanged may raise one of the documented errors, or return what it returns for the same
numbers as plain floats; never crash, and never return numbers that are not finite. What is not to be had must raise.
"""

from __future__ import annotations

import faulthandler
import inspect
import pickle
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import msgspec
import numpy as np

import flexmb as fm
from flexmb.frisch.nested_system import NestedSystem
from flexmb.jain.operators import Operators
from flexmb.scene import schema
from flexmb.scene.shapes import beam_section
from flexmb.system.closed import ClosedSystem
from flexmb.system.factors import MassMatrixFactors

# SceneError, ClosureError, LinAlgError are among the former; KeyError is of names that do not exist.
DOCUMENTED = (ValueError, TypeError, KeyError, ArithmeticError, NotImplementedError)
SECTION = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=1.7e-10, Iz=1.7e-10, rho=2700.0)


class World:
    """A tree with a quaternion, a flexible body and a wheel, a closed chain, and what is made of them."""

    @cached_property
    def scene(self) -> schema.Scene:
        builder = fm.SceneBuilder("hub").rigid_body("hub", mass=2.0, inertia=(0.1, 0.1, 0.1))
        builder.spherical("ball", "ground", "hub").marker("centre", "hub")
        builder.wheel("rotor", "hub", axis=(0.0, 0.0, 1.0), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3)
        builder.beam("arm", length=0.5, elements=2, section=SECTION, modes=2, level="linear")
        return builder.revolute("elbow", "hub", "arm", angle=0.25).scene()

    @cached_property
    def tree(self) -> fm.System:
        return fm.compile(self.scene)

    @cached_property
    def renamed(self) -> fm.System:
        """Another system with as many coordinates."""
        names = {"elbow": "knee", "ball": "socket"}
        hinges = tuple(msgspec.structs.replace(each, name=names[each.name]) for each in self.scene.hinges)
        return fm.compile(msgspec.structs.replace(self.scene, hinges=hinges))

    @cached_property
    def chain(self) -> ClosedSystem:
        """A pendulum on a ball, with a wheel."""
        builder = fm.SceneBuilder("chain", gravity=(0.0, 0.0, -9.81)).rigid_body(
            "bob", mass=2.0, inertia=(0.1, 0.1, 0.1)
        )
        builder.wheel("rotor", "bob", axis=(0.0, 0.0, 1.0), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3)
        builder.free("float", "ground", "bob")
        at = (0.25, 0.0, 0.0)
        closed = builder.closure("ball", "spherical", "ground", "bob", position_a=at, position_b=at).scene()
        system = fm.compile(closed)
        assert isinstance(system, ClosedSystem)
        return system

    @cached_property
    def state(self) -> fm.State:
        """Of numbers that single precision holds too."""
        start = self.tree.initial_state
        return self.tree.state(np.float32(start.q), np.float32(np.linspace(0.125, 0.5, self.tree.nu)), 0.5)

    @cached_property
    def model(self) -> fm.LinearModel:
        return fm.linearize(self.tree, self.state)

    @cached_property
    def run(self) -> fm.Trajectory:
        return fm.simulate(self.tree, 0.01, samples=3)

    @property
    def rates(self) -> np.ndarray:
        return np.arange(1.0, self.tree.nu + 1.0)

    @property
    def y(self) -> np.ndarray:
        return np.concatenate([self.state.q, self.state.u, [0.0]])


W = World()


# Kinds of arguments: names of variants and their values. Of some the numbers as plain floats are known: the oracle.


@dataclass
class Variant:
    """An argument that is not as it should be. `plain`: the same numbers as they should be; None: it must raise.

    `open`: it may raise or return, but only finite numbers.
    """

    name: str
    value: Any
    plain: Any = None
    open: bool = False


def vectors(v: np.ndarray) -> Iterator[Variant]:
    """Of a row of numbers."""
    whole = np.arange(1, len(v) + 1)
    wrong = {
        "short": v[:-1], "long": np.append(v, 1.0), "very long": np.zeros(10**5), "empty": v[:0], "2-D": v[None],
        "column": v[:, None], "0-d": np.array(1.0), "scalar": 1.0, "complex": v + 0j, "objects": v.astype(object),
        "strings": v.astype(str), "booleans": v > 0.0, "None": None, "nothing in a list": [None] * len(v),
        "text": "1.0", "ragged": [[1.0], [1.0, 2.0]], "huge integers": [10**400] * len(v),
    }  # fmt: skip
    for name, value in wrong.items():
        yield Variant(name, value)
    for bad in (np.nan, np.inf, -np.inf):
        for place in (0, len(v) - 1):
            yield Variant(f"{bad} at {place}", np.where(np.arange(len(v)) == place, bad, v))
    strided, unaligned = np.repeat(v, 2)[::2], np.zeros(8 * len(v) + 1, np.uint8)[1:].view(float)
    read_only, unaligned[:] = v.copy(), v
    read_only.flags.writeable = False
    right = {
        "list": v.tolist(), "tuple": tuple(v.tolist()), "float32": v.astype(np.float32), "strided": strided,
        "reversed": v[::-1].copy()[::-1], "read-only": read_only, "swapped bytes": v.astype(">f8"),
        "unaligned": unaligned, "Fortran's order": np.asfortranarray(v), "long double": v.astype(np.longdouble),
    }  # fmt: skip
    for name, value in right.items():
        yield Variant(name, value, v)
    for dtype in (int, np.int8, np.uint64):
        yield Variant(f"{np.dtype(dtype)}", whole.astype(dtype), whole.astype(float))
    for name, value in {"huge": 1e308, "hugely negative": -1e308, "large": 1e150, "tiny": 1e-320}.items():
        yield Variant(name, np.full(len(v), value), open=True)
    yield Variant("negative", -v, open=True)


def numbers(x: float) -> Iterator[Variant]:
    """Of one number."""
    wrong = (None, "1", 1j, [x], np.array([x, x]), True, np.nan, np.inf, -np.inf, 10**400, object(), b"1")
    yield from (Variant(repr(value)[:40], value) for value in wrong)
    yield Variant("integer", int(x) + 1, float(int(x) + 1))
    yield Variant("numpy's integer", np.int64(1), 1.0)
    yield Variant("float32", np.float32(0.5), 0.5)
    yield Variant("fraction", Fraction(1, 2), 0.5)
    yield from (Variant(f"{value}", value, open=True) for value in (1e308, -1e308, -1.0, 0.0, 1e-320))


def states(_: Any) -> Iterator[Variant]:
    """Of a state of the tree."""
    q, u, t = W.state.q.copy(), W.state.u.copy(), W.state.t
    nq, nu = len(q), len(u)
    wrong = {
        "None": None, "a tuple": (q, u, t), "an array": W.y, "a string": "state", "short q": fm.State(q[:-1], u),
        "short u": fm.State(q, u[:-1]), "long q": fm.State(np.append(q, 0.0), u),
        "moved": fm.State(W.y[: nq - 1], W.y[nq - 1 : -1]),
        "very long": fm.State(np.zeros(10**5), np.zeros(10**5)), "empty": fm.State([], []),
        "of another system": W.chain.initial_state, "of one as large": W.renamed.initial_state,
        "NaN": fm.State(np.full(nq, np.nan), u), "infinite": fm.State(q, np.full(nu, np.inf)),
        "no orientation": fm.State(np.zeros(nq), u), "hardly any": fm.State(1e-170 * q, u),
    }  # fmt: skip
    for name, value in wrong.items():
        yield Variant(name, value)
    spoiled = W.tree.state(q, u, t)
    spoiled.u[-1] = np.nan
    yield Variant("NaN written in place", spoiled)
    turned = np.concatenate([2.0 * q[:4], q[4:]])
    right = {
        "made by hand": fm.State(q, u, t), "of lists": fm.State(q.tolist(), u.tolist(), t),
        "of float32": fm.State(q.astype(np.float32), u.astype(np.float32), np.float32(t)),
        "pickled": pickle.loads(pickle.dumps(W.state)), "replaced": replace(W.state, t=t),
        "reversed": fm.State(q[::-1].copy()[::-1], np.repeat(u, 2)[::2], Fraction(1, 2)),
        "of the same layout": replace(W.state, layout=fm.compile(W.scene).layout),
    }  # fmt: skip
    for name, value in right.items():
        yield Variant(name, value, W.state)
    yield Variant("with a long quaternion", W.tree.state(turned, u, t), open=True)
    for size in (1e308, -1e308, 1e150, -1.0):
        yield Variant(f"times {size}", W.tree.state(np.concatenate([q[:4], size * q[4:]]), size * u, t), open=True)
    yield Variant("far in the future", W.tree.state(q, u, 1e308), open=True)


def closed_states(_: Any) -> Iterator[Variant]:
    """Of a state of the closed chain."""
    start = W.chain.initial_state
    wrong = {
        "None": None, "a tuple": (start.q, start.u), "of another system": W.state,
        "short q": fm.State(start.q[:-1], start.u),
        "very long": fm.State(np.zeros(10**5), np.zeros(10**5)), "NaN": fm.State(start.q, start.u + np.nan),
        "no orientation": fm.State(0.0 * start.q, start.u),
    }  # fmt: skip
    for name, value in wrong.items():
        yield Variant(name, value)
    yield Variant("made by hand", fm.State(start.q, start.u), start)
    yield Variant("huge", fm.State(start.q, np.full(len(start.u), 1e308)), open=True)


def matrices(b: np.ndarray) -> Iterator[Variant]:
    """Of (nu,m)."""
    wrong = {
        "short": b[:-1], "very long": np.zeros((10**5, 2)), "3-D": b[None], "0-d": 1.0, "complex": b + 0j,
        "objects": b.astype(object), "None": None, "empty": b[:0], "NaN": b + np.nan, "infinite": b + np.inf,
    }  # fmt: skip
    for name, value in wrong.items():
        yield Variant(name, value)
    for name, value in {
        "Fortran's order": np.asfortranarray(b), "strided": np.repeat(b, 2, axis=1)[:, ::2], "list": b.tolist(),
        "float32": b.astype(np.float32),
    }.items():  # fmt: skip
        yield Variant(name, value, b)
    yield Variant("huge", np.full_like(b, 1e308), open=True)


def names(_: Any) -> Iterator[Variant]:
    """Of a name that must exist."""
    yield from (Variant(repr(value), value) for value in (None, "", "nobody", 5, 1.5, b"ball", ("ball",), ["ball"]))


def systems(_: Any) -> Iterator[Variant]:
    """Of a system or a scene."""
    yield from (Variant(repr(value), value) for value in (None, "scene.toml", 1, np.zeros(3), fm.System))
    yield Variant("scene", W.scene, W.tree)


def chosen(*wrong: Any, plain: tuple[tuple[Any, Any], ...] = ()) -> Callable[[Any], Iterator[Variant]]:
    """Of an argument with variants of its own: wrong ones, and pairs of a right one and the same plainly."""

    def variants(_: Any) -> Iterator[Variant]:
        yield from (Variant(repr(value)[:40], value) for value in wrong)
        yield from (Variant(repr(value)[:40], value, same) for value, same in plain)

    return variants


@dataclass
class Call:
    """A public call, its sound arguments by name, and by argument the kind of its variants."""

    function: Callable[..., Any]
    arguments: dict[str, Any]
    kinds: dict[str, Callable[[Any], Iterator[Variant]]]


NO_NUMBER = (None, "1", 1j, np.nan, np.inf, -np.inf, True, [1.0], 10**400)
SAMPLES = chosen(
    None, "3", 3.0, 1, 0, -3, True, 10**9, 10**30, [], [0.0], [0.0, np.nan, 0.01], [0.0, 0.02], [0.01, 0.0],
    [0.0, 0.0, 0.01], [[0.0, 0.01]], np.array([0.0, 0.01 + 0j]), ["0", "0.01"],
    plain=((np.int64(3), 3), ([0, 0.005, 0.01], 3), ((0.0, 0.005, 0.01), 3)),
)  # fmt: skip
OF_STATE = {"state": states}
RUN = {"t_end": chosen(*NO_NUMBER, 0.0, -1.0, plain=((np.float64(0.01), 0.01), (Fraction(1, 100), 0.01)))}
ALGORITHM = {"algorithm": chosen(None, "", "newton", 5, ["articulated"])}


def calls() -> dict[str, Call]:
    """By name."""
    tree, chain, state, rates = W.tree, W.chain, W.state, W.rates
    found: dict[str, Call] = {}

    def add(called: str, function: Callable[..., Any], arguments: dict[str, Any], **kinds: Any) -> None:
        assert set(kinds) == set(arguments), called
        found[called] = Call(function, arguments, kinds)

    pointwise = (
        "mass_matrix", "bias", "applied", "energy", "momentum", "partitions", "digits_left", "precision",
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
        "precision",
    ):  # fmt: skip
        add(f"ClosedSystem.{name}", getattr(chain, name), {"state": start}, state=closed_states)
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
    asked = {"tolerance": 1e-2, "quantity": "marker:centre.position@1", "t_end": 0.01}
    refused = chosen(*NO_NUMBER, 0.0, -1.0)
    found["advise"] = Call(lambda **given: fm.advise(W.scene, **given), asked, {
        "tolerance": chosen(*NO_NUMBER, 0.0, 1.0, -1.0), "t_end": refused, "quantity": chosen("nobody", 5, ("nobody",)),
    })  # fmt: skip
    add(
        "check_scene",
        fm.check_scene,
        {"scene": W.scene, "t_end": 1.0},
        scene=chosen(None, "scene", 1),
        t_end=chosen("1", 1j, np.nan, np.inf, 0.0, -1.0, [1.0], 10**400),
    )
    return found


def _copying(evaluator: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """Of a function that writes one array: its results are compared."""
    return lambda t, q, u: evaluator(t, q, u).copy()


def seen(run: fm.Trajectory) -> tuple[Any, ...]:
    """Of a run that finished."""
    if not run.finished:
        raise ArithmeticError(run.message)
    return run.q, run.u, run.momentum


def but_none(kind: Callable[[Any], Iterator[Variant]]) -> Callable[[Any], Iterator[Variant]]:
    """Without the variant None: it stands for a default."""
    return lambda clean: (each for each in kind(clean) if each.value is not None)


def but_modal(v: np.ndarray) -> Iterator[Variant]:
    """Of speeds whose last is modal, and not looked at."""
    return (each for each in vectors(v) if not each.name.endswith(f" at {len(v) - 1}"))


def but_columns(kind: Callable[[Any], Iterator[Variant]]) -> Callable[[Any], Iterator[Variant]]:
    """Without the column: a matrix is right too."""
    return lambda clean: (each for each in kind(clean) if each.name != "column")


def rows(v: np.ndarray) -> Iterator[Variant]:
    """Of a state made by hand: any length, finite or not; it is for the system to refuse them."""
    loose = {"short", "long", "very long", "empty", "huge", "hugely negative", "large", "tiny", "negative"}
    for each in vectors(v):
        if each.name not in loose and not each.name.startswith(("nan", "inf", "-inf")):
            yield each


def quaternion_first(v: np.ndarray) -> Iterator[Variant]:
    """Of coordinates that begin with a quaternion."""
    yield from vectors(v)
    yield Variant("no orientation", np.concatenate([np.zeros(4), v[4:]]))
    yield Variant("hardly any", np.concatenate([1e-170 * v[:4], v[4:]]))


def wrong_only(v: np.ndarray) -> Iterator[Variant]:
    """Without those that open a closed chain."""
    return (each for each in vectors(v) if not each.open and each.plain is None or each.plain is v)


def wrong_only_number(x: float) -> Iterator[Variant]:
    return (each for each in numbers(x) if not each.open and each.plain is None)


def series(v: np.ndarray) -> Iterator[Variant]:
    """Of a row of any length, or one number."""
    loose = {"short", "long", "very long", "empty", "0-d", "scalar"}
    return (each for each in vectors(v) if each.name not in loose)


def not_a_mode(_: Any) -> Iterator[Variant]:
    yield from (Variant(repr(value), value) for value in (None, 5, "first"))


# What takes no numbers, and why. Whatever else is public must be among the calls.
EXEMPT = {
    "System.workspace", "System.recursion_workspace", "System.composite_workspace", "NestedSystem.workspace",  # nothing
    "System.fault_name", "ClosedSystem.fault_name",  # of the status of a kernel
    "Trajectory.columns", "LinearModel.to_scipy", "LinearModel.to_control",  # nothing
    "Trajectory.to_csv", "Trajectory.plot", "LinearModel.save", "Campbell.plot", "Campbell.to_csv",  # a path
    "ClosedSystem.consistent_inverse_dynamics", "ClosedSystem.modal_residual", "ClosedSystem.applied",  # the tree's
    "ClosedSystem.factorise", "ClosedSystem.operators", "ClosedSystem.partitions", "ClosedSystem.nested",
    "ClosedSystem.coordinate", "ClosedSystem.speed", "ClosedSystem.state",
    "ClosedSystem.evaluator",  # always refused
    "ClosedSystem.workspace", "ClosedSystem.recursion_workspace", "ClosedSystem.composite_workspace",
    "load_scene", "save_scene", "SceneBuilder",  # files and data, checked where they are compiled
    "Advice", "Campbell", "Evaluation", "LinearModel", "SteadySpin", "System", "Trajectory", "Status",  # results
    "ClosureError", "DynamicsError", "EquilibriumError", "Interrupted", "PrecisionWarning",
    "SceneError",
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
)


def public() -> set[str]:
    """Names of everything public that can be called; of a class its methods too."""
    found = set(fm.__all__) - set(schema.__all__)
    for each in CLASSES:
        methods = inspect.getmembers(each, inspect.isfunction)
        found |= {f"{each.__name__}.{name}" for name, _ in methods if not name.startswith("_")}
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
    if not finite(call.function(**call.arguments)):
        yield f"{name}: sound arguments give numbers that are not finite"
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
