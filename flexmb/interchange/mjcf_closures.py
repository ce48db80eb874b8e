"""Equality constraints of MJCF models between bodies: connect and weld become closures.

MuJoCo keeps them softly, a closure is exact. Between bodies, a connect holds the point data[0:3] of the first at the
point data[3:6] of the second; a weld holds the point data[3:6] of the first, with the attitude data[6:10], at the point
data[0:3] of the second. Between sites, these are the sites' frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flexmb.scene.build import SceneBuilder
from flexmb.scene.hinges import ClosureKind
from flexmb.typing import Real

CONNECT, WELD = 0, 1  # mjtEq
OF_SITES = 6  # mjtObj
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class JoinedSide(NamedTuple):
    """A frame on a body: its number, position (3,) m and quaternion."""

    body: int
    position: Real
    quaternion: Real


class MjcfClosures:
    """The closures of a compiled model `m`; `body_name` gives the name of a body by its number."""

    def __init__(self, m: Any, body_name: Callable[[int], str]) -> None:
        self._name = body_name
        self._closures: list[tuple[str, ClosureKind, JoinedSide, JoinedSide]] = []
        self.inactive: list[str] = []
        taken = {str(m.equality(i).name) for i in range(m.neq)}
        for i in np.flatnonzero(np.isin(m.eq_type, (CONNECT, WELD))):
            name = str(m.equality(i).name) or next(
                name for name in (f"equality {i}", *(f"equality {i} {k}" for k in range(m.neq))) if name not in taken
            )
            if m.eq_active0[i]:
                kind: ClosureKind = "spherical" if m.eq_type[i] == CONNECT else "weld"
                self._closures.append((name, kind, *_sides(m, int(i))))
            else:
                self.inactive.append(name)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._closures)

    def close(self, builder: SceneBuilder) -> None:
        """Add the closures."""
        for name, kind, a, b in self._closures:
            builder.closure(
                name, kind, self._name(a.body), self._name(b.body), position_a=a.position, quaternion_a=a.quaternion,
                position_b=b.position, quaternion_b=b.quaternion,
            )  # fmt: skip


def _sides(m: Any, i: int) -> tuple[JoinedSide, JoinedSide]:
    one, other, data = int(m.eq_obj1id[i]), int(m.eq_obj2id[i]), np.array(m.eq_data[i])
    if m.eq_objtype[i] == OF_SITES:
        first, second = (
            JoinedSide(int(m.site_bodyid[k]), np.array(m.site_pos[k]), np.array(m.site_quat[k])) for k in (one, other)
        )
    elif m.eq_type[i] == CONNECT:
        first, second = JoinedSide(one, data[:3], UPRIGHT), JoinedSide(other, data[3:6], UPRIGHT)
    else:
        turned = data[6:10] / np.linalg.norm(data[6:10])
        first, second = JoinedSide(one, data[3:6], turned), JoinedSide(other, data[:3], UPRIGHT)
    return first, second
