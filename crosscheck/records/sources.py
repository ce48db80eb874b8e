"""The files and libraries on which the result of a module can depend, found from source texts without importing them.

The files are the module's own and all that it imports, directly or not, in packages that count as sources: flexmb,
crosscheck, the module's own package, and packages on the path that belong to no installed distribution, such as one in
development. A module named in a string ("flexmb.system.compile", "crosscheck.engines.native:NativeEngine") counts as
imported. An installed package is a library: its distribution identifies it, and its sources are not read.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec
from importlib.metadata import Distribution, distributions
from importlib.util import find_spec
from pathlib import Path

from crosscheck.library.own_files import OURS, source_folder

_NAMED = re.compile(r"([A-Za-z_]\w*(?:\.\w+)*)(?::\w+)?")


@dataclass
class Sources:
    """Files by the name of their module, and the libraries that they import: top-level names."""

    files: dict[str, Path] = field(default_factory=dict)
    libraries: set[str] = field(default_factory=set)


def sources(modules: Iterable[str], alone: Iterable[str] = ()) -> Sources:
    """Everything that `modules` import, directly or not, and the files of the modules `alone` without their imports.

    CaseError if flexmb or crosscheck were not imported from files: a key without them would match any code.
    """
    for package in OURS:
        source_folder(package)
    known = Sources()
    waiting = list(dict.fromkeys(modules))
    own = {*OURS, *(_top(module) for module in waiting)}
    seen, read = set[str](), set[str]()
    for module in alone:
        known.files.update(_with_parents(module))
    while waiting:
        module = waiting.pop()
        if module in seen:
            continue
        seen.add(module)
        top = _top(module)
        if top in sys.stdlib_module_names:
            continue
        if top not in own and owner(top) is not None:
            known.libraries.add(top)
            continue
        files = _with_parents(module)
        if not files:
            if not _place(top):
                known.libraries.add(top)  # a result can also depend on a library being absent
            continue
        known.files.update(files)
        for name, file in files.items():
            if name not in read and (name != "flexmb" or module == "flexmb"):  # flexmb/__init__.py imports everything
                read.add(name)
                waiting.extend(imported(name, file))
    return known


def imported(module: str, file: Path) -> Iterator[str]:
    """Modules that a source file imports or names in strings, without the parents of submodules."""
    if file.suffix != ".py":
        return
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):  # its import would fail as well
        return
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(package, node)
            members = [f"{base}.{name.name}" for name in node.names]
            modules = [member for member in members if _file(member) is not None]
            yield from modules
            if len(modules) < len(members):
                yield base
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = _NAMED.fullmatch(node.value)
            if named and "." in named[1] and _top(named[1]) in {*OURS, _top(module)} and _file(named[1]) is not None:
                yield named[1]


@cache
def owner(top: str) -> Distribution | None:
    """The installed distribution of a top-level module; None if its sources are on the path."""
    spec = _spec(top)
    if spec is None or spec.origin is None:
        return None
    origin = Path(spec.origin)
    for distribution, record in _installed():
        root = Path(str(distribution.locate_file("")))
        if not origin.is_relative_to(root):
            continue
        inside = origin.relative_to(root).as_posix()
        if f"\n{inside}," in record or (not record and distribution.name.replace("-", "_") == top):
            return distribution
    return None


@cache
def _installed() -> list[tuple[Distribution, str]]:
    """Installed distributions with their lists of files, "" where a distribution keeps none."""
    return [(distribution, f"\n{distribution.read_text('RECORD') or ''}".rstrip()) for distribution in distributions()]


def _absolute(package: str, node: ast.ImportFrom) -> str:
    """The module that `from ... import` names, with the dots of a relative import resolved."""
    if not node.level:
        return node.module or ""
    parts = package.split(".")
    kept = parts[: len(parts) - node.level + 1]
    return ".".join([*kept, node.module] if node.module else kept)


def _with_parents(module: str) -> dict[str, Path]:
    """The files of a module and of its parent packages, which Python executes before it."""
    parts = module.split(".")
    names = (".".join(parts[: n + 1]) for n in range(len(parts)))
    return {name: file for name in names if (file := _file(name)) is not None}


@cache
def _file(module: str) -> Path | None:
    """The source file or compiled extension of a module, if it is found."""
    top, *rest = module.split(".")
    for place in _place(top):
        path = place.joinpath(*rest)
        beside = [path.with_name(f"{path.name}{suffix}") for suffix in (".py", *EXTENSION_SUFFIXES)]
        for candidate in (path / "__init__.py", *beside):
            if candidate.is_file():
                return candidate
    return None


@cache
def _place(top: str) -> tuple[Path, ...]:
    """Folders of a top-level package; of a single module its path without the suffix."""
    spec = _spec(top)
    if spec is None:
        return ()
    if spec.submodule_search_locations is not None:
        return tuple(Path(location) for location in spec.submodule_search_locations)
    if spec.origin is None:
        return ()
    origin = Path(spec.origin)
    return (origin.parent / origin.name.partition(".")[0],)


def _spec(top: str) -> ModuleSpec | None:
    try:
        return find_spec(top)
    except ValueError:  # a module without a specification, such as __main__
        return None


def _top(module: str) -> str:
    return module.partition(".")[0]
