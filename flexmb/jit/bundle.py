"""Many arrays as one argument of a kernel: a class of named arrays, or bundles, that is passed by its address.

A kernel that takes a NamedTuple of sixty arrays passes a thousand words to each function that it calls, and counts
references to every array that it uses. A bundle is one pointer to a table of addresses and shapes. The right-hand side
of a tree with all hinges and levels then compiles in 19 s of processor time instead of 28 s, and a call from Python
takes 9 us instead of 160 us. Kernels do not own the arrays: the caller must keep the bundle, which holds them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import NativeValue, infer_getattr, lower_getattr_generic, models, register_model, unbox

from flexmb.jit.tables import BYTE, WORD, TableType, table

Class = TypeVar("Class", bound=type)

_DIMENSIONS = 4  # the most an array of a bundle may have
_ROW = 1 + _DIMENSIONS  # words of the table for one array: address, shape; of a bundle its table's address only


@dataclass_transform(frozen_default=True)
def bundle(cls: Class) -> Class:
    """Make a class of annotated arrays and bundles a frozen dataclass that kernels take as one argument.

    In kernels and in Python, `b.name` is the array or bundle. The arrays must be C-contiguous; kernels may write to
    them. A method `features` returns the features of the contents: a frozenset of names, part of the type of the
    bundle. In a class with `numbers = LANE` or DUAL, floats are such numbers: see `flexmb.jit.wide_arrays`.
    """
    cls.__post_init__ = _describe  # type: ignore[attr-defined]
    cls.__reduce__ = _reduce  # type: ignore[method-assign]
    return dataclass(frozen=True, eq=False)(cls)


def _describe(self: Any) -> None:
    """Make the table of addresses and shapes, its address, and the type of the bundle.

    Arrays of a bundle with features are made read-only, because a change could add a feature that the kernels lack.
    """
    features = self.features() if hasattr(self, "features") else frozenset()
    numbers = getattr(type(self), "numbers", types.float64)
    rows, kinds = list[tuple[int, ...]](), list[tuple[str, types.Type]]()
    for name in _names(type(self)):
        array = getattr(self, name)
        if not isinstance(array, np.ndarray):
            rows.append((array.kernel_address, *[0] * _DIMENSIONS))
            kinds.append((name, array._numba_type_))
            continue
        shape = array.shape[:-1] if numbers != types.float64 and array.dtype == np.float64 else array.shape
        if not array.flags.c_contiguous or len(shape) > _DIMENSIONS:
            raise ValueError(f"{name}: a bundle holds C-contiguous arrays of at most {_DIMENSIONS} dimensions")
        rows.append((array.ctypes.data, *shape, *[0] * (_DIMENSIONS - len(shape))))
        kinds.append((name, _array_type(array.dtype, len(shape), numbers)))
        if features:
            array.setflags(write=False)
    table = np.array(rows, np.int64)
    object.__setattr__(self, "kernel_table", table)
    object.__setattr__(self, "kernel_address", table.ctypes.data)
    object.__setattr__(self, "_numba_type_", _bundle_type(type(self), tuple(kinds), features))


@cache
def _names(cls: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(cls))


@cache
def _array_type(dtype: np.dtype, dimensions: int, numbers: types.Type) -> TableType:
    """Cached, because numba takes 0.1 ms to describe a record."""
    return TableType(numbers if dtype == np.float64 else from_dtype(dtype), dimensions)


def broaden(bundles: Sequence[Any]) -> None:
    """Give all bundles of one class the features that any of them has, so that they share kernels and workspaces."""
    features = frozenset[str]().union(*(each._numba_type_.features for each in bundles))
    for each in bundles:
        kind = each._numba_type_
        object.__setattr__(each, "_numba_type_", _bundle_type(kind.of, kind.kinds, features))


def _reduce(self: Any) -> tuple[Any, ...]:
    """Pickle the arrays only, because addresses belong to one process.

    TypeError where arrays share memory: those of a copy would not.
    """
    members = tuple(getattr(self, name) for name in _names(type(self)))
    owners = [id(each if each.base is None else each.base) for each in members if isinstance(each, np.ndarray)]
    if len(set(owners)) < len(owners):
        raise TypeError(f"{type(self).__name__} cannot be copied: its arrays are parts of each other; copy the system")
    return type(self), members


class BundleType(types.Type):
    """Type of a bundle: its class, the names and types of its members, and its features (see `flexmb.jit.features`).

    Its name contains a digest of these instead of a list, because it is part of symbols.
    """

    def __init__(
        self, of: type, kinds: tuple[tuple[str, types.Type], ...], features: frozenset[str] = frozenset()
    ) -> None:
        self.of, self.kinds, self.features = of, kinds, features
        contents = of.__module__, of.__qualname__, [(key, str(kind)) for key, kind in kinds], sorted(features)
        super().__init__(name=f"{of.__name__}_{hashlib.sha256(repr(contents).encode()).hexdigest()[:12]}")

    def place(self, name: str) -> int:
        """Row of a member in the table."""
        return [key for key, _ in self.kinds].index(name)


@cache
def _bundle_type(of: type, kinds: tuple[tuple[str, types.Type], ...], features: frozenset[str]) -> BundleType:
    """Cached, because the name of a type is the digest of a long text."""
    return BundleType(of, kinds, features)


def is_long(kind: BundleType) -> bool:
    """Whether strips of such a workspace have several elements (see `flexmb.jit.strips`): its numbers are floats."""
    return bool(getattr(kind.of, "numbers", types.float64) == types.float64)


class AnyBundleType(types.Type):
    """Type of bundles that a kernel passes on without accessing their members."""

    def __init__(self) -> None:
        super().__init__(name="AnyBundle")


class AnyBundle:
    """A bundle as an argument of kernels that are compiled once for bundles of every type; see `pointer.py`."""

    _numba_type_ = AnyBundleType()

    def __init__(self, bundle: Any) -> None:
        self._bundle = bundle
        self.kernel_address = bundle.kernel_address


register_model(BundleType)(models.OpaqueModel)
register_model(AnyBundleType)(models.OpaqueModel)


@unbox(AnyBundleType)
@unbox(BundleType)
def _unbox(typ, obj, c):
    """A bundle enters a kernel as the address of its table."""
    address = c.pyapi.object_getattr_string(obj, "kernel_address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@infer_getattr
class _BundleAttribute(AttributeTemplate):
    key = BundleType

    def generic_resolve(self, typ, attr):
        return dict(typ.kinds).get(attr)


@lower_getattr_generic(BundleType)
def _member_of(context, builder, typ, value, attr):
    """The address of a bundle that is a member, or the table of an array.

    "invariant" lets LLVM load each address once per function.
    """
    place = typ.place(attr)
    kind = typ.kinds[place][1]
    words = builder.bitcast(value, WORD.as_pointer())

    def load(column):
        loaded = builder.load(builder.gep(words, [WORD(place * _ROW + column)], inbounds=True))
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(kind, BundleType):
        return builder.inttoptr(load(0), value.type)
    address = builder.inttoptr(load(0), BYTE.as_pointer())
    return table(context, builder, kind, address, [load(1 + i) for i in range(kind.ndim)])
