"""What the models of flexible bodies take of memory and time, estimated before anything is made.

A number in a file, such as `elements`, makes arrays that grow with its square. The factors below were measured (peak of
memory and time of one processor, to a factor of two) on beams of 50 to 400 elements with 8 to 100 modes.
"""

from __future__ import annotations

from typing import NamedTuple

from flexmb.scene.bodies import BeamBody, Level

MOST_BYTES = 2**32
"""Memory that the model of one body may take while it is made, as much as the outputs of a run may."""
MOST_MODES = 2_000  # of one body: its matrices are decomposed as a whole, in minutes
ENDLESS = 10**18  # whole numbers of files have any number of digits, and floats overflow
_COORDINATES = {"axial": 1, "torsion": 1, "bending_y": 2, "bending_z": 2}  # of an element, twice in bending with shear
_PER_COORDINATE = 170.0  # bytes, times the square of the number of coordinates
_PER_PAIR = 130.0  # bytes of each inertia point and pair of modes, of second order
_PER_TRIPLE = 500.0  # bytes of each triple of modes, of first order
_POINTS = {"line": 6, "rotary": 6, "section": 24}  # of an element
_SPEED = 8.6e5  # coordinates cubed in a millisecond of one processor, by the dense eigenproblem
PLENTY, PER_MODE = 200, 8  # elements that no beam is asked about, and beyond that for each mode


class Estimate(NamedTuple):
    """Memory in bytes and time in s."""

    memory: float
    time: float

    @property
    def words(self) -> str:
        """For messages."""
        took = f"{self.time:.0f} s" if self.time < 120.0 else f"{self.time / 60.0:.3g} min"
        return f"about {self.memory / 2**30:.2g} GiB and {took}"


def beam_estimate(body: BeamBody, modes: int) -> Estimate:
    """Of a beam with so many modal coordinates, static ones included."""
    shear = 2 if body.theory == "timoshenko" else 1
    elements, modes = float(min(body.elements, ENDLESS)), min(modes, ENDLESS)
    size = elements * sum(
        count * (shear if name.startswith("bending") else 1)
        for name, count in _COORDINATES.items()
        if name in body.modes.families
    )
    points = elements * _POINTS[body.points]
    memory = _PER_COORDINATE * size**2 + modes_memory(body.level, points, modes)
    return Estimate(memory, 1e-3 * size**3 / _SPEED)


def modes_memory(level: Level, points: float, modes: int) -> float:
    """Bytes of the tables of a level for a body with so many inertia points and modes."""
    match level:
        case "stiffened":
            return _PER_PAIR * points * float(modes) ** 2
        case "linear":
            return _PER_TRIPLE * float(modes) ** 3
        case "rigid" | "ruthless" | "full":
            return 8.0 * 12.0 * points * modes
