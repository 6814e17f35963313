"""What to say when one tick needs more distance tables than the scenario has room for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from automaton.engine.distance_tables import (
    BYTES_PER_WORD,
    TABLES_REFUSED,
    TABLES_ROWS,
    TABLES_WORDS,
    DistanceTables,
)
from automaton.engine.jit.structs import Struct
from automaton.engine.state import CLOCK_TICK, World
from automaton.errors import InputError
from automaton.units import count, memory


def no_room(world: World, structs: Iterable[Struct]) -> InputError:
    """The sentence about the tables among these structs that a table did not fit in."""
    tables = next(one for one in tables_in(structs) if one.status[TABLES_REFUSED])
    robots, size = len(world.robots.cell), BYTES_PER_WORD * int(tables.status[TABLES_WORDS])
    at_once = max(int(tables.status[TABLES_ROWS]) - 1, 0)
    return InputError(
        f"tick {world.clock[CLOCK_TICK]} needs more distance tables than world.distance_tables "
        f"({memory(world.rules.table_bytes)}) has room for: {count(at_once, 'table')} of {memory(size)} "
        f"at a time; set it to {memory((robots + 1) * size)}, for a table for each of "
        f"{count(robots, 'robot')}"
    )


def tables_in(structs: Iterable[Struct]) -> Iterator[DistanceTables]:
    """The tables in some structs, and in the structs in them."""
    for one in structs:
        if isinstance(one, DistanceTables):
            yield one
        else:
            parts = (getattr(one, name) for name in one._fields)
            yield from tables_in(part for part in parts if isinstance(part, Struct))
