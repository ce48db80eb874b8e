"""Initial values that a user gives of closed chains: kept to the last digit, or changed with a word, or refused."""

from __future__ import annotations

import warnings

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.scene import schema as s
from tests.flexmb.closure import mechanisms as m

FOUR_BAR = m.four_bar(rate=2.0, closure="spherical")
CLOSED = {hinge.name: hinge.rotation.angle_rad for hinge in FOUR_BAR.hinges}  # a closed form


def scene(of: s.Scene = FOUR_BAR, **coordinates: dict) -> s.Scene:
    """With other initial values, (angle, rate, given) by hinge."""
    return msgspec.structs.replace(of, hinges=tuple(
        msgspec.structs.replace(hinge, rotation=msgspec.structs.replace(hinge.rotation, **coordinates[hinge.name]))
        if hinge.name in coordinates else hinge for hinge in of.hinges
    ))  # fmt: skip


def rates(drive: float, pin: float = 0.0, pivot: float = 0.0, marked: tuple[str, ...] = ()) -> s.Scene:
    found = {"drive": drive, "pin": pin, "pivot": pivot}
    return scene(**{name: {"rate_rad_s": rate, "given": name in marked} for name, rate in found.items()})


def start(made: s.Scene) -> flexmb.State:
    """The initial state; a warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", flexmb.SceneWarning)
        return flexmb.compile(made).initial_state


@pytest.mark.parametrize("rate", [2.0, -0.1, 1.0 / 3.0, 1e6])
@pytest.mark.parametrize("hinge", [0, 1, 2])
def test_one_rate_determines_the_others_and_stays(rate, hinge):
    """Of four bars by hand: the end of the coupler is that of the rocker."""
    given = [0.0] * 3
    given[hinge] = rate
    state = start(rates(*given))
    assert state.u[hinge] == rate
    assert np.array_equal(state.q, list(CLOSED.values()))
    one, two, three = m.GRASHOF[:3]
    turned = np.cumsum(state.u[:2])
    at = np.cumsum(state.q[:2])
    velocity = turned @ (np.array([[one], [two]]) * np.stack([-np.sin(at), np.cos(at)], axis=1))
    expected = state.u[2] * three * np.array([-np.sin(state.q[2]), np.cos(state.q[2])])
    assert velocity == pytest.approx(expected, abs=1e-13 * abs(rate) * 10.0)


def test_rates_that_fit_all_stay():
    u = start(rates(2.0)).u
    assert np.array_equal(start(rates(*u)).u, u)


def test_rates_that_contradict_each_other_change_with_a_word():
    told = r'"drive.rotation.rate" from 2 to 3\.38.*"pivot.rotation.rate" from -1'
    with pytest.warns(flexmb.SceneWarning, match=told):
        flexmb.compile(rates(2.0, pivot=-1.0)).initial_state  # noqa: B018


def test_what_is_marked_stays_and_the_others_change_with_a_word():
    with pytest.warns(flexmb.SceneWarning, match='"pivot.rotation.rate" from -1 to 0.38') as told:
        u = flexmb.compile(rates(2.0, pivot=-1.0, marked=("drive",))).initial_state.u
    assert u[0] == 2.0 and "drive" not in str(told[0].message)


def test_a_marked_zero_is_a_value():
    with pytest.warns(flexmb.SceneWarning, match='"pivot.rotation.rate" from -1 to'):
        u = flexmb.compile(rates(0.0, pivot=-1.0, marked=("drive",))).initial_state.u
    assert u[0] == 0.0 and np.max(np.abs(u)) < 1e-12


def test_marks_that_contradict_each_other_are_refused_by_name():
    with pytest.raises(flexmb.ClosureError, match='"drive.rotation.rate", "pivot.rotation.rate"'):
        flexmb.compile(rates(2.0, pivot=-1.0, marked=("drive", "pivot"))).initial_state  # noqa: B018


def test_rough_angles_change_with_a_word_and_not_where_another_is_marked():
    rough = scene(drive={"angle_rad": 1.02})
    with pytest.warns(flexmb.SceneWarning, match=r'"drive.rotation" from 1\.02 to 1\.0'):
        flexmb.compile(rough).initial_state  # noqa: B018
    state = start(scene(drive={"angle_rad": 1.02, "given": True}))
    assert state.q[0] == 1.02 and state.u[0] == 2.0
    assert max(gap for gap, _ in flexmb.compile(rough).closure_gaps(state).values()) < 1e-12


def test_an_angle_alone_determines_the_others():
    """They are guesses at zero, from where the loop is assembled the other way round or not at all but for one."""
    state = start(scene(drive={"angle_rad": 1.3, "given": True}))
    assert state.q[0] == 1.3 and np.max(np.abs(state.q[1:] - list(CLOSED.values())[1:])) < 0.6


def test_bodies_do_not_bend_to_keep_what_contradicts_itself():
    bending = m.four_bar(rate=2.0, modes=2, closure="spherical")
    system = flexmb.compile(scene(bending, pivot={"rate_rad_s": -1.0}))
    with pytest.warns(flexmb.SceneWarning, match='"drive.rotation.rate" from 2'):
        u = system.initial_state.u
    assert np.max(np.abs(u[system._is_modal])) < 0.1
    system = flexmb.compile(bending)
    state = system.initial_state
    assert state.u[system.speed("drive")] == 2.0 and not np.any(state.u[system._is_modal])


def test_other_kinds_of_values_are_kept():
    """A ball hinge's speeds in space, and a wheel that no closure knows of."""
    made = flexmb.SceneBuilder("loop")
    made.rigid_body("arm", mass=1.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1), nodes={"end": (1, 0, 0)})
    made.rigid_body("rod", mass=1.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1), nodes={"end": (1, 0, 0)})
    made.rigid_body("cart", mass=1.0, inertia=(0.1, 0.1, 0.1))
    made.revolute("turn", "ground", "arm", angle=0.7, rate=0.0)
    made.spherical("ball", "arm", "rod", parent_node="end", quaternion=(np.cos(0.6), 0, 0, -np.sin(0.6)),
                   angular_velocity=(0.0, 0.0, 1.5))  # fmt: skip
    made.prismatic("slide", "ground", "cart", axis=(1, 0, 0), position=1.6)
    made.wheel("wheel", "arm", axis=(1, 0, 0), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3, speed=300.0)
    made.closure("shut", "spherical", "rod", "cart", node_a="end")
    system = flexmb.compile(made.scene())
    with pytest.warns(flexmb.SceneWarning, match='"slide.translation"'):  # rough, of all that is given
        u = system.initial_state.u
    assert np.array_equal(u[system.speed("ball")], [0.0, 0.0, 1.5]) and u[system.speed("wheel")] == [300.0]
    assert abs(u[system.speed("turn")][0]) > 0.1


