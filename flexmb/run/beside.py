"""Special kernels for scenes that compute for long, compiled in a process beside, at the lowest priority.

Ready kernels serve many kinds of scenes. Those that contain only what one scene needs are faster, and take seconds to
compile. So a process that has computed with scenes of one kind for some time starts another one, which compiles what
the recursion alone needs of them: accelerations, outputs, runs by explicit methods, or batches where there were some.
Systems that are compiled from then on, in any process, take them; a system never changes its kernels, because results
of different ones differ by rounding. Everything else keeps its ready kernels, so that nobody waits for a compiler.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import tempfile

import msgspec
import numpy as np

from flexmb.jit.folder import cache_directory
from flexmb.jit.warmed import is_warm
from flexmb.scene.control import UserLaw
from flexmb.scene.schema import Scene
from flexmb.system.system import System
from flexmb.tables.features import BY_ITSELF, RECURSION, contained

ENOUGH = 10.0  # s
_LOGGER = logging.getLogger("flexmb.jit")

_computed: dict[tuple[frozenset[str], str], float] = {}
"""Seconds that this process has computed by features of scenes and what; infinite where it has started a process."""
_started: list[subprocess.Popen[bytes]] = []


def computed(system: System, seconds: float, what: str = RECURSION) -> None:
    """Count what a system has computed; starts the process once it is enough for the first time.

    Not for closed chains and scenes with laws of users, and not where somebody has chosen kernels; see `is_off`.
    """
    c, scene = system.constants, system.scene
    if (
        c.kernels[0] != BY_ITSELF
        or scene.constraints
        or any(isinstance(controller, UserLaw) for controller in scene.controllers)
    ):
        return
    features = system.kept.get(RECURSION) or system.kept.setdefault(RECURSION, contained(c))
    key = features, what
    now = _computed[key] = _computed.get(key, 0.0) + seconds
    if ENOUGH <= now < np.inf and not is_off() and not is_warm(features | {what}):
        _computed[key] = np.inf
        _start(scene, what)


def is_off() -> bool:
    """Whether no process is started: on one core, in continuous integration, in tests, and where nothing is kept."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cores < 2 or "CI" in os.environ or "pytest" in sys.modules or cache_directory() is None


def _start(scene: Scene, what: str) -> None:
    _LOGGER.warning(
        'scenes like "%s" have computed for %g s: special kernels are compiled beside, for systems that are compiled '
        "later (FLEXMB_KERNELS=general turns this off)", scene.name, ENOUGH,
    )  # fmt: skip
    environment = {name: value for name, value in os.environ.items() if name != "FLEXMB_KERNELS"}
    with tempfile.TemporaryFile() as given:
        given.write(msgspec.json.encode((scene, what)))
        given.seek(0)
        try:
            process = subprocess.Popen(
                [sys.executable, "-m", "flexmb.warmup", "--beside"], stdin=given, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, env=environment | {"OPENBLAS_NUM_THREADS": "1"}, start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            _LOGGER.warning("they are not: %s", error)
        else:
            _started.append(process)  # it works on; one that is forgotten would be warned of
