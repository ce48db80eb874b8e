"""Invariances: changes of a scene, such as of frames or units, under which all results must stay the same."""

from crosscheck.mutation.invariances.counterpart import Counterpart, Invariance, NotApplicable
from crosscheck.mutation.invariances.later import CLOCK, LATER
from crosscheck.mutation.invariances.mirrored import MIRRORED
from crosscheck.mutation.invariances.placed import BOOSTED, MOVED, TURNED
from crosscheck.mutation.invariances.restated import REORDERED, RESTATED
from crosscheck.mutation.invariances.units import RESCALED

INVARIANCES = (TURNED, MOVED, BOOSTED, CLOCK, LATER, REORDERED, RESCALED, MIRRORED, RESTATED)

__all__ = ["INVARIANCES", "Counterpart", "Invariance", "NotApplicable"]
