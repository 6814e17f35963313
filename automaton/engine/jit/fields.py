"""Declarations of the fields of a struct: each is described once, in the body of its class.

    cell: Array = field("(n,) int32", "where it stands; NIL: off the floor", hidden=NIL, digest=0)
    width: int = field("int64", "cells in a row, border included")

The kind of an array is its shape and dtype. An extent is a number, or a name that stands for the same
number wherever a struct uses it; "4n" and "n + 1" follow from n, any other text is a name as it stands.
Arrays are checked against their declarations when a struct is made.

default    its value where none is given (`Struct.sized`)
role       what it is to a run (below); what has a number in the digest is state
hidden     its value where a strategy may not see it, the default unless said; VISIBLE: never hidden
digest     the number of the array in the digest: given by hand, never reused (`by` names a kernel
           (struct, i) that gives the value instead)
used       the field that says how much of each row is in use
recorded   False: left out of the keyframes of a recording, which hold the other arrays of the state
header     True: the header of a recording has it
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, Final

import numpy as np

NIL: Final = -1  # none
VISIBLE: Final = None

# Roles. Arguments, outputs and scratch of kernels have none.
STATE: Final = "state"  # what a tick goes on from: in the digest
DERIVED: Final = "derived"  # follows from the state, and is kept with it
MEASURED: Final = "measured"  # for metrics and viewers; decides nothing
STATIC: Final = "static"  # stays as it was built
CONSTANT: Final = "constant"  # the same, and read-only in kernels
SCRATCH: Final = "scratch"  # decides nothing in another tick
STOP: Final = "stop"  # of its run: not 0 once that is given up (Struct.stopped_by)
BY_ENTRY: Final = "by entry"  # some of its entries are state
DECISION: Final = "decision"  # begins as its default for each robot that is asked
CALL: Final = "call"  # begins as its default in each call of a layer
CARRIED: Final = (STATE, DERIVED, MEASURED)  # to a branch, and in keyframes in memory

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
    """Factor, name and summand of an extent that follows from another one."""
    match = _EXTENT.fullmatch(extent)
    if match is None or match[2] == extent:
        return None
    return int(match[1] or 1), match[2], int(match[3] or 0)


class Field:
    """A declared field; a struct in a struct has no kind."""

    def __init__(
        self,
        kind: str,
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
        self.kind = kind
        self.meaning = meaning
        self.extents, self.dtype = _parsed(kind)
        self.is_array = bool(self.extents)
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
        """What strategies see of it where they may not see it, or VISIBLE."""
        if self._hidden is not _UNSAID:
            return self._hidden
        return VISIBLE if self.role in (STATIC, CONSTANT) else self.default

    @property
    def is_kept(self) -> bool:
        """Whether a strategy that declares it goes on from it."""
        return self.role in ("", STATE)

    @property
    def in_keyframe(self) -> bool:
        """Whether the keyframes of a recording have it."""
        is_row_of_its_own = self.is_array and not self.used
        return (
            self._recorded and self.role == STATE and self.digest is not None and is_row_of_its_own
        )

    def is_scratch(self, in_scratch: bool) -> bool:
        """Whether it is scratch, in a struct that is: what does not change is not, even there."""
        return self.role == SCRATCH or (in_scratch and self.role not in (CONSTANT, STATIC, DERIVED))

    def word(self, number: Any) -> int:
        """The 64 bits of a number of this kind."""
        is_float = self.dtype == np.float64
        return int(np.float64(number).view(np.uint64)) if is_float else int(number) % 2**64

    def value(self, shape: tuple[int, ...]) -> Any:
        """The default: a number, or a new array of this shape."""
        if not self.default:
            # Pages of zeros that are not used cost nothing.
            return np.zeros(shape, self.dtype) if self.is_array else 0
        if not self.is_array:
            return self.default
        array = np.empty(shape, self.dtype)
        array.fill(self.default)
        return array


def field(kind: str, meaning: str = "", **options: Any) -> Any:
    """Declare a field of a struct: an array, "(n, 4) int32", or a number, "int64" or "float64"."""
    return Field(kind, meaning, **options)


def nested(digest: int | None = None, by: str = "") -> Any:
    """Declare a struct in a struct; one without options needs no more than its annotation."""
    return Field("", digest=digest, by=by)


class Sizes:
    """The extents that the fields of a struct have, by the texts of their declarations."""

    def __init__(self, fields: Iterable[Field]) -> None:
        extents = {extent for one in fields for extent in one.extents}
        self.fixed = {extent: int(extent) for extent in extents if extent.isdecimal()}
        rules = {extent: _rule(extent) for extent in extents}
        self._derived = {extent: rule for extent, rule in rules.items() if rule is not None}

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
