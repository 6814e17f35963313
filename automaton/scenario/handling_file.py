"""Measured durations of handling, of a column of a CSV file: `{empirical: times.csv, column: seconds}`.

A value is a number of ticks or a time such as 20 s. The values become the scenario's own, so that
recordings stand alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

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


def with_handling_of_files(
    document: Document, scenario: Scenario
) -> tuple[Scenario, list[DurationFile]]:
    """The scenario with the durations of its files as lists. Raises InputError."""
    files: list[DurationFile] = []
    usual = _filled(document, ("durations",), scenario.durations.handling, scenario, files)
    stations = {
        name: station
        if station.handling is None
        else msgspec.structs.replace(
            station,
            handling=_filled(document, ("stations", name), station.handling, scenario, files),
        )
        for name, station in scenario.stations.items()
    }
    if not files:
        return scenario, files
    durations = msgspec.structs.replace(scenario.durations, handling=usual)
    return msgspec.structs.replace(scenario, durations=durations, stations=stations), files


def _filled(
    document: Document,
    keys: Keys,
    handling: Handling,
    scenario: Scenario,
    files: list[DurationFile],
) -> Handling:
    drawn = handling.line
    if not isinstance(drawn, Distribution) or not isinstance(drawn.empirical, str):
        return handling
    path = document.folder / drawn.empirical
    if not path.exists():
        text = f"there is no file of durations '{drawn.empirical}'"
        raise document.error((*keys, "handling", "line", "empirical"), text)
    values = tuple(durations_of(path, drawn.column or "", scenario.units.scale))
    files.append(DurationFile(str(path.resolve()), content_hash(path)))
    line = msgspec.structs.replace(drawn, empirical=values, column=None)
    return msgspec.structs.replace(handling, line=line)


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
            errors.add("time", int(table.lines[rows][0]), error.message.__str__, int(rows.sum()))
    errors.raise_any()
    return (ticks[code] for code in codes.tolist())


def _ticks(column: str, text: str, scale: Scale) -> float:
    if not NUMBER.fullmatch(text):
        return convert(column, text, PLACE, scale).value
    if float(text) > LONGEST:
        raise InputError(f"{column} must be at most {LONGEST:,} ticks, found {quoted(text)}")
    return float(text)
