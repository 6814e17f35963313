"""The memory of a new struct: one block for all arrays that it is made with, and its table.

A block that is small is a copy of one in which all arrays have their defaults.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from typing import Any, Final

import numpy as np

from automaton.engine.jit.fields import Field, Sizes

WORDS: Final = 4  # of a row of the table
NO_SHAPE: Final = (0, 0, 0)
NOWHERE: Final = 64  # the address of an empty array
CACHE_LINE: Final = 64  # bytes; arrays begin at multiples of it
SMALL: Final = 1 << 16  # bytes that are copied in less time than arrays in them are filled


class Layout:
    """Where the arrays lie that a struct `owner` is made with, for these sizes.

    `values`: the fields that are not made, but come with a value. Raises TypeError for sizes that are
    missing or contradict each other.
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
        self.table = np.zeros((max(1, len(fields)), WORDS), np.uint64)
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
        self._template = self._made() if self._size <= SMALL else None

    def _place(self, row: int, name: str, declared: Field, shape: tuple[int, ...]) -> None:
        bytes_needed = prod(shape) * declared.dtype.itemsize
        self.places[name] = shape, declared.dtype, self._size
        self.table[row] = (self._size, *shape, *NO_SHAPE[len(shape) :])
        self.is_in_block[row] = bytes_needed > 0
        if not bytes_needed:
            self.table[row, 0] = NOWHERE
        elif declared.default:
            self._filled.append((name, declared.default))
        self._size += -(-bytes_needed // CACHE_LINE) * CACHE_LINE

    def block(self) -> Any:
        """Memory for the arrays, which have their defaults there."""
        return self._made() if self._template is None else self._template.copy()

    def _made(self) -> Any:
        # Pages of zeros that are not used cost nothing.
        block = np.zeros(max(1, self._size), np.uint8)
        for name, default in self._filled:
            shape, dtype, offset = self.places[name]
            np.ndarray(shape, dtype, block, offset).fill(default)
        return block
