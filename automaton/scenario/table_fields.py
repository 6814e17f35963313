"""How a kind of table is declared: its columns, the fields that they become, and how its file is read.

    class ShelfColumns(ColumnNames, frozen=True, kw_only=True):
        \"\"\"What the columns of a file of shelves are called; others are not read.\"\"\"

        rows, needed = "shelves", ((("x",),),)
        x: Annotated[Column, column("The column of the shelf.", NumberField, least=0, most=99)] = None

A field is what a scenario knows of a row; it stands in a column of the file. `fields_of` makes the
fields of such a declaration, and automaton.scenario.table_reader reads them.
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
from automaton.scenario.quantities import ConfigSection, NonEmptyText, SingleLine

NOTHING: Final = -1  # the code of a text field without a text
NO_DUE: Final = 2**31 - 1  # no tick is later
FARTHEST: Final = 1_000_000  # row or column of a cell
SERIAL: Final = "serial"  # instead of a format of times
DATE_CODES: Final = re.compile(r"%[dmyYjbBcGuVxUW]")
YEAR_CODES: Final = re.compile(r"%[yYcGx]")
FILE_OPTIONS: Final[dict[str, Any]] = {  # beside the file itself, as they are when left out
    "columns": None,
    "where": {},
    "time": None,
    "encoding": "utf-8",
    "sheet": None,
}
FIELD_KEY: Final = "field"  # in Meta.extra of a column: makes its field, from its name

Column = SingleLine | None
Values = str | int | tuple[str | int, ...]
ColumnGroups = Sequence[Sequence[str]]  # groups of fields, one of which must have columns


@dataclass(frozen=True)
class TextField:
    """Texts, as codes into the list of the different ones; -1 for nothing."""

    name: str
    is_required: bool = False  # in every row


@dataclass(frozen=True)
class NameField:
    """Names that are known, each with its number; -1 for nothing."""

    name: str
    known: Mapping[str, int]
    what: str  # a name is: "location"
    is_required: bool = False


@dataclass(frozen=True)
class NumberField:
    """Whole numbers."""

    name: str
    least: int
    most: int
    default: int | None = None  # where nothing stands; None: there must be a number


@dataclass(frozen=True)
class ReleaseField:
    """The tick in which a row is released; 0 for what comes before it."""

    name: str = "released"


@dataclass(frozen=True)
class DueField:
    """The tick until which a row is to be done; NO_DUE for none. Ticks and times count from release."""

    name: str = "due"


COORDINATE: Final = partial(NumberField, least=0, most=FARTHEST)  # of a cell, from 0
PRIORITY: Final = partial(NumberField, least=-100, most=100, default=0)

Field = TextField | NameField | NumberField | ReleaseField | DueField


class ColumnNames(ConfigSection, frozen=True, kw_only=True):
    """What the columns of a file are called: a key for each field; other columns are not read."""

    rows: ClassVar[str]  # what errors call them: "orders"
    needed: ClassVar[Sequence[ColumnGroups]] = ()  # beside the columns that are required
    may_rename: ClassVar[bool] = True  # whether a scenario can say what the columns are called

    @property
    def of_fields(self) -> dict[str, str]:
        """The column of each field that has one."""
        return {name: text for name, text in msgspec.to_builtins(self).items() if text is not None}


def column(meaning: str, kind: Callable[..., Field] = TextField, **said: Any) -> Meta:
    """The annotation of a column: what stands there, and its field; `said`: arguments of `kind`."""
    return Meta(description=meaning, extra={FIELD_KEY: partial(kind, **said)})


def fields_of(kind: type[ColumnNames], known: Mapping[str, Mapping[str, int]]) -> list[Field]:
    """The fields of a kind of table; `known`: the names of each NameField that the scenario decides."""
    hints = get_type_hints(kind, include_extras=True)
    fields = []
    for attribute, name in zip(kind.__struct_fields__, kind.__struct_encode_fields__, strict=True):
        names = {"known": known[name]} if name in known else {}
        fields.append(hints[attribute].__metadata__[-1].extra[FIELD_KEY](name=name, **names))
    return fields


class TableOptions(ConfigSection, frozen=True, kw_only=True):
    """A CSV file, or a workbook, that another system has written."""

    file: Annotated[
        NonEmptyText,
        Meta(
            description="A CSV file with a header line, separated by semicolons, tabs or commas, or a "
            "workbook (.xlsx, extra excel); path relative to the scenario."
        ),
    ]
    sheet: Annotated[
        SingleLine | None, Meta(description="The sheet of a workbook; null: its only one.")
    ] = None
    where: Annotated[
        dict[str, Values],
        Meta(
            description="Filter of rows: columns and the value, or list of values, that a row must "
            "have. Other rows are skipped."
        ),
    ] = field(default_factory=dict)
    time: Annotated[
        SingleLine | None,
        Meta(
            description='The format of its times, as of strptime: "%d.%m.%Y %H:%M". null: ISO 8601, '
            "times of the clock's day such as 06:30, ticks, or times after tick 0 such as 20 s. serial: "
            "days such as 46083.25, as spreadsheets store dates."
        ),
    ] = None
    encoding: Annotated[
        Literal["utf-8", "cp1252"],
        Meta(
            description="Encoding of the file; cp1252 is usual for Windows programs in western "
            "Europe."
        ),
    ] = "utf-8"

    def __post_init__(self) -> None:
        if self.time is not None:
            _check_format(self.time)
        if self.sheet is not None and self.file and not is_workbook(Path(self.file)):
            raise ValueError(f"sheet belongs to a workbook (.xlsx), and file is '{self.file}'")


def _check_format(of_format: str) -> None:
    """Raise ValueError with a sentence for a format that cannot be one of times."""
    if of_format == SERIAL:
        return
    sample = datetime.datetime(2026, 3, 2, 6, 30, tzinfo=datetime.UTC)
    if "%" not in of_format:
        raise ValueError(f"time must be a format such as '%d.%m.%Y %H:%M', found '{of_format}'")
    try:
        datetime.datetime.strptime(sample.strftime(of_format), of_format)
    except ValueError as error:
        raise ValueError(f"time cannot be the format '{of_format}': {error}") from None
    if DATE_CODES.search(of_format) and not YEAR_CODES.search(of_format):
        raise ValueError(f"time is the format '{of_format}', of dates without a year")
