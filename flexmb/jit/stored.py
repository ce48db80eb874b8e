"""A compiled kernel as bytes: its machine code and symbols, the kernels it calls, and numba's data for calling it.

Numba also stores the LLVM bitcode, for inlining into other functions, and the type of every variable as text. Neither
is needed for kernels. For the right-hand side of all scenes they would increase the size from 0.2 MB to 1.2 MB, and
reading the bitcode took half the time of loading.
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

_LEVEL = 6  # of compression; level 9 takes twice as long and saves 1 %


def packed(compiled: Any) -> bytes:
    """A compiled version of a kernel as bytes; the version itself is not changed."""
    (name, kind, (machine_code, _)), fndesc, environment, signature, objectmode, lifted, _, *rest = compiled._reduce()
    library = name, kind, (machine_code, _nothing_to_link())
    module = compiled.library._final_module
    symbols = [each.name for each in (*module.functions, *module.global_variables) if not each.is_declaration]
    state = library, fndesc, environment, signature, objectmode, lifted, "", *rest
    return zlib.compress(dumps((symbols, compiled.library.callees, state)), _LEVEL)


def unpacked(context: Any, contents: Any) -> Any:
    """The compiled version in this process, with all kernels that it calls; None if one of these has changed."""
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
