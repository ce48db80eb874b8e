"""What a bundle contains, in its type: a kernel is compiled for the features of its bundles, and without all others.

    if has(c, WHEELS):
        wheel_forces(c, w, k)

The class of a bundle says which features it has by a method `features`. Branches that a bundle cannot take are cut out
before types are inferred (parts.py), so that nothing in them is compiled. A kernel of more features than a scene has
is correct too, only larger: GENERAL stands for all of them.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import errors, ir
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import GuardException, find_const, get_definition, guard
from numba.extending import overload

GENERAL = "general"


def has(bundle: Any, feature: str) -> bool:
    """Whether a bundle has a feature, or has them all; in kernels a constant, `feature` a literal or a global name."""
    return includes(bundle._numba_type_.features, feature)


def includes(features: frozenset[str], feature: str) -> bool:
    """Whether a feature is one of these."""
    return feature in features or GENERAL in features


def numbers_of(features: frozenset[str], prefix: str, count: int) -> tuple[int, ...]:
    """Which of the features "prefix 0", "prefix 1", ... there are, of `count`."""
    return tuple(n for n in range(count) if includes(features, f"{prefix} {n}"))


@overload(has)
def _has(bundle, feature):
    """Where branches are not cut (no hooks into numba): still a constant, which the optimiser sees."""
    if not isinstance(feature, types.StringLiteral):
        raise errors.RequireLiteralValue("features have names that are known when a kernel is compiled")
    if includes(bundle.features, feature.literal_value):
        return lambda bundle, feature: True
    return lambda bundle, feature: False


@register_pass(mutates_CFG=False, analysis_only=False)
class KnownFeatures(FunctionPass):
    """`has(c, WHEELS)` becomes True or False, for numba's next pass to cut branches by."""

    _name = "known_features"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        found = False
        for block in state.func_ir.blocks.values():
            for statement in block.find_insts(ir.Assign):
                known = _known(state, statement.value)
                if known is not None:
                    statement.value = ir.Const(known, loc=statement.loc)
                    state.func_ir._definitions[statement.target.name] = [statement.value]
                    found = True
        return found


def _known(state: Any, value: Any) -> bool | None:
    """Value of a call of `has` by the types of the arguments; None for anything else."""
    if not isinstance(value, ir.Expr) or value.op != "call" or len(value.args) != 2:
        return None
    called = guard(get_definition, state.func_ir, value.func)
    if not isinstance(called, ir.Global | ir.FreeVar) or called.value is not has:
        return None
    kind = _type_of(state, value.args[0])
    try:
        feature = find_const(state.func_ir, value.args[1])
    except GuardException:
        return None
    return None if kind is None else includes(kind.features, feature)


def _type_of(state: Any, variable: Any) -> Any:
    """Type of a bundle that is an argument, or a member of one; None where that is not known yet."""
    definition = guard(get_definition, state.func_ir, variable)
    if isinstance(definition, ir.Arg):
        kind = state.args[definition.index]
    elif isinstance(definition, ir.Expr) and definition.op == "getattr":
        outer = _type_of(state, definition.value)
        kind = None if outer is None else dict(outer.kinds).get(definition.attr)
    else:
        return None
    return kind if hasattr(kind, "features") else None
