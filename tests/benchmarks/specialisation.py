"""What special kernels gain by leaving something out: a table for docs/kernels.md, feature by feature.

    python -m tests.benchmarks.specialisation

For two chains, kernels are compiled for what they contain and for one feature more (`flexmb.tables.features`), and the
evaluations by both are timed in turns: what the feature costs a scene that does without it. Each feature is measured in
a process of its own with an empty folder of kernels, so that seconds of compiling are those of this feature alone.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from time import process_time
from unittest import mock

from tests.benchmarks.rivals import flexible_chain, interleaved, rigid_chain
from tests.repo.project import ROOT

BODIES, MODES = 10, 5
SCENES = {"rigid": lambda: rigid_chain(BODIES), "flexible": lambda: flexible_chain(BODIES, MODES, "full")}


def additions() -> dict[str, frozenset[str]]:
    """Features by what a table calls them: alone, or all of a kind."""
    from flexmb.hinges.catalogue import KINDS
    from flexmb.levels.body import LEVELS
    from flexmb.tables import features as f

    kinds = {
        "all kinds of hinges": frozenset(f"{f.HINGE} {n}" for n in range(len(KINDS))) | {f.SEVERAL, f.QUATERNIONS},
        "all axes": frozenset(f"{f.AXIS} {n}" for n in range(3)),
        "all levels of bodies": frozenset(f"{f.LEVEL} {n}" for n in range(len(LEVELS))) | {f.MODES, f.SECOND_ORDER},
    }
    alone = (
        f.INBOARD_NODES, f.OUTBOARD_NODES, f.WHEELS, f.LOADS, f.CONNECTORS, f.FRAME_LAWS, f.HINGE_SPRINGS,
        f.COORDINATE_LAWS, f.FUNCTIONS, f.MOTORS, f.PRESCRIBED, f.SPRINGS, f.DAMPERS, f.MODAL_DAMPING,
    )  # fmt: skip
    return kinds | {name: frozenset({name}) for name in alone} | {"everything": frozenset({f.GENERAL})}


def measured(scene: str, addition: str) -> tuple[float, float, float]:
    """In this process: time by kernels that have it over that without, and CPU seconds to compile either."""
    logging.getLogger("flexmb.jit").setLevel(logging.ERROR)
    import flexmb
    from flexmb.tables import features

    contained = features.contained

    def evaluation(more: frozenset[str]) -> tuple[object, float]:
        start = process_time()
        with mock.patch.object(features, "contained", lambda c: contained(c) | more):
            system = flexmb.compile(SCENES[scene](), kernels="special")
            evaluator, state = system.evaluator(), system.initial_state
            evaluator(state.t, state.q, state.u)
            spent = process_time() - start
        return (lambda: evaluator(state.t, state.q, state.u)), spent

    evaluation(frozenset({"imports, and what every kernel shares"}))
    without, seconds_without = evaluation(frozenset())
    with_it, seconds_with = evaluation(additions()[addition])
    slow, fast = interleaved(with_it, without)
    return slow / fast, seconds_without, seconds_with


def rows() -> Iterator[str]:
    """Lines of the table."""
    yield "| what a kernel has more | slower: rigid | flexible | more to compile, s: rigid | flexible |"
    yield "|---|---|---|---|---|"
    for addition in additions():
        ratios, seconds = [], []
        for scene in SCENES:
            with tempfile.TemporaryDirectory() as folder:
                done = subprocess.run(
                    [sys.executable, "-m", __spec__.name, scene, addition], cwd=ROOT, check=True, text=True,
                    env=os.environ | {"NUMBA_CACHE_DIR": folder}, stdout=subprocess.PIPE,
                )  # fmt: skip
            ratio, without, with_it = json.loads(done.stdout)
            ratios.append(f"{round(100 * (ratio - 1))} %")
            seconds.append(f"{round(with_it - without, 1) + 0.0}")  # no minus before zero
        yield f"| {addition} | {' | '.join(ratios + seconds)} |"


def main(words: list[str]) -> None:
    """One measurement as JSON, or all as a table."""
    if words:
        print(json.dumps(measured(*words)))
        return
    for row in rows():
        print(row, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
