"""Declarations of the fields of a struct: each field is described once, in the body of its class.

    cell: Array = field("(n,) int32", "where it stands; NIL: off the floor")
    width: int = field("int64", "cells in a row, border included")

The kind of an array is its shape and dtype. An extent is a number, or a name that stands for the same
number wherever a struct uses it; "4n" and "n + 1" follow from n, any other text is a name as it stands.
The arrays of a struct are checked against their declarations when it is made. What is not given then
(`Struct.sized`) has its default, 0 unless declared otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

NIL: Final = -1  # none

STATE: Final = "state"  # what a tick goes on from
CONSTANT: Final = "constant"  # read-only, for kernels too

_EXTENT: Final = re.compile(r"(\d*)([A-Za-z]\w*)(?: \+ (\d+))?")
_UNSAID: Final = object()


class Field:
    """One declared field; `dtype` is None for a struct."""

    def __init__(self, kind: str, meaning: str, default: int, role: str) -> None:
        shape, _, dtype = kind.rpartition(" ")
        self.kind = kind
        self.meaning = meaning
        self.default = default
        self.role = role
        self.is_array = bool(shape)
        self.dtype = np.dtype(dtype)
        self.extents = tuple(part.strip() for part in shape[1:-1].split(",") if part.strip())
        self.ndim = len(self.extents)

    def value(self, sizes: Mapping[str, int]) -> Any:
        """The default: a number, or a new array of these sizes."""
        if not self.is_array:
            return self.default
        shape = tuple(sizes[extent] for extent in self.extents)
        if self.default == 0:
            return np.zeros(shape, self.dtype)  # pages that are not used cost nothing
        return np.full(shape, self.default, self.dtype)


def field(kind: str, meaning: str = "", *, default: int = 0, role: str = STATE) -> Any:
    """Declare a field of a struct: an array, such as "(n, 4) int32", or a number, "int64"."""
    return Field(kind, meaning, default, role)


class Sizes:
    """The extents that the fields of a struct have, by the texts of their declarations."""

    def __init__(self, fields: Iterable[Field]) -> None:
        extents = {extent for one in fields for extent in one.extents}
        self.fixed = {extent: int(extent) for extent in extents if extent.isdecimal()}
        parts = {extent: _EXTENT.fullmatch(extent) for extent in extents}
        self._derived = {
            extent: (int(match[1] or 1), match[2], int(match[3] or 0))
            for extent, match in parts.items()
            if match is not None and match[2] != extent
        }

    def complete(self, sizes: Mapping[str, int]) -> dict[str, int]:
        """These sizes, and those that follow from them."""
        known = {**self.fixed, **sizes}
        for extent, (factor, name, more) in self._derived.items():
            if name in known:
                known.setdefault(extent, factor * known[name] + more)
        return known

    def contradiction(self, sizes: Mapping[str, int]) -> str:
        """Say which size does not follow from another as declared, or nothing."""
        for extent, (factor, name, more) in self._derived.items():
            wanted = factor * sizes.get(name, 0) + more
            if name in sizes and sizes[extent] != wanted:
                return f"{extent} is {sizes[extent]}, where {name} is {sizes[name]}"
        return ""
