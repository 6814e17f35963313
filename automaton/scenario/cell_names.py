"""Names of cells, which a scenario may write instead of [x, y]: `at: packing`.

    locations: {packing: [4, 2], rack-7: [1, 0]}      beside      locations: locations.csv

A field of a struct that is such a cell says so by `place()` among its annotations, as the type
`NamedCell` does; `conversions` puts the cells there before the structs are made, so that nothing else
knows of names.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from msgspec import Meta

from automaton.errors import InputError, nearest
from automaton.scenario.field_types import NonEmptyText, Pair, SingleLine
from automaton.scenario.text_lines import quoted

Cell = tuple[int, int]
Locations = Annotated[
    dict[SingleLine, Pair] | NonEmptyText,
    Meta(
        description="Names of cells, for orders: {NAME: [x, y]}, or a CSV file with the columns name, "
        "x and y; path relative to the scenario."
    ),
]


def cell_named(name: str, names: Mapping[str, Cell]) -> Cell:
    """The cell of a name. Raises InputError without a place."""
    cell = names.get(name.strip())
    if cell is not None:
        return cell
    if not names:
        raise InputError(
            f"{quoted(name)} is a name, and the scenario names no cells; write [x, y], or set "
            "locations: {NAME: [x, y]}"
        )
    raise InputError(f"{quoted(name)} is not a location{nearest(name, names)}")
