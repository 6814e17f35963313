"""Types of fields that the structs of the schema share."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta

from automaton.scenario.quantities import DUE, MOMENT, TIME, place, quantity

LAST_TICK: Final = 2_000_000_000
Direction = Literal["east", "south", "west", "north"]
Ticks = Annotated[int, quantity(TIME, ge=1, le=10_000, description="A duration in ticks.")]
TicksOrNone = Annotated[
    int, quantity(TIME, ge=0, le=10_000, description="A duration in ticks, or 0.")
]
LongTicks = Annotated[int, quantity(TIME, ge=1, le=10_000_000, description="A duration in ticks.")]
Tick = Annotated[int, quantity(MOMENT, ge=0, le=2_000_000_000, description="A tick.")]
Weight = Annotated[
    int, Meta(ge=1, le=1_000_000_000, description="In whatever unit payloads are given.")
]
Pair = Annotated[tuple[int, int], Meta(description="A cell [x, y], from the upper left.")]
NamedCell = Annotated[Pair, place()]  # written as [x, y] or by its name
NonEmptyText = Annotated[str, Meta(min_length=1)]
Parameters = dict[str, Any]
StrategySpec = str | Parameters  # a strategy: its name, or {name: NAME, ...parameters}
SingleLine = Annotated[str, Meta(min_length=1, max_length=200, pattern=r"^[^\r\n]*$")]


class ConfigSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A section of a scenario: immutable; unknown keys are refused."""


class DueAt(ConfigSection, frozen=True, kw_only=True):
    """When an order is due, whenever it is released."""

    at: Annotated[
        int,
        quantity(
            MOMENT, ge=-LAST_TICK, le=LAST_TICK, description="The tick; before 0: late at once."
        ),
    ]


Due = Annotated[int, quantity(DUE, ge=0, le=LAST_TICK)] | DueAt


def due_tick(due: Due | None, release: int) -> int | None:
    """The tick until which something is to be done that is released at one; None: it has no due time."""
    return due.at if isinstance(due, DueAt) else None if due is None else release + due
