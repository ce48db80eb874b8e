"""The derivatives by recursion, interpreted as Python, with one of their terms left out: for planted errors.

A compiled kernel takes 20 s to compile anew, its interpreted twin a fraction of a second for a small scene. Dual
numbers are Python objects here. An index beyond an array, which a kernel does not check, is an IndexError.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from dataclasses import fields
from types import FunctionType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from flexmb.entry.derivatives import DerivativeWorkspace
from flexmb.jain.derivatives import sweeps
from flexmb.jain.derivatives.tables import Derivatives
from flexmb.jit import duals
from flexmb.jit.counting import Interpreter, _counting
from flexmb.jit.duals import RATES
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.features import contained
from tests.flexmb.entry.terms import Term


class Interpreted(NamedTuple):
    """Derivatives (nu,nu) of udot by displacement and by speed, and (nu,) of the power by both."""

    by_displacement: np.ndarray
    by_speed: np.ndarray
    power_by_displacement: np.ndarray
    power_by_speed: np.ndarray


def accelerations(c: Constants, w: DerivativeWorkspace, term: Term | None = None) -> Interpreted:
    """After an evaluation by the compiled kernel in w; without a term of the recursion."""
    tables = _run(sweeps.accelerations_and_power, term, c, w)
    order, nu = w.tables.place, len(w.tables.place)
    matrix, work = np.array(tables.matrix, float)[order], np.array(tables.work, float)
    return Interpreted(matrix[:, order], matrix[:, nu + order], work[order], work[nu + order])


def mass_matrix(c: Constants, w: DerivativeWorkspace, term: Term | None = None) -> np.ndarray:
    """M (nu,nu), a product of the same recursion."""
    order, nu = w.tables.place, len(w.tables.place)
    matrix = np.array(_run(sweeps.inverse_dynamics, term, c, w, True).matrix, float)
    return matrix[np.ix_(order, 2 * nu + order)]


def _run(kernel: Any, term: Term | None, c: Constants, w: DerivativeWorkspace, *further: Any) -> Any:
    """The tables of the derivatives after a call; the constants say which features the scene has, and no more."""
    arguments = [constants(c), _counting(w.sweeps, float), _tables(w.tables)]
    if term is None:  # to leave a term out changes no index
        arguments = [checked(argument) for argument in arguments]
    with np.errstate(all="ignore"):
        _Without(term)(kernel)(*arguments, *further)
    return arguments[2]


def constants(c: Constants) -> Any:
    """The constants of a scene with Python's numbers and with its own features."""
    found = _counting(c, float)
    object.__setattr__(found, "_numba_type_", SimpleNamespace(features=contained(c)))
    return found


class _Checked(np.ndarray):
    """An array that is used as kernels use it: negative indices do not count from the end, and slices end in it."""

    def __getitem__(self, index: Any) -> Any:
        self._check(index)
        return super().__getitem__(index)

    def __setitem__(self, index: Any, value: Any) -> None:
        self._check(index)
        super().__setitem__(index, value)

    def _check(self, index: Any) -> None:
        for one, extent in zip(index if isinstance(index, tuple) else (index,), self.shape, strict=False):
            if isinstance(one, slice):
                start, stop = one.start or 0, extent if one.stop is None else one.stop
            else:
                start, stop = one, one + 1
            if not 0 <= start <= stop <= extent:
                raise IndexError(f"{one} of {extent}")


def checked(value: Any) -> Any:
    """The same namespace, bundle or array, whose arrays are checked."""
    if isinstance(value, np.ndarray):
        if value.dtype == object:
            for each in value.flat:
                if isinstance(each, SimpleNamespace):
                    checked(each)
        return value.view(_Checked)
    for name, each in vars(value).items():
        if isinstance(each, np.ndarray | SimpleNamespace | Constants | Workspace):
            object.__setattr__(value, name, checked(each))
    return value


def _tables(d: Derivatives) -> Any:
    """A copy of the tables with Python's numbers in place of numpy's."""
    copy = SimpleNamespace()
    for field in fields(d):
        if field.name == "duals":
            copy.duals = SimpleNamespace(
                **{field.name: _as_duals(getattr(d.duals, field.name)) for field in fields(d.duals)}
            )
        else:
            setattr(copy, field.name, _counting(getattr(d, field.name), float))
    return copy


