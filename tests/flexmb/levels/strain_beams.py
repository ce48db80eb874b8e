"""Beams of level exact for tests, and coordinates of theirs that have given strains."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from flexmb.modal.exact import exact_model
from flexmb.modal.strain_field import STRETCH, WHOLE, StrainField
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.typing import Real
from tests.bounds import UNIT_ROUNDOFF

PLANE, SPACE = ("bending_y",), ("torsion", "bending_z", "bending_y")
SIX = s.StrainPolynomials(axial=2, shear_y=1, shear_z=2, torsion=2, bending_y=3, bending_z=3)


def stations(length: float = 1.0, curvature: Any = (0.0, 0.0, 0.0), more: Any = (0.0, 0.0, 0.0), taper: float = 1.0,
             rotary: float = 1e-2) -> list[s.BeamStation]:  # fmt: skip
    """Soft sections at the root and the tip, whose curvature (1/m) grows by `more` and whose data shrink by `taper`."""
    return [
        s.BeamStation(
            x_m=share * length, EA_N=900.0 * size, EIy_Nm2=1.0 * size, EIz_Nm2=1.6 * size, GJ_Nm2=0.8 * size,
            GAy_N=400.0 * size, GAz_N=300.0 * size, mass_per_length_kg_m=1.0 * size, rotary_y_kg_m=rotary,
            rotary_z_kg_m=1.5 * rotary,
            curvature_1_m=tuple((np.array(curvature) + share * np.array(more)).tolist()),
        )
        for share, size in ((0.0, 1.0), (1.0, taper))
    ]  # fmt: skip


def beam(modes: s.Modes, length: float = 1.0, section: list[s.BeamStation] | None = None, name: str = "rod",
         **more: Any) -> SceneBuilder:  # fmt: skip
    """A scene without gravity of one beam that is not hinged yet; it is soft, so that stretch matters."""
    builder = SceneBuilder("exact", gravity=more.pop("gravity", (0.0, 0.0, 0.0)), allow=ALLOW)
    return builder.beam(name, length=length, elements=4, section=section or stations(length), modes=modes,
                        **{"level": "exact", "points": "section"} | more)  # fmt: skip


ALLOW = ("wave_speed", "uncut_beam", "few_polynomials", "held_stretch")  # few strains make tests fast
ROUNDING = 2.0**8 * UNIT_ROUNDOFF
BEAMS: dict[str, dict[str, Any]] = {
    "plane": {"modes": s.Modes(count=4, families=PLANE)},
    "space": {"modes": s.Modes(count=3, families=SPACE)},
    "six strains": {"modes": s.Modes(count=3, polynomials=SIX), "section": stations(1.0, (0.4, -0.5, 0.9), taper=0.6)},
    "pieces": {"modes": s.Modes(count=2, pieces=3, families=SPACE),
               "section": stations(1.0, (0.0, 0.7, 0.0), (1.0, 0.0, 1.0))},
}  # fmt: skip


def bent(field: Any, seed: int = 0, size: float = 1.0) -> tuple[Real, Real, Real]:
    """Coordinates of strains of some `size` in all modes, with two rates."""
    scale = size / np.max(np.abs(strains(field)), axis=(0, 1, 2))
    return tuple(np.random.default_rng(seed).normal(size=(3, field.mode_count)) * scale)


def strains(field: StrainField) -> Real:
    """(n,2,3,m): each mode's mean curvature before each section that turns others, and stretch and shears there."""
    own = np.arange(field.steps)
    rows = field.rows[own][:, [WHOLE, STRETCH]].copy()
    rows[:, 0] /= np.diff(field.x[own], prepend=0.0)[:, None, None]
    return rows


def body_of(builder: SceneBuilder, name: str = "rod") -> s.BeamBody:
    """The beam alone, clamped."""
    scene = builder.weld("clamp", "ground", name).scene()
    found = scene.bodies[0]
    assert isinstance(found, s.BeamBody)
    return found


def field_of(builder: SceneBuilder) -> StrainField:
    """The sections of `body_of`."""
    field = exact_model(body_of(builder)).field
    assert field is not None
    return field


def strained(field: StrainField, like: StrainField, coordinates: Real, sections: Any, turn: Real) -> Real:
    """Coordinates (m,) of `field` whose strains are those of the `sections` of another, seen from axes R_own_like."""
    rows = field.rows[: len(sections), [WHOLE, STRETCH]].reshape(-1, field.mode_count)
    wanted = np.einsum("ab,jrbm,m->jra", turn, like.rows[sections][:, [WHOLE, STRETCH]], coordinates)
    found, *_ = np.linalg.lstsq(rows, wanted.ravel())
    np.testing.assert_allclose(rows @ found, wanted.ravel(), atol=1e-12 * np.abs(wanted).max())
    return np.asarray(found)


def curve(kappa: Any, tangent: Any, x: Real) -> tuple[Real, Real]:
    """R (n,3,3) and r (n,3) at ascending x (n,) of R' = R kappa(s)~, r' = R tangent(s), by scipy's DOP853."""

    def rates(s: float, y: Real) -> Real:
        R = y[3:].reshape(3, 3)
        a, b, c = kappa(s)
        turning = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
        return np.concatenate([R @ tangent(s), (R @ turning).ravel()])

    start = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    found = solve_ivp(rates, (0.0, x[-1]), start, "DOP853", t_eval=x, rtol=1e-13, atol=1e-13).y.T
    return found[:, 3:].reshape(-1, 3, 3), found[:, :3]
