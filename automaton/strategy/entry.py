"""One row of a table of strategies, without importing the strategy (which needs Numba)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

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


def resolve_paths(parameters: Any, folder: Path) -> Any:
    """Parameters with the files that they name found from a folder, as absolute paths.

    Parameters that name files have a method `resolve_paths(folder)`, and `files` that lists them;
    they may have `check_files(driving)`, which reads them and raises InputError; `driving()` gives the
    floor's grid, and the ticks of each action of robots of the first type.
    """
    return parameters.resolve_paths(folder) if hasattr(parameters, "resolve_paths") else parameters


def files_of(parameters: Any) -> tuple[Path, ...]:
    """The files that parameters name."""
    return tuple(getattr(parameters, "files", ()))


# What a method of scheduling can be: the columns of Table 1 of Keith & La.
MULTIPLE: Final = "multiple AMRs"
DYNAMIC: Final = "dynamic environment"
MANUFACTURING: Final = "manufacturing"
WAREHOUSE: Final = "warehouse"
DECENTRALIZED: Final = "decentralized"
PROPERTIES: Final = (MULTIPLE, DYNAMIC, MANUFACTURING, WAREHOUSE, DECENTRALIZED)


# Of which robots a right of way is the default: Entry.default_for.
ROUTED: Final = "robots that follow routes"
STEERED: Final = "robots that are steered"
SLOW_STEERED: Final = (
    "robots that are steered, turn or move for several ticks, and mostly both ways"
)


class Entry(NamedTuple):
    """Where a strategy is implemented, what parameters it takes, and one line for `list`.

    `properties`: those of PROPERTIES that its method has; None where nobody has said.
    `default_for`: the robots whose default it is, "" for none.
    """

    implementation: str  # "module:Class"
    parameters: type[msgspec.Struct]
    summary: str
    properties: tuple[str, ...] | None = None
    default_for: str = ""
