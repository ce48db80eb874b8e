"""The declaration that the file of a law along a coordinate makes of it, and what derivatives ask of its kernel.

A kernel is compiled for floats, for lanes and for duals, which carry derivatives along. What these cannot do is found
here when the law is declared, by a call of its source on numbers that refuse it, and said with its file and line: the
compiler would say so too, half a minute into the first linearisation.
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

from flexmb.jit.counting import Interpreter
from flexmb.scene.connectors import AlongHinge

MOST = 6
"""Parameters that the tables have room for."""
_DIFFERENTIATED = (math.sin, math.cos, math.atan2)  # beside square roots
_TRIED = ((0.3, 0.7), (-0.3, -0.7), (0.0, 0.0))  # values and rates on both sides of zero, and there


class LawError(TypeError):
    """The kernel of a law does what no derivative can be carried through."""


@dataclass(frozen=True, eq=False)
class CoordinateLaw:
    """One law along a scalar coordinate.

    The kernel ``load(parameters, q, v)`` returns the load along the coordinate (N m or N), the energy stored (J) and
    the power (W) of what is not elastic, from the value q and the rate v. `parameters` gives the numbers of a connector
    of this law, six at most, None of all others. Raises LawError.
    """

    name: str
    load: Callable[..., Any]
    parameters: Callable[[AlongHinge], tuple[float, ...] | None]

    def __post_init__(self) -> None:
        twin = Interpreter(_Differentiated)(self.load)
        for q, v in _TRIED:
            try:
                found = twin((1.0,) * MOST, _Differentiated(q), _Differentiated(v))
            except LawError as error:
                at = traceback.extract_tb(error.__traceback__)
                place = next(each for each in reversed(at) if each.filename != __file__)
                where = f"{place.filename}, line {place.lineno}: {place.line}"
                raise LawError(f'law "{self.name}": {error}\n  {where}') from None
            if not (isinstance(found, tuple) and len(found) == 3):
                raise LawError(f'law "{self.name}" returns {found!r}: return the load, the energy and the power')
            for what, number in zip(("load", "energy", "power"), found, strict=True):
                if not isinstance(number, _Differentiated):
                    remedy = "take functions from flexmb.spatial.scalar, and 0.0 * v where there is none"
                    raise LawError(f'law "{self.name}": its {what} has lost the derivatives: {remedy}')


def _refused(what: str) -> Callable[..., NoReturn]:
    def method(*operands: Any) -> NoReturn:
        raise LawError(what)

    return method


_COMPARED = "a number that carries derivatives, or is one of several, is compared: compare x.real, and take select()"


class _Differentiated(float):
    """A number as lanes and duals have it: arithmetic, square roots and a few functions, but no truth."""

    __slots__ = ()
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __bool__ = _refused(_COMPARED)  # type: ignore[assignment]
    __abs__ = _refused("abs() has no derivative at zero: take select(x.real < 0.0, -x, x)")  # type: ignore[assignment]
    __hash__ = float.__hash__

    @property
    def real(self) -> float:
        return float.__add__(self, 0.0)

    def __add__(self, other: float) -> float:
        return _Differentiated(float.__add__(self, other))

    def __sub__(self, other: float) -> float:
        return _Differentiated(float.__sub__(self, other))

    def __rsub__(self, other: float) -> float:
        return _Differentiated(float.__rsub__(self, other))

    def __mul__(self, other: float) -> float:
        return _Differentiated(float.__mul__(self, other))

    def __truediv__(self, other: float) -> float:
        return _Differentiated(float.__truediv__(self, other))

    def __rtruediv__(self, other: float) -> float:
        return _Differentiated(float.__rtruediv__(self, other))

    def __neg__(self) -> float:
        return _Differentiated(float.__neg__(self))

    def __pow__(self, exponent: float) -> float:  # type: ignore[override]
        if exponent != 2:
            raise LawError("only squares are powers that derivatives are carried through: multiply, or take sqrt()")
        return self * self

    __radd__, __rmul__ = __add__, __mul__

    @staticmethod
    def square_root(x: float) -> float:
        return _Differentiated(math.sqrt(x))

    @staticmethod
    def elementary(function: Callable[..., float]) -> Callable[..., float]:
        """What the function of `math` is here."""
        if function in _DIFFERENTIATED:
            return lambda *operands: _Differentiated(function(*operands))
        return _refused(f"derivatives are not carried through math.{function.__name__}()")
