"""What a scenario file may say of parts of its floor that are not as the rest."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, field

from automaton.scenario.durations import MoveTicks
from automaton.scenario.field_types import ConfigSection, NamedCell


class CellRectangle(ConfigSection, frozen=True, kw_only=True):
    """All cells of a rectangle."""

    first: Annotated[NamedCell, Meta(description="A corner.")] = field(name="from")
    last: Annotated[NamedCell, Meta(description="The opposite corner.")] = field(name="to")


MarkedCells = Annotated[
    CellRectangle | Annotated[tuple[NamedCell, ...], Meta(min_length=1, max_length=1000)],
    Meta(description="Corners of a path along rows and columns, or {from, to}: a rectangle."),
]


class SpeedLimit(ConfigSection, frozen=True, kw_only=True):
    """Cells between which no robot drives faster than this."""

    cells: MarkedCells
    max_speed: Annotated[
        MoveTicks,
        Meta(
            description="A move from one of these cells into another one takes at least as long as "
            "at this speed; a plain number: at least so many ticks. Slow zones multiply after that."
        ),
    ]


class ChangingFloor(ConfigSection, frozen=True, kw_only=True):
    """Rules of parts of the floor."""

    speed_limits: Annotated[
        tuple[SpeedLimit, ...],
        Meta(description="Where robots drive slowly; of several limits the slowest counts."),
    ] = ()
