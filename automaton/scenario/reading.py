"""Read a scenario and the files that it names step by step; errors get their file and line here."""

from __future__ import annotations

import copy
import glob
import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from msgspec import structs

from automaton.errors import InputError, InvalidValueError
from automaton.scenario.document import Document, Override, override, parse
from automaton.scenario.floor_section import Floor, floor_of
from automaton.scenario.order_files import (
    day_of_lines,
    day_of_orders,
    files_of_lines,
    files_of_orders,
    with_rates_of_file,
    with_tasks_of_file,
)
from automaton.scenario.order_lines import Day, plain_data
from automaton.scenario.schema import Scenario, Units
from automaton.scenario.street_files import ReadStreets, read_streets
from automaton.scenario.table_fields import is_pattern
from automaton.scenario.table_files import (
    names_of_cells,
    with_durations_of_files,
    with_locations_of_file,
    with_pods_of_file,
    with_starts_of_file,
)
from automaton.scenario.table_reader import ReadFile, with_rows
from automaton.scenario.text_files import SHIPPED_FOLDER, STUDIES_ARE_SWEPT, find, read_text
from automaton.scenario.validation import Conversion, validated, with_numbers

STUDY_KEYS: Final = frozenset(
    ("scenario", "factors", "points", "replications", "analysis", "common_random_numbers")
)
LONGEST_FILE_NAME: Final = 255  # characters; longer texts are pictures of floors


Draw = Callable[[int, int], int]  # the number from 0 of one of several files, for a seed


def first_of_all(seed: int, files: int) -> int:
    """The first of several files, whatever the seed."""
    return 0


class Reading:
    """A scenario while it is read.

    The contents of files become parts of the document, which has the line of each value. Methods raise
    InputError, or InvalidValueError without file and line.
    """

    def __init__(self, document: Document, draw: Draw = first_of_all) -> None:
        """`draw` chooses the file of orders if the scenario has several."""
        self.document = document
        self.draw = draw
        self.days: tuple[Day, ...] = ()  # files of orders or of their lines
        self.of_days: tuple[Document, ...] = ()  # the document with the rows of each
        self.day = 0  # the one that the seed of the scenario draws
        self.conversions: tuple[Conversion, ...] = ()  # of texts with units
        self.location_file: ReadFile | None = None
        self.pod_file: ReadFile | None = None
        self.start_file: ReadFile | None = None
        self.task_file: ReadFile | None = None
        self.rate_file: ReadFile | None = None
        self.street_file: ReadFile | None = None
        self.duration_files: list[ReadFile] = []

    @contextmanager
    def placing_errors(self) -> Iterator[None]:
        """Raise InputError with file and line for an invalid value inside."""
        try:
            yield
        except InvalidValueError as error:
            raise self.document.error(error.keys, error.message) from None

    def scenario(self) -> Scenario:
        """The data of the document, with numbers and cells instead of texts."""
        data = self.document.data
        units = validated(data.get("units", {}), Units, ("units",))
        names = names_of_cells(self.document)
        data, self.conversions = with_numbers(data, Scenario, units.scale, names=names)
        self.document = replace(self.document, data=data)
        return validated(data, Scenario)

    def scenario_with_files(self) -> Scenario:
        """The scenario with the contents of its files, except tasks and lines."""
        self.document, self.location_file = with_locations_of_file(self.document)
        self.document, self.pod_file = with_pods_of_file(self.document)
        scenario = self.scenario()
        paths = files_of_orders(self.document, scenario)
        days = (day_of_orders(self.document, scenario, path) for path in paths)
        scenario = self._of_drawn_day(scenario, days)
        self.document, scenario, self.rate_file = with_rates_of_file(self.document, scenario)
        self.document, scenario, self.start_file = with_starts_of_file(self.document, scenario)
        scenario, self.duration_files = with_durations_of_files(self.document, scenario)
        return scenario

    def floor(self, layout: dict[str, Any]) -> Floor:
        """The floor that a layout describes."""
        floor = floor_of(layout, self.document.folder)
        if floor.file:
            lines = range(1, floor.floor_plan.height + 1)
            self.document = with_rows(self.document, floor.rows, floor.file, lines)
        return floor

    def with_streets_on_floor(
        self, scenario: Scenario, floor: Floor, is_closed: bool = False
    ) -> tuple[Scenario, ReadStreets]:
        """The scenario with its file of streets, and the weights of all streets."""
        streets = read_streets(self.document, scenario.streets, floor.floor_plan, is_closed)
        self.document, self.street_file = streets.document, streets.file
        if streets.listed is not scenario.streets:
            scenario = structs.replace(scenario, streets=streets.listed)
        return scenario, streets

    def with_files_on_floor(self, scenario: Scenario, floor: Floor) -> Scenario:
        """The scenario with its files of tasks and lines, read for a floor."""
        plan = floor.floor_plan
        self.document, scenario, self.task_file = with_tasks_of_file(self.document, scenario, plan)
        paths = files_of_lines(self.document, scenario)
        days = (day_of_lines(self.document, scenario, plan, path) for path in paths)
        return self._of_drawn_day(scenario, days)

    def _of_drawn_day(self, scenario: Scenario, days: Iterable[tuple[Day, Document]]) -> Scenario:
        """The scenario with the orders of one of some files; unchanged without files."""
        read = list(days)
        if not read:
            return scenario
        self.days, self.of_days = zip(*read, strict=True)
        self.day = self.draw(scenario.seed, len(read))
        self.document = self.of_days[self.day]
        return structs.replace(scenario, orders=self.days[self.day].orders)

    @property
    def pattern(self) -> str:
        """The pattern that the files of orders match; "" if the scenario names a single file."""
        orders = self.document.data.get("orders", {})
        names = (
            orders[key]["file"] for key in ("transports", "lines") if self.days and key in orders
        )
        return next((str(name) for name in names if is_pattern(str(name))), "")

    @property
    def folder(self) -> Path:
        """The base of file names of strategies: the scenario's folder, except for shipped scenarios."""
        folder = self.document.folder
        return Path() if folder.resolve() == SHIPPED_FOLDER else folder

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """The files that were read: path, 16 hex digits of content."""
        files = (self.location_file, self.pod_file, *(day.file for day in self.days))
        every = (
            *files,
            self.start_file,
            self.task_file,
            self.rate_file,
            self.street_file,
            *self.duration_files,
        )
        return tuple((file.path, file.content_hash) for file in every if file is not None)


