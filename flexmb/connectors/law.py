"""The declarations that the files of laws make of them, and what derivatives ask of a kernel along a coordinate.

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
from flexmb.scene.connectors import AlongHinge, BetweenNodes

MOST = 6
"""Parameters of a law along a coordinate that the tables have room for; of one between frames there are 72."""
_DIFFERENTIATED = (math.sin, math.cos, math.atan2)  # beside square roots
_TRIED = ((0.3, 0.7), (-0.3, -0.7))  # values and rates on both sides of zero


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
                coordinate_twin = twin((1.0,) * MOST, _Differentiated(q), _Differentiated(v))
            except LawError as error:
                at = traceback.extract_tb(error.__traceback__)
                place = next(frame for frame in reversed(at) if frame.filename != __file__)
                where = f"{place.filename}, line {place.lineno}: {place.line}"
                raise LawError(f'law "{self.name}": {error}\n  {where}') from None
            if not (isinstance(coordinate_twin, tuple) and len(coordinate_twin) == 3):
                raise LawError(
                    f'law "{self.name}" returns {coordinate_twin!r}: return the load, the energy and the power'
                )
            for what, number in zip(("load", "energy", "power"), coordinate_twin, strict=True):
                if not isinstance(number, _Differentiated):
                    remedy = "take functions from flexmb.spatial.scalar, and 0.0 * v where there is none"
                    raise LawError(f'law "{self.name}": its {what} has lost the derivatives: {remedy}')


@dataclass(frozen=True, eq=False)
class FrameLaw:
    """One law between two frames.

    The kernel ``load(c, w, i, A, B)`` writes load, arm, energy and power of connector i to w.connector[i], and as
    `upright`, if the law has parameters, the square of the cosine of half the rotation, or 1 if the law allows every
    rotation. A and B are (position, rotation, velocity) of the two frames, World axes. `parameters` gives the numbers
    of a connector of this law, 72 at most, which the kernel finds in ``c.frame_law[c.connector[i].row].parameters``;
    None of all others.
    """

    name: str
    load: Callable[..., Any]
    parameters: Callable[[BetweenNodes], tuple[float, ...] | None]


def _refused(what: str) -> Any:
    def method(*operands: Any) -> NoReturn:
        raise LawError(what)

    return method


def _carried(operation: Callable[..., float]) -> Any:
    return lambda *operands: _Differentiated(operation(*operands))


_COMPARED = "a number that carries derivatives, or is one of several, is compared: compare x.real, and take select()"


class _Differentiated(float):
    """A number as lanes and duals have it: arithmetic, square roots and a few functions, but no truth."""

    __slots__ = ()
    __add__, __radd__ = _carried(float.__add__), _carried(float.__radd__)
    __sub__, __rsub__ = _carried(float.__sub__), _carried(float.__rsub__)
    __mul__, __rmul__ = _carried(float.__mul__), _carried(float.__rmul__)
    __truediv__, __rtruediv__ = _carried(float.__truediv__), _carried(float.__rtruediv__)
    __neg__, square_root = _carried(float.__neg__), staticmethod(_carried(math.sqrt))
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __bool__ = _refused(_COMPARED)
    __abs__ = _refused("abs() has no derivative at zero: take select(x.real < 0.0, -x, x)")
    __hash__ = float.__hash__

    @property
    def real(self) -> float:
        return float.__add__(self, 0.0)

    def __pow__(self, exponent: float) -> Any:
        if exponent != 2:
            raise LawError("only squares are powers that derivatives are carried through: multiply, or take sqrt()")
        return self * self

    @staticmethod
    def elementary(function: Callable[..., float]) -> Any:
        """What the function of `math` is here."""
        if function in _DIFFERENTIATED:
            return _carried(function)
        return _refused(f"derivatives are not carried through math.{function.__name__}()")
