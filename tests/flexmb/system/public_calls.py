"""Every public call, and everything that can be wrong with its arguments. Run as a program: prints what is not right.

A call with one argument exchanged may raise one of the documented errors, or return what it returns for the same
numbers as plain floats; never crash, and never return numbers that are not finite. What is not to be had must raise.
After all that is wrong with an argument, the right call gives the same bits as before. `shared_calls.py` has threads
ask the same calls; `walk.py` finds what must be among them.
"""

from __future__ import annotations

import faulthandler
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from time import perf_counter
from typing import Any
from zlib import crc32

import numpy as np

import flexmb as fm
from tests.flexmb.system.argument_kinds import Call, Calls, Variant, W, World
from tests.flexmb.system.batch_calls import of_batches
from tests.flexmb.system.object_calls import of_objects
from tests.flexmb.system.run_calls import of_scenes
from tests.flexmb.system.system_calls import of_the_chain, of_the_tree

# SceneError, ClosureError, LinAlgError are among the former; KeyError is of names that do not exist.
DOCUMENTED = (ValueError, TypeError, KeyError, ArithmeticError, NotImplementedError)


LONG = {
    "advise", "fit", "gradient", "uncertainty", "sensitivities", "compile_batch", "simulate_stages", "equilibrium_path",
}  # fmt: skip
"""What takes long: of numbers that are right in another form, two are tried unless there is time."""
SHARE = 3
"""Unless there is time, one in so many of the variants is tried, a different one for each argument of each call."""


@cache
def calls(w: World = W) -> Calls:
    """By name; what is asked is shared by all who ask."""
    return Calls(of_the_tree(w) | of_the_chain(w) | of_objects(w) | of_scenes(w) | of_batches(w))


def arrays_of(result: Any) -> Iterator[np.ndarray]:
    """All numbers in a result."""
    if isinstance(result, np.ndarray | float | int | complex):
        yield np.asarray(result)
    elif isinstance(result, dict):
        for each in result.values():
            yield from arrays_of(each)
    elif isinstance(result, tuple | list):
        for each in result:
            yield from arrays_of(each)
    elif isinstance(result, fm.State):
        yield from (result.q, result.u, np.asarray(result.t))
    elif is_dataclass(result):
        for field in fields(result):
            yield from arrays_of(getattr(result, field.name))


def same(a: Any, b: Any) -> bool:
    """Whether two results hold equal numbers: up to the rounding of what is scaled again."""
    pairs = list(zip(arrays_of(a), arrays_of(b), strict=True))
    return all(x.shape == y.shape and np.allclose(x, y, rtol=1e-9, atol=1e-12) for x, y in pairs)


def finite(result: Any) -> bool:
    return all(np.isfinite(each).all() for each in arrays_of(result))


def variants(name: str, call: Call, argument: str, thorough: bool) -> list[Variant]:
    """What is given in the place of an argument."""
    found = list(call.kinds[argument](call.arguments[argument]))
    if thorough:
        return found
    if name in LONG:
        found = [each for each in found if each.plain is None] + [each for each in found if each.plain is not None][:2]
    return found[crc32(f"{name}({argument})".encode()) % min(SHARE, len(found) or 1) :: SHARE]


def faults(name: str, call: Call, thorough: bool = False) -> Iterator[str]:
    """What is not right about a call."""
    first = call.function(**call.arguments)
    if not finite(first):
        yield f"{name}: sound arguments give numbers that are not finite"
    before = bits(first)
    for argument in call.kinds:
        for variant in variants(name, call, argument, thorough):
            where = f"{name}({argument}: {variant.name})"
            try:
                with np.errstate(all="ignore"):
                    result = call.function(**call.arguments | {argument: variant.value})
            except DOCUMENTED as error:
                if variant.plain is not None and not raises(call, argument, variant.plain):
                    yield f"{where}: refused, {type(error).__name__}: {error}"
            except BaseException as error:  # an error of another kind
                yield f"{where}: {type(error).__name__}: {error}"
            else:
                if variant.plain is None and not variant.open:
                    yield f"{where}: no error"
                elif not finite(result) and not (isinstance(result, tuple) and is_status(result)):
                    yield f"{where}: not finite"
                elif variant.plain is not None and not same(
                    result, call.function(**call.arguments | {argument: variant.plain})
                ):
                    yield f"{where}: another result than that of floats"
        try:
            if bits(call.function(**call.arguments)) != before:
                yield f"{name}: after wrong values of {argument} the right ones give other numbers"
        except Exception as error:
            yield f"{name}: after wrong values of {argument} the right ones give {type(error).__name__}: {error}"


HARD = "huge", "short", "short q", "NaN", "nan at 0", "times 1e+308", "times 1e+150", "nan at (0, 0)", "nan", "1e+308"
"""Variants that overflow, are not finite or too short: what they leave behind may be asked for by any other call."""
QUICK = 4e-4
"""Seconds that a right call may take to be asked after each of these."""


def left_behind(asked: dict[str, Call], thorough: bool = True) -> Iterator[str]:
    """Right calls of an object that give other bits after a hard call of the same object, whatever became of that."""
    objects: dict[str, dict[str, list[bytes]]] = {}
    for name, call in asked.items():
        call.function(**call.arguments)
        begin = perf_counter()
        right = bits(call.function(**call.arguments))
        if perf_counter() - begin < QUICK:
            objects.setdefault(object_of(name), {})[name] = right
    for name, call in asked.items():
        for argument in call.kinds:
            for variant in (variant for variant in variants(name, call, argument, thorough) if variant.name in HARD):
                with suppress(*DOCUMENTED), np.errstate(all="ignore"):
                    call.function(**call.arguments | {argument: variant.value})
                for other, right in objects.get(object_of(name), {}).items():
                    if fault := _another(asked[other], right):
                        yield f"{other} after {name}({argument}: {variant.name}): {fault}"


def object_of(name: str) -> str:
    """The kind of which there is one object; functions are given the tree."""
    kind = name.split(",")[0].split(".")[0]
    return kind if "." in name.split(",")[0] else "System"


def _another(call: Call, right: list[bytes]) -> str:
    """What is not as it was, if anything."""
    try:
        return "" if bits(call.function(**call.arguments)) == right else "other numbers"
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def bits(result: Any) -> list[bytes]:
    """All numbers in a result, to be compared to the bit."""
    return [each.tobytes() for each in arrays_of(result)]


def is_status(result: tuple[Any, ...]) -> bool:
    """A status that is not OK says that numbers mean nothing."""
    return isinstance(result[0], int) and result[0] != 0


def raises(call: Call, argument: str, value: Any) -> bool:
    try:
        call.function(**call.arguments | {argument: value})
    except DOCUMENTED:
        return True
    return False


def main() -> None:
    faulthandler.enable()
    from tests.flexmb.system.walk import unlisted

    thorough, count = "--thorough" in sys.argv, 0
    found = [f"{name}: public, and not called" for name in sorted(unlisted())]
    for name, call in calls().items():
        print(name, file=sys.stderr, flush=True)
        found += faults(name, call, thorough)
        count += sum(len(variants(name, call, argument, thorough)) for argument in call.kinds)
    found += left_behind(calls(), thorough)
    print("\n".join(found))
    print(f"{count} calls, {len(found)} faults")


if __name__ == "__main__":
    main()
