"""How kernels are compiled, kept and counted: all of the project that knows numba.

kernel.py       `kernel`, `helper`, `sweep`, `handed_on`, `by_bundle`, `by_number`: what the mechanics is written with
features.py     `has`: kernels hold what their bundles contain, and nothing else
numbered.py     one helper for several, chosen by a number in front
bundle.py       many arrays as one argument
tables.py       arrays of bundles inside kernels
lanes.py        eight copies of a number as one value, and masks: how kernels run eight scenes at once
lane_functions.py  their elementary functions
sine_cosine.py  sine and cosine of floats and lanes, without a call
duals.py        a number and its derivatives along eight directions: eight columns of a Jacobian at once
wide_arrays.py  arrays of lanes and duals
pointer.py      kernels as arguments of kernels
direct.py       kernels called by address, from Python and from kernels
prefetch.py     records asked for ahead of their turn, in sweeps over many bodies
objects.py      kernels as functions of the interpreter: what they read of Python's objects
parts.py        helpers are compiled into their callers only
linking.py      kernels that call kernels, by a symbol
cache.py        compiled kernels on disk
stored.py       a compiled kernel as bytes
processors.py   which processors a kernel runs on
warmed.py       special kernels that were compiled ahead
installed.py    kernels that came with the installation, and whether they fit
fingerprint.py  the key of a compiled kernel: the code that it reaches
folder.py       where compiled kernels are kept, and for how long
once.py         of many processes, one compiles a kernel
progress.py     a line about what takes long to compile
hooks.py        which of numba's internals are used, and what is done without them
counting.py     operations of a kernel, by interpreting it; it needs no numba

Numba documents as its extension API, and we take for granted: `njit`, `cfunc`, `overload`, types of one's own with
`register_model`, `unbox` and the lowering of attributes, `type_callable` and `lower_builtin`,
`WrapperAddressProtocol`, and compilers with other passes.

Internal to numba, with something in their place (see hooks.py), are: that the code of a function can be left
unoptimised, and that a kernel that is called stays where it is (`JITCodeLibrary`, which knows the addresses of what it
defines, and `NativeLowering`, in parts.py and linking.py); how a dispatcher asks its cache, what a compiled
version is as bytes, and what it needs to run (`NullCache`, `CompileResult`, `rtsys`, `global_compiler_lock`,
`normalize_signature`, in cache.py); and the address of a compiled version (`CompileResultWAP`, in hooks.py).

Internal to numba, with nothing in their place, are: the protocol `_numba_type_`; the templates that `infer_global` and
`infer_getattr` take, for tables and lanes; `populate_array` and the structure of an array, in direct.py; and in
features.py the statements of a function before types are inferred, with `get_definition` and `find_const`. All numba
versions that were tried have them.
"""
