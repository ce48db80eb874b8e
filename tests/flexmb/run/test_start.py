"""What a process loads before its first result: libraries that are slow to import are left to those who need them."""

import subprocess
import sys

from flexmb.jit.installed import unfit

LATER = (
    "scipy.linalg", "scipy.spatial", "scipy.interpolate", "scipy.sparse", "scipy.optimize", "matplotlib",
    "rich", "typer", "jinja2", "psutil", "filelock", "flexmb.dense.dense_system", "flexmb.jain.operators",
    "flexmb.frisch.evaluation", "flexmb.closure.closures", "flexmb.advisor", "flexmb.linear", "flexmb.interchange",
    "pandas", "pyarrow", "xarray", "rerun", "mujoco",
)  # fmt: skip
FLEXIBLE = """
import sys
import flexmb as fm
from flexmb.scene.shapes import beam_section

strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700)
scene = (
    fm.SceneBuilder("flexible pendulum", gravity=(0, 0, -9.81))
    .beam("rod", length=1.0, elements=8, section=strip, modes=4)
    .revolute("pivot", "ground", "rod", axis=(0, 1, 0), angle=0.5)
    .marker("end", "rod", node="tip")
    .scene()
)
system = fm.compile(scene)
state = system.initial_state
system.hinge_loads(state)
trajectory = fm.simulate(scene, t_end=0.1, method="dop853", rtol=1e-9, atol=1e-11)
assert trajectory.finished and trajectory.markers["end"].quaternion.shape == (201, 4)
"""
LOADED = "\nprint(*[name for name in {later} if name in sys.modules])"


def loaded(code: str) -> list[str]:
    """Of `LATER`, in a process that finds its kernels compiled."""
    text = code + LOADED.format(later=LATER)
    for _ in range(2 if unfit() else 1):  # who compiles loads what numba's compiler needs
        done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_the_first_results_of_a_flexible_scene_load_nothing_slow():
    assert loaded(FLEXIBLE) == []


def test_operators_load_their_equations_and_no_slow_library():
    asked = FLEXIBLE + "\nsystem.operators(state).inverse_dynamics(system.accelerations(state))\n"
    assert loaded(asked) == ["flexmb.dense.dense_system", "flexmb.jain.operators"]


def test_the_count_sees_what_is_loaded():
    asked = FLEXIBLE + "\nsystem.operators(state).P\n"
    assert {"scipy.linalg", "flexmb.dense.dense_system", "flexmb.jain.operators"} <= set(loaded(asked))
