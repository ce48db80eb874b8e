"""Four-bars, slider-cranks and Bennett's linkage: against closed forms, cut in different places, overconstrained."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.scene import functions as f
from flexmb.tables.status import Status
from tests.bounds import relative
from tests.flexmb.closure import mechanisms as m

TIGHT = {"rtol": 1e-11, "atol": 1e-12}


def angle(system: flexmb.System, run: flexmb.Trajectory, hinge: str) -> np.ndarray:
    return run.q[:, system.coordinate(hinge).start]


def test_four_bar_moves_as_two_circles_say():
    system = flexmb.compile(m.four_bar())
    run = flexmb.simulate(system, 10.0, samples=51, **TIGHT)
    assert run.finished
    for i in range(len(run.t)):
        crank = angle(system, run, "drive")[i]
        coupler, rocker = m.FourBar().angles(crank)
        turns = [crank + angle(system, run, "pin")[i] - coupler, angle(system, run, "pivot")[i] - rocker]
        assert np.max(np.abs(np.sin(turns))) < 1e-11


def test_four_bar_obeys_the_equation_of_its_one_freedom():
    """I(q) qdd + 1/2 I'(q) qd^2 = -V'(q) with I and V from the closed form, by differences of order 6."""
    lengths, rate = m.FourBar(), 2.0
    scene = m.four_bar(crank=1.0, rate=rate)
    system = flexmb.compile(scene)
    start = system.initial_state
    found = system.accelerations(start)[system.speed("drive")][0]

    def energies(crank: float) -> tuple[float, float]:
        """Twice the kinetic energy at unit speed of the crank, and the potential energy."""
        step = 1e-3
        weights = {-3: -1 / 60, -2: 3 / 20, -1: -3 / 4, 1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
        slopes = sum(w * np.array(lengths.angles(crank + i * step)) for i, w in weights.items()) / step
        directions, speeds = (crank, *lengths.angles(crank)), (1.0, *slopes)
        inertia = potential = 0.0
        tip, tip_rate = np.zeros(2), np.zeros(2)
        for n, length in enumerate(lengths[:3]):
            along = np.array([np.cos(directions[n]), np.sin(directions[n])])
            across = np.array([-along[1], along[0]]) * speeds[n]
            origin, moving = (tip, tip_rate) if n == 1 else (np.zeros(2), np.zeros(2))
            mass = 0.78 * length
            velocity = moving + 0.5 * length * across
            inertia += mass * velocity @ velocity + mass * length**2 / 12.0 * speeds[n] ** 2
            potential += mass * 9.81 * (origin + 0.5 * length * along)[1]
            tip, tip_rate = length * along, length * across
        return inertia, potential

    step = 1e-2
    weights = {-3: -1 / 60, -2: 3 / 20, -1: -3 / 4, 1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    slope = sum(w * np.array(energies(1.0 + i * step)) for i, w in weights.items()) / step
    speed = start.u[system.speed("drive")][0]
    expected = -(0.5 * slope[0] * speed**2 + slope[1]) / energies(1.0)[0]
    assert found == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("cut", ["slider", "pin"])
def test_slider_crank_moves_as_the_closed_form_says(cut):
    crank, rod = 0.2, 0.7
    system = flexmb.compile(m.slider_crank(crank, rod, angle=0.4, cut=cut))
    run = flexmb.simulate(system, 5.0, samples=41, **TIGHT)
    assert run.finished
    turn = angle(system, run, "drive")
    expected = crank * np.cos(turn) + np.sqrt(rod**2 - (crank * np.sin(turn)) ** 2)
    assert np.max(np.abs(run.markers["piston"].position - np.c_[expected, 0 * expected, 0 * expected])) < 1e-11


@pytest.mark.parametrize("modes", [0, 2])
def test_where_a_loop_is_cut_does_not_matter(modes):
    """Motion, and the loads of hinges that either scene has: in the plane, where they are determined."""
    runs = {}
    for cut in ("slider", "pin"):
        scene = m.slider_crank(0.2, 0.7, angle=0.4, cut=cut, modes=modes)
        runs[cut] = flexmb.simulate(scene, 0.3, samples=11, **TIGHT)
        assert runs[cut].finished
    slider, pin = runs["slider"], runs["pin"]
    assert relative(slider.markers["piston"].position, pin.markers["piston"].position) < 1e-9
    assert relative(slider.markers["piston"].acceleration, pin.markers["piston"].acceleration) < 1e-7
    in_plane = [2, 3, 4]
    assert relative(slider.loads["drive"][:, in_plane], pin.loads["drive"][:, in_plane]) < 1e-7
    # what the wrist pin does to the slider, either way
    assert relative(slider.loads["wristpin"][:, 3:5], pin.loads["wristpin"][:, 3:5]) < 1e-7


@pytest.mark.parametrize("closure", ["revolute", "spherical", "cylindrical", "universal"])
def test_redundant_rows_do_not_change_the_motion(closure):
    """A planar four-bar closed in space suppresses up to five motions where two are enough."""
    expected = flexmb.simulate(m.four_bar(), 2.0, samples=5, **TIGHT)
    upright = (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)  # the first axis of a universal closure is x
    place = {"quaternion_a": upright, "quaternion_b": upright} if closure == "universal" else {}
    system = flexmb.compile(m.four_bar(closure=closure, **place))
    run = flexmb.simulate(system, 2.0, samples=5, **TIGHT)
    assert run.finished
    assert (system.closures.rank, system.closures.mobility) == (2, 1)
    assert relative(run.markers["joint"].position, expected.markers["joint"].position) < 1e-9


def test_loads_of_an_overconstrained_loop_say_what_is_determined():
    system = flexmb.compile(m.four_bar())
    determined = system.determined_loads(system.initial_state)
    in_plane = [False, False, True, True, True, False]
    assert {name: each.tolist() for name, each in determined.items()} == dict.fromkeys(determined, in_plane)
    flexible = flexmb.compile(m.four_bar(modes=2))
    assert all(np.all(load) for load in flexible.determined_loads(flexible.initial_state).values())


def test_bennetts_linkage_moves():
    """Four revolutes in space have mobility -2 by count; with opposite links equal and twists in proportion it is 1."""
    system = flexmb.compile(m.bennett())
    run = flexmb.simulate(system, 10.0, samples=41, **TIGHT)
    assert run.finished, run.message
    assert (system.closures.rank, system.closures.mobility) == (2, 1)
    assert m.largest_gap(system, run) < 1e-10
    assert np.max(np.abs(run.energy_drift)) < 1e-9 * run.energy_scale
    first, second, third = (angle(system, run, name) for name in ("first", "second", "third"))
    assert np.max(np.abs(np.sin(0.5 * (first + third)))) < 1e-10
    product = np.tan(0.5 * first) * np.tan(0.5 * second)
    assert product == pytest.approx(m.bennett_ratio(1.0, 0.7, 0.8)[1], rel=1e-9)


@pytest.mark.parametrize("modes", [0, 4])
def test_residual_and_energy_over_ten_seconds(modes):
    system = flexmb.compile(m.four_bar(modes=modes))
    run = flexmb.simulate(system, 10.0 if modes == 0 else 0.5, samples=101, **TIGHT)
    assert run.finished, run.message
    assert m.largest_gap(system, run) < 1e-12
    assert np.max(np.abs(run.energy_drift)) < 1e-9 * run.energy_scale


SETTINGS = {
    "rk4": {"method": "rk4", "step": 0.025}, "coarse rk4": {"method": "rk4", "step": 0.1}, "dop853": {},
    "composite": {"algorithm": "composite"},
}  # fmt: skip
STOPPING = {
    "turns back": lambda crank, swing: f.Sine(amplitude=swing, angular_frequency_rad_s=np.pi / 2.0, offset=crank),
    "rests before and after": lambda crank, swing: f.SmoothStep(
        start_value=crank, end_value=crank + swing, start_s=0.5, duration_s=1.0
    ),
}


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("crank", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("swing", [0.5, -0.5])
@pytest.mark.parametrize("motion", STOPPING)
def test_a_driven_crank_may_stand_still(motion, crank, swing, settings):
    """Rounding is all the speed there is where it turns back, at a step's end, and where it rests pivots fall by it:
    closures neither open nor are singular, however small the speed."""
    scene = m.four_bar(crank=crank, prescribed=STOPPING[motion](crank, swing))
    run = flexmb.simulate(scene, 3.0, samples=13, **SETTINGS[settings])
    assert run.status is Status.OK, run.message
    assert run.statistics.accepted_steps + run.statistics.rejected_steps < 500
    for drive, pin, pivot in run.q:
        coupler, rocker = m.GRASHOF.angles(drive)
        assert np.sin([drive + pin - coupler, pivot - rocker]) == pytest.approx([0.0, 0.0], abs=1e-9)
