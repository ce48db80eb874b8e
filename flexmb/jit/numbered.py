"""One helper for several: a number in front of the arguments says which."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import signature
from typing import Any

from flexmb.jit.kernel import helper


def numbered(name: str, functions: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    """A helper that hands its arguments to the one of `functions`, all of one signature, that has the number in front.

    What is none of their numbers is the first, number 0. The helper is written as one would by hand,

        def name(number, q, i):
            if number == 1:
                return function_1(q, i)
            ...
            return function_0(q, i)

    since a closure around the rest of the chain would take arrays as `*arguments`, which are counted again at every
    link: evaluations of short chains then take an eighth longer.
    """
    arguments = ", ".join(signature(functions[0]).parameters)
    lines = [f"def {name}(number, {arguments}):"]
    lines += [f"    if number == {n}:\n        return function_{n}({arguments})" for n in range(1, len(functions))]
    lines += [f"    return function_0({arguments})"]
    space: dict[str, Any] = {f"function_{n}": function for n, function in enumerate(functions)}
    space["__name__"] = __name__  # numba looks a cached function's module up
    exec(compile("\n".join(lines), f"<{name} by number>", "exec"), space)
    return helper(space[name])
