"""Prints what comes of a process that is forked off while two threads make the first calls: `0 0` if all is well."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path

import flexmb as fm

SCENE = Path(__file__).parents[3] / "cases" / "deploying_boom" / "flexible" / "scene.toml"


def work() -> None:
    system = fm.compile(fm.load_scene(SCENE))
    system.accelerations(system.initial_state)


def main() -> None:
    failed: list[object] = []
    threading.excepthook = failed.append
    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    while "flexmb.system.compile" not in sys.modules:  # then it is being imported, for a second from now on
        time.sleep(1e-3)
    child = os.fork()
    if child == 0:
        signal.alarm(60)  # ends it if it waits for what never comes
        work()
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    for thread in threads:
        thread.join()
    print(status, len(failed))


if __name__ == "__main__":
    main()
