"""The key of a compiled kernel: it differs where what is compiled differs, and stays where only words are edited."""

import gc
import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import FunctionType, ModuleType

import pytest
from numba.core.dispatcher import Dispatcher

import flexmb
from flexmb.entry import articulated
from flexmb.export import entry
from flexmb.integrate.dop853 import state_at
from flexmb.jain import explicit
from flexmb.jit import fingerprint as module
from flexmb.jit.cache import KernelCache
from flexmb.jit.fingerprint import fingerprint, reached
from tests.flexmb.jit.test_cache import ALONE

ROOT = Path(__file__).parents[3]

FAR = '''"""A file that the kernel's own imports."""
import numpy as np
from flexmb.jit.kernel import helper

SHIFT = 3


@helper
def shifted(x, by=1.0):
    return x + by * SHIFT


@helper
def unused(x):
    return x
'''

NEAR = '''"""A kernel and what it uses."""
import math
from typing import NamedTuple

import far
import numpy as np
from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import by_bundle, by_number, helper, kernel, written_out

FACTOR = 2.0
PAIR = (1, 2.5)
TABLE = np.array([1.0, 2.0])


class Point(NamedTuple):
    x: float
    y: float = 0.5


@bundle
class Some:
    values: np.ndarray


@bundle
class Others:
    values: np.ndarray


def times(n):
    @helper
    def product(x):
        return n * x

    return product


twice = times(2)


@helper
def first(x):
    """The first."""
    return FACTOR * x  # as it is


@helper
def second(x):
    y = x + PAIR[0]
    return y + TABLE[1]


@helper
def of_some(b):
    return b.values[0]


@helper
def of_others(b):
    return b.values[1]


@helper
def of_lanes(x):
    return x


choose = by_bundle(Some, of_some, of_others)
root = by_number(math.sqrt, of_lanes)


@kernel
def entry(x, b):
    """What is compiled."""
    point = Point(first(x))
    if x > 4.5:
        return root(second(point.x) + choose(b))
    return twice(second(x)) + far.shifted(point.y)
'''


def key(near: str = NEAR, far: str = FAR) -> str:
    """Of `entry`, in these two files."""
    for name, source in (("far", far), ("near", near)):
        made = sys.modules[name] = ModuleType(name)
        exec(compile(source, f"{name}.py", "exec"), vars(made))
    try:
        return fingerprint(made.entry.py_func)
    finally:
        del sys.modules["far"], sys.modules["near"]


