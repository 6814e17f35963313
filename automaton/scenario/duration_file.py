"""Measured durations, of a column of a CSV file: `{empirical: times.csv, column: seconds}`.

Of handling, of repairs in place and of closings by chance.

A value is a number of ticks or a time such as 20 s. The values become the scenario's own, so that
recordings stand alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from msgspec import structs

from automaton.errors import InputError, nearest
from automaton.scenario.conversions import Bounds, Place, convert
from automaton.scenario.csv_columns import read_csv_columns
from automaton.scenario.document import Document, Keys
from automaton.scenario.handling import LONGEST, Distribution, Handling
from automaton.scenario.quantities import TIME, Scale
from automaton.scenario.reading import content_hash
from automaton.scenario.row_errors import RowErrors
from automaton.scenario.schema import Scenario
from automaton.scenario.text_lines import quoted

NUMBER: Final = re.compile(r"[0-9]+(\.[0-9]+)?")
PLACE: Final = Place(TIME, Bounds(is_whole=False, ge=0, le=LONGEST))


class DurationFile(NamedTuple):
    """A file that was read."""

    path: str
    content_hash: str  # 16 hex digits


def with_durations_of_files(
    document: Document, scenario: Scenario
) -> tuple[Scenario, list[DurationFile]]:
    """The scenario with the durations of its files as lists. Raises InputError."""
    filler = _Filler(document, scenario.units.scale)
    durations, faults, floor = scenario.durations, scenario.faults, scenario.floor
    usual = filler.of_handling(("durations",), durations.handling)
    stations = {
        name: station
        if station.handling is None
        else structs.replace(
            station, handling=filler.of_handling(("stations", name), station.handling)
        )
        for name, station in scenario.stations.items()
    }
    repair = filler.filled(("faults", "repair_in_place"), faults.repair_in_place)
    closed = tuple(
        structs.replace(closing, ticks=filler.filled(("floor", "closed", k, "for"), closing.ticks))
        for k, closing in enumerate(floor.closed)
    )
    if not filler.files:
        return scenario, filler.files
    filled = structs.replace(
        scenario,
        durations=structs.replace(durations, handling=usual),
        stations=stations,
        faults=structs.replace(faults, repair_in_place=repair),
        floor=structs.replace(floor, closed=closed),
    )
    return filled, filler.files


class _Filler:
    """Puts durations of files into distributions, and notes the files."""

    def __init__(self, document: Document, scale: Scale) -> None:
        self.document, self.scale = document, scale
        self.files: list[DurationFile] = []

    def of_handling(self, keys: Keys, handling: Handling) -> Handling:
        """What a visit takes, its lines by what stands in their file."""
        return structs.replace(
            handling, line=self.filled((*keys, "handling", "line"), handling.line)
        )

    def filled(self, keys: Keys, drawn: Any) -> Any:
        """A distribution with the values of its file, if it names one; anything else as it is."""
        if not isinstance(drawn, Distribution) or not isinstance(drawn.empirical, str):
            return drawn
        path = self.document.folder / drawn.empirical
        if not path.exists():
            text = f"there is no file of durations '{drawn.empirical}'"
            raise self.document.error((*keys, "empirical"), text)
        values = tuple(durations_of(path, drawn.column or "", self.scale))
        self.files.append(DurationFile(str(path.resolve()), content_hash(path)))
        return structs.replace(drawn, empirical=values, column=None)


def durations_of(path: Path, column: str, scale: Scale) -> Iterator[float]:
    """The ticks in a column of a file, row by row. Raises InputError."""

    def choose(head: Sequence[str], line: int) -> dict[str, str]:
        if column not in head:
            there = f"the columns are {', '.join(filter(None, head))}"
            text = f"there is no column '{column}'{nearest(column, head)}; {there}"
            raise InputError(text, str(path), line)
        return {column: column}

    errors = RowErrors(str(path))
    table = read_csv_columns(path, "utf-8", choose, errors)
    if not len(table.lines):
        raise InputError("has no rows below its head", str(path))
    texts, codes = table.columns[column]
    ticks: list[float] = []
    for code, text in enumerate(texts):
        try:
            ticks.append(_ticks(column, text, scale))
        except InputError as error:
            rows = codes == code
            ticks.append(0.0)
            errors.add("time", table.lines[rows].tolist(), error.message.__str__)
    errors.raise_any()
    return (ticks[code] for code in codes.tolist())


def _ticks(column: str, text: str, scale: Scale) -> float:
    if not NUMBER.fullmatch(text):
        return convert(column, text, PLACE, scale).value
    if float(text) > LONGEST:
        raise InputError(f"{column} must be at most {LONGEST:,} ticks, found {quoted(text)}")
    return float(text)
