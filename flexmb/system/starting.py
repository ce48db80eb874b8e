"""What a check calls sound can be started: it is compiled and evaluated once, or a defect says why that fails."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from flexmb.scene import check
from flexmb.scene.check.starting import started
from flexmb.scene.check.walk import entries
from flexmb.scene.problems import Doubt
from flexmb.scene.schema import Scene
from flexmb.scene.sticking import sticking, with_phases

if TYPE_CHECKING:
    from flexmb.system.system import System
    from flexmb.tables.state import State


def check_scene(scene: Scene, t_end: float | None = None, t_start: float = 0.0) -> tuple[Doubt, ...]:
    """Raise SceneError with all defects of a scene, under the name of its file if it has one; return its doubts.

    Tables of prescribed motions must cover t_start (s), and with `t_end` (s) the run from t_start to t_end. A scene
    without such defects is compiled, with its SID files and with its loops closed, and everything is evaluated once at
    its start: what fails there is a defect too. Bodies that turn too fast for their level or bend beyond their points
    and polynomials at the start, or by prescribed motions until t_end, are doubtful.

    A doubtful scene can be run; doubts that its `allow` lists are not returned. `compile`, `simulate` and the command
    lines show the same doubts as a `SceneWarning`, which `pytest -W error::flexmb.SceneWarning` and the option
    `--strict` turn into an error. Raises TypeError for anything but a Scene.
    """
    doubts = check.check_scene(scene, t_end, t_start)
    from flexmb.system.compile import assembled  # imported here because a scene with defects needs no compiler

    with started(scene):
        system = assembled(with_phases(scene, {each.name: "idle" for each in sticking(scene)}))
        start = system.initial_state
        system.evaluate(start.t, start.q, start.u)
    return (*doubts, *_watched(system, start, start.t if t_end is None else t_end))


def _watched(system: System, start: State, t_end: float) -> Iterator[Doubt]:
    """What watches say of the start, and of prescribed motions up to t_end (s)."""
    from flexmb.system.level_range import LOOKED_AT
    from flexmb.system.watches import WatchedStates, said  # imported here as they need the compiler
    from flexmb.tables.state import pack

    t = np.linspace(start.t, t_end, LOOKED_AT)
    y = np.tile(pack(start), (len(t), 1))
    for time, row in zip(t, y, strict=True):
        system.project(float(time), row, system.constants)  # to prescribed coordinates and speeds
    q, u = y[:, : system.nq], y[:, system.nq : -1]
    place = {body.name: place for place, body in entries(system.scene, "bodies")}
    for each in said(WatchedStates(system, t, q, u, lambda n: system.turns(float(t[n]), q[n], u[n]))):
        yield each.doubt(place[each.finding.body])
