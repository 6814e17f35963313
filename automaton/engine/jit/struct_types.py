"""How compiled code reads a Struct: its Numba type, and the loads behind an attribute."""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Iterator
from functools import cache
from typing import Any, Final

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
from automaton.engine.jit.structs import (
    CONSTANT,
    WORDS_PER_ROW,
    NamedNumbers,
    Struct,
    StructClass,
    struct_of_address,
)

WORD: Final = ir.IntType(64)


class StructType(types.Type):
    """The Numba type of a struct: its name and the types of its fields."""

    def __init__(self, name: str, fields: tuple[tuple[str, types.Type], ...]) -> None:
        self.fields = fields
        described = ", ".join(f"{field}: {kind}" for field, kind in fields)
        # Short: the name is repeated in every symbol and every error.
        super().__init__(name=f"{name}_{hashlib.sha256(described.encode()).hexdigest()[:8]}")

    def row(self, attribute: str) -> int:
        return [field for field, _ in self.fields].index(attribute)


class NumbersType(types.Type):
    """The Numba type of numbers with names: the class, the names, and whether kernels may write."""

    def __init__(self, cls: type[NamedNumbers], writable: bool) -> None:
        self.entries = tuple(cls.meanings)
        self.writable = writable
        names = hashlib.sha256(", ".join(self.entries).encode()).hexdigest()[:8]
        super().__init__(name=f"{'' if writable else 'Closed'}{cls.__name__}_{names}")


class CellType(types.Type):
    """The type of a number in a struct that kernels may write, and whether they may here."""

    def __init__(self, number: types.Type, writable: bool) -> None:
        self.number = number
        self.writable = writable
        super().__init__(name=f"cell({number}, {writable})")


@register_model(NumbersType)
@register_model(StructType)
class _StructModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: types.Type) -> None:
        super().__init__(manager, kind, WORD)


@typeof_impl.register(NamedNumbers)
def _typeof_numbers(value: NamedNumbers, context: Any) -> types.Type:
    return NumbersType(type(value), value.flags.writeable)


@typeof_impl.register(Struct)
def _typeof_struct(value: Struct, context: Any) -> types.Type:
    """The Numba type that follows from the declared fields and the nested structs."""
    cls, writable = type(value), value._writable
    if "_type" in value.__dict__:
        return value.__dict__["_type"]
    inner = [_typeof_struct(getattr(value, name), context) for name in cls._structs]
    key = (writable, *map(id, inner)) if inner else writable  # types are slow to hash
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
        elif declared.numbers is not None:
            kind = NumbersType(declared.numbers, writable and declared.role != CONSTANT)
        elif declared.is_cell:
            kind = CellType(from_dtype(declared.dtype), writable and declared.role != CONSTANT)
        else:
            readonly = not writable or declared.role == CONSTANT
            kind = types.Array(from_dtype(declared.dtype), len(declared.extents), "C", readonly)
        fields.append((name, kind))
    return StructType(cls.__name__, tuple(fields))


@cache
def declared_type(cls: type[Struct], writable: bool = True) -> StructType:
    """The type of writable or read-only instances of a class, including all nested structs."""
    classes = cls.struct_classes()
    inner = [declared_type(classes[name], writable) for name in cls._structs]
    return _struct_type(cls, writable, iter(inner))


class StructClassType(types.Dummy):
    """The Numba type of a struct class, for `State.of` in kernels.

    Numba identifies types by name, and a notebook may redefine a class with other fields.
    """

    def __init__(self, cls: type[Struct]) -> None:
        self.cls = cls
        super().__init__(f"class of {declared_type(cls).name}")


@typeof_impl.register(StructClass)
def _typeof_struct_class(cls: type[Struct], context: Any) -> types.Type:
    return StructClassType(cls)


@cache
def _of(cls: type[Struct]) -> Any:
    """`cls.of` in compiled code: the address in a memory, as a struct."""
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


@unbox(NumbersType)
@unbox(StructType)
def _unbox_struct(kind: types.Type, obj: Any, c: Any) -> NativeValue:
    attribute = c.pyapi.object_getattr_string(obj, "_address")
    address = c.pyapi.long_as_ulonglong(attribute)
    c.pyapi.decref(attribute)
    return NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@infer_getattr
class _StructAttributes(AttributeTemplate):
    key = StructType

    def generic_resolve(self, kind: StructType, attribute: str) -> types.Type | None:
        field = dict(kind.fields).get(attribute)
        return field.number if isinstance(field, CellType) else field


def _load_word(builder: Any, kind: StructType, address: Any, attribute: str, column: int) -> Any:
    """A word in the row of a field; the table is constant, so LLVM may read it once per loop."""
    table = builder.inttoptr(address, WORD.as_pointer())
    row = kind.row(attribute)
    place = builder.gep(table, [ir.Constant(WORD, row * WORDS_PER_ROW + column)], inbounds=True)
    loaded = builder.load(place)
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded


def _cell_of(context: Any, builder: Any, kind: StructType, address: Any, attribute: str) -> Any:
    """The address of a number that kernels write."""
    number = dict(kind.fields)[attribute].number
    data = _load_word(builder, kind, address, attribute, 0)
    return builder.inttoptr(data, context.get_data_type(number).as_pointer())


