"""Find the reader for a kind of layout file, and refuse options that it does not use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Final, NamedTuple

from automaton.errors import InputError
from automaton.exchange.graphs.import_graph import import_lif, import_opentcs
from automaton.exchange.guidance_graph import read_guidance_graph
from automaton.exchange.image_floor import read_image_floor
from automaton.exchange.imported_floor import (
    FILE_KINDS,
    GUIDANCE,
    LIF,
    OPENTCS,
    ROS,
    ImportedFloor,
    ImportOptions,
)


class FloorReader(NamedTuple):
    """The reader of a kind of layout, and the options of ImportOptions that it uses."""

    read: Callable[[Path, ImportOptions], ImportedFloor]
    options: frozenset[str]


OF_ALL: Final = frozenset(("robots", "ticks"))  # options of problems, too
OF_GRAPHS: Final = frozenset(("cell", "tick", "speed", "accept", "robot"))
FLOOR_READERS: Final[dict[str, FloorReader]] = {
    LIF: FloorReader(import_lif, OF_GRAPHS | {"layout", "type"}),
    OPENTCS: FloorReader(import_opentcs, OF_GRAPHS),
    ROS: FloorReader(read_image_floor, frozenset(("cell", "tick", "speed", "robot", "unknown"))),
    GUIDANCE: FloorReader(read_guidance_graph, frozenset()),
}


def read_floor(path: Path, kind: str, options: ImportOptions) -> ImportedFloor:
    """Read a layout of a kind in FLOOR_READERS. Raises InputError."""
    check_options(kind, options, path)
    return FLOOR_READERS[kind].read(path, options)


def check_options(kind: str, options: ImportOptions, path: Path) -> None:
    """Raises InputError for a given option that has no effect for this kind of file."""
    known = OF_ALL | (FLOOR_READERS[kind].options if kind in FLOOR_READERS else frozenset())
    plain = ImportOptions()
    for option in (field.name for field in fields(options)):
        if option not in known and getattr(options, option) != getattr(plain, option):
            what = FILE_KINDS.get(kind, "folder of a problem")
            raise InputError(f"--{option} has no effect on this file (a {what})", str(path))
