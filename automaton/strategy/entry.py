"""One row of a table of strategies, without importing the strategy (which needs Numba)."""

from __future__ import annotations

from typing import NamedTuple

import msgspec


class NoParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A strategy without parameters."""


class Entry(NamedTuple):
    """Where a strategy is implemented, what parameters it takes, and one line for `list`."""

    implementation: str  # "module:Class"
    parameters: type[msgspec.Struct]
    summary: str