CODE = {
    "a literal": ("x > 4.5", "x > 4.25"),
    "the sign of zero": ("x > 4.5", "x > -0.0"),
    "an operation": ("y = x + PAIR[0]", "y = x - PAIR[0]"),
    "a float constant": ("FACTOR = 2.0", "FACTOR = 2.5"),
    "the type of a constant": ("FACTOR = 2.0", "FACTOR = 2"),
    "a tuple": ("(1, 2.5)", "(2, 2.5)"),
    "an array's value": ("[1.0, 2.0]", "[1.0, 3.0]"),
    "an array's type": ("[1.0, 2.0]", "[1, 2]"),
    "an array's shape": ("[1.0, 2.0]", "[[1.0, 2.0]]"),
    "an array's order": ("np.array([1.0, 2.0])", "np.ones((2, 2), order='F')"),
    "a field of a tuple": ("    x: float\n    y:", "    y: float\n    x:"),
    "the default of a field": ("y: float = 0.5", "y: float = 0.25"),
    "a closure's cell": ("twice = times(2)", "twice = times(3)"),
    "the choice between bundles": ("by_bundle(Some, of_some, of_others)", "by_bundle(Others, of_some, of_others)"),
    "what is chosen": ("by_bundle(Some, of_some, of_others)", "by_bundle(Some, of_others, of_some)"),
    "one variant": ("return b.values[1]", "return b.values[2]"),
    "the variant for lanes": ("def of_lanes(x):\n    return x", "def of_lanes(x):\n    return -x"),
    "the variant for real numbers": ("by_number(math.sqrt", "by_number(math.exp"),
    "a name that is bound anew": ("@kernel", "first = second\n\n\n@kernel"),
    "two names exchanged": ("@kernel", "first, second = second, first\n\n\n@kernel"),
    "how a helper is compiled": ("@helper\ndef second", "@written_out\ndef second"),
    "a builtin that is hidden": ("y = x + PAIR[0]", "y = max(x, PAIR[0])"),
    "the name of a helper": ("twice", "double"),
}
FAR_CODE = {
    "a constant two files away": ("SHIFT = 3", "SHIFT = 4"),
    "a helper two files away": ("x + by * SHIFT", "x - by * SHIFT"),
    "a default two files away": ("by=1.0", "by=2.0"),
}
WORDS = {
    "a docstring": ('"""The first."""', '"""The first, in other words."""'),
    "no docstring": ('    """The first."""\n', ""),
    "a new docstring": ("    y = x + PAIR[0]", '    """Added."""\n    y = x + PAIR[0]'),
    "the kernel's docstring": ('"""What is compiled."""', '"""Compiled.\n\n    At length.\n    """'),
    "the file's docstring": ('"""A kernel and what it uses."""', '"""Words."""'),
    "a comment": ("  # as it is", "  # as it was, and longer"),
    "blank lines": ("@helper\ndef second", "\n\n\n@helper\ndef second"),
    "brackets over lines": ("return FACTOR * x", "return (\n        FACTOR\n        * x\n    )"),
    "the order of functions": ("@helper\ndef first", "@helper\ndef added(x):\n    return x\n\n\n@helper\ndef first"),
    "annotations": ('"""A kernel and what it uses."""\n', "from __future__ import annotations\n"),
    "a constant that nobody uses": ("PAIR = ", "UNUSED = 5\nPAIR = "),
}


def edited(source: str, edit: tuple[str, str]) -> str:
    assert edit[0] in source
    return source.replace(*edit)


def test_the_same_sources_have_the_same_key():
    assert key() == key()


@pytest.mark.parametrize("edit", CODE)
def test_what_is_compiled_changes_the_key(edit):
    assert key(near=edited(NEAR, CODE[edit])) != key()


@pytest.mark.parametrize("edit", FAR_CODE)
def test_what_is_compiled_from_another_file_changes_the_key(edit):
    assert key(far=edited(FAR, FAR_CODE[edit])) != key()


@pytest.mark.parametrize("edit", WORDS)
def test_words_do_not_change_the_key(edit):
    assert key(near=edited(NEAR, WORDS[edit])) == key()


def test_what_a_kernel_does_not_reach_does_not_change_its_key():
    assert key(far=edited(FAR, ("return x\n", "return 2.0 * x\n"))) == key()


def test_a_builtin_and_what_hides_it_are_two_things():
    with_max = edited(NEAR, CODE["a builtin that is hidden"])
    assert key(near=edited(with_max, ("@kernel", "max = first\n\n\n@kernel"))) != key(near=with_max)


def test_more_names_and_constants_than_one_byte_counts():
    """Python then splits their numbers in two."""
    names = [f"N{i}" for i in range(300)]
    constants = "\n".join(f"{name} = {i}.0" for i, name in enumerate(names))
    total = " + ".join(f"{name} * {i}.25" for i, name in enumerate(names))
    source = edited(edited(NEAR, ("PAIR = ", f"{constants}\nPAIR = ")), ("y = x + PAIR[0]", f"y = {total}"))
    keys = {key(near=source), key(near=edited(source, ("299.0", "1.0"))), key(near=edited(source, ("299.25", "1.0")))}
    assert len(keys) == 3


@pytest.mark.parametrize("value", ["[1.0]", "{}", "object()", "np.array([None])", "type('Class', (), {})"])
def test_what_cannot_be_told_from_others_is_refused(value):
    with pytest.raises(TypeError, match=r"second.*(refers to|knows no)|knows no"):
        key(near=edited(NEAR, ("TABLE = np.array([1.0, 2.0])", f"TABLE = {value}")))


