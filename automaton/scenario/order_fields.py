"""What files of orders hold: the options by which they are read, their fields, and their columns.

A field is what a scenario knows of a row; it stands in a column of the file. A row costs four bytes for
each field, and the texts that no other row has.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta, field
from numpy.typing import NDArray

from automaton.scenario.field_types import ConfigSection, NonEmptyText, SingleLine
from automaton.scenario.file_times import check_format
from automaton.scenario.row_errors import RowErrors
from automaton.scenario.sheet_columns import is_workbook

Array = NDArray[np.int32]
NOTHING: Final = -1  # the code of a text field without a text
NO_DUE: Final = 2**31 - 1  # no tick is later
LAST_TICK: Final = 2_000_000_000
Values = str | int | tuple[str | int, ...]
Column = SingleLine | None


class ColumnNames(ConfigSection, frozen=True, kw_only=True):
    """What the columns of a file are called: a key for each field; other columns are not read."""

    @property
    def of_fields(self) -> dict[str, str]:
        """The column of each field that has one."""
        return {name: text for name, text in msgspec.to_builtins(self).items() if text is not None}


class OrderFile(ConfigSection, frozen=True, kw_only=True):
    """A CSV file, or a workbook, that another system has written."""

    file: Annotated[
        NonEmptyText,
        Meta(
            description="A CSV file whose first line names its columns, between semicolons, tabs or "
            "commas, or a workbook (.xlsx, extra excel); path relative to the scenario."
        ),
    ]
    sheet: Annotated[
        SingleLine | None, Meta(description="The sheet of a workbook; null: its only one.")
    ] = None
    where: Annotated[
        dict[str, Values],
        Meta(
            description="Columns and the values, one or a list, of the rows that count; all others "
            "are left out."
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
        Meta(description="How its text is stored; cp1252: by Windows programs in western Europe."),
    ] = "utf-8"

    def __post_init__(self) -> None:
        if self.time is not None:
            check_format(self.time)
        if self.sheet is not None and self.file and not is_workbook(Path(self.file)):
            raise ValueError(f"sheet belongs to a workbook (.xlsx), and file is '{self.file}'")


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


Field = TextField | NameField | NumberField | ReleaseField | DueField


@dataclass
class Counts:
    """What `check` says of a file."""

    rows: int = 0  # all that hold a value
    left_out: dict[str, int] = dataclasses.field(default_factory=dict)  # by "STATUS CANCELLED"
    ignored: tuple[str, ...] = ()  # columns
    tick_zero: str = ""  # the earliest release, where units.clock does not say what tick 0 is
    before_start: int = 0  # rows that are released before tick 0
    late_at_once: int = 0  # and that are due before their release
    first_late_line: int = 0  # of the file, from 1
    rounded: int = 0  # times between two ticks


@dataclass
class OrderColumns:
    """The rows of a file that count."""

    path: str
    content_hash: str  # 16 hex digits
    lines: Array  # (n,) where each of them begins in the file, from 1
    values: dict[str, Array]  # (n,) of each field
    names: dict[str, list[str]]  # of each TextField
    column_of: dict[str, str]  # field: the column where it stands
    errors: RowErrors
    counts: Counts

    def __len__(self) -> int:
        return len(self.lines)

    def refuse(
        self, kind: str, field_name: str, rows: NDArray[np.bool_], sentence: Callable[[int], str]
    ) -> None:
        """Add a mistake of rows to `errors`; `sentence`: of a row by its index."""
        first = int(np.argmax(rows))
        if rows[first]:
            self.errors.add((kind, field_name), self.lines[rows].tolist(), lambda: sentence(first))
