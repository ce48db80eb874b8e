"""No function has more than eight arguments, but for those whose arguments are options of a command line or keys of the
schema, from which they are generated."""

import ast
from collections.abc import Iterator

import crosscheck.cli
import flexmb.cli
from tests.repo import builder
from tests.repo.project import ROOT

MOST = 8


def long_signatures(source: str) -> Iterator[str]:
    """Names of the functions with more arguments than that, positional and keyword-only ones, `self` included."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            if len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs) > MOST:
                yield node.name


def commands() -> set[tuple[str, str]]:
    """(file, function) of every command of the command lines."""
    found = [each.callback for app in (flexmb.cli.app, crosscheck.cli.app) for each in app.registered_commands]
    return {(f"{each.__module__.replace('.', '/')}.py", each.__name__) for each in found if each is not None}


def test_functions_have_few_arguments() -> None:
    files = [path for package in ("flexmb", "crosscheck") for path in sorted((ROOT / package).rglob("*.py"))]
    found = {
        (path.relative_to(ROOT).as_posix(), name)
        for path in files
        if path != builder.FILE
        for name in long_signatures(path.read_text(encoding="utf-8"))
    }
    assert found - commands() == set()


def test_a_ninth_argument_is_seen() -> None:
    nine = ", ".join(f"a{i}" for i in range(9))
    assert list(long_signatures(f"def f({nine}): ...\ndef g({nine[4:]}): ...")) == ["f"]
    assert list(long_signatures(f"def f(a, /, b, *, {nine[8:]}): ...")) == ["f"]
    assert list(long_signatures(f"def f({nine[4:]}, *more, **others): ...")) == []
