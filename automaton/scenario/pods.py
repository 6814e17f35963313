"""Pods that stand in storage cells, and the stations to which they are carried."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from msgspec import Meta, field

from automaton.scenario.durations import Handling
from automaton.scenario.quantities import (
    TIME,
    ConfigSection,
    NamedCell,
    NonEmptyText,
    Shares,
    SingleLine,
    Tick,
    Weight,
    check_shares,
    quantity,
)
from automaton.scenario.table_fields import (
    COORDINATE,
    FILE_OPTIONS,
    Column,
    ColumnNames,
    NumberField,
    TableOptions,
    column,
)

MAX_POD_STOPS: Final = 64


class Pod(ConfigSection, frozen=True, kw_only=True):
    """A pod: where it stands at the start, and what is known of it."""

    at: Annotated[NamedCell, Meta(description="The storage cell in which it stands.")]
    name: Annotated[
        SingleLine | None, Meta(description="What lines and orders call it, beside its number.")
    ] = None
    pod_class: Annotated[
        SingleLine | None,
        Meta(description="The class of the pod, one of pods.classes; all pods have one, or none."),
    ] = field(name="class", default=None)
    weight: Weight = 1
    skus: Annotated[
        tuple[SingleLine, ...], Meta(description="What it holds, for lines with a sku.")
    ] = ()


class PodColumns(ColumnNames, frozen=True, kw_only=True):
    """What the columns of a file of pods are called; others are not read."""

    rows = "pods"
    needed = ((("x",),), (("y",),))

    x: Annotated[
        Column,
        column("The column where the pod stands, from 0.", COORDINATE),
    ] = None
    y: Annotated[Column, column("The row where the pod stands, from 0.", COORDINATE)] = None
    pod: Annotated[
        Column,
        column(
            "The number of the pod, from 1; without a column: that of its row.",
            NumberField,
            least=1,
            most=1_000_000,
        ),
    ] = None
    name: Annotated[Column, column("What lines and orders call the pod.")] = None
    pod_class: Annotated[Column, column("The class of the pod, one of pods.classes.")] = field(
        name="class", default=None
    )
    weight: Annotated[
        Column,
        column(
            "How heavy the pod is; empty: 1.", NumberField, least=1, most=1_000_000_000, default=1
        ),
    ] = None
    skus: Annotated[Column, column("What the pod holds, between blanks.")] = None


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
        Shares | None,
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
        for name, default in FILE_OPTIONS.items() if self.file is None else ():
            if getattr(self, name, default) != default:
                raise ValueError(f"{name} belongs to pods with a file")
        _ = self.options
        if self.listed == ():
            raise ValueError("list must hold at least one pod")

    @property
    def options(self) -> TableOptions:
        """How the file is read. Raises ValueError for options that do not go together."""
        return TableOptions(file=self.file or "", sheet=self.sheet, encoding=self.encoding)


class Break(ConfigSection, frozen=True, kw_only=True):
    """A time in which no visit begins at a station."""

    begin: Annotated[Tick, Meta(description="The tick in which it begins.")] = field(name="from")
    ticks: Annotated[
        int, quantity(TIME, ge=1, le=2_000_000_000, description="Ticks that it lasts.")
    ] = field(name="for")


class PodStation(ConfigSection, frozen=True, kw_only=True):
    """A station with a name: its cell, the cells of its queue, how many it lets come."""

    at: Annotated[NamedCell, Meta(description="The cell of the station, one of kind station.")]
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
