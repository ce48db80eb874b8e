"""A screw: one angle, and a translation along its axis of the pitch times the angle."""

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.build import SceneBuilder
from tests.bounds import gamma

MASS, AXIAL, PITCH, G = 2.0, 0.04, 0.05, 9.81  # kg, kg m^2, m/rad, m/s^2
FALL = -MASS * G * PITCH / (AXIAL + MASS * PITCH**2)  # rad/s^2: (I + m p^2) q'' = -m g p


def nut(pitch: float = PITCH, **options) -> SceneBuilder:
    """A body on a vertical screw through its mass centre."""
    return (
        SceneBuilder("nut", gravity=(0.0, 0.0, -G))
        .rigid_body("nut", mass=MASS, com=(0.0, 0.0, 0.1), inertia=(0.02, 0.03, AXIAL))
        .screw("thread", "ground", "nut", pitch=pitch, **options)
        .marker("nut", "nut")
    )


def test_it_falls_as_its_equation_says():
    system = fm.compile(nut().scene())
    assert system.accelerations(system.initial_state) == pytest.approx([FALL], rel=gamma(50))
    assert system.mass_matrix(system.initial_state) == pytest.approx(np.array([[AXIAL + MASS * PITCH**2]]))


@pytest.mark.parametrize("pitch", [PITCH, -PITCH])
def test_a_right_handed_nut_that_turns_to_the_left_goes_down(pitch):
    found = fm.simulate(nut(pitch).scene(), t_end=0.5, rtol=1e-10)
    fallen = 0.5 * FALL * 0.5**2
    assert found.q[-1] == pytest.approx([np.sign(pitch) * fallen], rel=1e-9)
    assert found.markers["nut"].position[-1] == pytest.approx([0.0, 0.0, PITCH * fallen], rel=1e-9)
    assert found.energy["kinetic"][-1] + found.energy["gravity"][-1] == pytest.approx(found.energy["gravity"][0])


def test_its_torque_holds_what_it_carries():
    """A motor of m g p holds the weight. The thread turns back as much, so that the nut feels its weight alone."""
    system = fm.compile(nut(torque=fm.Constant(value=MASS * G * PITCH)).scene())
    state = system.initial_state
    assert system.accelerations(state) == pytest.approx([0.0], abs=gamma(50) * abs(FALL))
    load = system.hinge_loads(state)["thread"]
    assert load == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, MASS * G], abs=1e-12)


def test_a_prescribed_screw_drives_by_the_torque_of_both_motions():
    ramp = fm.Sine(amplitude=0.3, angular_frequency_rad_s=2.0)
    system = fm.compile(nut(prescribed=ramp).scene())
    found = system.evaluate(0.4, system.initial_state.q, system.initial_state.u)
    acceleration = -0.3 * 4.0 * np.sin(0.8)
    expected = (AXIAL + MASS * PITCH**2) * acceleration + MASS * G * PITCH
    assert found.drives["thread"] == pytest.approx([expected], rel=1e-12)


def test_without_pitch_it_is_a_revolute_hinge():
    scenes = nut(0.0, axis=(0.6, 0.0, 0.8), rate=2.0), (
        SceneBuilder("nut", gravity=(0.0, 0.0, -G))
        .rigid_body("nut", mass=MASS, com=(0.0, 0.0, 0.1), inertia=(0.02, 0.03, AXIAL))
        .revolute("thread", "ground", "nut", axis=(0.6, 0.0, 0.8), rate=2.0)
        .marker("nut", "nut")
    )
    systems = [fm.compile(builder.scene()) for builder in scenes]
    ours, theirs = (system.accelerations(system.initial_state) for system in systems)
    assert ours == pytest.approx(theirs, rel=1e-13)


def test_its_pitch_has_to_be_given_and_finite():
    with pytest.raises(TypeError, match="pitch"):
        SceneBuilder("nut").screw("thread", "ground", "nut")
    with pytest.raises(fm.SceneError, match="pitch_m_rad"):
        nut(np.inf).scene()


def test_a_massless_shaft_along_the_axis_is_moved_by_the_pitch_alone():
    """A point mass on the axis has no moment about it: a screw lifts it, a revolute hinge would move nothing."""
    bare = SceneBuilder("bead").rigid_body("bead", mass=1.0, inertia=(0.0, 0.0, 0.0))
    assert bare.screw("thread", "ground", "bead", pitch=PITCH).scene()
    without = SceneBuilder("bead").rigid_body("bead", mass=1.0, inertia=(0.0, 0.0, 0.0))
    with pytest.raises(fm.SceneError, match="no inertia about"):
        without.screw("thread", "ground", "bead", pitch=0.0).scene()
