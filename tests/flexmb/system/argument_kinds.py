"""What can be wrong, or odd but right, with the arguments of public calls; and the systems that are asked."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import msgspec
import numpy as np

import flexmb as fm
from flexmb.scene import schema
from flexmb.scene.shapes import beam_section

COPIES = 3
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
        hinges = tuple(msgspec.structs.replace(hinge, name=names[hinge.name]) for hinge in self.scene.hinges)
        return fm.compile(msgspec.structs.replace(self.scene, hinges=hinges))

    @cached_property
    def chain(self) -> fm.System:
        """A pendulum on a ball, with a wheel."""
        builder = fm.SceneBuilder("chain", gravity=(0.0, 0.0, -9.81)).rigid_body(
            "bob", mass=2.0, inertia=(0.1, 0.1, 0.1)
        )
        builder.wheel("rotor", "bob", axis=(0.0, 0.0, 1.0), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3)
        builder.free("float", "ground", "bob")
        at = (0.25, 0.0, 0.0)
        closed = builder.closure("ball", "spherical", "ground", "bob", position_a=at, position_b=at).scene()
        return fm.compile(closed)

    @cached_property
    def state(self) -> fm.State:
        """Of numbers that single precision holds too."""
        start = self.tree.initial_state
        return self.tree.state(np.float32(start.q), np.float32(np.linspace(0.125, 0.5, self.tree.nu)), 0.5)

    @cached_property
    def model(self) -> fm.LinearModel:
        return fm.linearize(self.tree, self.state)

    @cached_property
    def modes(self) -> Any:
        """Of another model, so that nobody has asked this one for them."""
        return fm.linearize(self.tree, self.state).modes

    @cached_property
    def run(self) -> fm.Trajectory:
        return fm.simulate(self.tree, 0.01, samples=3)

    @cached_property
    def batch(self) -> fm.Batch:
        """Of scenes of one structure, with gravity of their own."""
        copies = range(COPIES)
        return fm.compile_batch(
            [msgspec.structs.replace(self.scene, gravity_m_s2=(0.0, 0.0, -float(i))) for i in copies]
        )

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
        "masked": np.ma.array(v, mask=np.arange(len(v)) == 0), "all masked": np.ma.array(v, mask=True),
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
        "masked": np.ma.masked_less(b, 1.5),
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


Kind = Callable[[Any], Iterator[Variant]]


def itself(result: Any) -> Any:
    """The result tells all by itself."""
    return result


@dataclass
class Call:
    """A public call, its sound arguments by name, by argument the kind of its variants, and what its result tells."""

    ask: Callable[..., Any]
    arguments: dict[str, Any]
    kinds: dict[str, Kind]
    look: Callable[[Any], Any] = itself

    def function(self, **given: Any) -> Any:
        """What is compared: the result, or what is asked of it."""
        return self.look(self.ask(**given))


class Calls(dict[str, Call]):
    """Public calls by name, which may end in a comma and more words."""

    def add(
        self, called: str, ask: Callable[..., Any], arguments: dict[str, Any] | None = None,
        look: Callable[[Any], Any] = itself, /, **kinds: Kind,
    ) -> None:  # fmt: skip
        arguments = arguments or {}
        assert set(kinds) == set(arguments) and called not in self, called
        self[called] = Call(ask, arguments, kinds, look)

    def ask(self, thing: Any, *names: str, called: str = "") -> None:
        """Methods that need no argument."""
        for name in names:
            self.add(f"{called or type(thing).__name__}.{name}", getattr(thing, name))


NO_NUMBER = (None, "1", 1j, np.nan, np.inf, -np.inf, True, [1.0], 10**400)
SAMPLES = chosen(
    None, "3", 3.0, 1, 0, -3, True, 10**9, 10**30, [], [0.0], [0.0, np.nan, 0.01], [0.0, 0.02], [0.01, 0.0],
    [0.0, 0.0, 0.01], [[0.0, 0.01]], np.array([0.0, 0.01 + 0j]), ["0", "0.01"],
    plain=((np.int64(3), 3), ([0, 0.005, 0.01], 3), ((0.0, 0.005, 0.01), 3)),
)  # fmt: skip
RUN = {"t_end": chosen(*NO_NUMBER, 0.0, -1.0, plain=((np.float64(0.01), 0.01), (Fraction(1, 100), 0.01)))}
ALGORITHM = {"algorithm": chosen(None, "", "newton", 5, ["articulated"])}


def but_none(kind: Callable[[Any], Iterator[Variant]]) -> Callable[[Any], Iterator[Variant]]:
    """Without the variant None: it stands for a default."""
    return lambda clean: (each for each in kind(clean) if each.value is not None)


def but_modal(v: np.ndarray) -> Iterator[Variant]:
    """Of speeds whose last is modal, and not looked at."""
    return (vector for vector in vectors(v) if not vector.name.endswith(f" at {len(v) - 1}"))


def but_columns(kind: Callable[[Any], Iterator[Variant]]) -> Callable[[Any], Iterator[Variant]]:
    """Without the column: a matrix is right too."""
    return lambda clean: (each for each in kind(clean) if each.name != "column")


def rows(v: np.ndarray) -> Iterator[Variant]:
    """Of a state made by hand: any length, finite or not; it is for the system to refuse them."""
    loose = {"short", "long", "very long", "empty", "huge", "hugely negative", "large", "tiny", "negative"}
    for vector in vectors(v):
        if vector.name not in loose and not vector.name.startswith(("nan", "inf", "-inf")):
            yield vector


def quaternion_first(v: np.ndarray) -> Iterator[Variant]:
    """Of coordinates that begin with a quaternion."""
    yield from vectors(v)
    yield Variant("no orientation", np.concatenate([np.zeros(4), v[4:]]))
    yield Variant("hardly any", np.concatenate([1e-170 * v[:4], v[4:]]))


def wrong_only(v: np.ndarray) -> Iterator[Variant]:
    """Without those that open a closed chain."""
    return (vector for vector in vectors(v) if not vector.open and vector.plain is None or vector.plain is v)


def wrong_only_number(x: float) -> Iterator[Variant]:
    return (number for number in numbers(x) if not number.open and number.plain is None)


def series(v: np.ndarray) -> Iterator[Variant]:
    """Of a row of any length, or one number."""
    loose = {"short", "long", "very long", "empty", "0-d", "scalar"}
    return (vector for vector in vectors(v) if vector.name not in loose)


def not_a_mode(_: Any) -> Iterator[Variant]:
    yield from (Variant(repr(value), value) for value in (None, 5, "first"))


def seen(run: fm.Trajectory) -> tuple[Any, ...]:
    """Of a run that finished."""
    if not run.finished:
        raise ArithmeticError(run.message)
    return run.q, run.u, run.momentum


def attributes(thing: Any) -> dict[str, Any]:
    """What is found when it is first asked for, by name; not the fields of a dataclass, which were given."""
    kind = type(thing)
    names = [name for name in dir(kind) if not name.startswith("_") and not callable(getattr(kind, name))]
    return {name: getattr(thing, name) for name in names if name not in getattr(kind, "__dataclass_fields__", ())}
