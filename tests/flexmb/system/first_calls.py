"""The first calls of a process, by several threads at once. Run as a program: prints what went wrong, or "right".

    python -m tests.flexmb.system.first_calls {shared,own} [--spoiled]

Kernels are found or compiled at first calls, and much is looked up that is kept for the next one. `own`: each thread
has a system of its own. `--spoiled` is the negative control: kernels are settled without a lock.
"""

from __future__ import annotations

import sys
import threading
from typing import Any

import numpy as np

THREADS, COPIES = 4, 4096


def spoil() -> None:
    """One thread forbids what another is about to compile."""
    from flexmb.jit import direct

    def settled(compiled: Any, *kinds: Any) -> Any:
        if kinds not in compiled.overloads:
            compiled.disable_compile(False)
            compiled.compile(kinds)
            compiled.disable_compile()
        return compiled

    direct.settled = settled


def asked(fm: Any, system: Any) -> list[Any]:
    """Of a system, in this order."""
    rng = np.random.default_rng(0)
    q, u = rng.normal(size=(COPIES, system.nq)), rng.normal(size=(COPIES, system.nu))
    state = system.state(q[0], u[0])
    return [
        system.accelerations_batch(q, u).accelerations,
        system.evaluator()(0.0, q[0], u[0]).copy(),
        system.accelerations(state, "composite"),
        system.mass_matrix(state),
        np.array(list(system.energy(state).values())),
        fm.simulate(system, 1e-3, samples=3).q,
    ]


def main(which: str, *more: str) -> None:
    """The command line."""
    sys.setswitchinterval(1e-5)
    if more:
        spoil()
    import flexmb as fm
    from tests.benchmarks.rivals import rigid_chain

    shared = fm.compile(rigid_chain(3))
    systems = [shared if which == "shared" else fm.compile(rigid_chain(3)) for _ in range(THREADS)]
    at_once, found, problems = threading.Barrier(THREADS), list[Any](), list[str]()

    def work(system: Any) -> None:
        at_once.wait()
        try:
            found.append(asked(fm, system))
        except BaseException as problem:
            problems.append(f"{type(problem).__name__}: {problem}")

    threads = [threading.Thread(target=work, args=(system,)) for system in systems]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    expected = asked(fm, fm.compile(rigid_chain(3)))
    for one in found:
        right = [np.array_equal(a, b) for a, b in zip(one, expected, strict=True)]
        problems += [f"answer {i}" for i in np.flatnonzero(np.logical_not(right))]
    print("\n".join(problems) or "right")


if __name__ == "__main__":
    main(*sys.argv[1:])
