"""What maps of resonance, sampled control and conservation rest on: their two routes agree at single places."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.stability.flow import transition_matrix
from crosscheck.stability.maps import column_resonance as column
from crosscheck.stability.maps import conservation
from crosscheck.stability.maps import sampled_control as control
from crosscheck.stability.runs import conserved, drift, growth
from crosscheck.stability.spectrum import linearised, states_of
from flexmb.run.simulate import simulate
from flexmb.system.compile import compile


@pytest.mark.parametrize(("frequency", "amplitude"), [(2.0, 0.3), (1.0, 0.4), (1.7, 0.1)])
def test_multipliers_of_a_column_are_those_of_beam_elements(frequency: float, amplitude: float) -> None:
    """A load whose frequency is a thousandth higher has others."""
    system = compile(column.scene(frequency, amplitude))
    period = 2.0 * np.pi / float(column.drive(np.asarray(frequency)))
    found = np.linalg.eigvals(transition_matrix(system, states_of(system, ["beam.modes"], ["beam.modes"]), period))
    theory = column.multipliers(np.asarray(frequency), np.asarray(amplitude))
    other = column.multipliers(np.asarray(1.001 * frequency), np.asarray(amplitude))
    sizes, expected, wrong = (np.sort(np.abs(each)) for each in (found, theory, other))
    assert np.max(np.abs(sizes - expected)) < 5e-6
    assert np.max(np.abs(sizes - wrong)) > 2e-5


@pytest.mark.parametrize(("sampling", "delay"), [(1.4, 0.25), (0.6, 1.25), (0.3, 2.5)])
def test_a_sampled_loop_grows_as_its_poles_say(sampling: float, delay: float) -> None:
    expected = np.log(control.rigid_radius(np.asarray([sampling]), np.asarray([delay]))[0] + 1.0)
    found = control.DELAY.outcome(sampling, delay)
    assert found.status == "measured" and found.value == pytest.approx(expected, rel=0.1, abs=2e-3)
    less = np.log(control.rigid_radius(np.asarray([sampling]), np.asarray([0.5 * delay]))[0] + 1.0)
    assert abs(less - found.value) > 0.02


def test_poles_without_delay_are_those_of_the_double_integrator() -> None:
    """Closed form: 1/s^2, held, u = -k x - d v has z^2 + (d h + k h^2/2 - 2) z + (1 - d h + k h^2/2)."""
    h, k, d = 0.7, 1.0, 2.0 * control.RATIO
    roots = np.roots([1.0, d * h + 0.5 * k * h**2 - 2.0, 1.0 - d * h + 0.5 * k * h**2])
    found = control.rigid_radius(np.asarray([h]), np.asarray([0.0]))[0] + 1.0
    assert found == pytest.approx(np.max(np.abs(roots)), rel=1e-12)
    # A whole period of delay is one more pole at the origin, and the gains act on the state before: by hand.
    A, B = np.array([[1.0, h], [0.0, 1.0]]), np.array([[0.5 * h**2], [h]])
    late = np.block([[A, B], [np.array([[-k, -d]]), np.zeros((1, 1))]])
    whole = control.rigid_radius(np.asarray([h]), np.asarray([1.0]))[0] + 1.0
    assert whole == pytest.approx(np.max(np.abs(np.linalg.eigvals(late))), rel=1e-12)


def test_hub_and_elements_are_hub_and_panel() -> None:
    """The frequencies and decays of the free pair, by the elements' reduction, are those of the flexible body."""
    scene = control.hub(1.0, 1.0, 0.0, 1.0, panel=True)
    free = msgspec.structs.replace(scene, sensors=(), controllers=(), loads=(), events=())
    system = compile(free)
    own = linearised(system, states_of(system, ["attitude", "panel.modes"], ["attitude", "panel.modes"]))
    expected, found = (np.sort_complex(np.linalg.eigvals(each)) for each in (control.satellite()[0], own))
    assert np.max(np.abs(found - expected)) < 1e-3 * np.max(np.abs(expected))
    assert abs(found[0].imag) > 1.003 * 22.035  # of the free pair, not of the clamped panel


def test_the_momentum_that_rk4_loses_is_that_of_the_same_steps_by_hand() -> None:
    """Euler's equations and the quaternion's, by Kutta's four stages."""
    step, span = 0.05, 20.0
    inertia = conservation.INERTIA

    def rates(state):
        w, spin = state[:4], state[4:]
        turn = 0.5 * np.array([-w[1:] @ spin, *(w[0] * spin + np.cross(w[1:], spin))])
        return np.hstack([turn, np.cross(inertia * spin, spin) / inertia])

    state, found = np.array([1.0, 0.0, 0.0, 0.0, *conservation.SPIN]), []
    for number in range(round(span / step) + 1):
        if number % conservation.BETWEEN == 0:
            turned = Rotation.from_quat(state[:4], scalar_first=True).as_matrix()
            found.append(turned @ (inertia * state[4:]))
        k1 = rates(state)
        k2 = rates(state + 0.5 * step * k1)
        k3 = rates(state + 0.5 * step * k2)
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rates(state + step * k3))
    measured, _ = conservation.kept(conservation.RIVALS[0], conservation.tumbling(), step)
    assert measured == pytest.approx(drift(np.array(found)), abs=0.02)


def test_the_closed_form_of_a_pin_is_met_and_a_wrong_one_is_not() -> None:
    times = np.linspace(0.0, conservation.SWING, 21)
    force = simulate(conservation.swinging(), conservation.SWING, samples=times).loads["pin"][:, 3:]
    assert np.max(np.abs(force - conservation.pin_force(times))) < 1e-8
    assert np.max(np.abs(force - conservation.pin_force(1.001 * times))) > 1e-3


def test_measures_of_runs_say_what_they_cannot_say() -> None:
    run = simulate(conservation.swinging(), 3.0, samples=31)
    decaying = np.exp(-0.5 * run.t)
    assert growth(run, decaying).value == pytest.approx(-0.5)
    assert growth(run, 0.0 * decaying).status == "failed"
    spin = np.array([[0.0, 0.0, 2.0, 0.0, 0.0, 0.0]])
    momentum, energy = conserved(np.array([[1.0, 0.0, 0.0, 0.0]]), spin, np.array([1.0, 2.0, 3.0]))
    assert momentum[0].tolist() == [0.0, 0.0, 6.0] and energy.tolist() == [6.0]
    assert drift(np.array([1.0, 1.1])) == pytest.approx(-1.0)
