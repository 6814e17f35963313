"""Orders of a file, each of which brings a load from one place to another."""

from __future__ import annotations

from typing import Annotated, Final

from msgspec import Meta, field

from automaton.scenario.order_fields import (
    Column,
    ColumnNames,
    DueField,
    Field,
    NumberField,
    OrderFile,
    ReleaseField,
    TextField,
)

FARTHEST: Final = 1_000_000
MAX_WEIGHT: Final = 1_000_000_000

PLACES: Final = (  # of each entry the fields of one group are needed
    (("from",), ("from_x", "from_y")),
    (("to",), ("to_x", "to_y")),
)
FIELDS: Final[tuple[Field, ...]] = (
    ReleaseField(),
    DueField(),
    TextField("order"),
    NumberField("priority", -100, 100, default=0),
    NumberField("weight", 1, MAX_WEIGHT, default=1),
    *(NumberField(name, 0, FARTHEST) for name in ("from_x", "from_y", "to_x", "to_y")),
)


class TransportColumns(ColumnNames, frozen=True, kw_only=True):
    """What the columns of a file of transports are called; others are not read."""

    released: Annotated[Column, Meta(description="When the order is released.")] = None
    source: Annotated[Column, Meta(description="The slot with the load, by its name.")] = field(
        name="from", default=None
    )
    target: Annotated[Column, Meta(description="Where to bring it, by its name.")] = field(
        name="to", default=None
    )
    from_x: Annotated[Column, Meta(description="The slot with the load: its column.")] = None
    from_y: Annotated[Column, Meta(description="And its row.")] = None
    to_x: Annotated[Column, Meta(description="Where to bring it: the column.")] = None
    to_y: Annotated[Column, Meta(description="And the row.")] = None
    order: Annotated[Column, Meta(description="The number or name of the order.")] = None
    due: Annotated[
        Column, Meta(description="Until when: a clock time, or ticks or a time after the release.")
    ] = None
    priority: Annotated[Column, Meta(description="From -100 to 100; empty: 0.")] = None
    weight: Annotated[Column, Meta(description="How heavy the load is; empty: 1.")] = None


class Transports(OrderFile, frozen=True, kw_only=True):
    """A file of orders, each of which brings a load from one place to another."""

    columns: Annotated[
        TransportColumns | None,
        Meta(description="What its columns are called; null: as the keys of this are."),
    ] = None
