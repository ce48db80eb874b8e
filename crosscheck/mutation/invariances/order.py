"""Everything declared in the opposite order, since references are by name."""

from __future__ import annotations

import msgspec

from crosscheck.mutation.invariances.counterpart import Counterpart, Invariance, NotApplicable
from crosscheck.mutation.invariances.linearised import relation
from flexmb.scene.schema import Scene

COLLECTIONS = (
    "bodies", "hinges", "closures", "couplings", "connectors", "wheels", "point_masses", "loads", "markers",
    "modal_states",
)  # fmt: skip


def _reordered(scene: Scene) -> Counterpart:
    changes = {name: getattr(scene, name)[::-1] for name in COLLECTIONS}
    if all(len(items) < 2 for items in changes.values()):
        raise NotApplicable("there is one of each thing only")
    other = msgspec.structs.replace(scene, **changes)
    return Counterpart(other, lambda times, channels: channels, linear=relation(scene, other))


REORDERED = Invariance("reordered", "bodies, hinges and all else declared in the opposite order", _reordered)
