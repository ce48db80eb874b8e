"""Pinocchio's articulated-body algorithm and its derivatives in a compiled loop, as a user of its C++ would have it.

Pinocchio has no integrator of its own; Boost's odeint, whose headers come with Pinocchio's wheel, has Runge-Kutta
methods of order 5 and 8 with error control. What is missing is a C++ compiler and the headers of Eigen, which
`pip install flexmb[race]` brings.
"""

from __future__ import annotations

import ctypes
import hashlib
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flexmb.scene.schema import Scene
from tests.benchmarks import peers
from tests.benchmarks.must_hold.row import Call
from tests.repo.project import ROOT

SOURCE = Path(__file__).with_name("pinocchio_odeint.cpp")
FOLDER = ROOT / ".benchmarks"
FLAGS = (
    "-O3", "-march=native", "-DNDEBUG", "-std=c++17", "-shared", "-fPIC",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",  # for Pinocchio's list of joints
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=10",  # for the arguments of its derivatives
)  # fmt: skip
REMEDY = "the compiled rival needs g++ and the headers of Eigen: pip install flexmb[race]"

Stepper = Literal["dopri5", "fehlberg78"]


def runs(scene: Scene, t_end: float) -> Callable[[Stepper, float], np.ndarray]:
    """A function of the method and the tolerance (relative and absolute): the state [q, v] at t_end.

    For trees without quaternions. ModuleNotFoundError where nothing can be compiled.
    """
    library, loaded, start = _loaded(scene)
    steppers = {name: _declared(library[f"run_{name}"]) for name in ("dopri5", "fehlberg78")}

    def run(stepper: Stepper, tolerance: float) -> np.ndarray:
        y = start.copy()
        steppers[stepper](loaded, y, t_end, tolerance, tolerance)
        return y

    return run


def derivatives(scene: Scene, x: np.ndarray, *, inverse: bool = False, times: int = 100) -> Call:
    """Derivatives of forward dynamics at forces x, or of inverse dynamics at accelerations x; at the initial state.

    The result has the columns of those by coordinates, speeds, and forces or accelerations, one after the other.
    """
    library, loaded, start = _loaded(scene)
    n, vector = len(x), np.ctypeslib.ndpointer(float, flags="C")
    out = np.zeros((3, n, n))
    library.derivatives.restype = None
    library.derivatives.argtypes = [ctypes.c_void_p, vector, vector, vector, ctypes.c_long, ctypes.c_int]

    def result() -> np.ndarray:
        symmetric = np.triu(out[2].T) + np.triu(out[2].T, 1).T
        return np.concatenate([out[0].T.ravel(), out[1].T.ravel(), symmetric.ravel()])

    return Call(lambda: library.derivatives(loaded, start, x, out, times, inverse), times, result)


def _loaded(scene: Scene) -> tuple[ctypes.CDLL, Any, np.ndarray]:
    """The library, the tree that it has loaded, and the initial state [q, v]."""
    library = ctypes.CDLL(str(compiled()))
    tree, q, v = peers.pinocchio_tree(scene)
    if tree.model.nq != tree.model.nv:
        raise ValueError("a joint has a quaternion, and the compiled rival takes scalar joints only")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.bin"
        tree.model.saveToBinary(str(file))
        library.load_tree.restype, library.load_tree.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        loaded = library.load_tree(str(file).encode())
    return library, loaded, np.concatenate([q, v])


def _declared(function: Any) -> Any:
    real = ctypes.c_double
    function.restype = ctypes.c_long
    function.argtypes = [ctypes.c_void_p, np.ctypeslib.ndpointer(float, flags="C"), real, real, real]
    return function


@cache
def compiled() -> Path:
    """The shared library, compiled in about a minute where this source was not compiled for this Pinocchio before."""
    import pinocchio

    prefix = next(p for p in Path(pinocchio.__file__).parents if p.name == "cmeel.prefix")
    eigen = next((p for p in (prefix / "include/eigen3", Path("/usr/include/eigen3")) if p.exists()), None)
    compiler = shutil.which("g++")
    if compiler is None or eigen is None:
        raise ModuleNotFoundError(REMEDY)
    key = hashlib.sha256(SOURCE.read_bytes() + repr((FLAGS, version("pin"), str(prefix))).encode()).hexdigest()[:16]
    library = FOLDER / f"pinocchio_odeint-{key}.so"
    if not library.exists():
        FOLDER.mkdir(exist_ok=True)
        folder = prefix / "lib"
        boost = next(folder.glob("libboost_serialization.so*"))
        with tempfile.TemporaryDirectory(dir=FOLDER) as scratch:
            made = Path(scratch) / library.name
            command = [compiler, *FLAGS, f"-I{prefix / 'include'}", f"-I{eigen}", str(SOURCE), "-o", str(made)]
            command += [f"-L{folder}", "-lpinocchio_default", str(boost), f"-Wl,-rpath,{folder}"]
            subprocess.run(command, check=True, capture_output=True, text=True)
            made.replace(library)
    return library