@lower_getattr_generic(StructType)
def _lower_attribute(
    context: Any, builder: Any, kind: StructType, address: Any, attribute: str
) -> Any:
    field = dict(kind.fields)[attribute]
    if isinstance(field, CellType):
        return builder.load(_cell_of(context, builder, kind, address, attribute))
    if isinstance(field, types.Array):
        return _lower_array(context, builder, kind, address, attribute)
    number = _load_word(builder, kind, address, attribute, 0)
    return builder.bitcast(number, ir.DoubleType()) if field == types.float64 else number


def _lower_array(context: Any, builder: Any, kind: StructType, address: Any, attribute: str) -> Any:
    field = dict(kind.fields)[attribute]
    array = context.make_array(field)(context, builder)
    model = context.data_model_manager[field.dtype]
    size = context.get_abi_sizeof(model.get_data_type())
    data, *shape = (
        _load_word(builder, kind, address, attribute, column) for column in range(1 + field.ndim)
    )
    strides = [ir.Constant(WORD, size)]
    for extent in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], extent))
    populate_array(
        array,
        data=builder.inttoptr(data, context.get_data_type(field.dtype).as_pointer()),
        shape=shape,
        strides=strides,
        itemsize=size,
        meminfo=None,
    )
    return array._getvalue()


@lower_setattr_generic(StructType)
def _store_attribute(
    context: Any, builder: Any, signature: Any, arguments: Any, attribute: str
) -> None:
    kind = signature.args[0]
    field, struct = dict(kind.fields)[attribute], kind.name.rpartition("_")[0]
    if not isinstance(field, CellType):
        raise NumbaTypeError(
            f"{struct}.{attribute} can only be read in kernels; kernels write to arrays, or to a "
            'number declared as "() int64"'
        )
    if not field.writable:
        raise NumbaTypeError(f"{struct}.{attribute} is read-only here")
    address, number = arguments
    builder.store(number, _cell_of(context, builder, kind, address, attribute))


@infer_getattr
class _NumbersAttributes(AttributeTemplate):
    key = NumbersType

    def generic_resolve(self, kind: NumbersType, attribute: str) -> types.Type | None:
        return types.int64 if attribute in kind.entries else None


def _place_of_number(builder: Any, kind: NumbersType, address: Any, attribute: str) -> Any:
    entry = ir.Constant(WORD, kind.entries.index(attribute))
    return builder.gep(builder.inttoptr(address, WORD.as_pointer()), [entry], inbounds=True)


@lower_getattr_generic(NumbersType)
def _load_number(context: Any, builder: Any, kind: NumbersType, address: Any, name: str) -> Any:
    return builder.load(_place_of_number(builder, kind, address, name))


@lower_setattr_generic(NumbersType)
def _store_number(
    context: Any, builder: Any, signature: Any, arguments: Any, attribute: str
) -> None:
    kind = signature.args[0]
    if not kind.writable:
        raise NumbaTypeError(f"{kind.name.rpartition('_')[0]}.{attribute} is read-only here")
    builder.store(arguments[1], _place_of_number(builder, kind, arguments[0], attribute))


# Structs and functions by their addresses, where kernels step many worlds in one call.


def _name(name: str, *forms: Any) -> None:
    """Name the forms of a function: Numba finds compiled code by names, so each needs its own."""
    for form in forms:
        form.__name__ = form.__qualname__ = name.replace(".", "_")


@cache
def struct_at(cls: type[Struct], writable: bool) -> Any:
    """A function (address) of kernels: the struct of a class at an address (`registered_address`)."""

    def at(address: int) -> Any:
        return struct_of_address(address)

    @intrinsic
    def load(context: Any, address: Any) -> Any:
        return declared_type(cls, writable)(types.int64), lambda *arguments: arguments[3][0]

    def compiled(address):
        return load(address)

    kind = "struct" if writable else "closed_struct"
    _name(f"{kind}_at_{cls.__module__}_{cls.__qualname__}", at, compiled)
    overload(at)(lambda address: compiled)
    return at


FUNCTION_WORDS: Final = 2
_FUNCTIONS: dict[int, Any] = {}  # by their first word, where kernels are plain Python


def words_of_function(function: Any, signature: Any) -> tuple[int, int]:
    """The words by which `function_at` finds a first-class function; zeros for None."""
    if function is None:
        return 0, 0
    if not hasattr(function, "get_compile_result"):
        _FUNCTIONS[id(function)] = function
        return id(function), 0
    result = function.get_compile_result(signature)
    names = result.fndesc.llvm_cfunc_wrapper_name, result.fndesc.llvm_func_name
    wrapper, code = (result.library.get_pointer_to_function(name) for name in names)
    return wrapper, code


@cache
def function_at(row: int, signature: Any) -> Any:
    """A function (words) of kernels: the function of a signature in a row of (f, 2) int64 `words`."""

    def at(words: Any) -> Any:
        return _FUNCTIONS.get(int(words[row, 0]))

    types_of_call = hashlib.sha256(str(signature).encode()).hexdigest()[:8]
    name = f"function_at_{row}_{types_of_call}"
    _name(name, at)
    if signature is None:
        return at
    kind = types.FunctionType(signature)

    @intrinsic
    def load(context: Any, wrapper: Any, code: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            function = cgutils.create_struct_proxy(kind)(context, builder)
            pointer = context.get_value_type(types.voidptr)
            function.c_addr, function.jit_addr = (
                builder.inttoptr(one, pointer) for one in arguments
            )
            return function._getvalue()

        return kind(types.int64, types.int64), generate

    def compiled(words):
        return load(words[row, 0], words[row, 1])

    _name(name, compiled)
    overload(at)(lambda words: compiled)
    return at


# Bytes at raw addresses, for data whose type is unknown where it is copied.


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
