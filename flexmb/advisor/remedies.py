"""What to change in a question or in its scene where advice is refused, by what makes its runs hard to resolve."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexmb.advisor.models import flexible_bodies, undamped
from flexmb.advisor.quantity import Quantity
from flexmb.closure.closures import ClosureError
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.tables.state import DynamicsError

SAFE = 1.1  # a tolerance for which models suffice, over what they were seen to reach
AT_REST = 1e-9  # acceleration in SI units that is rounding


def remedies(
    scene: Scene, wanted: tuple[Quantity, ...], tolerance: float, budget: float, needs: float, reached: float
) -> tuple[str, ...]:
    """Sentences, those first that change the scene so that fewer modes are excited, or ring less long; one at least.

    `needs`: budget with which a finer model may run, infinite if there is none; `reached`: tolerance for which those
    that ran suffice, infinite if none does.
    """
    return tuple(_remedies(scene, wanted, tolerance, budget, needs, reached))


def _remedies(
    scene: Scene, wanted: tuple[Quantity, ...], tolerance: float, budget: float, needs: float, reached: float
) -> Iterator[str]:
    if _jumps_at_the_start(scene):
        yield (
            "start from equilibrium (`fm.equilibrium`), or let loads and drives grow smoothly: this scene is let go "
            "out of balance, which excites all modes at once"
        )
    pulses = [str(place) for place, _, value in values(ROOT, scene) if isinstance(value, Pulse)]
    if pulses:
        yield f"a smoother pulse, of two smooth steps, in place of that of {', '.join(pulses)}, which jumps"
    ringing = [body.name for body in flexible_bodies(scene) if undamped(body)]
    if ringing:
        yield f"damping of {', '.join(ringing)}, whose modes ring to the end: `damping_ratio` or `viscosity_s`"
    if np.isfinite(needs):
        yield f"a longer budget, of {_above(needs, 2):g} in place of {budget:g}, so that a finer model may run"
    loads = [str(quantity) for quantity in wanted if "load" in quantity.pattern or "drive" in quantity.pattern]
    of = f", or another quantity than {', '.join(loads)}, which high modes move more than a path" if loads else ""
    such = f", such as {larger:g}," if (larger := _above(SAFE * reached, 1)) < 1.0 else ""
    yield f"a larger tolerance than {tolerance:g}{such} or a shorter time{of}"


def _above(value: float, digits: int) -> float:
    """The least number of so many significant digits above a positive one."""
    if not np.isfinite(value):
        return value
    unit = 10.0 ** (np.floor(np.log10(value)) + 1 - digits)
    return float(np.ceil(value / unit) * unit)


def _jumps_at_the_start(scene: Scene) -> bool:
    """Whether the scene starts with accelerations, although at rest."""
    try:
        system = compile(scene)
        start = system.initial_state
        first = system.evaluate(start.t, start.q, start.u).accelerations
    except (ClosureError, DynamicsError, ValueError, NotImplementedError):
        return False
    return not np.any(start.u) and bool(np.any(np.abs(first) > AT_REST))
