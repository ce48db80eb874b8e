"""Compiling ahead: what is left to compile afterwards, counted in processes of their own, without a clock."""

import os
import subprocess
import sys

import pytest

from flexmb.run import warm_up as warming
from flexmb.run.warm_up import looped, main, warm_up
from flexmb.scene.files import save_scene
from flexmb.system.compile import compile
from flexmb.tables.features import GENERAL, contained, features

# Compiled versions of every function of the package, before and after the scenes of the tests are run.
PROBE = """
import gc, sys
import flexmb as fm
from flexmb.run.warm_up import main
from flexmb.integrate.catalogue import INTEGRATORS
from tests.flexmb.run.warmed import SCENES

def compiled():
    return sum(len(x.overloads) for x in gc.get_objects() if type(x).__name__ == "CPUDispatcher"
               and x.py_func.__module__.startswith("flexmb"))

scene, method, algorithm, *arguments = sys.argv[1:]
main(arguments)
before = compiled()
step = 1e-2 if INTEGRATORS[method].fixed else None
done = fm.simulate(SCENES[scene](), 0.05, method, samples=3, step=step, algorithm=algorithm)
assert done.finished, done.message
print(before, compiled() - before)
"""


def left(scene: str, method: str, algorithm: str, *arguments: str) -> tuple[int, int]:
    """Functions compiled or loaded by the warm-up with these arguments, and by a run of another scene after it."""
    probe = [sys.executable, "-c", PROBE, scene, method, algorithm, *arguments]
    done = subprocess.run(probe, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    warmed, more = done.stdout.split()[-2:]
    return int(warmed), int(more)


@pytest.mark.parametrize(
    ("scene", "method", "algorithm", "arguments"),
    [
        ("tree", "dop853", "articulated", ()),
        ("tree", "rk4", "articulated", ()),
        ("tree", "radau5", "articulated", ("--method", "radau5")),
        ("tree", "dop853", "composite", ("--algorithm", "composite")),
        ("condensed", "dop853", "articulated", ("--scene", "condensed")),
        ("closed", "rk4", "articulated", ("--scene", "closed")),
    ],
)
def test_nothing_is_compiled_after_the_warm_up(scene, method, algorithm, arguments):
    warmed, more = left(scene, method, algorithm, *arguments)
    assert warmed > 0
    assert more == 0


@pytest.mark.parametrize(
    ("scene", "method", "algorithm"),
    [("tree", "radau5", "articulated"), ("tree", "dop853", "composite"), ("condensed", "dop853", "articulated")],
)
def test_what_was_not_asked_for_is_left(scene, method, algorithm):
    """The count of the test above sees what the default warm-up leaves."""
    assert left(scene, method, algorithm)[1] > 0


@pytest.mark.parametrize("names", [{"methods": ["euler"]}, {"algorithms": ["unsplit"]}, {"scenes": ["ring"]}])
def test_names_that_do_not_exist_are_refused(names):
    with pytest.raises(ValueError, match="use one of"):
        warm_up(**names)


def test_the_command_line_refuses_them_too(capsys):
    with pytest.raises(SystemExit):
        main(["--scene", "ring"])
    assert "invalid choice: 'ring'" in capsys.readouterr().err


def test_kinds_are_compiled_for_everything_and_scenes_for_what_they_contain(monkeypatch, tmp_path):
    """A file is a scene of the user's; the environment is what it was before."""
    asked = []

    def note(scene, kind, methods, algorithms):
        system = compile(scene)
        asked.append((scene.name, kind, features(system.constants) == {GENERAL}))
        return system

    noted = []
    monkeypatch.setattr(warming, "_compile", note)
    monkeypatch.setattr(warming, "note_warm", noted.append)
    monkeypatch.delenv("FLEXMB_KERNELS", raising=False)
    save_scene(looped(), tmp_path / "scene.toml")
    main([])
    main([str(tmp_path / "scene.toml"), "--scene", "condensed"])
    assert [each[1:] for each in asked] == [("tree", True), ("closed", False), ("condensed", True)]
    assert noted == [contained(compile(looped()).constants)]  # of the scene alone: those are at hand from now on
    assert "FLEXMB_KERNELS" not in os.environ
    monkeypatch.setenv("FLEXMB_KERNELS", "mine")
    warm_up(scenes=["tree"])
    assert os.environ["FLEXMB_KERNELS"] == "mine" and asked[-1][2]
