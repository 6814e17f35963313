"""Declare a kind of table: its columns, their fields, and how its file is read.

    class ShelfColumns(ColumnNames, frozen=True, kw_only=True):
        \"\"\"Names of the columns of a file of shelves; other columns are ignored.\"\"\"

        rows, needed = "shelves", ((("x",),),)
        x: Annotated[Column, column("The column of the shelf.", NumberField, least=0, most=99)] = None

A field is a value of each row; a column of the file holds it. `fields_of` makes the fields of a
declaration, and automaton.scenario.table_reader reads them.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, get_type_hints

import msgspec
from msgspec import Meta, field

from automaton.scenario.columns import is_workbook
from automaton.scenario.quantities import (
    SHARE_LIMIT,
    ConfigSection,
    NonEmptyText,
    SingleLine,
    quantity,
)

NOTHING: Final = -1  # the code of a text field without a text
NO_DUE: Final = 2**31 - 1  # the latest tick
FARTHEST: Final = 1_000_000  # row or column of a cell
SERIAL: Final = "serial"  # as the format of times: days with a fraction
DATE_CODES: Final = re.compile(r"%[dmyYjbBcGuVxUW]")
YEAR_CODES: Final = re.compile(r"%[yYcGx]")
FILE_OPTIONS: Final[dict[str, Any]] = {  # keys beside `file`, with their defaults
    "columns": None,
    "where": {},
    "time": None,
    "encoding": "utf-8",
    "sheet": None,
    "unknown": "refuse",
    "at_most": None,
}
FIELD_KEY: Final = "field"  # in Meta.extra of a column: makes a field from its name

Column = SingleLine | None
Values = str | int | tuple[str | int, ...]
ColumnGroups = Sequence[Sequence[str]]  # groups of fields; one group must have columns


@dataclass(frozen=True)
class TextField:
    """Texts, as indices into the list of different texts; -1 for nothing."""

    name: str
    is_required: bool = False  # in every row


@dataclass(frozen=True)
class NameField:
    """Known names, as their numbers; -1 for nothing."""

    name: str
    known: Mapping[str, int]
    what: str  # kind of thing that is named: "location"
    is_required: bool = False


@dataclass(frozen=True)
class NumberField:
    """Whole numbers."""

    name: str
    least: int
    most: int
    default: int | None = None  # for an empty value; None: a number is required
    rounds_up: bool = False  # decimal numbers are read and rounded up


@dataclass(frozen=True)
class ReleaseField:
    """The tick in which a row is released; 0 if it is released before."""

    name: str = "released"


@dataclass(frozen=True)
class DueField:
    """The due tick of a row, or NO_DUE. Ticks and times count from the release."""

    name: str = "due"


COORDINATE: Final = partial(NumberField, least=0, most=FARTHEST)  # of a cell, from 0
PRIORITY: Final = partial(NumberField, least=-100, most=100, default=0)

Field = TextField | NameField | NumberField | ReleaseField | DueField


class ColumnNames(ConfigSection, frozen=True, kw_only=True):
    """Names of the columns of a file: a key for each field; other columns are ignored."""

    rows: ClassVar[str]  # name of the rows in errors: "orders"
    needed: ClassVar[Sequence[ColumnGroups]] = ()  # in addition to required columns
    may_rename: ClassVar[bool] = True  # whether a scenario can name the columns

    @property
    def of_fields(self) -> dict[str, str]:
        """The column of each field that has one."""
        return {name: text for name, text in msgspec.to_builtins(self).items() if text is not None}


def column(meaning: str, kind: Callable[..., Field] = TextField, **said: Any) -> Meta:
    """The annotation of a column: its description and its field; `said`: arguments of `kind`."""
    return Meta(description=meaning, extra={FIELD_KEY: partial(kind, **said)})


def fields_of(kind: type[ColumnNames], known: Mapping[str, Mapping[str, int]]) -> list[Field]:
    """The fields of a kind of table; `known`: the names for each NameField that the scenario defines."""
    hints = get_type_hints(kind, include_extras=True)
    fields = []
    for attribute, name in zip(kind.__struct_fields__, kind.__struct_encode_fields__, strict=True):
        names = {"known": known[name]} if name in known else {}
        fields.append(hints[attribute].__metadata__[-1].extra[FIELD_KEY](name=name, **names))
    return fields


class Quarantine(ConfigSection, frozen=True, kw_only=True):
    """Rows with mistakes are skipped, and written to a file by `automaton check`."""

    quarantine: Annotated[
        NonEmptyText,
        Meta(
            description="A CSV file that `automaton check` writes: the skipped rows unchanged, "
            "with the reason in an extra first column; path relative to the scenario. If the "
            "orders come from several files, one file is written for each, and its name "
            "contains the name of the order file."
        ),
    ]


class TableOptions(ConfigSection, frozen=True, kw_only=True):
    """A CSV file or a workbook written by another system."""

    file: Annotated[
        NonEmptyText,
        Meta(
            description="A CSV file with a header line and columns separated by semicolons, tabs "
            "or commas, or a workbook (.xlsx; needs fleet-automaton[excel]); path relative to "
            "the scenario. A pattern such as days/*.csv names several files: the seed of a "
            "run selects one, whose times count from midnight of its first day."
        ),
    ]
    sheet: Annotated[
        SingleLine | None, Meta(description="The sheet of a workbook; null: the only sheet.")
    ] = None
    where: Annotated[
        dict[str, Values],
        Meta(
            description="Filter of rows: for each column named here, the value or list of values that a "
            "row must have. Other rows are skipped."
        ),
    ] = field(default_factory=dict)
    time: Annotated[
        SingleLine | None,
        Meta(
            description='The format of times in the file, in the notation of strptime: "%d.%m.%Y %H:%M". '
            "null: ISO 8601, times of the clock's day such as 06:30, ticks, or times after "
            "tick 0 such as 20 s. serial: days such as 46083.25, as spreadsheets store dates."
        ),
    ] = None
    encoding: Annotated[
        Literal["utf-8", "cp1252"],
        Meta(
            description="Encoding of the file; cp1252 is usual for Windows programs in western Europe."
        ),
    ] = "utf-8"

    unknown: Annotated[
        Literal["refuse", "skip"] | Quarantine,
        Meta(
            description="What happens to rows with mistakes: an unknown location, pod, SKU or station, a "
            "quantity of 0, or a value that cannot be read. refuse: the scenario is refused; "
            "skip: the rows are skipped and counted; {quarantine: FILE}: in addition, "
            "`automaton check` writes them to a file."
        ),
    ] = "refuse"
    at_most: Annotated[
        Annotated[float, quantity(SHARE_LIMIT, ge=0, le=1)] | None,
        Meta(
            description="The greatest share of rows that may be skipped, such as 2 % or 0.02; above "
            "it the scenario is refused."
        ),
    ] = None

    @property
    def names_several(self) -> bool:
        """Whether `file` is a pattern, which several files may match."""
        return is_pattern(self.file or "")

    def __post_init__(self) -> None:
        if self.time is not None:
            _check_format(self.time)
        if self.sheet is not None and self.file and not is_workbook(Path(self.file)):
            raise ValueError(f"sheet belongs to a workbook (.xlsx), and file is '{self.file}'")
        if self.unknown != "refuse" and self.at_most is None:
            raise ValueError(
                "unknown lets rows be skipped, which needs at_most, the greatest share of them, such "
                "as at_most: 2 %"
            )
        if self.unknown == "refuse" and self.at_most is not None:
            raise ValueError("at_most belongs to unknown: skip, or unknown: {quarantine: FILE}")


def is_pattern(name: str) -> bool:
    """Whether the name of a file has wildcards: *, ? or [...]."""
    return any(sign in name for sign in "*?[")


def _check_format(of_format: str) -> None:
    """Raise ValueError for a format that is not a format of times."""
    if of_format == SERIAL:
        return
    sample = datetime.datetime(2026, 3, 2, 6, 30, tzinfo=datetime.UTC)
    if "%" not in of_format:
        raise ValueError(f"time must be a format such as '%d.%m.%Y %H:%M', found '{of_format}'")
    if DATE_CODES.search(of_format) and not YEAR_CODES.search(of_format):
        raise ValueError(f"time is the format '{of_format}', of dates without a year")
    try:
        datetime.datetime.strptime(sample.strftime(of_format), of_format)
    except ValueError as error:
        raise ValueError(f"time cannot be the format '{of_format}': {error}") from None
