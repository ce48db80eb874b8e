"""The cases by both native routes: Frisch's equations and the recursion move, load and drive them alike.

Both take the same steps, so their distance is that of rounding, grown by the motion; a planted fault is far above it.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engines.contract import Effort, Run, Trajectory
from crosscheck.engines.registry import engine
from crosscheck.library.find import load_case
from crosscheck.library.mutations import mutate
from crosscheck.running.plan import variant_scene
from flexmb.scene.schema import Scene

CASES = Path(__file__).parents[2] / "cases"
EFFORT = Effort("tolerance", 1e-9, "dop853")
SCENES = {  # case, variant, seconds, the body that the fault is planted in
    "gyrostat": ("wheel_gyrostat/torque_driven", "rigid", 10.0, "hub"),
    "gyrostat with a beam": ("wheel_gyrostat/flexible_appendage", "linear", 10.0, "panel"),
    "boom": ("deploying_boom/rigid", "rigid", 10.0, "member_3"),
    "flexible boom": ("deploying_boom/flexible", "linear", 0.5, "member_3"),
    "spin-up": ("spinning_beam/beam_k_subcritical", "linear", 15.0, "beam"),
}


KINDS: dict[str, Callable[[Trajectory], list[np.ndarray]]] = {
    "position": lambda path: [marker.position for marker in path.markers.values()],
    "velocity": lambda path: [marker.velocity for marker in path.markers.values()],
    "loads": lambda path: [*path.loads.values(), *path.wheel_loads.values(), *path.drives.values()],
    "energy": lambda path: [*path.energy.values(), path.work],
}


def motion(name: str, scene: Scene, seconds: float) -> Trajectory:
    path = engine(name).compile(scene).simulate(Run(np.linspace(0.0, seconds, 51)), EFFORT)
    assert path.status == "finished", path.message
    return path


def distance(ours: Trajectory, theirs: Trajectory) -> dict[str, float]:
    """Largest differences by kind, in units of the kind's largest value; accelerations show in the loads."""
    found = {}
    for kind, values in KINDS.items():
        a, b = values(ours), values(theirs)
        size = max(float(np.max(np.abs(x))) for x in a)
        found[kind] = max(float(np.max(np.abs(x - y))) for x, y in zip(a, b, strict=True)) / size
    return found


@pytest.mark.parametrize("which", SCENES)
def test_both_native_routes_run_the_case_alike(which):
    name, variant_name, seconds, body = SCENES[which]
    case = load_case(CASES / name)
    variant = case.run.variant(variant_name)
    scene = case.scene(variant)
    model = variant_scene(scene, variant)
    recursion = motion("native", model, seconds)
    same = distance(motion("native-frisch", model, seconds), recursion)
    faulty = distance(motion("native-frisch", variant_scene(mutate(scene, "mass", body), variant), seconds), recursion)
    # 1e-16 times the condition of mass matrix and motion, measured 1e-15 to 1e-11; integrators err by 1e-9
    assert max(same.values()) < 1e-9, same
    assert max(faulty.values()) > 1e-4, faulty
