"""Static check of a law "module:function" in the source of its module, since importing a module executes it.

Only definite faults are reported. Modules without source (compiled, built in), and names that are bound otherwise than
by `def`, are left to the import.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path

BOUND_BY_HAND = ("globals", "exec", "setattr", "vars", "locals")  # calls that bind names dynamically
DEEPEST = 8  # limit of successive re-exports of a name


def fault(module: str, name: str, arguments: int, depth: int = 0) -> str | None:
    """Why "module:name" cannot be a function of that many arguments, by its source; None if that cannot be told."""
    if module in sys.modules:
        return None  # already imported: another import executes nothing
    found = _spec(module)
    if found is None:
        return f"No module named {module!r}"
    tree = _parsed(found)
    if tree is None or _makes_names(tree):
        return None
    first, _, inner = name.partition(".")
    bindings = list(_bindings(tree.body, first))
    if not bindings:
        return f"module {module!r} has no attribute {first!r}"
    last = bindings[-1]
    match last:
        case ast.FunctionDef() if not inner and len(bindings) == 1 and not _replaced(last):
            return None if _takes(last.args, arguments) else f"it does not take {arguments} arguments"
        case ast.AsyncFunctionDef():
            return "it is asynchronous"
        case ast.Import() if not inner:
            return "it is a module"
        case ast.ImportFrom(module=str(other), level=0) if len(bindings) == 1 and depth < DEEPEST:
            true = next(name.name for name in last.names if (name.asname or name.name) == first)
            return None if inner else fault(other, true, arguments, depth + 1)
    return None


def _spec(module: str) -> ModuleSpec | None:
    """Search along sys.path as Python does, but without importing parent packages."""
    path: Sequence[str] | None = None
    parts, found = module.split("."), None
    for count in range(1, len(parts) + 1):
        full = ".".join(parts[:count])
        loaded = getattr(sys.modules.get(full), "__spec__", None)
        found = loaded or _searched(full, path)
        if found is None:
            return None
        path = list(found.submodule_search_locations or ())
        if count < len(parts) and found.submodule_search_locations is None:
            return None
    return found


def _searched(module: str, path: Sequence[str] | None) -> ModuleSpec | None:
    for finder in sys.meta_path:
        if found := getattr(finder, "find_spec", lambda *_: None)(module, path, None):
            return found
    return None


def _parsed(spec: ModuleSpec) -> ast.Module | None:
    if not spec.has_location or spec.origin is None or Path(spec.origin).suffix != ".py":
        return None
    try:
        return ast.parse(Path(spec.origin).read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return None  # the import gives a better message


def _makes_names(tree: ast.Module) -> bool:
    """Whether names may be bound dynamically: `from m import *`, `__getattr__`, `globals()`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and any(name.name == "*" for name in node.names):
            return True
        if isinstance(node, ast.FunctionDef) and node.name == "__getattr__":
            return True
        if isinstance(node, ast.Name) and node.id in BOUND_BY_HAND:
            return True
    return False


def _bindings(body: Sequence[ast.stmt], name: str) -> Iterator[ast.stmt]:
    """The statements at module level, also inside branches and blocks, that bind a name."""
    for statement in body:
        match statement:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                if statement.name == name:
                    yield statement
                continue
            case ast.Import() | ast.ImportFrom():
                if any((alias.asname or alias.name.partition(".")[0]) == name for alias in statement.names):
                    yield statement
                continue
        inner = [block for key in ("body", "orelse", "finalbody") for block in getattr(statement, key, ())]
        inner += [line for handler in getattr(statement, "handlers", ()) for line in handler.body]
        inner += [line for case in getattr(statement, "cases", ()) for line in case.body]
        yield from _bindings(inner, name)
        if any(_binds(node, name) for node in ast.walk(statement)):
            yield statement


def _binds(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name and not isinstance(node.ctx, ast.Load)


def _replaced(function: ast.FunctionDef) -> bool:
    """Whether a decorator may replace the function; flexmb's own decorator keeps the arguments."""
    names = {ast.unparse(decorator).rpartition(".")[2] for decorator in function.decorator_list}
    return bool(names - {"user_function"})


def _takes(arguments: ast.arguments, count: int) -> bool:
    most = len(arguments.posonlyargs) + len(arguments.args)
    least = most - len(arguments.defaults)
    required = any(default is None for default in arguments.kw_defaults)
    return least <= count and (count <= most or arguments.vararg is not None) and not required
