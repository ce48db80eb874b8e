"""Estimates of the memory and time that models of flexible bodies need, before they are made.

The memory of a model can grow with the square of a number in a file, such as `elements`. The factors below were
measured (peak memory and processor time, within a factor of two) on beams of 50 to 400 elements with 8 to 100 modes.
"""

from __future__ import annotations

from typing import NamedTuple

from flexmb.scene.bodies import BeamBody, Level
from flexmb.scene.sections import has_plain_sections
from flexmb.scene.strains import families

MOST_BYTES = 2**32
"""Limit (bytes) of the memory for the model of one body, the outputs of a run, or matrices over all speeds."""
MOST_MODES = 2_000  # of one body: the dense eigenproblem of its matrices takes minutes
ENDLESS = 10**18  # larger integers, which files can contain, are replaced by this one, so that floats do not overflow
_COORDINATES = {"axial": 1, "torsion": 1, "bending_y": 2, "bending_z": 2}  # per element; bending with shear: twice
_PER_COORDINATE = 170.0  # bytes, times the square of the number of coordinates
_PER_COUPLED = 90.0  # the same where sections may couple all families, times the square of all their coordinates
_PER_PAIR = 130.0  # bytes per inertia point and pair of modes, level stiffened
_PER_TRIPLE = 500.0  # bytes per triple of modes, level linear
_POINTS = {"line": 6, "rotary": 6, "section": 24}  # inertia points per element
_SPEED = 8.6e5  # cube of the number of coordinates per millisecond, of the dense eigenproblem
_SPEED_COUPLED = 1.7e6  # where sections may couple the families, of all their coordinates
PLENTY, PER_MODE = 200, 8  # doubt "many_elements": more than PLENTY and more than PER_MODE for each mode


def counted(number: int) -> str:
    """A number in a message; Python does not write those of more than 4300 digits."""
    return str(number) if abs(number) <= ENDLESS else f"{'-' if number < 0 else ''}more than {ENDLESS:g}"


class Estimate(NamedTuple):
    """Memory in bytes and time in s."""

    memory: float
    time: float

    @property
    def words(self) -> str:
        """The estimate as text."""
        took = f"{self.time:.0f} s" if self.time < 120.0 else f"{self.time / 60.0:.3g} min"
        return f"about {self.memory / 2**30:.2g} GiB and {took}"


def beam_estimate(body: BeamBody, modes: int) -> Estimate:
    """The estimate for a beam with this number of modes, attachment modes included."""
    shear = 2 if body.theory == "timoshenko" else 1
    elements, modes = float(min(body.elements, ENDLESS)), min(modes, ENDLESS)
    points = elements * _POINTS[body.points]
    if not has_plain_sections(body):  # one eigenproblem of all families
        bending = 9 if body.theory == "timoshenko" else 4
        coupled = elements * sum(bending if name.startswith("bending") else 4 for name in families(body))
        memory = _PER_COUPLED * coupled**2 + modes_memory(body.level, points, modes)
        return Estimate(memory, 1e-3 * coupled**3 / _SPEED_COUPLED)
    size = elements * sum(
        count * (shear if name.startswith("bending") else 1)
        for name, count in _COORDINATES.items()
        if name in families(body)
    )
    memory = _PER_COORDINATE * size**2 + modes_memory(body.level, points, modes)
    return Estimate(memory, 1e-3 * size**3 / _SPEED)


def refuse_beyond(amount: float, most: float, what: str, remedy: str, unit: str = "") -> None:
    """ValueError unless an amount of work, estimated before it is begun, is at most `most`: NaN is refused too.

    `what` takes or does the amount, as in "the outputs take" with the unit "GiB".
    """
    if not amount <= most:
        unit = unit and f" {unit}"
        raise ValueError(f"{what} {amount:.6g}{unit}, but {most:g}{unit} are allowed: {remedy}")


def refuse_bytes(size: float, what: str, remedy: str) -> None:
    """ValueError if that many bytes, estimated before they are allocated, exceed MOST_BYTES."""
    refuse_beyond(size / 2**30, MOST_BYTES / 2**30, what, remedy, "GiB")


def refuse_large_matrix(n: int, what: str, remedy: str, matrices: int = 1) -> None:
    """ValueError if so many matrices (n,n) of real numbers would exceed MOST_BYTES."""
    size = 8.0 * matrices * n**2
    if size <= MOST_BYTES:
        return  # before any words are made: each public call of one state asks
    some = "a matrix" if matrices == 1 else f"{matrices} matrices"
    refuse_bytes(size, f"{what} would need {some} of {n} x {n} numbers, which take", remedy)


def modes_memory(level: Level, points: float, modes: int) -> float:
    """Bytes of the tables of a level for a body with these numbers of inertia points and modes."""
    match level:
        case "stiffened":
            return _PER_PAIR * points * float(modes) ** 2
        case "linear":
            return _PER_TRIPLE * float(modes) ** 3
        case "rigid" | "ruthless" | "full" | "exact":
            return 8.0 * 12.0 * points * modes
