"""A name with an underscore in front is for the module that defines it, and for classes that inherit it; no function
has more than eight arguments, but for those whose arguments are options of a command line or keys of a file.
"""

import ast
from collections.abc import Iterable, Iterator, Mapping

import crosscheck.cli
import flexmb.cli
from tests.repo import builder
from tests.repo.project import ROOT

NAMED_TUPLES = {"_asdict", "_fields", "_make", "_replace"}  # underscores keep these apart from fields
OWN = {"self", "cls", "super"}


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("_") and name not in NAMED_TUPLES


def members(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Names of the attributes and methods that the classes of a module define."""
    for node in nodes:
        match node:
            case ast.ClassDef(body=body):
                for each in body:
                    match each:
                        case ast.FunctionDef(name=name) | ast.AnnAssign(target=ast.Name(id=name)):
                            yield name
                        case ast.Assign(targets=targets):
                            yield from (target.id for target in targets if isinstance(target, ast.Name))
            case ast.Attribute(attr=name, value=owner, ctx=ast.Store()) if _is_own(owner):
                yield name


def _is_own(owner: ast.expr) -> bool:
    """Whether it is an object of the class itself, whose names a class inherits."""
    match owner:
        case ast.Name(id=name) | ast.Call(func=ast.Name(id=name)):
            return name in OWN
    return False


def imported(nodes: Iterable[ast.AST]) -> Iterator[tuple[int, str]]:
    """(line, name) of private names that are imported."""
    for node in nodes:
        match node:
            case ast.ImportFrom(lineno=line, names=names, module=module):
                modules = (module or "").split(".")
                yield from ((line, name) for name in (*modules, *(name.name for name in names)) if is_private(name))


def asked(nodes: Iterable[ast.AST]) -> Iterator[tuple[int, str]]:
    """(line, name) of private names that are asked of other objects."""
    for node in nodes:
        match node:
            case ast.Attribute(lineno=line, attr=name, value=owner) if is_private(name) and not _is_own(owner):
                yield line, name


def strangers(sources: Mapping[str, str]) -> list[str]:
    """Where a module of these imports a private name, or asks for one that only classes of other modules have."""
    kinds = ast.ClassDef, ast.ImportFrom, ast.Attribute
    nodes = {
        place: [node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds)]
        for place, source in sources.items()
    }
    defined = {place: set(filter(is_private, members(node))) for place, node in nodes.items()}
    ours = set().union(*defined.values())
    return [
        f"{place}:{line}: {name}"
        for place, node in nodes.items()
        for line, name in (*imported(node), *((at, name) for at, name in asked(node) if name in ours - defined[place]))
    ]


def test_private_names_stay_in_their_modules() -> None:
    files = [path for package in ("flexmb", "crosscheck") for path in sorted((ROOT / package).rglob("*.py"))]
    found = strangers({path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in files})
    assert not found, "give them public names, or move the code to where they are:\n" + "\n".join(found)


def test_private_names_of_others_are_found() -> None:
    """Those of libraries, of a class that is inherited and of named tuples are not meant."""
    one = "_kept = 1\nclass One:\n    _first: int\n    _last = 3\n    def _ask(self): self._found = 2"
    other = "\n".join((
        "from one import One, _kept", "x._ask()", "x._found", "x._first + x._last", "x._library", "x._replace(a=1)",
        "class Other(One):\n    def say(self): return self._found, super()._ask()",
    ))  # fmt: skip
    found = sorted(strangers({"one": one, "other": other}))
    assert found == [f"other:{each}" for each in ("1: _kept", "2: _ask", "3: _found", "4: _first", "4: _last")]
    assert strangers({"one": f"{one}\nOne()._ask()"}) == []


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
    found = [command.callback for app in (flexmb.cli.app, crosscheck.cli.app) for command in app.registered_commands]
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
