"""Operations that a kernel executes, counted by interpreting its source on scalars that count.

    count(dynamics.accelerations, 0.0, y, system.constants, system.workspace()).operations

Every addition, multiplication, division and square root whose operands depend on the arguments counts, also with zeros
and ones. Changes of sign and operations on literals alone do not count. The compiled kernel executes no more operations
than that. Kernels are not changed for it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from types import BuiltinFunctionType, CellType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

_OF_THE_PACKAGE = f"{__name__.partition('.')[0]}."  # prefix of the names of its modules
_CHOOSERS = {f"{__package__}.kernel", f"{__package__}.numbered"}  # modules that make functions that dispatch
_LANES = f"{__package__}.lanes"  # its functions have a Python implementation beside the compiled one


@dataclass(frozen=True)
class Operations:
    """Numbers of operations; `elementary` are sines, cosines and the like."""

    multiplications: int = 0
    additions: int = 0  # and subtractions
    divisions: int = 0
    square_roots: int = 0
    elementary: int = 0

    @property
    def total(self) -> int:
        """All of them, each for one floating-point operation."""
        return self.multiplications + self.additions + self.divisions + self.square_roots + self.elementary

    def __add__(self, other: Operations) -> Operations:
        return Operations(*(getattr(self, field.name) + getattr(other, field.name) for field in fields(self)))

    def __sub__(self, other: Operations) -> Operations:
        return self + -1 * other

    def __rmul__(self, times: int) -> Operations:
        return Operations(*(times * getattr(self, field.name) for field in fields(self)))


@dataclass(frozen=True)
class Counted:
    """Operations of one call, its result, and its arguments after the call."""

    operations: Operations
    result: Any
    arguments: tuple[Any, ...]


def count(kernel: Callable[..., Any], *arguments: Any) -> Counted:
    """Call a kernel or helper, interpreted, on copies of the arguments: floats, arrays, bundles, tuples of these.

    Arrays of floats become arrays of objects, and tables of records arrays of namespaces; other types stay as they are.
    """
    tally = Counter[str]()
    scalar = _scalars(tally)
    copies = tuple(_counting(argument, scalar) for argument in arguments)
    result = Interpreter(scalar)(kernel)(*copies)
    return Counted(Operations(**tally), result, copies)


def _scalars(tally: Counter[str]) -> Any:
    """The class of floats whose operations `tally` counts."""

    def counted(kind: str, operation: Callable[..., float]) -> Callable[..., float]:
        def method(*operands: float) -> float:
            tally[kind] += 1
            return CountingFloat(operation(*operands))

        return method

    class CountingFloat(float):
        __slots__ = ()
        __add__ = counted("additions", float.__add__)
        __radd__ = counted("additions", float.__radd__)
        __sub__ = counted("additions", float.__sub__)
        __rsub__ = counted("additions", float.__rsub__)
        __mul__ = counted("multiplications", float.__mul__)
        __rmul__ = counted("multiplications", float.__rmul__)
        __truediv__ = counted("divisions", _divide)
        __rtruediv__ = counted("divisions", lambda a, b: _divide(b, a))
        square_root = counted("square_roots", math.sqrt)
        elementary = staticmethod(lambda function: counted("elementary", function))

        def __pow__(self, exponent: float) -> float:  # type: ignore[override]
            if exponent == 2:
                return CountingFloat.__mul__(self, self)
            if exponent != 0.5:
                raise NotImplementedError("only squares and square roots are counted as powers")
            return CountingFloat.square_root(self)

        def __neg__(self) -> float:
            return CountingFloat(float.__neg__(self))

        def __abs__(self) -> float:
            return CountingFloat(float.__abs__(self))

    return CountingFloat


def _divide(a: float, b: float) -> float:
    """Division as in compiled code: division by zero raises no exception."""
    if b == 0.0:
        with np.errstate(all="ignore"):
            return float(np.divide(float(a), float(b)))
    return float(a) / float(b)


def _counting(value: Any, scalar: Any) -> Any:
    """A copy of an argument, of the same class, in which every float is a `scalar`; records become namespaces."""
    if is_dataclass(value) and not isinstance(value, type):
        copy = object.__new__(type(value))  # a bundle's own constructor takes addresses of arrays
        for field in fields(value):
            object.__setattr__(copy, field.name, _counting(getattr(value, field.name), scalar))
        if hasattr(value, "_numba_type_"):  # a bundle's features are part of its type
            object.__setattr__(copy, "_numba_type_", value._numba_type_)
        return copy
    if isinstance(value, tuple):
        parts = [_counting(part, scalar) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if isinstance(value, np.void):
        names = value.dtype.names or ()
        return SimpleNamespace(**{name: _counting(value[name], scalar) for name in names})
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "iub":
            return value.copy()
        objects = np.empty(value.shape, object)
        for place in np.ndindex(value.shape):
            objects[place] = _counting(value[place], scalar)
        return objects
    if isinstance(value, np.integer):
        return int(value)
    return scalar(value) if isinstance(value, float) else value


class Interpreter:
    """Makes interpreted twins of compiled functions: the same code, whose global names refer to twins as well.

    `scalar` is the class of the numbers, with its methods `square_root` and `elementary`.
    """

    def __init__(self, scalar: Any) -> None:
        self._scalar = scalar
        self._namespaces: dict[int, dict[str, Any]] = {}

    def __call__(self, thing: Any) -> Any:
        """The twin of a function, a tuple of functions, a module of the package or a function of `math`; anything else
        is returned unchanged."""
        function = getattr(thing, "py_func", None)
        if isinstance(function, FunctionType):
            return self._function(function)
        if isinstance(thing, FunctionType):
            chooses = thing.__closure__ and thing.__module__ in _CHOOSERS
            return self._function(thing) if chooses or thing.__module__ == _LANES else thing
        if isinstance(thing, tuple):
            return tuple(map(self, thing)) if all(callable(each) for each in thing) else thing
        if isinstance(thing, ModuleType) and thing.__name__.startswith(_OF_THE_PACKAGE):
            return SimpleNamespace(**self._namespace(vars(thing)))
        if isinstance(thing, BuiltinFunctionType) and thing.__module__ == "math":
            return self._scalar.square_root if thing is math.sqrt else self._scalar.elementary(thing)
        return thing

    def _function(self, function: FunctionType) -> FunctionType:
        space = self._namespace(function.__globals__)
        cells = tuple(CellType(self(cell.cell_contents)) for cell in function.__closure__ or ())
        twin = FunctionType(function.__code__, space, function.__name__, function.__defaults__, cells)
        twin.__kwdefaults__ = function.__kwdefaults__
        return twin

    def _namespace(self, original: dict[str, Any]) -> dict[str, Any]:
        if id(original) not in self._namespaces:
            space = self._namespaces[id(original)] = {}
            for key, value in original.items():
                space[key] = self(value)
        return self._namespaces[id(original)]
