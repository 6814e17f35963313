"""How compiled code reads a Struct: its Numba type, and the loads behind an attribute."""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Iterator
from functools import cache
from typing import Any

from llvmlite import ir
from numba import from_dtype, types
from numba.core.errors import NumbaTypeError
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)

from automaton.engine.jit.numba_parts import (
    AttributeTemplate,
    cgutils,
    infer_getattr,
    populate_array,
)
from automaton.engine.jit.structs import CONSTANT, WORDS_PER_ROW, Struct, StructClass


class StructType(types.Type):
    """The Numba type of a struct: its name and the types of its fields."""

    def __init__(self, name: str, fields: tuple[tuple[str, types.Type], ...]) -> None:
        self.fields = fields
        described = ", ".join(f"{field}: {kind}" for field, kind in fields)
        # Short: the name is repeated in every symbol and every error.
        super().__init__(name=f"{name}_{hashlib.sha256(described.encode()).hexdigest()[:8]}")

    def row(self, attribute: str) -> int:
        return [field for field, _ in self.fields].index(attribute)


@register_model(StructType)
class _StructModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: StructType) -> None:
        super().__init__(manager, kind, ir.IntType(64))


@typeof_impl.register(Struct)
def _typeof_struct(value: Struct, context: Any) -> types.Type:
    """Its type follows from its declared fields, and from the types of the structs in it."""
    cls, writable = type(value), value._writable
    if "_type" in value.__dict__:
        return value.__dict__["_type"]
    inner = [_typeof_struct(getattr(value, name), context) for name in cls._structs]
    key = (writable, *map(id, inner)) if inner else writable  # types are slow to hash, and stay
    if key not in cls._types:
        cls._types[key] = _struct_type(cls, writable, iter(inner))
    if inner:
        value.__dict__["_type"] = cls._types[key]
    known: types.Type = cls._types[key]
    return known


def _struct_type(cls: type[Struct], writable: bool, inner: Iterator[types.Type]) -> StructType:
    fields = []
    for name, declared in cls._declared.items():
        if not declared.kind:
            kind = next(inner)
        elif not declared.is_array:
            kind = from_dtype(declared.dtype)
        else:
            readonly = not writable or declared.role == CONSTANT
            kind = types.Array(from_dtype(declared.dtype), len(declared.extents), "C", readonly)
        fields.append((name, kind))
    return StructType(cls.__name__, tuple(fields))


@cache
def declared_type(cls: type[Struct], writable: bool = True) -> StructType:
    """The type of the instances of a class that are writable, or not, with all structs in them."""
    classes = cls.struct_classes()
    inner = [declared_type(classes[name], writable) for name in cls._structs]
    return _struct_type(cls, writable, iter(inner))


class StructClassType(types.Dummy):
    """The Numba type of a struct class, for `State.of` in kernels.

    Numba takes types of one name for one type, and a notebook may define a class again with other fields.
    """

    def __init__(self, cls: type[Struct]) -> None:
        self.cls = cls
        super().__init__(f"class of {declared_type(cls).name}")


@typeof_impl.register(StructClass)
def _typeof_struct_class(cls: type[Struct], context: Any) -> types.Type:
    return StructClassType(cls)


@cache
def _of(cls: type[Struct]) -> Any:
    """What `cls.of` is in compiled code: the address that a memory has, as a struct."""
    result = declared_type(cls)

    @intrinsic
    def of(context: Any, memory: Any) -> Any:
        def load(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return _lower_attribute(context, builder, memory, arguments[0], "address")

        return result(memory), load

    return of


@infer_getattr
class _StructClassAttributes(AttributeTemplate):
    key = StructClassType

    def generic_resolve(self, kind: StructClassType, attribute: str) -> types.Type | None:
        if attribute != "of":
            return None
        function = _of(kind.cls)
        self.context.refresh()
        kind_of_function: types.Type = self.context.resolve_value_type(function)
        return kind_of_function


@lower_getattr_generic(StructClassType)
def _lower_class_attribute(
    context: Any, builder: Any, kind: StructClassType, value: Any, attribute: str
) -> Any:
    return context.get_dummy_value()


@unbox(StructType)
def _unbox_struct(kind: StructType, obj: Any, c: Any) -> NativeValue:
    attribute = c.pyapi.object_getattr_string(obj, "_address")
    address = c.pyapi.long_as_ulonglong(attribute)
    c.pyapi.decref(attribute)
    return NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@infer_getattr
class _StructAttributes(AttributeTemplate):
    key = StructType

    def generic_resolve(self, kind: StructType, attribute: str) -> types.Type | None:
        return dict(kind.fields).get(attribute)


@lower_getattr_generic(StructType)
def _lower_attribute(
    context: Any, builder: Any, kind: StructType, address: Any, attribute: str
) -> Any:
    word = ir.IntType(64)
    row = kind.row(attribute)
    field = kind.fields[row][1]
    table = builder.inttoptr(address, word.as_pointer())

    def load(column: int) -> Any:
        place = builder.gep(table, [ir.Constant(word, row * WORDS_PER_ROW + column)], inbounds=True)
        loaded = builder.load(place)
        # The table never changes, so LLVM may read it once for a whole loop.
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if not isinstance(field, types.Array):
        number = load(0)
        return builder.bitcast(number, ir.DoubleType()) if field == types.float64 else number
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


@lower_setattr_generic(StructType)
def _refuse_to_set(
    context: Any, builder: Any, signature: Any, arguments: Any, attribute: str
) -> None:
    struct = signature.args[0].name.rpartition("_")[0]
    raise NumbaTypeError(
        f"{struct}.{attribute} can only be read in kernels; what a kernel writes is an array, such as "
        "(1,) int64"
    )


# Bytes at bare addresses: what has no type where it is copied.


def copy_bytes(to, source, count):
    """Copy bytes from one address to another; the two do not overlap."""
    ctypes.memmove(int(to), int(source), int(count))


def clear_bytes(to, count):
    """Fill with zeros."""
    ctypes.memset(int(to), 0, int(count))


@intrinsic
def _copy_bytes(context, to, source, count):
    def generate(context, builder, signature, arguments):
        pointer = ir.IntType(8).as_pointer()
        to, source = (builder.inttoptr(address, pointer) for address in arguments[:2])
        cgutils.raw_memcpy(builder, to, source, arguments[2], 1)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@intrinsic
def _clear_bytes(context, to, count):
    def generate(context, builder, signature, arguments):
        to = builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())
        cgutils.memset(builder, to, arguments[1], 0)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


@overload(copy_bytes)
def _compiled_copy(to, source, count):
    return lambda to, source, count: _copy_bytes(to, source, count)


@overload(clear_bytes)
def _compiled_clear(to, count):
    return lambda to, count: _clear_bytes(to, count)
