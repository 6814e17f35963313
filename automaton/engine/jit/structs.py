"""Structs of arrays that cross into compiled code as one pointer; each field is declared once.

    cell: Array = field("(n,) int32", "where it stands; NIL: off the floor", hidden=NIL, digest=0)
    width: int = field("int64", "cells in a row, border included")

A field is an array (of 1 to 3 dimensions, C-contiguous), a constant number of 64 bits, a number
that kernels write ("() int64"), several such numbers in one array (named_numbers), or another
struct (by annotation alone). The kind of an array is its shape and dtype. An extent is a number, or
a name for the same number throughout a struct; "4n" and "n + 1" are derived from n, any other text
is a name. Arrays are checked against their declarations when a struct is made.

default    its value if none is given (`Struct.sized`)
role       its role in a run (below); fields with a digest number are state
hidden     its value if a strategy may not see it, by default the default; VISIBLE: never hidden
digest     the number of the array in the digest: assigned by hand, never reused (`by` names a kernel
           (struct, i) that gives the value instead)
used       the field with the used length of each row
recorded   False: left out of the keyframes of a recording, which hold all other state
header     True: included in the header of a recording

In Python, and with the JIT off, a struct is a plain object with these attributes. Compiled code
gets the address of a table with one row per field, from which it reads fields when used:

    array:    data pointer, shape (3)        number: value        struct: its table
    numbers that kernels write: data pointer

A NamedTuple of arrays is passed by value at every call, seven words per array: the same kernels
then compiled in 122 s instead of 34 s (measured with Numba 0.68). Constant arrays and arrays of
read-only structs are also read-only in compiled code: kernels that write to them do not compile.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from ctypes import addressof, c_char
from functools import cache
from math import prod
from operator import index
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from automaton.engine.jit.named_numbers import NamedNumbers as NamedNumbers
from automaton.engine.jit.named_numbers import number as number

Array = NDArray[Any]

NIL: Final = -1  # none
VISIBLE: Final = None

# Roles. Arguments, outputs and scratch of kernels have no role.
STATE: Final = "state"  # the next tick depends on the field: it is in the digest
DERIVED: Final = "derived"  # follows from the state, and is stored with it
MEASURED: Final = "measured"  # metrics and viewers read the field; no influence on the run
STATIC: Final = "static"  # never changes after it is built
CONSTANT: Final = "constant"  # never changes, as STATIC, and is read-only in kernels
SCRATCH: Final = "scratch"  # no influence on later ticks
STOP: Final = "stop"  # not 0 once the run is aborted (Struct.stopped_by)
BY_ENTRY: Final = "by entry"  # some entries belong to the state, others do not
DECISION: Final = "decision"  # reset to its default for each robot that is asked
CALL: Final = "call"  # reset to its default in each call of a layer
CARRIED: Final = (STATE, DERIVED, MEASURED)  # copied to branches and to keyframes in memory

_EXTENT: Final = re.compile(r"(\d*)([A-Za-z]\w*)(?: \+ (\d+))?")
_UNSAID: Final = object()


@cache
def _parsed(kind: str) -> tuple[tuple[str, ...], Any]:
    """Extents and dtype."""
    shape, _, dtype = kind.rpartition(" ")
    extents = tuple(part.strip() for part in shape[1:-1].split(",") if part.strip())
    return extents, np.dtype(dtype) if kind else None


@cache
def _rule(extent: str) -> tuple[int, str, int] | None:
    """Factor, name and summand of an extent derived from another one."""
    match = _EXTENT.fullmatch(extent)
    if match is None or match[2] == extent:
        return None
    return int(match[1] or 1), match[2], int(match[3] or 0)


class Field:
    """A declared field; nested structs have no kind."""

    def __init__(
        self,
        kind: str | type[NamedNumbers],
        meaning: str = "",
        default: int = 0,
        hidden: Any = _UNSAID,
        role: str = "",
        digest: int | None = None,
        by: str = "",
        used: str = "",
        recorded: bool = True,
        header: bool = False,
    ) -> None:
        self.kind = kind if isinstance(kind, str) else kind.kind()
        self.numbers = None if isinstance(kind, str) else kind
        self.meaning = meaning
        self.extents, self.dtype = _parsed(self.kind)
        self.is_array = self.kind.startswith("(")
        self.is_cell = self.is_array and not self.extents  # a number that kernels write
        self.default = default
        self.role = role or ("" if digest is None else STATE)
        self._hidden = hidden
        self.digest = digest
        self.by = by
        self.used = used
        self.in_header = header
        self._recorded = recorded

    @property
    def hidden(self) -> Any:
        """The value that strategies see if the field is hidden, or VISIBLE."""
        if self._hidden is not _UNSAID:
            return self._hidden
        return VISIBLE if self.role in (STATIC, CONSTANT) else self.default

    @property
    def is_per_robot(self) -> bool:
        """Whether it has a row for each robot."""
        return self.extents[:1] == ("n",)

    @property
    def is_kept(self) -> bool:
        """Whether a strategy that declares it remembers it between calls."""
        return self.role in ("", STATE)

    @property
    def in_keyframe(self) -> bool:
        """Whether it is in the keyframes of a recording."""
        is_row_of_its_own = self.is_array and not self.used
        return (
            self._recorded and self.role == STATE and self.digest is not None and is_row_of_its_own
        )

    def is_scratch(self, in_scratch: bool) -> bool:
        """Whether it is scratch, or in a scratch struct and not constant or derived."""
        return self.role == SCRATCH or (in_scratch and self.role not in (CONSTANT, STATIC, DERIVED))

    def word(self, number: Any) -> int:
        """The 64 bits of a number of this kind."""
        is_float = self.dtype == np.float64
        return int(np.float64(number).view(np.uint64)) if is_float else int(number) % 2**64

    def named(self, array: Any) -> Any:
        """The same memory, as named numbers if its entries have names."""
        return array if self.numbers is None else array.view(self.numbers)

    def value(self, shape: tuple[int, ...]) -> Any:
        """The default: a number, or a new array of this shape."""
        if not self.default:
            # Unused pages of zeros cost nothing.
            return np.zeros(shape, self.dtype) if self.is_array else 0
        if not self.is_array:
            return self.default
        array = np.empty(shape, self.dtype)
        array.fill(self.default)
        return array


def field(kind: str | type[NamedNumbers], meaning: str = "", **options: Any) -> Any:
    """Declare a field of a struct: an array, "(n, 4) int32"; a number, "int64" or "float64"; a
    number that kernels write, "() int64"; or several of these, by their class."""
    return Field(kind, meaning, **options)


def nested(digest: int | None = None, by: str = "") -> Any:
    """Declare a nested struct with options; without options its annotation is enough."""
    return Field("", digest=digest, by=by)


class Sizes:
    """The extents of the fields of a struct, by the texts of their declarations."""

    def __init__(self, fields: Iterable[Field]) -> None:
        extents = {extent for one in fields for extent in one.extents}
        self.fixed = {extent: int(extent) for extent in extents if extent.isdecimal()}
        rules = {extent: _rule(extent) for extent in extents}
        self._derived = {extent: rule for extent, rule in rules.items() if rule is not None}

    def complete(self, sizes: Mapping[str, int]) -> dict[str, int]:
        """These sizes and all derived sizes."""
        known = {**sizes, **self.fixed}
        for extent, (factor, name, more) in self._derived.items():
            if name in known:
                known.setdefault(extent, factor * known[name] + more)
        return known

    def contradiction(self, sizes: Mapping[str, int]) -> str:
        """Describe a size that contradicts its declaration, or return ""."""
        for extent, (factor, name, more) in self._derived.items():
            wanted = factor * sizes.get(name, 0) + more
            if name in sizes and sizes[extent] != wanted:
                return f"{extent} is {sizes[extent]}, where {name} is {sizes[name]}"
        return ""


# The memory of a new struct: one block for all its new arrays, and its table. A small block is a
# copy of a block in which all arrays have their defaults.
WORDS_PER_ROW: Final = 4  # words per row of the table
NO_SHAPE: Final = (0, 0, 0)
EMPTY_ARRAY_ADDRESS: Final = 64  # the address of an empty array
CACHE_LINE: Final = 64  # bytes; arrays begin at multiples of it
MAX_TEMPLATE_BYTES: Final = (
    1 << 16
)  # bytes; up to this size copying is faster than filling the arrays


class BlockLayout:
    """The layout of the new arrays of a struct `owner`, for these sizes.

    `values`: the fields given with a value. Raises TypeError for missing or contradictory sizes.
    """

    def __init__(
        self,
        owner: str,
        fields: Mapping[str, Field],
        extents: Sizes,
        sizes: Mapping[str, int],
        values: Iterable[str],
    ) -> None:
        self.sizes = extents.complete(sizes)
        rows = {name: row for row, name in enumerate(fields)}
        self.rows_of_values = [rows[name] for name in values]
        self.places: dict[str, tuple[tuple[int, ...], Any, int]] = {}  # shape, dtype, offset
        self.numbers: dict[str, int] = {}
        self.table = np.zeros((max(1, len(fields)), WORDS_PER_ROW), np.uint64)
        self.is_in_block = np.zeros(len(self.table), np.uint64)
        self._filled: list[tuple[str, int]] = []
        self._size = 0
        for row, (name, declared) in enumerate(fields.items()):
            if row in self.rows_of_values:
                continue
            if not declared.kind:
                raise TypeError(f"{owner} takes the struct {name}")
            if declared.is_array:
                try:
                    shape = tuple([self.sizes[extent] for extent in declared.extents])
                except KeyError as error:
                    raise TypeError(f"{owner}.{name} needs {error.args[0]}") from None
                self._place(row, name, declared, shape)
            else:
                self.numbers[name] = declared.value(())
                self.table[row, 0] = declared.word(self.numbers[name])
        wrong = extents.contradiction(self.sizes)
        if wrong:
            raise TypeError(f"{owner}: {wrong}")
        self._template = self._made() if self._size <= MAX_TEMPLATE_BYTES else None

    def _place(self, row: int, name: str, declared: Field, shape: tuple[int, ...]) -> None:
        bytes_needed = prod(shape) * declared.dtype.itemsize
        self.places[name] = shape, declared.dtype, self._size
        self.table[row] = (self._size, *shape, *NO_SHAPE[len(shape) :])
        self.is_in_block[row] = bytes_needed > 0
        if not bytes_needed:
            self.table[row, 0] = EMPTY_ARRAY_ADDRESS
        elif declared.default:
            self._filled.append((name, declared.default))
        self._size += -(-bytes_needed // CACHE_LINE) * CACHE_LINE

    def block(self) -> Any:
        """Memory for the arrays, filled with their defaults."""
        return self._made() if self._template is None else self._template.copy()

    def _made(self) -> Any:
        # Unused pages of zeros cost nothing.
        block = np.zeros(max(1, self._size), np.uint8)
        for name, default in self._filled:
            shape, dtype, offset = self.places[name]
            np.ndarray(shape, dtype, block, offset).fill(default)
        return block


# The state of a strategy is a struct of its own type. The loop, compiled once for all strategies,
# passes only its address; `State.of(memory)` is the typed struct at that address.
#
# Strategies in Python get structs as views: other objects over the same memory. Their arrays cannot
# be resized or made writable, since the arrays that own the memory are out of reach. Only writes to
# raw addresses (ctypes) can still do harm.


NO_SIZES: Final[Mapping[str, int]] = {}
LAYOUTS_KEPT: Final = 64  # members of a class


class _Window:
    """The base of an array over the memory of another one: it does not expose that array."""

    __slots__ = ("__array_interface__", "__weakref__")
    __array_interface__: dict[str, Any]


_OWNERS: WeakKeyDictionary[_Window, Any] = WeakKeyDictionary()  # keeps owners alive


def window(array: Any, writable: bool) -> Any:
    """The same memory as an array that cannot be resized, or made writable if it is not."""
    base = _Window()
    interface = array.__array_interface__
    base.__array_interface__ = interface | {"data": (interface["data"][0], not writable)}
    _OWNERS[base] = array
    return np.asarray(base)


class StructClass(type):
    """The metaclass of structs, by which compiled code recognizes them."""


class Struct(metaclass=StructClass):
    """Base of all structs; made with one keyword argument for each annotated field."""

    _table: Any
    _address: int  # of the table
    _writable: bool
    _fields: ClassVar[tuple[str, ...]] = ()
    _declared: ClassVar[dict[str, Field]] = {}
    _sizes: ClassVar[Sizes]
    _structs: ClassVar[tuple[str, ...]]  # names of the nested structs
    _types: ClassVar[dict[Any, Any]]  # the Numba types of its instances
    _layouts: ClassVar[dict[Any, BlockLayout]]  # layouts by given fields and sizes

    def __init_subclass__(cls, role: str = "") -> None:
        """`role`: default role of the fields."""
        own = {name: vars(cls).get(name) or nested() for name in cls.__annotations__}
        for name, declared in own.items():
            declared.role = declared.role or role
            if declared.is_cell:
                setattr(cls, name, _cell(name))
            elif name in vars(cls):
                delattr(cls, name)  # instances hold the values
        cls._declared = cls._declared | own
        cls._fields = tuple(cls._declared)
        cls._sizes = Sizes(cls._declared.values())
        cls._structs = tuple(name for name, one in cls._declared.items() if not one.kind)
        cls._types, cls._layouts = {}, {}

    def __init__(self, **values: Any) -> None:
        if tuple(values) != self._fields:
            raise TypeError(f"{type(self).__name__} takes the fields {', '.join(self._fields)}")
        sizes = self._sizes.fixed.copy()
        rows = self._rows(values, sizes)
        wrong = self._sizes.contradiction(sizes)
        if wrong:
            raise TypeError(f"{type(self).__name__}: {wrong}")
        self._enter(np.array(rows or [(0, *NO_SHAPE)], np.uint64), values)

    def _rows(self, values: dict[str, Any], sizes: dict[str, int]) -> list[tuple[int, ...]]:
        """The rows of the table for these values; adds their extents to `sizes`. Raises TypeError."""
        shapes: dict[tuple[str, ...], tuple[int, ...]] = {}
        rows: list[tuple[int, ...]] = []
        for name, value in values.items():
            declared = self._declared[name]
            if declared.is_cell and not isinstance(value, np.ndarray):
                value = np.array(value, declared.dtype)
            if declared.is_array:
                address = self._checked(name, declared, value, sizes, shapes)
                rows.append((address, *value.shape, *NO_SHAPE[len(value.shape) :]))
                values[name] = declared.named(value)
            elif declared.kind:
                values[name] = self._number(name, declared, value)
                rows.append((declared.word(values[name]), *NO_SHAPE))
            else:
                rows.append((value._address, *NO_SHAPE))
        return rows

    def _enter(self, table: Any, values: dict[str, Any]) -> None:
        """`table`: its own, with one row per field; `values`: of all fields not made later."""
        address = addressof(c_char.from_buffer(table))
        self.__dict__.update(values, _table=table, _address=address, _writable=True)

    def _checked(
        self,
        name: str,
        declared: Field,
        array: Any,
        sizes: dict[str, int],
        shapes: dict[tuple[str, ...], tuple[int, ...]],
    ) -> int:
        """Check an array against its declaration; returns its address, and adds its extents and
        shape.

        Raises TypeError.
        """
        if not isinstance(array, np.ndarray):
            raise self._unfit(name, "is not an array")
        shape = array.shape
        if array.dtype != declared.dtype or len(shape) != len(declared.extents):
            raise self._unfit(name, f"is {shape} {array.dtype}")
        if shapes.get(declared.extents) != shape:
            for extent, size in zip(declared.extents, shape, strict=True):
                if sizes.setdefault(extent, size) != size:
                    raise self._unfit(name, f"is {shape}, where {extent} is {sizes[extent]}")
            shapes[declared.extents] = shape
        flags = array.flags
        if not flags.c_contiguous:
            raise self._unfit(name, "is not contiguous")
        if not array.size:
            return EMPTY_ARRAY_ADDRESS
        if flags.writeable:
            buffer: Any = array  # what a buffer is to type checkers depends on the version of NumPy
            return addressof(c_char.from_buffer(buffer))  # 4 times faster
        if declared.role != CONSTANT:
            raise self._unfit(name, "is read-only")
        address: int = array.__array_interface__["data"][0]
        return address

    def _number(self, name: str, declared: Field, value: Any) -> int | float:
        """A number as kernels see it. Raises TypeError for a fraction where an integer is declared."""
        try:
            return float(value) if declared.dtype == np.float64 else index(value)
        except TypeError:
            raise self._unfit(name, f"is {value!r}") from None

    def _unfit(self, name: str, fault: str) -> TypeError:
        kind = self._declared[name].kind
        return TypeError(f"{type(self).__name__}.{name} {fault}; it is declared as {kind}")

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._declared or not self._declared[name].is_cell:
            raise AttributeError(
                f"{type(self).__name__}.{name} cannot be replaced; write into arrays"
            )
        self.array(name)[()] = value

    def array(self, name: str) -> Any:
        """The array of a field; for a number that kernels write, an array without dimensions."""
        if not self._declared[name].is_cell:
            return getattr(self, name)
        array = self.__dict__.get(name)
        return self._make_array(name) if array is None else array

    @classmethod
    def sized(cls, sizes: Mapping[str, int] = NO_SIZES, **values: Any) -> Self:
        """A new struct with these values, and defaults for all other fields.

        `sizes`: extents that the given arrays do not determine. Arrays may be given as lists of
        numbers.
        """
        known = dict(sizes)
        for name, value in values.items():
            if name not in cls._declared:
                raise TypeError(f"{cls.__name__} has no field {name}")
            extents = cls._declared[name].extents
            if extents:
                if isinstance(value, list | tuple):
                    value = values[name] = np.array(value, cls._declared[name].dtype)
                known.update(zip(extents, getattr(value, "shape", ()), strict=False))
        key = (frozenset(known.items()), *values)
        layout = cls._layouts.get(key)
        if layout is None:
            if len(cls._layouts) == LAYOUTS_KEPT:
                cls._layouts.clear()
            layout = BlockLayout(cls.__name__, cls._declared, cls._sizes, known, values)
            cls._layouts[key] = layout
        struct = object.__new__(cls)
        table, block = layout.table.copy(), layout.block()
        if values:
            rows = struct._rows(values, layout.sizes.copy())
            table[layout.rows_of_values] = rows
        table[:, 0] += layout.is_in_block * np.uint64(addressof(c_char.from_buffer(block)))
        struct._enter(table, layout.numbers | values)
        struct.__dict__.update(_block=block, _places=layout.places)
        return struct

    @classmethod
    def struct_classes(cls) -> dict[str, type[Struct]]:
        """The classes of the nested structs."""
        names = {}
        for base in reversed(cls.__mro__[:-1]):
            known = vars(sys.modules[base.__module__])
            for name, text in base.__annotations__.items():
                part = known.get(text) if isinstance(text, str) else text
                if isinstance(part, type) and issubclass(part, Struct):
                    names[name] = part
        return names

    @classmethod
    def fields_where(cls, is_meant: Callable[[Field], bool]) -> tuple[str, ...]:
        """The names of the fields with matching declarations."""
        return tuple(name for name, declared in cls._declared.items() if is_meant(declared))

    def replaced(self, **values: Any) -> Self:
        """The same struct with some fields replaced."""
        return type(self)(**{name: values.get(name, self.array(name)) for name in self._fields})

    def copied(self) -> Self:
        """The same struct over copies of its arrays, including those of nested structs.

        Scratch is not copied: the copy has its own.
        """
        return self._over(
            lambda kind, is_scratch, array: kind.value(array.shape) if is_scratch else array.copy()
        )

    def cleared(self) -> Self:
        """The same struct with its own state, set to zero; it shares constants and scratch."""
        return self._over(
            lambda kind, is_scratch, array: (
                np.zeros(array.shape, kind.dtype) if kind.is_kept and not is_scratch else array
            )
        )

    def stopped_by(self, stop: Any) -> Self:
        """The same struct with `stop`, (1,) int64, for all arrays of role STOP."""
        if not self._has(STOP):
            return self
        return self._over(lambda kind, is_scratch, array: stop if kind.role == STOP else array)

    def _has(self, role: str) -> bool:
        """Whether it or a nested struct has a field of this role."""
        return any(one.role == role for one in self._declared.values()) or any(
            getattr(self, name)._has(role) for name in self._structs
        )

    def _over(self, other: Callable[[Field, bool, Any], Any], in_scratch: bool = False) -> Self:
        """The same struct over other arrays, from `other`(declaration, is scratch, array), also
        nested."""
        values = {name: self.array(name) for name in self._fields}
        for name, value in values.items():
            declared = self._declared[name]
            if isinstance(value, Struct):
                values[name] = value._over(other, in_scratch or declared.role == SCRATCH)
            elif declared.is_array:
                values[name] = other(declared, declared.is_scratch(in_scratch), value)
        return type(self)(**values)

    def arrays(self, in_scratch: bool = False) -> Iterator[tuple[str, Field, Any]]:
        """Name, declaration and value of each array, including those of nested structs.

        Arrays that are scratch only because their struct is scratch are left out.
        """
        for name, declared in self._declared.items():
            value = self.array(name)
            if isinstance(value, Struct):
                parts = value.arrays(in_scratch or declared.role == SCRATCH)
                yield from ((f"{name}.{part}", *rest) for part, *rest in parts)
            elif declared.is_array and not (in_scratch and declared.is_scratch(in_scratch)):
                yield name, declared, value

    @property
    def is_open(self) -> bool:
        """Whether kernels may write to it and to its nested structs."""
        parts = (getattr(self, name) for name in self._structs)
        return self._writable and all(part.is_open for part in parts)

    @classmethod
    def of(cls, memory: Any) -> Self:
        """The state of a strategy in a memory; kernels can call this too (struct_types)."""
        state = _STATES_BY_ADDRESS.get(memory.address)
        if not isinstance(state, cls):
            raise TypeError(f"the state is {type(state).__name__}, not {cls.__name__}")
        return state

    def read_only(self) -> Self:
        """The same memory, read-only: the view of strategies."""
        return self._view(python=False, kernels=False)

    def for_kernels_only(self) -> Self:
        """The same memory, read-only for Python but not for kernels."""
        return self._view(python=False, kernels=True)

    def writable_view(self) -> Self:
        """The same memory, as writable as before; its arrays cannot be resized."""
        return self._view(python=True, kernels=True)

    def _view(self, python: bool, kernels: bool) -> Self:
        view = object.__new__(type(self))
        table = self._table
        if self._structs:
            table = table.copy()
        for row, name in enumerate(self._fields):
            declared = self._declared[name]
            if not declared.kind:
                part = view.__dict__[name] = getattr(self, name)._view(python, kernels)
                table[row, 0] = part._address
            elif not declared.is_array:
                view.__dict__[name] = getattr(self, name)
        closed = np.frombuffer(table.tobytes(), np.uint64).reshape(-1, WORDS_PER_ROW)
        address = closed.__array_interface__["data"][0]
        is_writable = kernels and self._writable
        view.__dict__.update(_table=closed, _address=address, _writable=is_writable)
        _ORIGINALS[view] = self, python
        return view

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            return self._make_array(name)

    def _make_array(self, name: str) -> Any:
        """Make an array at its first use, since most runs use few: its own array or, for a view, a
        window."""
        places = self.__dict__.get("_places")
        if places is not None and name in places:
            shape, dtype, offset = places[name]
            array = np.ndarray(shape, dtype, self.__dict__["_block"], offset)
        elif name in self._fields and self in _ORIGINALS:
            original, python = _ORIGINALS[self]
            array = original.array(name)
            is_constant = self._declared[name].role == CONSTANT
            array = window(array, python and array.flags.writeable and not is_constant)
        else:
            raise AttributeError(f"{type(self).__name__} has no field {name}")
        self.__dict__[name] = array = self._declared[name].named(array)
        return array


def _cell(name: str) -> property:
    """The Python attribute for a number that kernels write."""
    return property(lambda struct: struct.array(name)[()])


_ORIGINALS: WeakKeyDictionary[Struct, tuple[Struct, bool]] = WeakKeyDictionary()  # of views
_STATES_BY_ADDRESS: WeakValueDictionary[int, Struct] = WeakValueDictionary()


def registered_address(struct: Struct) -> int:
    """The address of a struct, by which `of` finds it while the struct exists."""
    address = struct._address
    _STATES_BY_ADDRESS[address] = struct
    return address


def struct_of_address(address: int) -> Struct:
    """The registered struct of an address."""
    return _STATES_BY_ADDRESS[int(address)]