def test_a_name_that_is_nowhere_is_refused():
    with pytest.raises(TypeError, match="first: there is no NOWHERE"):
        key(near=edited(NEAR, ("return FACTOR * x", "return NOWHERE * x")))


def dispatchers() -> tuple[set[FunctionType], set[FunctionType]]:
    """All kernels of the package, and all its helpers."""
    modules = [
        importlib.import_module(package.name)
        for package in pkgutil.walk_packages(flexmb.__path__, "flexmb.")
        if not package.name.endswith("__main__") and not package.name.startswith("flexmb.bridges.")  # other libraries'
    ]
    found = {
        value for module in modules for value in vars(module).values() if isinstance(value, Dispatcher | FunctionType)
    }
    found = {value for value in found if hasattr(value, "py_func")}
    kernels = {each.py_func for each in found if isinstance(getattr(each, "_cache", None), KernelCache)}
    return kernels, {each.py_func for each in found} - kernels


def test_every_kernel_of_the_package_has_a_key_of_its_own():
    kernels, _ = dispatchers()
    assert len(kernels) > 30
    assert len({fingerprint(kernel) for kernel in kernels}) == len(kernels)


def test_every_helper_of_the_package_is_in_the_key_of_a_kernel():
    """Else it is dead, or a chooser hides it, and who edits it goes on with what was compiled before."""
    kernels, helpers = dispatchers()
    exported = {  # compiled anew for each export; what makes tables is not compiled
        each for name, each in vars(entry).items()
        if isinstance(each, FunctionType) and each.__module__ == entry.__name__ and not name.endswith("_tangent")
    }  # fmt: skip
    roots = kernels | exported
    known = {function for root in roots for function in reached(root)}
    unknown = {f"{each.__module__}.{each.__qualname__}" for each in helpers - known if _counts(each)}
    assert unknown == set()
    assert state_at.py_func in helpers & known  # one that is handed on


def test_both_choices_are_in_the_key():
    """By width, by class and by number, what is not interpreted as Python too."""
    assert {explicit._in_strips.py_func, explicit._one_by_one.py_func} <= set(reached(articulated.rhs.py_func))


ROOM = """'''Words.'''
KINDS = {"a", "b", "c"}
class Kind:
    '''Words.'''
    def of(self):
        '''Words.'''
        return KINDS, 2.0
"""


def test_of_the_room_itself_only_words_are_free(tmp_path, monkeypatch):
    """Files of the compiler count as a whole, also what no kernel refers to."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(module, "__package__", "room")
    (tmp_path / "room").mkdir()

    def digest(source: str) -> bytes:
        importlib.invalidate_caches()
        (tmp_path / "room" / "part.py").write_text(source)
        (tmp_path / "room" / "__pycache__").exists() and shutil.rmtree(tmp_path / "room" / "__pycache__")
        return module._digest(module._ModuleWords("part"))

    assert digest(ROOM.replace("Words", "Other words, of another length")) == digest(ROOM)
    assert digest(f"# a comment\n\n{ROOM}") == digest(ROOM)
    assert digest(ROOM.replace("2.0", "3.0")) != digest(ROOM)
    assert digest(ROOM.replace("'c'", "'d'").replace('"c"', '"d"')) != digest(ROOM)


class Speechless:
    """A loader that has no code to show, as that of compiled extensions, or of pytest for what it rewrites."""


def test_the_room_is_read_from_its_files_whatever_loaded_it(monkeypatch):
    """pytest's loader runs other code than the file says, and shows none."""
    plain = module.compiler.__wrapped__()
    found = module.find_spec

    def rewritten(name: str) -> ModuleSpec:
        return spec_from_file_location(name, found(name).origin, loader=Speechless())

    monkeypatch.setattr(module, "find_spec", rewritten)
    assert module.compiler.__wrapped__() == plain