def document_of(
    scenario: str | Path | Mapping[str, Any] | Scenario, settings: Iterable[str | Override] = ()
) -> Document:
    """The unchecked data of a scenario with KEY=VALUE settings applied. Raises InputError."""
    if isinstance(scenario, Scenario | Mapping):
        data = plain_data(scenario) if isinstance(scenario, Scenario) else dict(scenario)
        document = Document(copy.deepcopy(data))
    elif is_study((document := read(scenario)).data):
        raise InputError(f"this is a study; {STUDIES_ARE_SWEPT}", document.file)
    return override(document, settings)


def read(name: str | Path) -> Document:
    """Read a scenario by path or by shipped name, without checking its values."""
    path = find(name)
    text = read_text(path)
    file = str(path)
    data, root = parse(text, file)
    if data is None:
        raise InputError("is empty; a scenario needs at least name, layout and fleet", file)
    if not isinstance(data, dict):
        raise InputError("a scenario has keys such as name, layout and fleet; found none", file, 1)
    return Document(data=data, file=file, folder=path.parent, text=text, root=root)


def is_study(data: dict[str, Any]) -> bool:
    """Whether data looks like a study and not like a scenario."""
    return "layout" not in data and not STUDY_KEYS.isdisjoint(data)


def named_files(scenario: str | Path) -> tuple[Path, ...]:
    """The file of a scenario, then the files that it names.

    A scenario that cannot be read names none. Raises InputError if there is no such scenario.
    """
    own = find(scenario)
    try:
        document = read(own)
    except InputError:
        return (own,)
    texts = list(_texts(document.data))
    several = (glob.glob(text, root_dir=document.folder) for text in texts if is_pattern(text))
    paths = [document.folder / text for text in (*texts, *itertools.chain(*map(sorted, several)))]
    return (own, *dict.fromkeys(path for path in paths if os.path.isfile(path) and path != own))


def _texts(value: Any) -> Iterator[str]:
    """The texts of a document that may be file names."""
    if isinstance(value, dict):
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)
    elif isinstance(value, str) and 0 < len(value) <= LONGEST_FILE_NAME and value.isprintable():
        yield value
