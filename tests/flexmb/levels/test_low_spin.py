"""Level `ruthless` needs a low spin: the flapping frequencies of docs/notation.md, and a published one."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section
from flexmb.typing import Real
from tests.repo.project import ROOT

FIRST = 1.875104068711961**2  # of a clamped-free beam, rad/s for EI = m L^4, the root of cos x cosh x = -1 squared
SECTION = beam_section(E=1e8, G=4e7, A=1.0, Iy=1e-8, Iz=1e-8, rho=1.0)  # EI = 1 N m^2, 1 kg/m
PUBLISHED = (6.0, 7.360373)  # spin and flapping frequency over sqrt(EI / (m L^4)): Wright, Smith, Thresher, Wang (1982)
ROW = re.compile(r"> \| (?:s|flapping frequency[^|]*) \|([\d. |]+)\|")


def flapping(level: fm.Level, spins: Real) -> Real:
    """Lowest frequency (rad/s) across the plane of rotation at these rates (rad/s) of a hub of no radius."""
    scene = (
        fm.SceneBuilder("rotor", allow=("level_range",))
        .beam("blade", length=1.0, elements=16, section=SECTION, level=level, points="line",
              modes=fm.Modes(count=6, families=("bending_z",)))
        .revolute("hub", "ground", "blade", axis=(0, 0, 1))
        .scene()
    )  # fmt: skip
    return 2.0 * np.pi * fm.campbell(scene, "hub", spins).frequencies_hz.min(axis=1)


def test_the_table_of_the_page():
    """`stiffened` over `ruthless`, to the digits that are printed; `full` keeps the frequency at rest as well."""
    text = (ROOT / "docs" / "notation.md").read_text(encoding="utf-8")
    spins, printed = (np.array(row.split("|"), float) for row in ROW.findall(text))
    stiffened = flapping("stiffened", FIRST * spins)
    for level in ("ruthless", "full"):
        assert stiffened / flapping(level, FIRST * spins) == pytest.approx(printed, abs=0.5001e-3)


def test_published_frequency():
    """Six modes are within 1e-4 of the published frequency."""
    spin, frequency = PUBLISHED
    [found] = flapping("stiffened", np.array([spin]))
    assert found == pytest.approx(frequency, rel=1e-4)
