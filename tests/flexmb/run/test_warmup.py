"""Compiling ahead: what is left to compile afterwards, counted in processes of their own, without a clock. What is
compiled is kept: the process after the first one compiles nothing, whatever a scene contains."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from flexmb.jit.installed import unfit
from flexmb.run import warm_up as warming
from flexmb.run.warm_up import looped, main, warm_up
from flexmb.scene.files import save_scene
from flexmb.system.compile import compile
from flexmb.tables.features import GENERAL, contained, features
from tests.flexmb.run.every_kind import PARTS

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

main(sys.argv[2:])
print("counts", compiled())
for scene, method, algorithm in map(str.split, sys.argv[1].split(",")):
    before = compiled()
    step = 1e-2 if INTEGRATORS[method].fixed else None
    done = fm.simulate(SCENES[scene](), 0.05, method, samples=3, step=step, algorithm=algorithm)
    assert done.finished, done.message
    print("counts", compiled() - before)
"""


def left(runs: str, *arguments: str) -> list[int]:
    """Functions compiled or loaded by the warm-up with these arguments, and by each run of other scenes after it."""
    done = subprocess.run([sys.executable, "-c", PROBE, runs, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [int(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("counts ")]


def test_the_default_warm_up_leaves_nothing_of_its_own_to_compile_and_all_else():
    """The counts of the test below see what was not asked for."""
    own = "tree dop853 articulated,tree rk4 articulated"
    others = "tree radau5 articulated,tree dop853 composite,condensed dop853 articulated"
    warmed, *more = left(f"{own},{others}")
    assert warmed > 0 and more[:2] == [0, 0] and min(more[2:]) > 0


@pytest.mark.parametrize(
    ("run", "arguments"),
    [
        ("tree radau5 articulated", ("--method", "radau5")),
        ("tree dop853 composite", ("--algorithm", "composite")),
        ("condensed dop853 articulated", ("--scene", "condensed")),
        ("closed rk4 articulated", ("--scene", "closed")),
    ],
)
def test_nothing_is_compiled_after_the_warm_up(run, arguments):
    warmed, more = left(run, *arguments)
    assert warmed > 0 and more == 0


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


ROOT = Path(__file__).parents[3]


def compiled(*parts: str, **environment: str) -> list[str]:
    """Lines of `every_kind`: kernels that its process compiled, each with whether it is on disk now."""
    command = [sys.executable, "-W", "error::RuntimeWarning", "-m", "tests.flexmb.run.every_kind", *parts]
    inherited = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=inherited | environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_no_kernel_of_any_kind_of_run_is_lost():
    """Where the suite has run before, none but such kernels are compiled here: they would be, in every process."""
    assert [line for line in compiled("methods") if not line.endswith(": kept")] == []


@pytest.mark.slow
@pytest.mark.parametrize(("kernels", "parts"), [("general", tuple(PARTS)), ("special", ("methods",))])
def test_the_second_process_compiles_nothing(kernels, parts, tmp_path):
    """All cases, every method and algorithm, events, controllers, restarts, closures, linear models, batches.

    Nor does the first one where general kernels came with the installation.
    """
    given = {"NUMBA_CACHE_DIR": str(tmp_path), "FLEXMB_KERNELS": kernels}
    first = compiled(*parts, **given)
    if kernels == "general" and not unfit():
        assert first == []
    else:
        assert len(first) > 50 and all(line.endswith(": kept") for line in first)
    assert compiled(*parts, **given) == []
