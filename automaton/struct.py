"""Structs of arrays that cross into compiled code as one pointer.

A subclass of Struct lists its fields by annotation: arrays (of 1 to 3 dimensions, C-contiguous),
integers, or other structs. In Python, and with the JIT off, it is a plain object with these
attributes. Compiled code gets the address of a table with one row per field,

    array:    data pointer, shape (3)        integer: value        struct: its table

and reads a field from there when it is used. A NamedTuple of arrays would be passed by value, seven
words for each array, at every call: the same kernels then compiled in 122 s instead of 34 s
(measured with Numba 0.68), so the world is passed by reference.

Read-only arrays give a type of their own, and kernels that write to them do not compile.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np

WORDS = 4  # of a row of the table


class Struct:
    """Base of all structs; made with keyword arguments, one for each annotated field."""

    _fields: ClassVar[tuple[str, ...]] = ()
    _types: ClassVar[dict[bool, Any]]  # Numba types, of the writable and the read-only form

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
