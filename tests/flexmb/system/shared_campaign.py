"""Millions of calls of one evaluator, and of one system's accelerations, by threads. Run as a program: prints counts.

    python -m tests.flexmb.system.shared_campaign CALLS [--spoiled]

A tenth of them each is of a chain of sixty bodies, whose kernels let go of the interpreter's lock.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from tests.flexmb.system.shared_calls import spoil

THREADS = 8
SHARE = {(3, "evaluator"): 0.4, (3, "accelerations"): 0.4, (60, "evaluator"): 0.1, (60, "accelerations"): 0.1}


def asking(bodies: int, what: str) -> tuple[list[Callable[[], Any]], list[bytes]]:
    """For each thread, at a state of its own: a call, and what it is to give."""
    import flexmb as fm
    from tests.benchmarks.rivals import rigid_chain

    system, alone, rng = fm.compile(rigid_chain(bodies)), fm.compile(rigid_chain(bodies)), np.random.default_rng(0)
    given = [system.state(rng.normal(size=system.nq), rng.normal(size=system.nu)) for _ in range(THREADS)]
    right = [alone.accelerations(alone.state(x.q, x.u)).tobytes() for x in given]
    if what == "accelerations":
        return [lambda x=x: system.accelerations(x) for x in given], right
    evaluator = system.evaluator()
    return [lambda q=x.q, u=x.u: evaluator(0.0, q, u) for x in given], right


def wrong(bodies: int, what: str, calls: int) -> int:
    """Of so many in all."""
    asked, right = asking(bodies, what)
    found, at_once = [0] * THREADS, threading.Barrier(THREADS)

    def work(i: int) -> None:
        ask, expected, count = asked[i], right[i], 0
        at_once.wait()
        for _ in range(calls // THREADS):
            count += ask().tobytes() != expected
        found[i] = count

    threads = [threading.Thread(target=work, args=(i,)) for i in range(THREADS)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    return sum(found)


def main(calls: str, *more: str) -> None:
    """The command line."""
    if more:
        spoil()
    sys.setswitchinterval(1e-5)
    total = 0
    for (bodies, what), share in SHARE.items():
        found = wrong(bodies, what, round(share * int(calls)))
        print(f"{what} of {bodies} bodies: {found} wrong of {round(share * int(calls))}", flush=True)
        total += found
    print(f"in all {total} wrong of {calls}")


if __name__ == "__main__":
    main(*sys.argv[1:])
