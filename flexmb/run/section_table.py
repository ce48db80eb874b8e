"""Writes section loads over time to a CSV file."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from flexmb.output.whole import whole_file
from flexmb.system.section_loads import SectionLoads
from flexmb.typing import Real

HEADER = (
    "t [s]", "x [m]", "axial [N]", "shear_y [N]", "shear_z [N]", "torsion [N m]", "bending_y [N m]", "bending_z [N m]"
)  # fmt: skip


def write_sections(path: Path, t: Real, loads: SectionLoads) -> None:
    """Write one row per time t (T,) and section, with 17 digits, which are read back exactly."""
    with whole_file(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(HEADER)
        for i, time in enumerate(t):
            parts = (loads.axial[i], *loads.shear[i].T, loads.torsion[i], *loads.bending[i].T)
            for row in np.column_stack([np.full(len(loads.x), time), loads.x, *parts]).tolist():
                writer.writerow([f"{value:.17g}" for value in row])
