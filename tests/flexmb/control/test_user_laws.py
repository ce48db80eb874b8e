"""Functions of a user's own: what they are called with, what they raise, and how a scene names them. What it names is
looked up in the text of its module: what is no law is refused without running anything."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.control.user import fault
from flexmb.scene.files import dumps, loads, save_scene
from flexmb.scene.user_code import VARIABLE
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


RUNS = "from pathlib import Path\nPath(__file__ + '.ran').touch()\n"
LAW = "def {}(t, inputs, state, parameters, outputs, change):\n    outputs[0] = 0.0\n"
Write = Callable[..., str]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """A module that leaves a file where it is run, under a name that no other test has."""
    monkeypatch.syspath_prepend(str(tmp_path))
    count = 0

    def written(text: str, name: str = "") -> str:
        nonlocal count
        count += 1
        module = name or f"stranger_{tmp_path.name.replace('-', '_')}_{count}"
        file = tmp_path.joinpath(*module.split(".")).with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(RUNS + text)
        return module

    yield written
    for module in [name for name in sys.modules if name.startswith("stranger")]:
        del sys.modules[module]


def ran(folder: Path) -> bool:
    return any(folder.rglob("*.ran"))


def scene_of(address: str) -> fm.Scene:
    return rotor(fm.UserLaw(name="law", inputs=("angle",), function=address))


@pytest.mark.parametrize(("text", "name"), [
    ("", "law"), (LAW.format("other"), "law"), ("def law(t, inputs):\n    pass\n", "law"),
    ("import os as law\n", "law"), ("async " + LAW.format("law"), "law"), ("from math import sqrt as law\n", "lawx"),
    ("def law(t, i, s, p, o, c, *, more):\n    pass\n", "law"), ("def law(a, b, c, d, e, f, g):\n    pass\n", "law"),
    ("import flexmb\n@flexmb.user_function\ndef law(t, inputs):\n    pass\n", "law"),
    ("x = [law for law in []]\n", "b"), ("import os\nos.getcwd()\n", "os"),
])  # fmt: skip
def test_a_module_without_such_a_law_is_refused_and_not_run(write: Write, tmp_path: Path, text: str, name: str) -> None:
    module = write(text)
    with pytest.raises(fm.SceneError, match="cannot be imported") as refused:
        fm.simulate(scene_of(f"{module}:{name}"), 0.1)
    assert "$.controllers[0].function" in str(refused.value) and not ran(tmp_path) and module not in sys.modules


def test_a_library_that_does_something_when_it_is_imported_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """`import antigravity` opens a browser."""
    for name in ("x", "geohash", "webbrowser"):
        monkeypatch.delitem(sys.modules, "antigravity", raising=False)
        with pytest.raises(fm.SceneError, match="cannot be imported"):
            fm.simulate(scene_of(f"antigravity:{name}"), 0.1)
        assert "antigravity" not in sys.modules


@pytest.mark.parametrize("text", [
    LAW.format("law"), "if True:\n    " + LAW.format("law").replace("\n", "\n    ") + "\n",
    LAW.format("first") + "law = first\n", "globals()['law'] = None\n" + LAW.format("law"),
    "def law(*words):\n    words[4][0] = 0.0\n", "def __getattr__(name):\n    raise AttributeError(name)\n",
    "import os as law\nlaw = print\n",
    "try:\n    from nowhere import law\nexcept ImportError:\n    law = None\n", "from os.path import *\n",
    "def law(:\n", "for law in (print,):\n    pass\n", "with open(__file__) as law:\n    pass\n",
])  # fmt: skip
def test_what_the_text_does_not_decide_is_left_to_the_import(write: Write, text: str) -> None:
    assert fault(write(text), "law", 6) is None


def test_a_law_in_a_package_is_found_without_running_the_package(write: Write, tmp_path: Path) -> None:
    write("", "stranger_package.__init__")
    write(LAW.format("law"), "stranger_package.laws")
    assert fault("stranger_package.laws", "law", 6) is None
    assert fault("stranger_package.laws", "lost", 6) == "module 'stranger_package.laws' has no attribute 'lost'"
    assert fault("stranger_package.nowhere", "law", 6) == "No module named 'stranger_package.nowhere'"
    assert fault("stranger_package.laws.deeper", "law", 6) == "No module named 'stranger_package.laws.deeper'"
    assert not ran(tmp_path)


def test_a_law_that_another_module_lends_is_looked_up_there(write: Write, tmp_path: Path) -> None:
    lender = write("def law(t):\n    pass\n")
    borrower = write(f"from {lender} import law as mine\n")
    assert fault(borrower, "mine", 6) == "it does not take 6 arguments"
    assert not ran(tmp_path)


def test_a_module_that_ends_the_process_is_an_error_with_its_place(write: Write) -> None:
    module = write("import sys\n" + LAW.format("law") + "sys.exit(3)\n")
    with pytest.raises(fm.SceneError, match="cannot be imported: SystemExit: 3"):
        fm.simulate(scene_of(f"{module}:law"), 0.1)


def test_a_sound_law_of_a_stranger_is_not_run_where_user_code_is_forbidden(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "0")  # the command line sets it, for what the process starts
    module = write(LAW.format("law"))
    scene, file = scene_of(f"{module}:law"), tmp_path / "scene.toml"
    save_scene(scene, file)
    with fm.no_user_code():
        loaded = fm.load_scene(file)
        for use in (fm.check_scene, lambda scene: fm.simulate(scene, 0.1)):
            with pytest.raises(fm.SceneError, match="user code was forbidden") as refused:
                use(loaded)
            assert str(file) in str(refused.value) and "$.controllers[0].function" in str(refused.value)
    fm.check_scene(scene)
    done = CliRunner().invoke(app, ["check", "--no-user-code", str(file)])
    assert done.exit_code == 2 and "user code was forbidden" in " ".join(done.output.split()), done.output
    with pytest.raises(fm.SceneError, match=VARIABLE):  # the option holds for what the process starts
        fm.check_scene(scene)
    assert not ran(tmp_path)


def test_laws_of_flexmb_are_no_code_of_others() -> None:
    with fm.no_user_code():
        fm.check_scene(scene_of("flexmb.control.attitude:eigenaxis_slew"))