def _as_duals(array: np.ndarray) -> Any:
    """Objects for numbers whose last axis is a value and its derivatives; records become namespaces."""
    if array.dtype.names is not None:
        found = np.empty(array.shape, object)
        for place in np.ndindex(array.shape):
            names = {name: _as_duals(np.asarray(array[place][name])) for name in array.dtype.names}
            found[place] = SimpleNamespace(**names)
        return found
    if array.dtype.kind == "f":
        found = np.empty(array.shape[:-1], object)
        for place in np.ndindex(found.shape):
            found[place] = Dual(float(array[place][0]), np.zeros(RATES))
        return found if found.ndim else found[()]
    return array.copy() if array.ndim else int(array)


class Dual:
    """A number with derivatives (RATES,)."""

    __slots__ = ("rates", "real")

    def __init__(self, real: float, rates: Any) -> None:
        self.real, self.rates = real, rates

    def __add__(self, other: Any) -> Dual:
        return Dual(self.real + other.real, self.rates + _rates(other))

    def __sub__(self, other: Any) -> Dual:
        return Dual(self.real - other.real, self.rates - _rates(other))

    def __rsub__(self, other: Any) -> Dual:
        return Dual(other - self.real, -self.rates)

    def __mul__(self, other: Any) -> Dual:
        return Dual(self.real * other.real, other.real * self.rates + self.real * _rates(other))

    def __truediv__(self, other: Any) -> Dual:
        quotient = self.real / other.real
        return Dual(quotient, (self.rates - quotient * _rates(other)) / other.real)

    def __rtruediv__(self, other: Any) -> Dual:
        return Dual(other / self.real, -other / self.real**2 * self.rates)

    def __neg__(self) -> Dual:
        return Dual(-self.real, -self.rates)

    __radd__, __rmul__ = __add__, __mul__


def _rates(x: Any) -> Any:
    return x.rates if isinstance(x, Dual) else 0.0


def _seeded(x: Any, lane: int) -> Dual:
    rates = np.zeros(RATES) + _rates(x)
    rates[lane] = 1.0
    return Dual(x.real, rates)


def _rate(x: Any, lane: int) -> Any:
    return x.rates[lane] if isinstance(x, Dual) else 0.0


def _nonzero(x: Any) -> bool:
    return bool(x.real != 0.0 or np.any(_rates(x)))


_BY_DUALS = {duals.seeded: _seeded, duals.rate: _rate, duals.nonzero: _nonzero}
_SLOPES: dict[Callable[..., float], Callable[[float], float]] = {
    math.sin: math.cos, math.cos: lambda x: -math.sin(x), math.exp: math.exp,
    math.sqrt: lambda x: 0.5 / math.sqrt(x) if x else math.inf,
}  # fmt: skip


class _Numbers:
    """Functions of floats and duals."""

    @staticmethod
    def square_root(x: Any) -> Any:
        return _Numbers.elementary(math.sqrt)(x)

    @staticmethod
    def elementary(function: Callable[..., float]) -> Callable[..., Any]:
        def of(*operands: Any) -> Any:
            value = function(*(operand.real for operand in operands))
            if not any(isinstance(operand, Dual) for operand in operands):
                return value
            if function is math.atan2:
                y, x = operands
                return Dual(value, (x.real * _rates(y) - y.real * _rates(x)) / (x.real**2 + y.real**2))
            [x] = operands
            return Dual(value, _SLOPES[function](x.real) * x.rates)

        return of


class _Without(Interpreter):
    """Interprets all functions as they are, and one without a term."""

    def __init__(self, term: Term | None) -> None:
        super().__init__(_Numbers)
        self._term = term

    def __call__(self, thing: Any) -> Any:
        if isinstance(thing, FunctionType) and thing in _BY_DUALS:
            return _BY_DUALS[thing]
        return super().__call__(thing)

    def _function(self, function: FunctionType) -> FunctionType:
        twin = super()._function(function)
        if self._term is not None and function is self._term.function.py_func:
            twin.__code__ = _code(self._term.without)
        return twin


def _code(definition: ast.FunctionDef) -> Any:
    found: dict[str, Any] = {}
    exec(compile(ast.Module([definition], []), "<without a term>", "exec"), found)
    return found[definition.name].__code__
