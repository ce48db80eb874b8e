"""What a check calls sound can be started: it is compiled and evaluated once, or a defect says why that fails."""

from __future__ import annotations

from flexmb.scene import check
from flexmb.scene.check.starting import started
from flexmb.scene.problems import Doubt
from flexmb.scene.schema import Scene
from flexmb.system.compile import assembled


def check_scene(scene: Scene, t_end: float | None = None, t_start: float = 0.0) -> tuple[Doubt, ...]:
    """Raise SceneError with all defects of a scene, under the name of its file if it has one; return its doubts.

    Tables of prescribed motions must cover t_start (s), and with `t_end` (s) the run from t_start to t_end. A scene
    without such defects is compiled, with its SID files and with its loops closed, and everything is evaluated once at
    its start: what fails there is a defect too.

    A doubtful scene can be run; doubts that its `allow` lists are not returned. `compile`, `simulate` and the command
    lines show the same doubts as a `SceneWarning`, which `pytest -W error::flexmb.SceneWarning` and the option
    `--strict` turn into an error. Raises TypeError for anything but a Scene.
    """
    doubts = check.check_scene(scene, t_end, t_start)
    with started(scene):
        system = assembled(scene)
        start = system.initial_state
        system.evaluate(start.t, start.q, start.u)
    return doubts
