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
    """A pod: its start cell and its properties."""

    at: Annotated[NamedCell, Meta(description="The storage cell in which the pod stands.")]
    name: Annotated[
        SingleLine | None,
        Meta(description="Name of the pod in lines and orders, in addition to its number."),
    ] = None
    pod_class: Annotated[
        SingleLine | None,
        Meta(
            description="The class of the pod, one of pods.classes; give a class to all pods or to none."
        ),
    ] = field(name="class", default=None)
    weight: Weight = 1
    skus: Annotated[
        tuple[SingleLine, ...], Meta(description="SKUs in the pod, for lines with a sku.")
    ] = ()


class PodColumns(ColumnNames, frozen=True, kw_only=True):
    """Names of the columns of a file of pods; other columns are ignored."""

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
            "The number of the pod, from 1; without this column: the number of the row.",
            NumberField,
            least=1,
            most=1_000_000,
        ),
    ] = None
    name: Annotated[Column, column("Name of the pod in lines and orders.")] = None
    pod_class: Annotated[Column, column("The class of the pod, one of pods.classes.")] = field(
        name="class", default=None
    )
    weight: Annotated[
        Column,
        column(
            "How heavy the pod is; empty: 1.", NumberField, least=1, most=1_000_000_000, default=1
        ),
    ] = None
    skus: Annotated[Column, column("SKUs in the pod, separated by blanks.")] = None


class Pods(ConfigSection, frozen=True, kw_only=True):
    """The pods: shelves in storage cells that robots carry to stations and back."""

    under: Annotated[
        Literal["empty", "none"],
        Meta(
            description="Which robots may drive under stored pods. empty: robots without a load; "
            "none: only the robot that lifts the pod."
        ),
    ] = "empty"
    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="A CSV file with a header line and a pod in each row, or a workbook "
            "(.xlsx; needs fleet-automaton[excel]); path relative to the scenario."
        ),
    ] = None
    columns: Annotated[
        PodColumns | None,
        Meta(description="Names of the columns; null: the columns have the names of the keys."),
    ] = None
    sheet: Annotated[
        SingleLine | None, Meta(description="The sheet of a workbook; null: the only sheet.")
    ] = None
    encoding: Annotated[Literal["utf-8", "cp1252"], Meta(description="Encoding of the file.")] = (
        "utf-8"
    )
    listed: Annotated[
        tuple[Pod, ...] | None,
        Meta(
            description="The pods, in the sequence of their numbers; left out: the pods drawn in the "
            "picture."
        ),
    ] = field(name="list", default=None)
    join: Annotated[
        bool,
        Meta(
            description="Whether a line joins a trip of its pod that is under way; false: each line "
            "is a trip of its own."
        ),
    ] = True
    max_stops: Annotated[
        int, Meta(ge=1, le=MAX_POD_STOPS, description="Greatest number of stations of one trip.")
    ] = 4
    classes: Annotated[
        Shares | None,
        Meta(
            description="Classes of pods and of storage cells, each with its share. The cells of the "
            "first class are nearest to the stations."
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
        """How the file is read. Raises ValueError for options that exclude each other."""
        return TableOptions(file=self.file or "", sheet=self.sheet, encoding=self.encoding)


class Break(ConfigSection, frozen=True, kw_only=True):
    """A break of a station, during which no visit begins."""

    begin: Annotated[Tick, Meta(description="The tick in which the break begins.")] = field(
        name="from"
    )
    ticks: Annotated[
        int, quantity(TIME, ge=1, le=2_000_000_000, description="Duration of the break, in ticks.")
    ] = field(name="for")


class PodStation(ConfigSection, frozen=True, kw_only=True):
    """A named station: its cell, its queue and its limit of trips."""

    at: Annotated[NamedCell, Meta(description="The cell of the station, one of kind station.")]
    queue: Annotated[
        tuple[NamedCell, ...],
        Meta(
            max_length=1000,
            description="Corners of the path of the queue, from the cell next to the station outwards.",
        ),
    ] = ()
    max_trips: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | Literal["queue"] | None,
        Meta(
            description="Greatest number of trips at the station or on their way to it. queue: the "
            "number of queue cells plus one; null: no limit."
        ),
    ] = "queue"
    handling: Annotated[
        Handling | None, Meta(description="Handling time of a visit; left out: durations.handling.")
    ] = None
    breaks: Annotated[tuple[Break, ...], Meta(description="Breaks of the station.")] = ()
