"""Invariances: changes of a scene, such as of frames or units, under which all results must stay the same."""

from crosscheck.biting.invariances.boosted import BOOSTED
from crosscheck.biting.invariances.clock import CLOCK
from crosscheck.biting.invariances.counterpart import Counterpart, Invariance, NotApplicable
from crosscheck.biting.invariances.later import LATER
from crosscheck.biting.invariances.mirrored import MIRRORED
from crosscheck.biting.invariances.order import REORDERED
from crosscheck.biting.invariances.placed import MOVED, TURNED
from crosscheck.biting.invariances.restated import RESTATED
from crosscheck.biting.invariances.units import RESCALED

INVARIANCES = (TURNED, MOVED, BOOSTED, CLOCK, LATER, REORDERED, RESCALED, MIRRORED, RESTATED)

__all__ = ["INVARIANCES", "Counterpart", "Invariance", "NotApplicable"]
