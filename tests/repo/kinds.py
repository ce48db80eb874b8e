"""Where the sources tell kinds of one union apart, and whether each place knows all of them.

A place is a `match` over kinds, a chain of `if isinstance`, or an `isinstance` with an `else` that means another kind.
"""

import ast
from collections.abc import Iterator
from typing import NamedTuple, get_args

from crosscheck.engines.links import Freedom as Joint
from flexmb.scene import schema as s
from flexmb.scene.freedoms import Coordinate, Freedom

UNIONS = {
    "hinges": s.Hinge, "connectors": s.Connector, "bodies": s.Body, "functions of time": s.Function,
    "actions of events": s.Action, "sensors": s.Sensor, "controllers": s.Controller, "coordinates": Coordinate,
    "items with freedoms": s.PointMass | s.Wheel, "freedoms": Freedom | Joint,
}  # fmt: skip
UNION_OF = {kind.__name__: union for union, kinds in UNIONS.items() for kind in get_args(kinds)}


class Place(NamedTuple):
    """Where kinds of a union are told apart without all of them being known."""

    line: int
    function: str
    union: str


def silent_places(source: str) -> Iterator[Place]:
    """Where something that is none of the named kinds is silently taken for another."""
    if not any(name in source for name in UNION_OF):
        return
    for function, body in _functions(ast.parse(source)):
        nodes = list(_own(body))
        chained = {id(node.orelse[0]) for node in nodes if isinstance(node, ast.If) and len(node.orelse) == 1}
        for node in nodes:
            match node:
                case ast.Match():
                    named = [_kinds(case.pattern) for case in node.cases]
                    whole = _refuses(node.cases[-1].body) or _follows(node, body)
                    yield from _unless(whole or not _tells_apart(named), node, function, named)
                case ast.IfExp():
                    named = [_asked(node.test)]
                    yield from _unless(not named[0] or _filters(node), node, function, named)
                case ast.If() if id(node) not in chained:
                    named, last = _branches(node)
                    apart = _tells_apart(named) or bool(last and any(named))
                    yield from _unless(not apart or _refuses(last), node, function, named)


def _unless(fine: bool, node: ast.stmt | ast.expr, function: str, named: list[set[str]]) -> Iterator[Place]:
    if not fine:
        yield Place(node.lineno, function, UNION_OF[sorted(set().union(*named))[0]])


def _functions(tree: ast.Module) -> Iterator[tuple[str, ast.AST]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node


def _own(function: ast.AST) -> Iterator[ast.AST]:
    """All nodes of a function but those of functions inside it."""
    for node in ast.iter_child_nodes(function):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node
            yield from _own(node)


def _tells_apart(named: list[set[str]]) -> bool:
    """Whether two branches name kinds of one union."""
    unions = [{UNION_OF[kind] for kind in kinds} for kinds in named]
    pairs = [(i, j) for i in range(len(named)) for j in range(i)]
    return any(unions[i] & unions[j] and named[i] != named[j] for i, j in pairs)


def kinds_of(match: ast.Match) -> set[str]:
    """The kinds that a match names."""
    return set().union(*(_kinds(case.pattern) for case in match.cases))


def _kinds(pattern: ast.AST) -> set[str]:
    """The kinds that a pattern or the second argument of isinstance names."""
    names = {node.id for node in ast.walk(pattern) if isinstance(node, ast.Name)}
    names |= {node.attr for node in ast.walk(pattern) if isinstance(node, ast.Attribute)}
    return names & UNION_OF.keys()


def _asked(test: ast.expr) -> set[str]:
    """The kinds after which an isinstance in a condition asks, unless it asks for one thing among several."""
    match test:
        case ast.Call(func=ast.Name(id="isinstance"), args=[_, kinds]):
            return _kinds(kinds)
    return set()


def _branches(node: ast.If) -> tuple[list[set[str]], list[ast.stmt]]:
    """The kinds that each branch of a chain asks for, and its else."""
    named = [_asked(node.test)]
    rest = node.orelse
    while len(rest) == 1 and isinstance(rest[0], ast.If):
        named.append(_asked(rest[0].test))
        rest = rest[0].orelse
    return named, rest


def _filters(node: ast.IfExp) -> bool:
    """Whether it changes or counts some kinds only: the others stay as they are, or there is nothing of them."""
    asked = ast.unparse(node.test.args[0]) if isinstance(node.test, ast.Call) else ""
    return any(ast.unparse(each) in (asked, "None", "()", "[]") for each in (node.body, node.orelse))


def _refuses(body: list[ast.stmt]) -> bool:
    """Whether a branch ends in an error: assert_never, raise, a method that always raises, or an entry by type that
    there has to be."""
    match body:
        case [ast.Assign(value=ast.Subscript(slice=ast.Call(func=ast.Name(id="type"))))]:
            return True
        case [*_, ast.Raise()]:
            return True
        case [*_, ast.Expr(ast.Call(func=ast.Name(id="assert_never") | ast.Attribute(attr="_fail")))]:
            return True
    return False


def _follows(node: ast.Match, function: ast.AST) -> bool:
    """Whether an error comes right after a match all of whose branches leave."""
    for each in ast.walk(function):
        for block in (getattr(each, "body", []), getattr(each, "orelse", [])):
            if isinstance(block, list) and node in block[:-1]:
                return isinstance(block[block.index(node) + 1], ast.Raise)
    return False
