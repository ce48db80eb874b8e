"""Features of bundles, which are part of their types: a kernel contains only the code for the features of its bundles.

    if has(c, WHEELS):
        wheel_forces(c, w, k)

The method `features` of the class of a bundle returns its features. Branches that a bundle cannot take are removed
before type inference (parts.py), so that they are not compiled. A kernel with more features than a scene has is correct
too, only larger: GENERAL stands for all features.
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
    """Whether a bundle has a feature or all of them; a constant in kernels, where `feature` is a literal or global."""
    return includes(bundle._numba_type_.features, feature)


def includes(features: frozenset[str], feature: str) -> bool:
    """Whether a feature is one of these."""
    return feature in features or GENERAL in features


def numbers_of(features: frozenset[str], prefix: str, count: int) -> tuple[int, ...]:
    """The numbers n below `count` for which the feature "<prefix> n" is present."""
    return tuple(n for n in range(count) if includes(features, f"{prefix} {n}"))


@overload(has)
def _has(bundle, feature):
    """For numba versions without hooks, where branches are not removed early: a constant that the optimiser uses."""
    if not isinstance(feature, types.StringLiteral):
        raise errors.RequireLiteralValue("features have names that are known when a kernel is compiled")
    if includes(bundle.features, feature.literal_value):
        return lambda bundle, feature: True
    return lambda bundle, feature: False


@register_pass(mutates_CFG=False, analysis_only=False)
class KnownFeatures(FunctionPass):
    """Replaces `has(c, WHEELS)` by True or False, so that numba's next pass removes the branches."""

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
    """The value of a call of `has`, from the types of its arguments; None for any other expression."""
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
    """Type of a bundle that is an argument, or a member of such a bundle; None if it is not known yet."""
    definition = guard(get_definition, state.func_ir, variable)
    if isinstance(definition, ir.Arg):
        kind = state.args[definition.index]
    elif isinstance(definition, ir.Expr) and definition.op == "getattr":
        outer = _type_of(state, definition.value)
        kind = None if outer is None else dict(outer.kinds).get(definition.attr)
    else:
        return None
    return kind if hasattr(kind, "features") else None
