"""Workspaces in one buffer: every number has a place of its own, the same number in both."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

import flexmb
from flexmb.entry import stiff_part
from tests import trees


def test_every_number_is_copied_once_with_nothing_beside_it():
    """All floats of a workspace are drawn, copied as `shift` copies them, and read by name: none is lost or moved."""
    system = flexmb.compile(trees.random_scene(2, trees.LATER))
    part = stiff_part.stiff_part(system.constants, system.nq, system.nu)
    rng, m = np.random.default_rng(1), part.first
    part.numbers[part.place] = rng.standard_normal(len(part.place))
    m.numbers[m.place], m.numbers[m.place + 1] = part.numbers[part.place], 7.0
    assert len(np.unique(part.place)) == len(part.place)
    assert len(np.unique([*m.place, *(m.place + 1)])) == 2 * len(part.place)
    count = 0
    for field in fields(part.plain):
        plain, wide = getattr(part.plain, field.name), getattr(m.w, field.name)
        names = [name for name in plain.dtype.names or () if plain.dtype[name].base == np.float64]
        pairs = [(plain, wide)] if plain.dtype == np.float64 else [(plain[name], wide[name]) for name in names]
        for one, other in pairs:
            assert np.array_equal(other[..., 0], one) and np.all(other[..., 1] == 7.0), field.name
            count += one.size
    assert count == len(part.place)
    assert not np.any(m.w.fault) and np.array_equal(m.w.body["free_count"], part.plain.body["free_count"])
