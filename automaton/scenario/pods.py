"""Pods that stand in storage cells, the stations to which they are carried, and the lines of orders."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, field

from automaton.scenario.durations import Handling
from automaton.scenario.order_fields import Column, ColumnNames, OrderFile
from automaton.scenario.quantities import (
    GAP,
    TIME,
    ConfigSection,
    Due,
    NamedCell,
    NonEmptyText,
    SingleLine,
    Tick,
    Weight,
    due_tick,
    quantity,
)

MAX_POD_STOPS = 64
MAX_LINES = 1_000_000
SHARE_ERROR = 0.001  # by which shares may miss 1

DRAWN_ALONE: dict[str, Any] = {  # keys of lines that are drawn, as they are when left out
    "mean_interarrival_time": 0.0,
    "per_order": 1,
    "classes": None,
    "stations": "fewest-lines",
    "due": None,
}
READ_ALONE: dict[str, Any] = {
    "columns": None,
    "where": {},
    "time": None,
    "encoding": "utf-8",
    "sheet": None,
}  # and of a file
Share = Annotated[float, Meta(ge=0, le=1)]


def check_shares(name: str, shares: dict[str, float]) -> None:
    """Shares add up to 1. Raises ValueError."""
    total = sum(shares.values())
    if abs(total - 1) > SHARE_ERROR:
        raise ValueError(f"{name} must add up to 1, found {total:.4g}")


class Pod(ConfigSection, frozen=True, kw_only=True):
    """A pod: where it stands at the start, and what is known of it."""

    at: Annotated[NamedCell, Meta(description="The storage cell in which it stands.")]
    name: Annotated[
        SingleLine | None, Meta(description="What lines and orders call it, beside its number.")
    ] = None
    pod_class: Annotated[
        SingleLine | None,
        Meta(description="Its class, one of pods.classes; all pods have one, or none."),
    ] = field(name="class", default=None)
    weight: Weight = 1
    skus: Annotated[
        tuple[SingleLine, ...], Meta(description="What it holds, for lines with a sku.")
    ] = ()


class PodColumns(ColumnNames, frozen=True, kw_only=True):
    """What the columns of a file of pods are called; others are not read."""

    x: Annotated[Column, Meta(description="Where the pod stands: its column.")] = None
    y: Annotated[Column, Meta(description="And its row.")] = None
    pod: Annotated[
        Column, Meta(description="Its number from 1; without a column: that of its row.")
    ] = None
    name: Annotated[Column, Meta(description="What lines and orders call it.")] = None
    pod_class: Annotated[Column, Meta(description="One of pods.classes.")] = field(
        name="class", default=None
    )
    weight: Annotated[Column, Meta(description="How heavy it is; empty: 1.")] = None
    skus: Annotated[Column, Meta(description="What it holds, between blanks.")] = None


class Pods(ConfigSection, frozen=True, kw_only=True):
    """Pods: what stands in storage cells, and is carried to stations and back."""

    under: Annotated[
        Literal["empty", "none"],
        Meta(
            description="Who drives under pods. empty: robots without a load; none: only the robot that "
            "is to lift the pod."
        ),
    ] = "empty"
    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="A CSV file with a pod in each row, whose first row names its columns, or a "
            "workbook (.xlsx, extra excel); path relative to the scenario."
        ),
    ] = None
    columns: Annotated[
        PodColumns | None,
        Meta(description="What its columns are called; null: as the keys of this are."),
    ] = None
    sheet: Annotated[
        SingleLine | None, Meta(description="The sheet of a workbook; null: its only one.")
    ] = None
    encoding: Annotated[
        Literal["utf-8", "cp1252"], Meta(description="How the text of the file is stored.")
    ] = "utf-8"
    listed: Annotated[
        tuple[Pod, ...] | None,
        Meta(description="The pods, in the sequence of their numbers; left out: as drawn."),
    ] = field(name="list", default=None)
    join: Annotated[
        bool,
        Meta(description="Lines join a trip of their pod under way; false: each is a trip alone."),
    ] = True
    max_stops: Annotated[
        int, Meta(ge=1, le=MAX_POD_STOPS, description="Stations of one trip, at most.")
    ] = 4
    classes: Annotated[
        dict[SingleLine, Share] | None,
        Meta(
            description="Classes of pods and of storage cells, the first nearest to the stations, "
            "and the share of both that each has."
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.classes is not None:
            check_shares("classes", self.classes)
        if self.file is not None and self.listed is not None:
            raise ValueError("pods have either a file or a list")
        for name, default in READ_ALONE.items() if self.file is None else ():
            if getattr(self, name, default) != default:
                raise ValueError(f"{name} belongs to pods with a file")
        _ = self.options
        if self.listed == ():
            raise ValueError("list must hold at least one pod")

    @property
    def options(self) -> OrderFile:
        """How the file is read. Raises ValueError for options that do not go together."""
        return OrderFile(file=self.file or "", sheet=self.sheet, encoding=self.encoding)


class Break(ConfigSection, frozen=True, kw_only=True):
    """A time in which no visit begins at a station."""

    begin: Annotated[Tick, Meta(description="The tick in which it begins.")] = field(name="from")
    ticks: Annotated[
        int, quantity(TIME, ge=1, le=2_000_000_000, description="Ticks that it lasts.")
    ] = field(name="for")


class PodStation(ConfigSection, frozen=True, kw_only=True):
    """A station with a name: its cell, the cells of its queue, how many it lets come."""

    at: Annotated[NamedCell, Meta(description="Its cell, one of kind station.")]
    queue: Annotated[
        tuple[NamedCell, ...],
        Meta(
            max_length=1000,
            description="Corners of the path of its queue, from the cell next to it outwards.",
        ),
    ] = ()
    max_trips: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | Literal["queue"] | None,
        Meta(
            description="Trips on their way to it or at it, at most. queue: as many as its queue has "
            "cells, and one; null: any number."
        ),
    ] = "queue"
    handling: Annotated[
        Handling | None, Meta(description="How long a visit takes; left out: durations.handling.")
    ] = None
    breaks: Annotated[tuple[Break, ...], Meta(description="When no visit begins.")] = ()


# gc=False: 16 bytes less for each of a million, and no cycle of references leads through them.
class Line(ConfigSection, frozen=True, kw_only=True, gc=False):
    """What an order wants of one pod, or of any pod with some SKU, at a station."""

    pod: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | SingleLine | None,
        Meta(description="The pod, by name or number from 1."),
    ] = None
    sku: Annotated[
        int | SingleLine | None,
        Meta(description="What is wanted, of any pod that holds it; read where no pod is named."),
    ] = None
    station: Annotated[
        int | SingleLine | None,
        Meta(
            description="The station, by name or number from 1; left out: that of the earlier lines "
            "of its order, or the one with the fewest open lines."
        ),
    ] = None
    order: Annotated[
        int | SingleLine | None,
        Meta(description="Lines of one order have the same; left out: an order of its own."),
    ] = None
    release: Annotated[Tick, Meta(description="The tick from which it is known.")] = 0
    due: Annotated[
        Due | None,
        Meta(description="Ticks after release until which it is to be done, or {at: ...}: a tick."),
    ] = None
    priority: Annotated[int, Meta(ge=-100, le=100, description="Larger ones come first.")] = 0
    units: Annotated[int, Meta(ge=0, le=1_000_000, description="Units that are picked.")] = 1

    def __post_init__(self) -> None:
        if self.pod is None and self.sku is None:
            raise ValueError("a line needs a pod or a sku")

    @property
    def due_tick(self) -> int | None:
        """The tick until which it is to be done; None: it has no due time."""
        return due_tick(self.due, self.release)


class PerOrder(ConfigSection, frozen=True, kw_only=True):
    """A number of lines from 1 on, drawn geometrically for each order."""

    mean: Annotated[float, Meta(ge=1, le=1000, description="Its mean.")]


class LineColumns(ColumnNames, frozen=True, kw_only=True):
    """What the columns of a file of lines are called; others are not read."""

    released: Annotated[Column, Meta(description="When the line is released.")] = None
    pod: Annotated[Column, Meta(description="The pod, by name or number from 1.")] = None
    sku: Annotated[Column, Meta(description="What is wanted, where no pod is named.")] = None
    station: Annotated[Column, Meta(description="The station, by name or number; empty: any.")] = (
        None
    )
    order: Annotated[Column, Meta(description="What lines of one order have in common.")] = None
    due: Annotated[
        Column, Meta(description="Until when: a clock time, or ticks or a time after the release.")
    ] = None
    priority: Annotated[Column, Meta(description="From -100 to 100; empty: 0.")] = None
    units: Annotated[Column, Meta(description="Units that are picked; empty: 1.")] = None


class LineDemand(OrderFile, frozen=True, kw_only=True):
    """Lines that are drawn, so many of them, or those of a file."""

    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="A CSV file with a line in each row, whose first row names its columns, between "
            "semicolons, tabs or commas, or a workbook (.xlsx, extra excel); path relative to the "
            "scenario."
        ),
    ] = None  # type: ignore[assignment]
    columns: Annotated[
        LineColumns | None,
        Meta(description="What its columns are called; null: as the keys of this are."),
    ] = None
    count: Annotated[
        Annotated[int, Meta(ge=1, le=MAX_LINES)] | None,
        Meta(description="How many lines are drawn."),
    ] = None
    mean_interarrival_time: Annotated[
        float,
        quantity(
            GAP,
            ge=0,
            le=1_000_000,
            description="Mean ticks between two orders, whose lines come together: one arrives in a "
            "tick with probability 1 / this. 0: all are known from the start.",
        ),
    ] = 0.0
    per_order: Annotated[
        Annotated[int, Meta(ge=1, le=1000)] | PerOrder,
        Meta(description="Lines of an order: so many, or drawn with this mean."),
    ] = 1
    classes: Annotated[
        dict[SingleLine, Share] | None,
        Meta(
            description="Which share of lines wants pods of each class; left out: all pods alike."
        ),
    ] = None
    stations: Annotated[
        Literal["fewest-lines", "random"],
        Meta(description="The station of an order: the one with the fewest open lines, or any."),
    ] = "fewest-lines"
    due: Annotated[
        Annotated[int, quantity(TIME, ge=0, le=2_000_000_000)] | None,
        Meta(description="Ticks after release in which they are due; null: never."),
    ] = None

    @property
    def drawn(self) -> int:
        """How many lines are drawn."""
        return self.count or 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.file is None) == (self.count is None):
            raise ValueError("lines are a list, or have either a count or a file")
        for name, default in (DRAWN_ALONE if self.count is None else READ_ALONE).items():
            if getattr(self, name) != default:
                other = "count" if self.count is None else "file"
                raise ValueError(f"{name} belongs to lines with a {other}")
        if self.classes is not None:
            check_shares("classes", self.classes)
        if 0 < self.mean_interarrival_time < 1:
            raise ValueError(
                "mean_interarrival_time must be 0 or at least 1: at most one order arrives per tick"
            )