def test_named_values_of_a_run_are_kept_and_others_follow():
    system = flexmb.compile(FOUR_BAR)
    with warnings.catch_warnings():
        warnings.simplefilter("error", flexmb.SceneWarning)
        run = flexmb.simulate(system, 0.01, samples=2, state={"drive.rotation": 1.01, "drive.rotation.rate": 1.5})
    # Kept but for rounding: sums in the least squares of the others may depend on where arrays lie in memory.
    np.testing.assert_allclose([run.q[0, 0], run.u[0, 0]], [1.01, 1.5], rtol=16 * 2.0**-53)
    with pytest.warns(flexmb.SceneWarning, match='"pivot.rotation.rate" from 1 to'):
        flexmb.simulate(system, 0.01, samples=2, state={"drive.rotation.rate": 1.5, "pivot.rotation.rate": 1.0})


def test_a_whole_state_that_is_open_moves_with_a_word():
    system = flexmb.compile(FOUR_BAR)
    state = system.initial_state
    with warnings.catch_warnings():
        warnings.simplefilter("error", flexmb.SceneWarning)
        flexmb.simulate(system, 0.01, samples=2, state=state)
    with pytest.warns(flexmb.SceneWarning, match='"drive.rotation" from 1.001 to'):
        flexmb.simulate(system, 0.01, samples=2, state=system.state(state.q + [1e-3, 0.0, 0.0], state.u))
