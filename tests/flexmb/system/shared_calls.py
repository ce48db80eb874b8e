"""All public calls, by many threads at once on the same objects. Run as a program: prints how many were wrong.

    python -m tests.flexmb.system.shared_calls [--span S] [--thorough] [--spoiled] [scene ...]

All ask the same question at once, again and again for a span of time. Each thread has arguments of its own: one that
wrote over another's numbers would leave others. What is right is what one thread finds with objects of its own, to the
bit; the shared ones are new, so that threads meet at all that is made when it is first asked for. What is asked is the
list of `public_calls.py`, which holds everything that `walk.py` finds; other scenes are asked what any system can be
asked. `--spoiled` is the negative control: what should be each thread's own is shared.
"""

from __future__ import annotations

import argparse
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

THREADS = 8
WHOLE = "whole"


def spoil() -> None:
    """What should be each thread's own is shared, and gates let every thread pass."""
    from flexmb.tables import per_thread

    per_thread.per_thread = cached_property  # type: ignore[assignment,misc]
    from flexmb.entry import gate
    from flexmb.jit.kernel import helper

    @helper
    def everybody(g):  # type: ignore[no-untyped-def]
        return True

    gate._is_owner = everybody


def scenes() -> dict[str, Callable[[], Any]]:
    """Connectors of all kinds, a closed chain, a controlled one, a long one."""
    from tests.benchmarks.rivals import rigid_chain
    from tests.flexmb.closure.mechanisms import bennett
    from tests.flexmb.connectors.connected_scenes import everything
    from tests.flexmb.system.test_copies import controlled

    return {
        "connected": everything, "closed": bennett, "controlled": controlled, "long": lambda: rigid_chain(60),
    }  # fmt: skip


@dataclass
class Asked:
    """New objects, what can be asked of them, and a state of each of their systems for each thread."""

    calls: dict[str, Any]
    states: list[list[Any]]

    def ask(self, name: str, i: int) -> Any:
        """The answer to what a thread asks."""
        call = self.calls[name]
        given = {argument: self._own(argument, value, i) for argument, value in call.arguments.items()}
        return call.function(**given)

    def _own(self, argument: str, value: Any, i: int) -> Any:
        """What a thread gives in the place of an argument."""
        import flexmb as fm

        if isinstance(value, fm.State):
            return next(own[i] for own in self.states if own[0].layout is value.layout)
        if isinstance(value, list) and value and isinstance(value[0], fm.State):
            return [self._own(argument, each, i) for each in value]
        if isinstance(value, np.ndarray) and value.dtype == float:
            for own in self.states:
                for part in ("q", "u", "y"):
                    if np.array_equal(value, getattr(own[0], part)):
                        return getattr(own[i], part).copy()
            return value if argument in ("q", "rows") else (1.0 + i / 32) * value  # quaternions stay what they are
        if isinstance(value, float):
            return (1.0 + i / 32) * value
        return value


def asked(scene: str) -> Asked:
    """Of a scene by name, of whom `WHOLE` stands for all objects."""
    import flexmb as fm
    from tests.flexmb.system.argument_kinds import World
    from tests.flexmb.system.public_calls import calls
    from tests.flexmb.system.system_calls import of_any

    if scene == WHOLE:
        world = World()
        systems = (world.tree, world.state), (world.chain, world.chain.initial_state)
        return Asked(calls(world), [own_states(*system) for system in systems])
    system = fm.compile(scenes()[scene]())
    states = own_states(system, system.initial_state)
    return Asked(of_any(system, states[0]), [states])


def own_states(system: Any, start: Any) -> list[Any]:
    """One for each thread, the first as given; on one motion, where closures are to be closed."""
    import flexmb as fm

    if system.scene.closures:
        run = fm.simulate(fm.compile(system.scene), 0.3, samples=THREADS)
        later = [system.state(q, u, start.t) for q, u in zip(run.q, run.u, strict=True)]
        return [start, *later[1:]]
    speeds = np.random.default_rng(0).normal(size=(THREADS, system.nu))
    later = [system.state(start.q, start.u + speeds[i], start.t + 1e-4 * i) for i in range(1, THREADS)]
    return [start, *later]


def numbers(result: Any) -> Iterator[Any]:
    """All that can be compared in a result."""
    if isinstance(result, dict):
        for key in result:
            yield key
            yield from numbers(result[key])
    elif is_dataclass(result) and not isinstance(result, type):
        for field in fields(result):
            if field.name not in ("layout", "made_by"):
                yield from numbers(getattr(result, field.name))
    elif isinstance(result, tuple | list):
        for each in result:
            yield from numbers(each)
    else:
        yield result


def same(one: Any, other: Any) -> bool:
    """To the bit."""
    return all(
        a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b or (a != a and b != b)
        for a, b in zip(numbers(one), numbers(other), strict=True)
    )


def wrong(scene: str, span: float, thorough: bool) -> tuple[int, dict[str, int]]:
    """How many questions were asked, and how many answers were wrong, by question; each is asked for so long (s)."""
    from tests.flexmb.system.public_calls import LONG  # they share a scene only, and two threads ask them

    alone, shared = asked(scene), asked(scene)
    threads = {name: range(2 if name in LONG and not thorough else THREADS) for name in shared.calls}
    right = {name: [alone.ask(name, i) for i in who] for name, who in threads.items()}
    found, count, at_once = dict.fromkeys(threads, 0), [0] * THREADS, threading.Barrier(THREADS)

    def work(i: int) -> None:
        for name, who in threads.items():
            at_once.wait()
            end = perf_counter() + span
            while i in who:
                try:
                    is_right = same(shared.ask(name, i), right[name][i])
                except Exception as problem:
                    is_right = False
                    print(f"{name}: {type(problem).__name__}: {problem}"[:300], file=sys.stderr)
                found[name] += not is_right
                count[i] += 1
                if perf_counter() > end:
                    break

    working = [threading.Thread(target=work, args=(i,)) for i in range(THREADS)]
    for each in working:
        each.start()
    for each in working:
        each.join()
    return sum(count), {name: number for name, number in found.items() if number}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", help="by default all")
    parser.add_argument("--span", type=float, default=0.002, help="seconds for each question")
    parser.add_argument("--thorough", action="store_true", help="all threads ask what takes long, too")
    parser.add_argument("--spoiled", action="store_true")
    asked_for = parser.parse_args()
    if asked_for.spoiled:
        spoil()
    sys.setswitchinterval(1e-5)  # so that threads meet in the middle of everything
    warnings.simplefilter("ignore")
    for name in asked_for.scenes or (WHOLE, *scenes()):
        count, found = wrong(name, asked_for.span, asked_for.thorough)
        print(f"{name}: {sum(found.values())} wrong of {count} {found}", flush=True)


if __name__ == "__main__":
    main()
