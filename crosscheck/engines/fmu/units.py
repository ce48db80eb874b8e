"""Units as FMUs declare them and mappings write them: exponents of base units and the factor to SI.

Angles have no dimension here, since models differ in whether a stiffness is in N m or in N m/rad.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

SYMBOLS: dict[str, tuple[float, tuple[int, int, int]]] = {
    "1": (1.0, (0, 0, 0)), "%": (1e-2, (0, 0, 0)),
    "rad": (1.0, (0, 0, 0)), "mrad": (1e-3, (0, 0, 0)), "deg": (math.pi / 180.0, (0, 0, 0)),
    "rev": (2.0 * math.pi, (0, 0, 0)), "rpm": (math.pi / 30.0, (0, 0, -1)), "Hz": (2.0 * math.pi, (0, 0, -1)),
    "kg": (1.0, (1, 0, 0)), "g": (1e-3, (1, 0, 0)), "t": (1e3, (1, 0, 0)), "lb": (0.45359237, (1, 0, 0)),
    "m": (1.0, (0, 1, 0)), "mm": (1e-3, (0, 1, 0)), "cm": (1e-2, (0, 1, 0)), "km": (1e3, (0, 1, 0)),
    "in": (0.0254, (0, 1, 0)), "ft": (0.3048, (0, 1, 0)),
    "s": (1.0, (0, 0, 1)), "ms": (1e-3, (0, 0, 1)), "min": (60.0, (0, 0, 1)), "h": (3600.0, (0, 0, 1)),
    "N": (1.0, (1, 1, -2)), "mN": (1e-3, (1, 1, -2)), "kN": (1e3, (1, 1, -2)), "lbf": (4.4482216152605, (1, 1, -2)),
    "J": (1.0, (1, 2, -2)), "mJ": (1e-3, (1, 2, -2)), "kJ": (1e3, (1, 2, -2)),
    "W": (1.0, (1, 2, -3)), "kW": (1e3, (1, 2, -3)),
}  # fmt: skip
"""Factors to SI, and exponents of kg, m and s. A frequency in Hz is the angular one over 2 pi."""
BASE = "kg", "m", "s"
POWERS = str.maketrans({"²": "2", "³": "3", "^": None, "*": " ", "·": " ", ".": " ", "(": " ", ")": " "})


class Unit(NamedTuple):
    """A unit: SI value = factor * value + offset; exponents of kg, m and s."""

    name: str
    factor: float
    exponents: tuple[int, int, int]
    offset: float = 0.0

    @property
    def dimension(self) -> str:
        """In words, "kg m s^-2"."""
        powers = zip(BASE, self.exponents, strict=True)
        return " ".join(f"{base}^{power}" if power != 1 else base for base, power in powers if power) or "1"

    def same_quantity(self, other: Unit) -> bool:
        """Whether one can be converted into the other."""
        return self.exponents == other.exponents

    def to_si(self, value: float) -> float:
        """The value in SI."""
        return self.factor * value + self.offset

    def from_si(self, value: float) -> float:
        """The value in this unit."""
        return (value - self.offset) / self.factor


def unit(text: str) -> Unit:
    """The unit that a text such as "deg/s", "N mm" or "kg m^2" names; ValueError for one that is not known.

    All behind a / is divided by, up to the next one.
    """
    factor, exponents = 1.0, [0, 0, 0]
    for place, part in enumerate(text.translate(POWERS).split("/")):
        for word in part.split():
            match = re.fullmatch(r"([^\d\s-]+|1)(-?\d*)", word)
            known = SYMBOLS.get(match[1]) if match else None
            if match is None or known is None:
                raise ValueError(f'unit "{text}" is not known: write it with {", ".join(SYMBOLS)}, such as "kg m^2/s"')
            power = int(match[2] or 1) * (-1 if place else 1)
            factor *= known[0] ** power
            exponents = [total + each * power for total, each in zip(exponents, known[1], strict=True)]
    return Unit(text, factor, (exponents[0], exponents[1], exponents[2]))
