"""A latch whose impulse leaves modes or wheels as they were is found out by balances and by the reference."""

from collections.abc import Callable

import numpy as np
import pytest

import flexmb as fm
from crosscheck.library.find import resolve
from crosscheck.library.reference import load_reference
from flexmb.run import impulses, situation
from flexmb.run.origin import names_of_places

T_END = 14.0  # s; the left panel latches at 11.87 s
Fault = Callable[[pytest.MonkeyPatch], None]


def leaving(*names: str) -> Fault:
    """The fault: speeds of these keep their values in every impulse."""

    def plant(monkeypatch: pytest.MonkeyPatch) -> None:
        def struck(system: fm.System, state: fm.State, speeds: dict[int, float]) -> impulses.Struck:
            found = impulses.struck(system, state, speeds)
            for name in names:
                place = names_of_places(system)[f"{name}.speeds"]
                along = slice(place.start - system.nq, place.stop - system.nq)
                found.u[along] = state.u[along]
            return found

        monkeypatch.setattr(situation, "struck", struck)

    return plant


def excess(run: fm.Trajectory) -> dict[str, float]:
    """Beyond the bounds that the case has (times them): of balances, and of the distance from the stored reference."""
    (case,) = resolve(("deploy_and_slew",))
    reference = load_reference(case.folder)
    reached = reference.times <= T_END
    far = np.linalg.norm(
        run.markers["right_tip"].position - reference.channels["marker:right_tip.position"][reached], axis=1
    )
    total = np.sum(list(run.energy.values()), axis=0)
    balance = total - run.work
    linear = run.momentum[:, 3:]
    return {
        "reference": far.max() / 1e-6,
        "energy": np.ptp(balance) / (1e-9 * total.max()),
        "momentum": np.abs(linear - linear[0]).max() / (1e-10 * np.abs(linear).max()),
    }


def simulated() -> fm.Trajectory:
    (case,) = resolve(("deploy_and_slew",))
    reference = load_reference(case.folder)
    times = reference.times[reference.times <= T_END]
    return fm.simulate(case.scene(case.run.variant("full")), float(times[-1]), samples=times, rtol=1e-11, atol=1e-13)


def test_the_impulse_of_a_latch_reaches_everything() -> None:
    run = simulated()
    assert len(run.events) == 1
    assert max(excess(run).values()) <= 1.0


@pytest.mark.parametrize("plant", [leaving("left.modes", "right.modes"), leaving("wheel_y")], ids=["modes", "wheel"])
def test_an_impulse_that_leaves_something_out_is_noticed(plant: Fault, monkeypatch: pytest.MonkeyPatch) -> None:
    plant(monkeypatch)
    found = excess(simulated())
    assert max(found.values()) > 10.0, found
