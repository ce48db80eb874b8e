"""One helper that dispatches to several, by a number in front of the arguments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from inspect import signature
from typing import Any

from numba.extending import overload

from flexmb.jit.features import has, numbers_of
from flexmb.jit.kernel import AS_PART


def numbered(name: str, feature: str, functions: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    """A helper `name(bundle, number, ...)` that calls `functions[number](...)`.

    All have the same signature. Only those with a feature "<feature> n" of the bundle are compiled. The source of the
    helper is generated,

        def name(bundle, number, q, i):
            if number == 1:
                return function_1(q, i)
            ...
            return function_4(q, i)

    so that a single function is called without a test.
    """

    functions = tuple(functions)

    def choose(bundle: Any, number: int, *arguments: Any) -> Any:
        if not has(bundle, f"{feature} {number}"):
            raise ValueError(f"{name}: the bundle has no {feature} {number}")
        return functions[number](*arguments)

    @cache
    def written(present: tuple[int, ...]) -> Callable[..., Any]:
        arguments = ", ".join(signature(functions[0]).parameters)
        lines = [f"def {name}(bundle, number, {arguments}):"]
        lines += [f"    if number == {n}:\n        return function_{n}({arguments})" for n in present[:-1]]
        lines += [f"    return function_{present[-1]}({arguments})"]
        space: dict[str, Any] = {f"function_{n}": functions[n] for n in present}
        space["__name__"] = __name__  # numba looks a cached function's module up
        exec(compile("\n".join(lines), f"<{name} by number>", "exec"), space)
        call: Callable[..., Any] = space[name]
        call.__qualname__ = f"{name}.{'_'.join(map(str, present))}"  # part of its symbol
        return call

    @overload(choose, jit_options=AS_PART, strict=False)  # the written one names the arguments
    def _typed(bundle, number, *arguments):
        # a bundle without any never calls it; if branches are not removed early, the first is compiled in vain
        return written(numbers_of(bundle.features, feature, len(functions)) or (0,))

    return choose
