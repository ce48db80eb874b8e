"""Compiled functions that Python calls without a dispatcher: they read their arguments directly from Python objects.

Numba's dispatcher takes 0.3 us for the types of three arguments, and 0.1 us for each array. Here a kernel is a builtin
function of the interpreter (`builtin`), like one written in C: it gets the addresses of its arguments, and reads them
only if they have exactly the expected types. For all other objects it calls a Python function with the same arguments
(`called`).

The layout of objects is part of the binary interfaces of Python and numpy. `readable` checks it for objects of this
process; if the check fails, nothing in this module may be used.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import lower_builtin, type_callable

from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.kernel import helper
from flexmb.jit.tables import BYTE, TableType, table
from flexmb.typing import Index

_TYPE, _VALUE = 1, 2  # words of an object: its type, and the number of a float
_DATA, _DIMENSIONS, _SHAPE, _ELEMENTS, _FLAGS = 2, 3, 4, 7, 8  # of an array: dtype is _ELEMENTS; two are 32 bits wide
_ORDERED = 0x0001 | 0x0100  # flags of an array: C order, aligned
_LOW = 0xFFFFFFFF

FLOAT, ARRAY, REALS, VECTORCALL, INCREF, SAVE, RESTORE, IDENT = range(8)  # rows of `interpreter`


@cache
def interpreter() -> Index:
    """Addresses (8,) in this process: types float and array, dtype float64, and functions of the interpreter."""
    api = ctypes.pythonapi
    lock = api.PyEval_SaveThread, api.PyEval_RestoreThread
    functions = api.PyObject_Vectorcall, api.Py_IncRef, *lock, api.PyThread_get_thread_ident
    where = [ctypes.cast(function, ctypes.c_void_p).value for function in functions]
    return np.array([id(float), id(np.ndarray), id(np.dtype(np.float64)), *where], np.int64)


@cache
def readable() -> bool:
    """Whether the objects of this interpreter have the layout that the kernels expect."""
    return all(map(_reads, (1.5, np.arange(3.0), np.zeros((2, 3)), np.arange(8.0)[1::2], np.zeros(2, np.int64))))


def _reads(example: Any) -> bool:
    """Whether kernels would read the correct values from a float or an array."""
    word = (ctypes.c_int64 * (1 + _FLAGS)).from_address(id(example))
    if isinstance(example, float):
        return word[_TYPE] == id(float) and ctypes.c_double.from_buffer(word, 8 * _VALUE).value == example
    return (
        word[_TYPE] == id(np.ndarray)
        and word[_DATA] == example.ctypes.data
        and word[_DIMENSIONS] & _LOW == example.ndim
        and word[_ELEMENTS] == id(example.dtype)
        and word[_FLAGS] & _LOW == example.flags.num
        and word[_SHAPE] + 8 * example.ndim == word[_SHAPE + 1]  # strides stand behind the shape: now it may be read
        and tuple((ctypes.c_int64 * example.ndim).from_address(word[_SHAPE])) == example.shape
    )


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


_FAST, _WITH_NAMES = 0x0080, 0x0002
_methods: dict[int, _Method] = {}  # kept as long as the process, like the kernels


class Anchor(np.ndarray):
    """The table of a bundle as the `self` of a builtin; it keeps everything that its addresses refer to."""

    held: tuple[Any, ...]


def builtin(address: int, bundle: Any, *held: Any) -> Callable[..., Any]:
    """The kernel at an address as a builtin function of Python.

    The kernel takes four integers, by the protocol METH_FASTCALL | METH_KEYWORDS: address of an Anchor, address of the
    arguments, number of positional arguments, and address of the names of keyword arguments, or 0. It returns the
    address of an object, as a new reference, or 0 after an error.
    """
    place = bundle.kernel_table.view(Anchor)
    place.held = bundle, held
    method = _methods.setdefault(address, _Method(b"evaluator", address, _FAST | _WITH_NAMES, None))
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    function: Callable[..., Any] = make(ctypes.byref(method), place, None)
    return function


@helper
def bundle_of(place):
    """Address of the bundle whose table is an Anchor."""
    return word_at(place, _DATA)


@helper
def is_float(python, x):
    """Whether an object is a float, and no subclass of it."""
    return word_at(x, _TYPE) == python[FLOAT]


@helper
def value(x):
    """The value of a float object."""
    return reals_at(x, _VALUE + 1)[_VALUE]


@helper
def is_vector(python, x):
    """Whether an object is an array (n,) of float64 in C order, and no subclass of it."""
    return (
        word_at(x, _TYPE) == python[ARRAY]
        and word_at(x, _ELEMENTS) == python[REALS]
        and (word_at(x, _DIMENSIONS) & _LOW) == 1
        and (word_at(x, _FLAGS) & _ORDERED) == _ORDERED
    )


@helper
def vector(x):
    """The numbers of such an array."""
    return reals_at(word_at(x, _DATA), word_at(word_at(x, _SHAPE), 0))


@helper
def called(python, function, arguments, count, names):
    """The result of a Python function for the arguments of a builtin."""
    return status_at(python[VECTORCALL], (function, arguments, count, names))


@helper
def taken(python, x):
    """A new reference to an object."""
    nothing_at(python[INCREF], (x,))
    return x


@helper
def this_thread(python):
    """The number of the calling thread, `threading.get_ident()`."""
    return status_at(python[IDENT], ())


def word_at(address: Any, i: Any) -> Any:
    """For kernels: 64-bit integer i at an address."""


def reals_at(address: Any, count: Any) -> Any:
    """For kernels: the table of `count` floats at an address."""


@type_callable(word_at)
def _type_of_word(context):
    return lambda address, i: types.int64


@type_callable(reals_at)
def _type_of_reals(context):
    return lambda address, count: TableType(types.float64, 1)


@lower_builtin(word_at, types.Integer, types.Integer)
def _word(context, builder, sig, args):
    i = context.cast(builder, args[1], sig.args[1], types.int64)
    return builder.load(builder.gep(builder.inttoptr(args[0], ir.IntType(64).as_pointer()), [i]))


@lower_builtin(reals_at, types.Integer, types.Integer)
def _reals(context, builder, sig, args):
    count = context.cast(builder, args[1], sig.args[1], types.int64)
    return table(context, builder, sig.return_type, builder.inttoptr(args[0], BYTE.as_pointer()), [count])
