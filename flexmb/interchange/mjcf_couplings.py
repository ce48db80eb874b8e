"""Equality constraints of MJCF models that relate coordinates: between joints, and of fixed tendons.

MuJoCo keeps q_1 - q_1,0 equal to a polynomial of q_2 - q_2,0, where q is a joint's coordinate or the length of a
tendon, by default softly. What is linear becomes a coupling, which is exact; coordinates of scenes count from the
reference already. A joint or tendon that is kept at a constant has no second one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np

from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.rounding import ROUNDING

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
