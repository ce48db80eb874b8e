"""Statuses print their names, and stay numbers."""

from __future__ import annotations

import numpy as np

import flexmb as fm
from flexmb.run.warm_up import pendulum


def test_a_status_prints_its_name() -> None:
    assert str(fm.Status.MAX_STEPS) == f"{fm.Status.MAX_STEPS}" == "MAX_STEPS"
    assert f"{fm.Status.MAX_STEPS:>10}" == " MAX_STEPS"
    assert f"{fm.Status.MAX_STEPS:02d}" == "04"
    assert fm.Status.MAX_STEPS == 4 and int(fm.Status.MAX_STEPS) == 4
    assert np.array([fm.Status.MAX_STEPS]).dtype.kind == "i"


def test_of_single_states_and_of_many() -> None:
    system = fm.compile(pendulum())
    state = system.initial_state
    assert str(system.precision(state).status) == "OK"
    assert system.accelerations_batch(state.q[None], state.u[None]).statuses == (fm.Status.OK,)
    assert fm.simulate_batch(system, 0.1, q=state.q[None], u=state.u[None]).statuses == (fm.Status.OK,)
