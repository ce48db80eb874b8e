"""Kernels called by address, from Python and from kernels, which avoids determining the types at every call.

Numba's dispatcher determines the type of every argument at each call, which takes 0.5 us for a bundle. Here the
addresses of a kernel and of its bundles are passed as integers to an entry point, which calls through the address and
is compiled once for all kernels with the same arrangement of arguments. In kernels, `status_at`, `real_at` and
`nothing_at` call through an address, and `at_address` converts an address to a bundle.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.compiler_lock import global_compiler_lock
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import populate_array

from flexmb.jit.kernel import kernel
from flexmb.jit.pointer import REAL, STATUS, VOID, pointer
from flexmb.jit.tables import TableType

ADDRESS = types.int64


class Direct(partial):
    """A kernel with its bundles, as a function of its other arguments. Threads may share it if they may share these."""

    held: tuple[Any, ...]

    def __reduce__(self) -> Any:
        """Raises TypeError: the addresses belong to one process and to these bundles."""
        raise TypeError("a call by address cannot be copied: make another one for the bundles of the copy")


def bound(entry: Any, where: tuple[int, ...], *held: Any) -> Direct:
    """An entry point with its first arguments, which are addresses, and with the objects that these refer to."""
    function = Direct(entry, *where)
    function.held = held
    return function


def direct(compiled: Any, returned: Any, *arguments: Any) -> Direct:
    """A kernel with those of `arguments` that are bundles; it is called with the others, of which the types are given.

    The types are those of `pointer.py`. Compiles the kernel, or finds it compiled; TypeError if it does not return
    `returned`. A call with an argument of another type raises TypeError; lengths of arrays are not checked.
    """
    is_given = tuple(isinstance(argument, types.Type) for argument in arguments)
    given = [argument for argument in arguments if isinstance(argument, types.Type)]
    entry = settled(_entry(returned, is_given), *[ADDRESS] * (1 + is_given.count(False)), *given)
    return bound(entry, addresses(compiled, returned, *arguments), *arguments)


def addresses(compiled: Any, returned: Any, *arguments: Any) -> tuple[int, ...]:
    """Addresses of a kernel, compiled for these arguments, and of the bundles in them, which the caller must keep."""
    bundles = [argument for argument in arguments if not isinstance(argument, types.Type)]
    function = pointer(compiled, returned, *arguments).__wrapper_address__()
    return function, *map(address, bundles)


def address(bundle: Any) -> int:
    """Address of a bundle, which the caller must keep."""
    return int(bundle.kernel_address)


def settled(compiled: Any, *kinds: Any) -> Any:
    """A kernel compiled for these types, which raises TypeError for others instead of being compiled anew."""
    if kinds not in compiled.overloads:
        with global_compiler_lock:  # else one thread could disable compilation just before another one compiles
            if kinds not in compiled.overloads:
                compiled.disable_compile(False)
                compiled.compile(kinds)
                compiled.disable_compile()
    return compiled


def undispatched(compiled: Any, *like: Any) -> Any:
    """A kernel compiled for the types of these arguments, which must not be called with others: it checks no types.

    A dispatcher takes 30 us at every call to determine the type of a tuple of bundles and addresses.
    """
    return compiled.compile(tuple(map(typeof, like)))


@cache
def _entry(returned: Any, is_given: tuple[bool, ...]) -> Any:
    """A kernel that takes addresses, then the given arguments, and passes them on in the order of `is_given`.

    For a kernel of two numbers with a bundle between them, its source is

        def status_of_aba(function, b1, a0, a2):
            return status_at(function, (a0, b1, a2))
    """
    names = [f"{'a' if given else 'b'}{i}" for i, given in enumerate(is_given)]
    ordered = sorted(names, key=lambda name: name[0] == "a")
    by = "nothing" if returned == VOID else "status"
    name = f"{by}_of_{''.join(each[0] for each in names)}"
    text = f"def {name}(function, {', '.join(ordered)}):\n    return {by}_at(function, ({', '.join(names)},))"
    space: dict[str, Any] = {"status_at": status_at, "nothing_at": nothing_at, "__name__": __name__}
    exec(compile(text, f"<{name}>", "exec"), space)
    return kernel(space[name])


def at_address(example: Any) -> Callable[[Any], Any]:
    """For kernels: a function that converts an address to the bundle there, which has the type of `example`."""
    kind = example._numba_type_

    def at(address: Any, kind: Any = kind) -> Any:  # a default value, so that the fingerprint of kernels contains it
        return address

    type_callable(at)(lambda context: lambda address: kind)
    lower_builtin(at, types.Integer)(_pointed)
    return at


def _pointed(context, builder, sig, args):
    return builder.inttoptr(args[0], context.get_value_type(sig.return_type))


def status_at(function: Any, arguments: Any) -> Any:
    """Call the kernel at an address, which returns a status code; integers among the arguments are addresses of
    bundles, and tables are passed as arrays."""
    return function(*arguments)


def nothing_at(function: Any, arguments: Any) -> Any:
    """The same for a kernel that returns nothing."""
    function(*arguments)


def real_at(function: Any, arguments: Any) -> Any:
    """The same for a kernel that returns a float."""
    return function(*arguments)


@type_callable(real_at)
def _type_of_real(context):
    return lambda function, arguments: REAL


@type_callable(status_at)
def _type_of_status(context):
    return lambda function, arguments: STATUS


@type_callable(nothing_at)
def _type_of_nothing(context):
    return lambda function, arguments: VOID


@lower_builtin(real_at, types.Integer, types.BaseTuple)
@lower_builtin(status_at, types.Integer, types.BaseTuple)
@lower_builtin(nothing_at, types.Integer, types.BaseTuple)
def _call(context, builder, sig, args):
    given = zip(sig.args[1], cgutils.unpack_tuple(builder, args[1]), strict=True)
    values = [_handed_over(context, builder, kind, value) for kind, value in given]
    kind = ir.FunctionType(context.get_value_type(sig.return_type), [value.type for value in values])
    return builder.call(builder.inttoptr(args[0], kind.as_pointer()), values)


def _handed_over(context, builder, kind, value):
    """An argument in the form in which a separately compiled kernel takes it."""
    if isinstance(kind, types.Integer):
        return builder.inttoptr(value, context.get_value_type(types.voidptr))
    return _array(context, builder, kind, value) if isinstance(kind, TableType) else value


def _array(context, builder, kind, value):
    """A table of numbers as a numba array that does not own its data."""
    array = context.make_array(types.Array(kind.dtype, kind.ndim, "C"))(context, builder)
    shape = cgutils.unpack_tuple(builder, builder.extract_value(value, 1))
    size = context.get_constant(types.intp, kind.dtype.bitwidth // 8)
    strides = [size]
    for extent in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], extent))
    populate_array(
        array,
        data=builder.bitcast(builder.extract_value(value, 0), array.data.type),
        shape=cgutils.pack_array(builder, shape),
        strides=cgutils.pack_array(builder, strides),
        itemsize=size,
        meminfo=None,
    )
    return array._getvalue()
