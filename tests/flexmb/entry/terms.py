"""Terms of the derivatives by recursion, each left out once: the planted errors of `test_terms.py`.

A term is an argument of a sum or difference of vectors, one side of a sum with a scalar product or a derivative by
duals, or a statement that adds to an element of a table.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import textwrap
from collections.abc import Iterator
from functools import cache
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

from flexmb.jain import derivatives
from flexmb.jain.derivatives import blocks, sweeps
from flexmb.jit.duals import rate
from flexmb.spatial.spatial_vector import axpy6, dot6, plus6, sub6, sum6
from flexmb.spatial.vector import add, axpy, dot, sub

_SUMS = {sum6, add, blocks.sum_block6, blocks.sum_block}  # (a, b)
_FIRST_AND_MORE = {sub6, sub, blocks.less, plus6}  # (a, ...): a - b, or a + b . c
_SCALED_SUMS = {axpy6, axpy, blocks.plus6, blocks.plus}  # (s, a, b): b + s a
_PRODUCTS = {dot6, dot, rate}


class Term(NamedTuple):
    """Where a term is, and the function without it."""

    where: str  # module.function
    text: str  # of the sum, and what is left of it
    function: Any
    without: ast.FunctionDef


def modules() -> list[str]:
    """Names of the modules of the recursion but that of strained beams, which `test_strained.py` holds."""
    return [module.name for module in pkgutil.iter_modules(derivatives.__path__) if module.name != "strained"]


def terms(module: str) -> Iterator[Term]:
    """All terms of a module that the derivatives of accelerations and inverse dynamics have."""
    loaded = importlib.import_module(f"{derivatives.__name__}.{module}")
    names, used = vars(loaded), _reached()
    for name, function in names.items():
        python = getattr(function, "py_func", None)
        if python is None or python.__module__ != loaded.__name__ or python not in used:
            continue
        source = textwrap.dedent(inspect.getsource(python))
        for i in range(len(_changes(ast.parse(source), names))):
            tree = ast.parse(source)
            node, left = _changes(tree, names)[i]
            said = f"{ast.unparse(node)} -> {ast.unparse(left)}"
            [definition] = _Replaced(node, left).visit(tree).body
            definition.decorator_list = []
            yield Term(f"{module}.{name}", said, function, ast.fix_missing_locations(definition))


@cache
def _reached() -> frozenset[FunctionType]:
    """The functions that these kernels call, directly or not."""
    found, waiting = set[FunctionType](), [sweeps.accelerations_and_power.py_func, sweeps.inverse_dynamics.py_func]
    while waiting:
        function = waiting.pop()
        if function not in found:
            found.add(function)
            waiting += _called(function)
    return frozenset(found)


def _called(function: FunctionType) -> list[FunctionType]:
    """The helpers that a function names: as they are, as attributes of modules, and those that it chooses among."""
    names = function.__code__.co_names
    known = [function.__globals__[name] for name in names if name in function.__globals__]
    known += [getattr(module, name, None) for module in known if isinstance(module, ModuleType) for name in names]
    known += [cell.cell_contents for cell in function.__closure__ or ()]
    plain = [each for each in known if isinstance(each, FunctionType) and each.__closure__]
    return [each.py_func for each in known if isinstance(getattr(each, "py_func", None), FunctionType)] + plain


def _changes(tree: ast.AST, names: dict[str, Any]) -> list[tuple[ast.AST, ast.AST]]:
    """Nodes, and what is left of each without a term."""
    return [(node, left) for node in ast.walk(tree) for left in _without(node, names)]


def _without(node: ast.AST, names: dict[str, Any]) -> list[ast.AST]:
    match node:
        case ast.Call(func=ast.Name(id=name), args=[a, b]) if names.get(name) in _SUMS:
            return [a, b]
        case ast.Call(func=ast.Name(id=name), args=[a, *_]) if names.get(name) in _FIRST_AND_MORE:
            return [a]
        case ast.Call(func=ast.Name(id=name), args=[_, _, b]) if names.get(name) in _SCALED_SUMS:
            return [b]
        case ast.BinOp(left=a, op=ast.Add(), right=b) if _has_product(node, names):
            return [a, b]
        case ast.BinOp(left=a, op=ast.Sub(), right=_) if _has_product(node, names):
            return [a]
        case ast.AugAssign(target=ast.Subscript()):
            return [ast.Pass()]
    return []


def _has_product(node: ast.AST, names: dict[str, Any]) -> bool:
    """Whether a sum of numbers, and not of places, has a product or a derivative in it."""
    called = [each.func.id for each in ast.walk(node) if isinstance(each, ast.Call) and isinstance(each.func, ast.Name)]
    return any(names.get(name) in _PRODUCTS for name in called)


class _Replaced(ast.NodeTransformer):
    def __init__(self, node: ast.AST, left: ast.AST) -> None:
        self._node, self._left = node, left

    def visit(self, node: ast.AST) -> Any:
        """The replacement in place of the node."""
        return self._left if node is self._node else self.generic_visit(node)
