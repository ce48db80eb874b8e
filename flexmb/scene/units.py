"""Units of the schema's keys: "stiffness_Nm_rad" has the stem "stiffness" and the unit N m/rad."""

from __future__ import annotations

UNITS = {
    "s": "s", "m": "m", "kg": "kg", "rad": "rad", "N": "N", "Nm": "N m", "Nm2": "N m²",
    "m_s": "m/s", "m_s2": "m/s²", "rad_s": "rad/s", "kg_m": "kg/m", "kg_m2": "kg m²",
    "N_m": "N/m", "Ns_m": "N s/m", "Nm_rad": "N m/rad", "Nms_rad": "N m s/rad", "s_m": "s/m", "s_rad": "s/rad",
    "m_rad": "m/rad", "1_m": "1/m",
}  # fmt: skip

# In these keys the suffix means kg m, not kg/m: moments of inertia per length have the unit kg m²/m.
ROTARY = ("rotary_y_kg_m", "rotary_z_kg_m")


def split_unit(key: str) -> tuple[str, str]:
    """Stem and unit of a schema key, by the longest suffix that is a unit; the unit is "" if there is none."""
    parts = key.split("_")
    for start in range(1, len(parts)):
        suffix = "_".join(parts[start:])
        if suffix in UNITS:
            return "_".join(parts[:start]), "kg m" if key in ROTARY else UNITS[suffix]
    return key, ""
