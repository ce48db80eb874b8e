"""The fingerprint of a compiled kernel: one digest of the code of every function that it can call, and nothing else.

References are followed as the compiler follows them: from the code of the kernel through global names, attributes of
modules and closure cells to helpers, dispatching functions (`by_bundle`), constants and classes, and on from there. The
digest contains the instructions, names, constants and defaults of each function, and the values of constants, but no
docstrings, comments, line numbers or file names. Correcting a comment therefore compiles nothing anew, and editing one
hinge compiles the kernels that use it. Of numba and numpy the digest contains the versions; of the room `jit`, which is
part of the compiler, it contains all code.

A reference to an object whose value cannot be determined raises TypeError, because a wrong kernel from the disk would
give wrong results without an error. Global names have their values at the first use of a kernel; as in numba, rebinding
them later has no effect.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
import inspect
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, is_dataclass
from enum import Enum
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np

_BY_VERSION = {"builtins", "math", "cmath", "numpy", "numba"}
# Modules of this room that have no influence on compiled code.
_COMPILE_NOTHING = {"counting", "folder", "installed", "once", "processors", "progress", "warmed"}
_PLAIN = {type(None), type(...), bool, int, float, complex, str, bytes}
_KIND = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS | inspect.CO_GENERATOR  # other flags depend on compiler options
_CONSTANT, _GLOBAL, _EXTENDED = frozenset(dis.hasconst), dis.opmap["LOAD_GLOBAL"], dis.opmap["EXTENDED_ARG"]
_STORE = bytes([dis.opmap["STORE_NAME"]])


def fingerprint(kernel: FunctionType) -> str:
    """Digest of everything that the compiled kernel depends on, except the types of its arguments and the processor.

    Raises TypeError if a function refers to an object whose value cannot be determined.
    """
    functions = reached(kernel)
    place = {function: i for i, function in enumerate(functions)}
    digest = hashlib.sha256(compiler())
    for function in functions:
        own = _own(function)
        digest.update(own.digest + b"".join(place[called].to_bytes(4) for called in own.refers_to))
    return digest.hexdigest()


def reached(kernel: FunctionType) -> list[FunctionType]:
    """The kernel and all functions that it refers to, directly or indirectly, in the order in which they are found."""
    met = {kernel: None}
    waiting = [kernel]
    for function in waiting:
        for called in _own(function).refers_to:
            if called not in met:
                met[called] = None
                waiting.append(called)
    return waiting


@cache
def compiler() -> bytes:
    """Digest of the compiler: the versions of Python, numba, llvmlite and numpy, and the code of this room."""
    versions = sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, np.__version__
    names = sorted(module.name for module in iter_modules(sys.modules[__package__].__path__))  # in a zip file, too
    room = [_digest(_ModuleWords(name)) for name in names if name not in _COMPILE_NOTHING]
    if not room:
        raise TypeError(f"{__package__} shows none of its modules, and what compiles is part of the key of a kernel")
    return hashlib.sha256(repr((versions, room)).encode()).digest()


@dataclass(frozen=True)
class _Own:
    """The digest of one function without those it refers to, and these in the order of its words."""

    digest: bytes
    refers_to: tuple[FunctionType, ...]


@cache
def _own(function: FunctionType) -> _Own:
    words = _Words(function)
    return _Own(_digest(words), tuple(words.refers_to))


def _digest(words: Iterable[str | bytes]) -> bytes:
    digest = hashlib.sha256()
    for word in words:
        text = word if isinstance(word, bytes) else word.encode()
        digest.update(b"%d:" % len(text) + text)
    return digest.digest()


class _Words:
    """A function as a sequence of words, which differ for functions that compile differently."""

    def __init__(self, function: FunctionType) -> None:
        self.refers_to: list[FunctionType] = []
        self._function = function
        self._modules = set[str]()
        self._attributes = sorted(_names(function.__code__))

    def __iter__(self) -> Iterator[str | bytes]:
        function = self._function
        yield f"{function.__module__}.{function.__qualname__}"  # part of the symbols in what is compiled
        yield from self._code(function.__code__)
        yield from self._value(function.__defaults__)
        for name, default in (function.__kwdefaults__ or {}).items():
            yield name
            yield from self._value(default)
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            yield name
            yield from self._value(cell.cell_contents)

    def _code(self, code: CodeType) -> Iterator[str | bytes]:
        """Its instructions, with the values of constants instead of their indices, which depend on docstrings."""
        operations, arguments = code.co_code[::2], bytearray(code.co_code[1::2])
        constants, names = list[Any](), dict[str, None]()
        for i, operation in enumerate(operations):
            if operation not in _CONSTANT and operation != _GLOBAL:
                continue
            number = arguments[i] + (arguments[i - 1] << 8 if i and operations[i - 1] == _EXTENDED else 0)
            if operation == _GLOBAL:
                names[code.co_names[number >> 1]] = None  # the last bit is not part of the index
            else:
                arguments[i] = 0
                if not _is_docstring(code, operations[i + 1 : i + 2], arguments[i + 1 : i + 2]):
                    constants.append(code.co_consts[number])
        yield operations
        yield bytes(arguments)
        yield code.co_exceptiontable
        counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags & _KIND
        yield repr((counts, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))
        yield from self._value(tuple(constants))
        for name in names:
            yield name
            yield from self._value(self._global(name))

    def _global(self, name: str) -> Any:
        try:
            space = self._function.__globals__
            return space[name] if name in space else getattr(builtins, name)
        except AttributeError:
            raise TypeError(f"{self._function.__qualname__}: there is no {name}") from None

    def _value(self, value: Any) -> Iterator[str | bytes]:
        """Words of a constant, or of the value of a name."""
        function = getattr(value, "py_func", value)  # of what is compiled
        if isinstance(function, FunctionType) and _root(function.__module__) not in _BY_VERSION:
            self.refers_to.append(function)
            yield f"function {sorted(map(str, getattr(value, 'targetoptions', {}).items()))}"
        elif isinstance(value, ModuleType):
            yield from self._module(value)
        elif isinstance(value, type):
            yield from self._class(value)
        elif type(value) in _PLAIN:
            yield f"{type(value).__name__} {value!r}"
        elif isinstance(value, CodeType):
            yield "code"
            yield from self._code(value)
        elif isinstance(value, (tuple, frozenset)):
            yield from self._collection(value)
        elif isinstance(value, Enum):
            yield f"member {value.name}"
            yield from self._value(value.value)
        elif isinstance(value, (np.ndarray, np.generic)) and not value.dtype.hasobject:
            yield f"array {value.dtype!r} {value.shape} {value.flags.c_contiguous} {value.flags.f_contiguous}"
            yield value.tobytes()
        elif isinstance(value, (np.dtype, numba.types.Type)):
            yield f"type {value!r}"
        elif hasattr(value, "__name__") and _root(_home(value)) in _BY_VERSION:
            yield f"{type(value).__name__} {_home(value)}.{value.__name__}"
        else:
            raise TypeError(
                f"{self._function.__module__}.{self._function.__qualname__} refers to a {type(value).__qualname__}, "
                f"which the key of a compiled kernel cannot tell from others: {value!r}"
            )

    def _module(self, module: ModuleType) -> Iterator[str | bytes]:
        """Its name, and the values in it of all attribute names that the function uses."""
        yield f"module {module.__name__}"
        if _root(module.__name__) in _BY_VERSION or module.__name__ in self._modules:
            return
        self._modules.add(module.__name__)
        for name in self._attributes:
            if hasattr(module, name):
                yield name
                yield from self._value(getattr(module, name))

    def _class(self, value: type) -> Iterator[str | bytes]:
        """A class that a kernel may instantiate, or that a dispatching function tests for."""
        yield f"class {value.__module__}.{value.__qualname__}"
        if issubclass(value, tuple) and hasattr(value, "_fields"):
            yield repr(value._fields)
            yield from self._value(tuple(getattr(value, "_field_defaults", {}).values()))
        elif issubclass(value, Enum):
            yield from self._value(tuple(value))
        elif not (is_dataclass(value) or issubclass(value, BaseException) or _root(value.__module__) in _BY_VERSION):
            raise TypeError(f"{self._function.__qualname__}: the key of a compiled kernel knows no classes as {value}")

    def _collection(self, value: tuple[Any, ...] | frozenset[Any]) -> Iterator[str | bytes]:
        yield f"{type(value).__name__} of {len(value)}"
        items: Iterable[Any] = value if isinstance(value, tuple) else sorted(value, key=repr)
        for item in items:
            yield from self._value(item)


class _ModuleWords(_Words):
    """A module of this room; global names are not followed, because they refer to this room or to libraries."""

    def __init__(self, name: str) -> None:
        name = f"{__package__}.{name}"
        super().__init__(FunctionType(_code_of(name), {"__name__": name}))

    def _global(self, name: str) -> Any:
        return None


def _code_of(module: str) -> CodeType:
    """The code of a module, compiled here if its source is a file, because its loader may have changed it.

    pytest loads the modules of distributions with plug-ins by a loader without `get_code`. Loaders of zip files and of
    frozen programs have no files, but `get_code`.
    """
    spec = find_spec(module)
    if spec is not None and spec.origin and spec.has_location and Path(spec.origin).suffix == ".py":
        with suppress(OSError):
            return compile(Path(spec.origin).read_bytes(), spec.origin, "exec", dont_inherit=True, optimize=0)
    code = getattr(spec and spec.loader, "get_code", lambda _: None)(module)
    if not isinstance(code, CodeType):
        raise TypeError(f"the code of {module} cannot be read, and it is part of the key of a compiled kernel")
    return code


def _is_docstring(code: CodeType, operation: bytes, argument: Sequence[int]) -> bool:
    """Whether the instruction after a constant stores it as docstring or line number of a module or class."""
    return operation == _STORE and code.co_names[argument[0]] in ("__doc__", "__firstlineno__")


def _names(code: CodeType) -> set[str]:
    """All names in a function and in the functions nested in it."""
    inner = (_names(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*inner)


def _home(value: Any) -> str:
    """Module of a built-in function; for numpy's, which have none, that of their class."""
    return getattr(value, "__module__", None) or type(value).__module__


def _root(module: str) -> str:
    return module.partition(".")[0]
