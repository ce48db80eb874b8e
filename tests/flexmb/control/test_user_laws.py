"""Functions of a user's own: what they are called with, what they raise, and how a scene names them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.files import dumps, loads
from tests.flexmb.control import laws
from tests.flexmb.control.scenes import rotor

HERE = "tests.flexmb.control.laws"


def user(function: str, **more: Any) -> fm.UserLaw:
    """The law of that name."""
    return fm.UserLaw(**({"name": "law", "inputs": ("angle", "rate"), "function": f"{HERE}:{function}"} | more))


@pytest.mark.parametrize("period", [None, 0.1])
def test_compiled_plain_and_built_in_laws_are_one(period: float | None) -> None:
    """Compiled ones bit for bit, of the same sums; numpy's dot may sum otherwise."""
    gains = (3.0, 0.4)
    compiled = fm.simulate(rotor(user("proportional", parameters=gains, period_s=period)), 2.0)
    plain = fm.simulate(rotor(user("plainly_proportional", parameters=gains, period_s=period)), 2.0)
    law = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-3.0, -0.4),), period_s=period)
    built_in = fm.simulate(rotor(law), 2.0)
    assert np.abs(compiled.q - built_in.q).max() < 1e-14
    assert np.abs(plain.q - built_in.q).max() < 1e-13


@pytest.mark.parametrize("period", [None, 0.1])
@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_what_a_plain_law_raises_comes_out_unharmed(period: float | None, method: Any) -> None:
    system = fm.compile(rotor(user("late_failure", parameters=(0.45,), period_s=period)))
    step = 0.01 if method == "rk4" else None
    with pytest.raises(laws.Broken, match=r"at 0\.\d+ s") as caught:
        fm.simulate(system, 2.0, method, step=step)
    assert any(frame.name == "late_failure" for frame in caught.traceback)
    with pytest.raises(laws.Broken):  # and again: nothing is left of the first
        fm.simulate(system, 2.0, method, step=step)
    assert fm.simulate(system, 0.4, method, step=step).finished


def test_a_law_that_says_nan_ends_the_run() -> None:
    run = fm.simulate(rotor(user("nonsense", period_s=0.25)), 1.0)
    assert run.status is fm.Status.NONFINITE
    assert run.stopped_at == 0.25


@pytest.mark.parametrize(("function", "what"), [
    ("nothing.of_the_kind:law", "cannot be imported"), (f"{HERE}:absent", "cannot be imported"),
    (f"{HERE}:of_two", r"no function of \(t, inputs, state, parameters, outputs, change\)"),
    (f"{HERE}:Broken", "no function of"), (f"{HERE}:uncompilable", "cannot be compiled"),
])  # fmt: skip
def test_a_function_that_cannot_be_had_is_refused(function: str, what: str) -> None:
    with pytest.raises(fm.SceneError, match=what) as caught:
        fm.simulate(rotor(fm.UserLaw(name="law", inputs=("angle",), function=function)), 1.0)
    assert '$.controllers[0].function (controller "law")' in str(caught.value)


def test_a_scene_names_its_functions_and_never_holds_them() -> None:
    scene = rotor(user("proportional", parameters=(3.0, 0.4)))
    text = dumps(scene)
    assert f'function = "{HERE}:proportional"' in text
    assert loads(text) == scene


def test_every_kind_of_sensor_and_controller_reads_back() -> None:
    parts = (
        fm.MarkerSensor(name="felt", marker="rim", quantity="specific_force", frame="marker"),
        fm.LoadSensor(name="load", hinge="pivot"),
        fm.TimeSensor(name="clock"),
        fm.ProfileSensor(name="wanted", function=fm.Sine(amplitude=0.5, angular_frequency_rad_s=2.0)),
        fm.StateSpace(name="filter", inputs=("felt",), A=((-1.0,),), B=((0.0, 1.0, 0.0),), C=((1.0,),)),
        fm.GainTable(name="gain", inputs=("clock", "filter"), points=(0.0, 1.0), values=(0.0, 2.0)),
        fm.Pid(name="pid", inputs=("angle", "wanted[0]"), kp=1.0, lower=-1.0, period_s=0.1, delay_s=0.02),
        fm.Saturation(name="law", inputs=("pid",), lower=-0.5, upper=0.5),
    )
    scene = rotor(*parts)
    assert loads(dumps(scene)) == scene
    assert fm.simulate(loads(dumps(scene)), 0.5).finished
