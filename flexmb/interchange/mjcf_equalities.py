"""Equality constraints of MJCF models: linear relations of coordinates become couplings, connect and weld closures.

MuJoCo keeps them softly by default, couplings and closures are exact. Between joints, and of fixed tendons, it keeps
q_1 - q_1,0 equal to a polynomial of q_2 - q_2,0, where q is a joint's coordinate or the length of a tendon; coordinates
of scenes count from the reference already. A joint or tendon that is kept at a constant has no second one.

Between bodies, a connect holds the point data[0:3] of the first at the point data[3:6] of the second; a weld holds the
point data[3:6] of the first, with the attitude data[6:10], at the point data[0:3] of the second. Between sites, these
are the sites' frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

import numpy as np

from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.hinges import ClosureKind
from flexmb.scene.rounding import ROUNDING
from flexmb.typing import Real

JOINT, TENDON = 2, 3  # mjtEq
OF_JOINT = 1  # mjtWrap
HIGHER = slice(2, 5)  # the coefficients of the second to the fourth power

Fail = Callable[[str, str], NoReturn]
Relation = dict[int, float]
"""By joint, its factor."""


class MjcfCouplings:
    """The relations of a compiled model `m`; `names`: of its joints, as hinges have them."""

    def __init__(self, m: Any, names: list[str], fail: Fail) -> None:
        self._m, self._names, self._fail = m, names, fail
        self.held: dict[int, Constant] = {}
        """Joints that are kept at a constant, which is prescribed."""
        self._couplings: list[tuple[str, int, Relation, float]] = []
        self.inactive: list[str] = []
        for i in range(m.neq):
            if m.eq_type[i] in (JOINT, TENDON):
                self._read(i)

    @property
    def count(self) -> int:
        """How many equality constraints are of these types."""
        return int(np.isin(self._m.eq_type, (JOINT, TENDON)).sum())

    def couple(self, builder: SceneBuilder) -> None:
        """Add the couplings."""
        for name, led, ratios, offset in self._couplings:
            by_name = {self._names[j]: ratio for j, ratio in ratios.items()}
            builder.coupling(name, self._names[led], by_name, offset=offset)

    def _read(self, i: int) -> None:
        m, called = self._m, str(self._m.equality(i).name)
        name = called if called and called not in self._names else f"equality {i}"
        if not m.eq_active0[i]:
            self.inactive.append(name)
            return
        powers = m.eq_data[i]
        one, other = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        if other >= 0 and np.max(np.abs(powers[HIGHER])) > ROUNDING * np.max(np.abs(powers)):
            remedy = "make it linear, or prescribe both coordinates"
            self._fail(f'equality constraint "{name}" is a polynomial of higher degree than one', remedy)
        factors = self._factors(name, int(m.eq_type[i]), one)
        if other >= 0:
            for j, factor in self._factors(name, int(m.eq_type[i]), other).items():
                factors[j] = factors.get(j, 0.0) - float(powers[1]) * factor
        largest = max(map(abs, factors.values()), default=0.0)
        factors = {j: factor for j, factor in factors.items() if abs(factor) > ROUNDING * largest}
        offset = float(powers[0])
        if not factors:
            self._fail(f'equality constraint "{name}" relates no coordinates', "remove it")
        led, scale = next(iter(factors.items()))
        ratios = {j: -factor / scale for j, factor in factors.items() if j != led}
        if ratios:
            self._couplings.append((name, led, ratios, offset / scale))
        else:
            self.held[led] = Constant(value=offset / scale)

    def _factors(self, name: str, kind: int, k: int) -> Relation:
        """Of the coordinates in joint or tendon k."""
        if kind == JOINT:
            return {k: 1.0}
        m, found = self._m, Relation()
        for w in range(m.tendon_adr[k], m.tendon_adr[k] + m.tendon_num[k]):
            if m.wrap_type[w] != OF_JOINT:
                what = f'equality constraint "{name}" holds the length of tendon "{m.tendon(k).name}" through space'
                self._fail(what, "use a fixed tendon, or a spring between nodes")
            j = int(m.wrap_objid[w])
            found[j] = found.get(j, 0.0) + float(m.wrap_prm[w])
        return found


def tendon_that_acts(m: Any) -> str:
    """The first tendon that exerts forces by itself, and what it has; "" where none does."""
    for key, what in (
        ("tendon_stiffness", "stiffness"), ("tendon_stiffnesspoly", "stiffness"), ("tendon_damping", "damping"),
        ("tendon_dampingpoly", "damping"), ("tendon_armature", "inertia"),
    ):  # fmt: skip
        for k, values in enumerate(getattr(m, key, ())):  # versions of MuJoCo differ in what tendons have
            if np.any(values):
                return f'tendon "{m.tendon(k).name or k}" has {what}'
    return ""


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
