"""Structs of arrays that cross into compiled code as one pointer.

A subclass of Struct declares its fields (module fields): arrays (of 1 to 3 dimensions, C-contiguous),
integers, or, by annotation alone, other structs. In Python, and with the JIT off, it is a plain object
with these attributes. Compiled code gets the address of a table with one row per field,

    array:    data pointer, shape (3)        integer: value        struct: its table

and reads a field from there when it is used. A NamedTuple of arrays would be passed by value, seven
words for each array, at every call: the same kernels then compiled in 122 s instead of 34 s
(measured with Numba 0.68), so the world is passed by reference.

Types follow from the declarations. Arrays of constants and of read-only structs are read-only in them,
and kernels that write to these do not compile.

Strategies in Python get their structs as faces: other objects over the same memory, whose arrays can
be neither resized nor opened for writing, since the arrays that own the memory cannot be reached from
there. Only somebody who writes to bare addresses (ctypes) can still do harm.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Self
from weakref import WeakKeyDictionary

import numpy as np

from automaton.engine.jit.fields import CONSTANT as CONSTANT
from automaton.engine.jit.fields import NIL as NIL
from automaton.engine.jit.fields import Field, Sizes
from automaton.engine.jit.fields import field as field

WORDS = 4  # of a row of the table
NO_SHAPE = (0, 0, 0)
NO_SIZES: Mapping[str, int] = {}


class _Window:
    """What an array over another one's memory has for a base: it gives nothing away."""

    __slots__ = ("__array_interface__", "__weakref__")
    __array_interface__: dict[str, Any]


_OWNERS: WeakKeyDictionary[_Window, Any] = WeakKeyDictionary()  # kept as long as their windows


def window(array: Any, writable: bool) -> Any:
    """The same memory as an array that cannot be resized, nor opened for writing if it is not."""
    base = _Window()
    interface = array.__array_interface__
    base.__array_interface__ = interface | {"data": (interface["data"][0], not writable)}
    _OWNERS[base] = array
    return np.asarray(base)


class Struct:
    """Base of all structs; made with keyword arguments, one for each annotated field."""

    _table: Any
    _writable: bool
    _fields: ClassVar[tuple[str, ...]] = ()
    _declared: ClassVar[dict[str, Field]] = {}  # without structs
    _sizes: ClassVar[Sizes]
    _types: ClassVar[dict[tuple[Any, ...], Any]]  # the Numba types of its instances

    def __init_subclass__(cls) -> None:
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Field)}
        for name in own:
            delattr(cls, name)  # instances have the values
        cls._fields = (*cls._fields, *cls.__annotations__)
        cls._declared = cls._declared | own
        cls._sizes = Sizes(cls._declared.values())
        cls._types = {}

    def __init__(self, **values: Any) -> None:
        if tuple(values) != self._fields:
            raise TypeError(f"{type(self).__name__} takes the fields {', '.join(self._fields)}")
        sizes = self._sizes.fixed.copy()
        words: list[int] = []
        for name, value in values.items():
            words += self._row(name, value, sizes)
        wrong = self._sizes.contradiction(sizes)
        if wrong:
            raise TypeError(f"{type(self).__name__}: {wrong}")
        table = np.array(words, np.uint64).reshape(len(values), WORDS)
        self.__dict__.update(values, _table=table, _writable=True)

    def _row(self, name: str, value: Any, sizes: dict[str, int]) -> tuple[int, ...]:
        """What compiled code reads of a field; checks it, and enters its extents into `sizes`."""
        declared = self._declared.get(name)
        if declared is None:
            return (value._address, *NO_SHAPE)
        if not declared.is_array:
            return (int(value) % 2**64, *NO_SHAPE)  # two's complement
        if not isinstance(value, np.ndarray):
            raise self._unfit(name, "is not an array")
        shape = value.shape
        if len(shape) != declared.ndim or value.dtype != declared.dtype:
            raise self._unfit(name, f"is {shape} {value.dtype}")
        for extent, size in zip(declared.extents, shape, strict=True):
            if sizes.setdefault(extent, size) != size:
                raise self._unfit(name, f"is {shape}, where {extent} is {sizes[extent]}")
        flags = value.flags
        if not flags.c_contiguous:
            raise self._unfit(name, "is not contiguous")
        if not flags.writeable and declared.role != CONSTANT:
            raise self._unfit(name, "is read-only")
        address = value.__array_interface__["data"][0]
        return (address, *shape, *NO_SHAPE[declared.ndim :])

    def _unfit(self, name: str, fault: str) -> TypeError:
        kind = self._declared[name].kind
        return TypeError(f"{type(self).__name__}.{name} {fault}; it is declared as {kind}")

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(f"{type(self).__name__}.{name} cannot be replaced; write into arrays")

    @property
    def _address(self) -> int:
        address: int = self._table.__array_interface__["data"][0]
        return address

    @classmethod
    def sized(cls, sizes: Mapping[str, int] = NO_SIZES, **values: Any) -> Self:
        """One with these values, and the defaults of all other fields.

        `sizes`: the extents that do not follow from the arrays among the values.
        """
        known = dict(sizes)
        for name in values.keys() - set(cls._fields):
            raise TypeError(f"{cls.__name__} has no field {name}")
        for name in values.keys() & cls._declared.keys():
            if cls._declared[name].is_array:
                known |= zip(cls._declared[name].extents, values[name].shape, strict=True)
        known = cls._sizes.complete(known)
        try:
            return cls(
                **{
                    name: values[name] if name in values else cls._declared[name].value(known)
                    for name in cls._fields
                }
            )
        except KeyError as error:
            raise TypeError(f"{cls.__name__} needs {error.args[0]}") from None

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
        return self._face(python=False, kernels=False)

    def sealed(self) -> Self:
        """The same memory, closed to Python but not to kernels."""
        return self._face(python=False, kernels=True)

    def lent(self) -> Self:
        """The same memory, open to writing as it was, for somebody who may do what he likes with it."""
        return self._face(python=True, kernels=True)

    def _face(self, python: bool, kernels: bool) -> Self:
        face = object.__new__(type(self))
        table = self._table.copy()
        for row, name in enumerate(self._fields):
            value = self.__dict__.get(name)  # no array of a face that nobody has looked at
            if isinstance(value, Struct):
                value = value._face(python, kernels)
                table[row, 0] = value._address
            if not isinstance(value, np.ndarray | None):
                face.__dict__[name] = value
        face.__dict__.update(_table=window(table, False), _writable=kernels and self._writable)
        _ORIGINALS[face] = self, python
        return face

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """An array of a face: a window is made when somebody looks, since most runs look at few."""
            if name not in self._fields or self not in _ORIGINALS:
                raise AttributeError(f"{type(self).__name__} has no field {name}")
            original, python = _ORIGINALS[self]
            array = getattr(original, name)
            self.__dict__[name] = window(array, python and array.flags.writeable)
            return self.__dict__[name]


_ORIGINALS: WeakKeyDictionary[Struct, tuple[Struct, bool]] = WeakKeyDictionary()  # of faces
