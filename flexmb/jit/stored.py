"""A compiled kernel as bytes: its machine code, the symbols in it, the kernels it calls, what numba needs to call it.

Numba keeps beside the machine code the same once more as bitcode of LLVM, for functions that it will be compiled into,
and the type of every variable as text. Nobody compiles kernels into anything, nor reads the text. For the right-hand
side of all scenes they make 1.2 MB of what is 0.2 MB without them; to read the bitcode took half the time of loading.
"""

from __future__ import annotations

import pickle
import zlib
from functools import cache
from typing import Any

from llvmlite import binding
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from flexmb.jit.linking import resolve

_LEVEL = 6  # of compression: nine takes twice as long, for 1 %


def packed(compiled: Any) -> bytes:
    """Bytes of a compiled version of a kernel; afterwards it can be called as before."""
    (name, kind, (machine_code, _)), fndesc, environment, signature, objectmode, lifted, _, *rest = compiled._reduce()
    library = name, kind, (machine_code, _nothing_to_link())
    module = compiled.library._final_module
    symbols = [each.name for each in (*module.functions, *module.global_variables) if not each.is_declaration]
    state = library, fndesc, environment, signature, objectmode, lifted, "", *rest
    return zlib.compress(dumps((symbols, compiled.library.callees, state)), _LEVEL)


def unpacked(context: Any, contents: Any) -> Any:
    """The compiled version again, in this process, and all kernels that it calls; None where one is not what it was."""
    symbols, callees, state = pickle.loads(zlib.decompress(contents))
    held = resolve(callees)
    if held is None:
        return None
    context.codegen()._engine._defined_symbols.update(symbols)
    compiled = CompileResult._rebuild(context, *state)
    compiled.library.held = held
    return compiled


@cache
def _nothing_to_link() -> bytes:
    return bytes(binding.parse_assembly("").as_bitcode())
