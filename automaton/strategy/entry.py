"""One row of a table of strategies, without importing the strategy (which needs Numba)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import msgspec


class NoParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A strategy without parameters."""


class AsRecorded(msgspec.Struct, frozen=True):
    """The parameters of a strategy that is not loaded: what a recording says of them."""

    values: dict[str, Any]

    def __getattr__(self, name: str) -> Any:
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None


def located(parameters: Any, folder: Path) -> Any:
    """Parameters with the files that they name found from a folder, as absolute paths.

    Parameters that name files have a method `located(folder)`, and `files` that lists them.
    """
    return parameters.located(folder) if hasattr(parameters, "located") else parameters


def files_of(parameters: Any) -> tuple[Path, ...]:
    """The files that parameters name."""
    return tuple(getattr(parameters, "files", ()))


class Entry(NamedTuple):
    """Where a strategy is implemented, what parameters it takes, and one line for `list`."""

    implementation: str  # "module:Class"
    parameters: type[msgspec.Struct]
    summary: str
