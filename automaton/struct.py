"""Structs of arrays that cross into compiled code as one pointer.

A subclass of Struct lists its fields by annotation: arrays (of 1 to 3 dimensions, C-contiguous), integers, or
other structs. In Python, and with the JIT off, it is a plain object with these attributes. Compiled
code gets the address of a table with one row per field,

    array:    data pointer, shape (3)        integer: value        struct: its table

and reads a field from there when it is used. A NamedTuple of arrays would be passed by value, seven
words for each array, at every call: with the 75 arrays of a world the loop then compiles in 122 s
instead of 12 s (measured with Numba 0.68), so the world is passed by reference.

Read-only arrays give a type of their own, and kernels that write to them do not compile.
"""

from __future__ import annotations

import hashlib
from typing import Any, Self

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import (
    NativeValue,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array

WORDS = 4  # of a row of the table


class Struct:
    """Base of all structs; made with keyword arguments, one for each annotated field."""

    _fields: tuple[str, ...] = ()
    _types: dict[bool, types.Type]

    def __init_subclass__(cls) -> None:
        cls._fields = tuple(cls.__annotations__)
        cls._types = {}

    def __init__(self, **values: Any) -> None:
        if tuple(values) != self._fields:
            raise TypeError(f"{type(self).__name__} takes the fields {', '.join(self._fields)}")
        self.__dict__.update(values)
        self._table = np.zeros((len(self._fields), WORDS), np.uint64)
        self._writable = True
        for row, value in enumerate(values.values()):
            self._enter(row, value)

    def _enter(self, row: int, value: Any) -> None:
        if isinstance(value, np.ndarray):
            if not value.flags.c_contiguous:
                raise TypeError(f"{type(self).__name__}.{self._fields[row]} is not contiguous")
            self._table[row, 0] = value.__array_interface__["data"][0]
            self._table[row, 1 : 1 + value.ndim] = value.shape
        elif isinstance(value, Struct):
            self._table[row, 0] = value._address
        else:
            self._table[row, 0] = int(value) % 2**64  # two's complement

    @property
    def _address(self) -> int:
        address: int = self._table.__array_interface__["data"][0]
        return address

    def replaced(self, **values: Any) -> Self:
        """The same struct with some fields replaced."""
        return type(self)(**{name: values.get(name, getattr(self, name)) for name in self._fields})

    def copied(self) -> Self:
        """The same struct over copies of its arrays."""
        arrays = {name: getattr(self, name) for name in self._fields}
        return type(self)(
            **{
                name: value.copy() if isinstance(value, np.ndarray) else value
                for name, value in arrays.items()
            }
        )

    def read_only(self) -> Self:
        """The same memory, closed to writing: what strategies see."""
        seen = object.__new__(type(self))
        for name, value in self.__dict__.items():
            if isinstance(value, np.ndarray) and name in self._fields:
                value = value.view()
                value.setflags(write=False)
            elif isinstance(value, Struct):
                value = value.read_only()
            seen.__dict__[name] = value
        seen._writable = False
        for row, name in enumerate(self._fields):
            if isinstance(seen.__dict__[name], Struct):
                seen._table = seen._table.copy() if seen._table is self._table else seen._table
                seen._table[row, 0] = seen.__dict__[name]._address
        return seen


class StructType(types.Type):
    """The Numba type of a struct: its name and the types of its fields."""

    def __init__(self, name: str, fields: tuple[tuple[str, types.Type], ...]) -> None:
        self.fields = fields
        described = ", ".join(f"{field}: {kind}" for field, kind in fields)
        # Short: the name is repeated in every symbol (with the fields spelled out, a third slower).
        super().__init__(name=f"{name}_{hashlib.sha256(described.encode()).hexdigest()[:8]}")

    def row(self, attribute: str) -> int:
        return [field for field, _ in self.fields].index(attribute)


@register_model(StructType)
class _StructModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: StructType) -> None:
        super().__init__(manager, kind, ir.IntType(64))


@typeof_impl.register(Struct)
def _typeof_struct(value: Struct, context: Any) -> types.Type:
    known = type(value)._types
    if value._writable not in known:
        fields = []
        for name in value._fields:
            field = getattr(value, name)
            plain = not isinstance(field, np.ndarray | Struct)
            kind = types.int64 if plain else typeof_impl(field, context)
            if plain and isinstance(field, np.uint64):
                kind = types.uint64
            fields.append((name, kind))
        known[value._writable] = StructType(type(value).__name__, tuple(fields))
    return known[value._writable]


@unbox(StructType)
def _unbox_struct(kind: StructType, obj: Any, c: Any) -> NativeValue:
    attribute = c.pyapi.object_getattr_string(obj, "_address")
    address = c.pyapi.long_as_ulonglong(attribute)
    c.pyapi.decref(attribute)
    return NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@infer_getattr
class _StructAttributes(AttributeTemplate):  # type: ignore[misc]
    key = StructType

    def generic_resolve(self, kind: StructType, attribute: str) -> types.Type | None:
        return dict(kind.fields).get(attribute)


@lower_getattr_generic(StructType)
def _lower_attribute(context: Any, builder: Any, kind: StructType, address: Any, attribute: str) -> Any:
    word = ir.IntType(64)
    row = kind.row(attribute)
    field = kind.fields[row][1]
    table = builder.inttoptr(address, word.as_pointer())

    def load(column: int) -> Any:
        place = builder.gep(table, [ir.Constant(word, row * WORDS + column)], inbounds=True)
        loaded = builder.load(place)
        # The table never changes, so LLVM may read it once for a whole loop.
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if not isinstance(field, types.Array):
        return load(0)
    array = context.make_array(field)(context, builder)
    model = context.data_model_manager[field.dtype]
    size = context.get_abi_sizeof(model.get_data_type())
    shape = [load(1 + axis) for axis in range(field.ndim)]
    strides = [ir.Constant(word, size)]
    for extent in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], extent))
    populate_array(
        array,
        data=builder.inttoptr(load(0), context.get_data_type(field.dtype).as_pointer()),
        shape=shape,
        strides=strides,
        itemsize=size,
        meminfo=None,
    )
    return array._getvalue()
