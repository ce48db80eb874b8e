"""Compilation of kernels, their cache, and counting of their operations; no other room uses numba directly.

kernel.py       `kernel`, `helper`, `sweep`, `handed_on`, `by_bundle`, `by_number`: decorators of the mechanics
features.py     `has`: a kernel contains only the code for the features of its bundles
numbered.py     one helper that dispatches to several by a number
bundle.py       many arrays as one argument
tables.py       arrays of bundles inside kernels
lanes.py        eight copies of a number as one value, and masks: kernels for eight scenes at once
lane_functions.py  elementary functions of lanes
sine_cosine.py  sine and cosine of floats and lanes, without a call
duals.py        a number and its derivatives along seven directions: seven columns of a Jacobian at once
wide_arrays.py  arrays of lanes and duals
pointer.py      kernels as arguments of kernels
direct.py       kernels called by address, from Python and from kernels
prefetch.py     prefetching of records in sweeps over many bodies
objects.py      kernels as builtin functions of the interpreter, which read Python objects
parts.py        helpers are compiled into their callers only
linking.py      kernels that call kernels, by symbols
cache.py        compiled kernels on disk
stored.py       a compiled kernel as bytes
processors.py   the processors that a kernel runs on
warmed.py       special kernels that were compiled ahead
installed.py    kernels that came with the installation, and whether they fit
fingerprint.py  the key of a compiled kernel: the code that it reaches
folder.py       the folder of compiled kernels, and how long they are kept
once.py         only one of several processes compiles a kernel
progress.py     a message about long compilations
hooks.py        the internals of numba that are used, and the replacement if they are missing
counting.py     operations of a kernel, by interpreting it; needs no numba

These parts of numba's documented extension API are required: `njit`, `cfunc`, `overload`, custom types with
`register_model`, `unbox` and the lowering of attributes, `type_callable` and `lower_builtin`,
`WrapperAddressProtocol`, and compilers with custom passes.

These internals of numba have a replacement if they are missing (see hooks.py): that the code of a function can be left
unoptimised, and that a kernel can be called without being linked into its caller (`JITCodeLibrary` with the addresses
of its symbols, and `NativeLowering`, in parts.py and linking.py); how a dispatcher uses its cache, and how a compiled
version is stored as bytes (`NullCache`, `CompileResult`, `rtsys`, `global_compiler_lock`, `normalize_signature`, in
cache.py); the address of a compiled version, and how the version for a call is found (`CompileResultWAP`,
`get_call_template`, in hooks.py).

These internals of numba have no replacement: the protocol `_numba_type_`; the templates of `infer_global` and
`infer_getattr`, for tables and lanes; `populate_array` and the structure of an array, in direct.py; and the statements
of a function before type inference, with `get_definition` and `find_const`, in features.py. All tested versions of
numba have them.
"""
