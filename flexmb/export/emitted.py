"""Kernels as position-independent machine code in an object file, for programs without Python.

A kernel refers to others by symbols (`flexmb.jit.linking`). Here the LLVM code of an entry point and of all kernels
that it reaches is linked into one module, in which everything but the entry points is internal, and machine code is
made of it for one of `TARGETS` instead of this processor. Code of kernels that were read from disk is not there (see
`flexmb.jit.stored`): these are compiled once more, without their wrappers for Python.

The code was optimised for x86-64 before, with vectors that LLVM divides for other processors. Addresses in it are
numbers of 64 bits, in tables of such words; processors with addresses of 32 bits read the lower half, so that they have
to be little-endian.

This module uses numba and LLVM outside of the room `jit` because every module of that room is part of the key of all
kernels, and nothing here changes what flexmb itself runs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, NamedTuple

from llvmlite import binding
from numba import njit
from numba.core.compiler_lock import global_compiler_lock

from flexmb.export.refusals import NotExportable
from flexmb.jit.hooks import HOOKS, SEMANTICS
from flexmb.jit.processors import LEVELS
from flexmb.scene.problems import closest

LEVEL = "x86-64-v3"
"""The processors that exported code runs on unless others are asked for: AVX2 and fused multiply-add (2013)."""
BUILDING = "x86_64"  # the machines that export
AVX2 = ",".join(f"+{name}" for name in LEVELS[LEVEL])


class Processors(NamedTuple):
    """Processors that code is emitted for, as LLVM names them.

    described: for people. fused: whether they multiply and add with one rounding; by `fma` of a C library it would take
    fifty times as long.
    """

    described: str
    triple: str
    processor: str
    features: str = ""
    fused: bool = True
    relocation: str = "pic"


TARGETS = {
    LEVEL: Processors("x86-64 with AVX2", "x86_64-unknown-linux-gnu", LEVEL, AVX2),
    "aarch64": Processors("ARM of 64 bits", "aarch64-unknown-linux-gnu", "generic"),
    "armv7": Processors("ARM of 32 bits with VFPv4, hard float", "armv7-unknown-linux-gnueabihf", "cortex-a7"),
    "cortex-m7": Processors(
        "Cortex-M7 with double precision, hard float", "thumbv7em-unknown-none-eabihf", "cortex-m7",
        relocation="static",
    ),
    "riscv64": Processors("RISC-V, rv64gc", "riscv64-unknown-linux-gnu", "generic-rv64", "+m,+a,+f,+d,+c"),
    "wasm32": Processors("WebAssembly", "wasm32-unknown-unknown", "generic", "+simd128", fused=False),
}  # fmt: skip
"""Processors by name: the options of `flexmb export --c --target`."""
OF_C = {"numba_nextafter": "nextafter"}
"""Functions of numba's own library, and those of the C library in place of them."""


def emitted(entries: Mapping[str, tuple[Callable[..., Any], tuple[Any, ...]]], target: str = LEVEL) -> bytes:
    """An object file with these functions, by symbol, each with the types of its arguments, for one of `TARGETS`.

    A symbol is a function of C `int32_t (int64_t *result, void **error, ...)`; bundles are addresses of their tables.
    NotExportable where numba's internals are not those that flexmb knows, this machine is no x86-64, or LLVM lacks the
    target; ValueError for another target.
    """
    if target not in TARGETS:
        raise ValueError(f'there is no target "{target}": {closest(target, TARGETS)}')
    if not HOOKS.parts:
        raise NotExportable(
            "this version of numba is not one that flexmb knows from inside, and its code cannot be taken out: install "
            "a version that flexmb was tested with (flexmb --version)"
        )
    if not binding.get_process_triple().startswith(BUILDING):
        raise NotExportable("export is for x86-64 machines: run it on one")
    with global_compiler_lock:
        whole = binding.parse_assembly("")
        done = set[str]()
        for symbol, (function, arguments) in entries.items():
            library, own = _compiled(function, arguments)
            _link(whole, library, own, symbol, done)
        _keep_only(whole, set(entries))
        for symbol in entries:  # of several models in one program, and of no library to others
            whole.get_function(symbol).visibility = "hidden"
        return bytes(_for_target(whole, TARGETS[target]).emit_object(whole))


def _compiled(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, str]:
    """The library of a function compiled as a kernel that Python cannot call, and the name of its symbol."""
    options = HOOKS.kernels | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    compiled = njit(**SEMANTICS, **options)(function)
    compiled.compile(arguments)
    version = compiled.overloads[arguments]
    return version.library, version.fndesc.llvm_func_name


def _link(whole: Any, library: Any, own: str, symbol: str, done: set[str]) -> None:
    """Link the code of a library into the module, its function as `symbol`, and then that of all that it calls."""
    module = library._final_module.clone()
    module.get_function(own).name = symbol
    for function in module.functions:
        if not function.is_declaration and function.name != symbol:
            function.linkage = "internal"
    whole.link_in(module)
    done.add(symbol)
    for callee in library.callees:
        if callee.symbol in done:
            continue
        kernel = getattr(import_module(callee.module), callee.name)
        version = kernel.overloads[callee.arguments]
        found, name = version.library, version.fndesc.llvm_func_name
        if not any(not function.is_declaration for function in found._final_module.functions):  # read from disk
            found, name = _compiled(kernel.py_func, callee.arguments)
        elif not any(function.name == name for function in found._final_module.functions):
            name = callee.symbol
        _link(whole, found, name, callee.symbol, done)


def _keep_only(module: Any, entries: set[str]) -> None:
    """Make all but the entries internal, and remove what they do not reach."""
    for function in module.functions:
        if function.is_declaration:
            function.name = OF_C.get(function.name, function.name)
        elif function.name not in entries:
            function.linkage = "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    manager = binding.create_new_module_pass_manager()
    manager.add_global_dead_code_eliminate_pass()
    options = binding.create_pipeline_tuning_options(3)
    manager.run(module, binding.create_pass_builder(_machine(TARGETS[LEVEL]), options))


def _for_target(module: Any, target: Processors) -> Any:
    """The machine that makes code for a target, which the module is told of."""
    machine = _machine(target)
    module.triple, module.data_layout = target.triple, str(machine.target_data)
    if not target.fused:
        for function in module.functions:
            if function.name.startswith("llvm.fma."):
                function.name = function.name.replace("llvm.fma.", "llvm.fmuladd.")
    module.verify()
    return machine


def _machine(target: Processors) -> Any:
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    try:
        found = binding.Target.from_triple(target.triple)
    except RuntimeError as problem:
        raise NotExportable(f"this build of llvmlite makes no code for {target.described}: {problem}") from None
    return found.create_target_machine(
        cpu=target.processor, features=target.features, opt=3, reloc=target.relocation, codemodel="small"
    )