@pytest.mark.parametrize("place", [None, "hidden.so", "gone.py"])
def test_a_room_that_cannot_be_read_gives_no_key(place, monkeypatch, tmp_path):
    """A key that left the compiler out would find kernels of another one."""
    spec = ModuleSpec("flexmb.jit.kernel", Speechless(), origin=place and str(tmp_path / place))
    spec.has_location = place is not None
    monkeypatch.setattr(module, "find_spec", lambda name: spec)
    with pytest.raises(TypeError, match="cannot be read"):
        module.compiler.__wrapped__()


def test_a_room_that_is_not_listed_gives_no_key(monkeypatch):
    """As by a loader of a frozen program that finds modules by their names and lists none."""
    monkeypatch.setattr(module, "iter_modules", lambda path: iter(()))
    with pytest.raises(TypeError, match="shows none of its modules"):
        module.compiler.__wrapped__()


def _counts(function: FunctionType) -> bool:
    return function.__module__.startswith("flexmb.") and not function.__module__.startswith("flexmb.jit.")


def compiled_beyond(*kernels: Dispatcher) -> list[str]:
    """What numba compiled for these kernels in this process and their keys do not know; all of the room jit counts."""
    known = {function for kernel in kernels for function in reached(kernel.py_func)}
    found = list[str]()
    for each in gc.get_objects():
        if isinstance(each, Dispatcher) and each.overloads and _counts(each.py_func):
            cells = [cell.cell_contents for cell in each.py_func.__closure__ or ()]  # of a choice: what is chosen
            chosen = [getattr(cell, "py_func", cell) for cell in cells if not isinstance(cell, type)]
            inner = each.py_func.__qualname__.startswith("call.")
            for function in chosen if inner else [each.py_func]:
                if isinstance(function, FunctionType) and _counts(function) and function not in known:
                    found.append(f"{function.__module__}.{function.__qualname__}")
    return found


QUICK = """
import gc
import numpy as np
from numba.core.dispatcher import Dispatcher
from flexmb.integrate.rk4 import rk4
from tests.flexmb.integrate.integration_problems import HARMONIC, solve
from tests.flexmb.jit.test_fingerprint import compiled_beyond
solve(HARMONIC, [0.0, 1.0], step=1e-2)
from flexmb.integrate import problem, watch
from tests.flexmb.integrate import integration_problems
rooms = (problem, watch, integration_problems)  # those with kernels of their own, which it reaches by address
mine = [each for room in rooms for each in vars(room).values() if isinstance(each, Dispatcher)]
helpers = [each for each in gc.get_objects() if isinstance(each, Dispatcher) and each.overloads]
assert len(helpers) > 5, helpers
print(compiled_beyond(rk4, *mine))
"""
WHOLE = """
import gc
import flexmb
from flexmb.jit.cache import KernelCache
from flexmb.run.warm_up import looped, with_panel
from numba.core.dispatcher import Dispatcher
from tests import trees
from tests.flexmb.jit.test_fingerprint import compiled_beyond
for scene in (trees.random_scene(0, trees.MIXED), with_panel(), looped()):
    system = flexmb.compile(scene)
    for algorithm in ("articulated", "composite", *(() if scene.closures else ("unsplit", "frisch"))):
        try:
            system.accelerations(system.initial_state, algorithm)
        except flexmb.SceneError:
            assert algorithm == "frisch"
dispatchers = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
kernels = [each for each in dispatchers if isinstance(each._cache, KernelCache)]
assert len(kernels) > 5, kernels
print(compiled_beyond(*kernels))
"""


def unknown(program: str, cache: Path) -> str:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", ALONE + program]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("program", [QUICK, pytest.param(WHOLE, marks=pytest.mark.slow)], ids=["an integrator", "all"])
def test_all_that_numba_compiled_into_a_kernel_is_in_its_key(program, tmp_path):
    """In a process of its own that finds nothing compiled."""
    assert unknown(program, tmp_path) == "[]"
