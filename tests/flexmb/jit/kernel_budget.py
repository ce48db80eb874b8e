"""What kernels cost without a clock: operations executed, calls left in machine code, helpers compiled.

    python -m tests.flexmb.jit.kernel_budget          # write tests/flexmb/jit/kernel_budget.json anew
    python -m tests.flexmb.jit.kernel_budget rigid    # print what one scene costs now

Each scene is measured in a process of its own, with its own features and an empty cache: what another kernel compiled
before counts for nobody.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from flexmb.scene.schema import Scene
from tests import trees
from tests.benchmarks.rivals import flexible_chain, rigid_chain
from tests.repo.project import ROOT

BASELINE = Path(__file__).with_name("kernel_budget.json")
BODIES, MODES = 3, 5
SCENES: dict[str, Callable[[], Scene]] = {
    "rigid": lambda: rigid_chain(BODIES),
    "ruthless": lambda: flexible_chain(BODIES, MODES, "ruthless"),
    "full": lambda: flexible_chain(BODIES, MODES, "full"),
    "everything": lambda: trees.random_scene(1, trees.Recipe(levels=("full", "linear", "ruthless", "stiffened"))),
}
# Of C's library; all else that is called is a helper that was not written out, or numba's runtime.
ELEMENTARY = {"sin", "cos", "sincos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "pow", "fmod", "hypot"}


class Budget(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Cost of the right-hand side of one scene; `calls` by instruction in the optimised module, at whatever place."""

    operations: dict[str, int]
    calls: int
    helpers: int

    @property
    def figures(self) -> dict[str, int]:
        """Everything that must not grow, by name."""
        total = sum(self.operations.values())
        return {"operations": total, "calls": self.calls, "helpers": self.helpers}


class Budgets(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """By scene; `compiler` are the versions that calls and helpers are of."""

    compiler: str
    scenes: dict[str, Budget]


def grown(now: Budget, before: Budget) -> list[str]:
    """What has grown, as sentences."""
    return [
        f"{name}: {now.figures[name]} instead of {figure}"
        for name, figure in before.figures.items()
        if now.figures[name] > figure
    ]


def baseline() -> Budgets:
    """What is stored."""
    return msgspec.json.decode(BASELINE.read_bytes(), type=Budgets)


def compiler() -> str:
    """Versions of what makes machine code."""
    import llvmlite
    import numba

    return f"numba {numba.__version__}, llvmlite {llvmlite.__version__}"


def measured_apart(scene: str) -> Budget:
    """Of a scene by name, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder, "PYTHONPATH": str(ROOT), "FLEXMB_KERNELS": "special"}
        command = [sys.executable, "-m", "tests.flexmb.jit.kernel_budget", scene]
        done = subprocess.run(command, cwd=ROOT, env=environment, check=True, stdout=subprocess.PIPE)
    return msgspec.json.decode(done.stdout, type=Budget)


def measure(scene: Scene) -> Budget:
    """Of the right-hand side at the initial state."""
    import flexmb
    from flexmb.entry.articulated import rhs
    from flexmb.jit.counting import count

    system = flexmb.compile(scene)
    state, c, w = system.initial_state, system.recursion_constants, system.recursion_workspace()
    y = np.concatenate([state.q, state.u, [0.0]])
    arguments = 0.0, y, np.empty_like(y), c, w
    helpers = compiled_helpers(lambda: rhs(*arguments))
    ((signature, _),) = rhs.overloads.items()
    operations = count(rhs, *arguments).operations
    return Budget(
        {name: getattr(operations, name) for name in operations.__dataclass_fields__},
        sum(
            sum(calls(kernel.inspect_llvm(types), kernel.overloads[types].fndesc.mangled_name).values())
            for kernel, types in reached(rhs, signature)
        ),
        helpers,
    )


def reached(kernel: Any, types: tuple[Any, ...]) -> set[tuple[Any, tuple[Any, ...]]]:
    """A version of a kernel, and those of all kernels that it calls, directly or not."""
    found = {(kernel, types)}
    for callee in kernel.overloads[types].library.callees:
        found |= reached(getattr(import_module(callee.module), callee.name), callee.arguments)
    return found


def compiled_helpers(call: Callable[[], Any]) -> int:
    """How many functions are compiled while `call` runs, each for one set of types; the kernel itself is not one."""
    from numba.core import event

    with event.install_recorder("numba:compile") as recorder:
        call()
    return max(0, sum(each.is_start for _, each in recorder.buffer) - 1)


def calls(module: str, entry: str) -> Counter[str]:
    """Call instructions by the name of what they call, in `entry` and in all that it calls, of optimised LLVM IR.

    Intrinsics and elementary functions are left out; calls through an address count as "an address".
    """
    import llvmlite.binding as llvm

    functions = {function.name: function for function in llvm.parse_assembly(module).functions}
    found, waiting, met = Counter[str](), [entry], {entry}
    while waiting:
        for called in _called(functions[waiting.pop()]):
            if called.startswith("llvm.") or called in ELEMENTARY:
                continue
            found[called] += 1
            if called in functions and called not in met and not functions[called].is_declaration:
                met.add(called)
                waiting.append(called)
    return found


def _called(function: Any) -> Iterator[str]:
    for block in function.blocks:
        for instruction in block.instructions:
            if instruction.opcode in ("call", "invoke"):
                yield [*instruction.operands][-1].name or "an address"


def main(words: list[str]) -> None:
    """Print the budget of the scene that is named, or write those of all."""
    if words:
        print(msgspec.json.encode(measure(SCENES[words[0]]())).decode())
        return
    found = Budgets(compiler(), {name: measured_apart(name) for name in SCENES})
    BASELINE.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n")


if __name__ == "__main__":
    main(sys.argv[1:])
