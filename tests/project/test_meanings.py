"""Meanings of keys, columns and metrics stand alone: each is a noun phrase or a sentence.

They are printed beside a name in the reference, in the JSON Schema and in reports, where nothing comes
before them that "and its row" or "of the station" could go on from.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.scenario.floor_section import json_schema
from automaton.scenario.orders import LineColumns, TransportColumns
from automaton.scenario.pods import PodColumns
from automaton.scenario.table_files import LocationColumns, StartColumns
from automaton.studies.sweeps.study import study_schema
from automaton.tables.columns import TABLES

CONTRACT = Path(__file__).parents[2] / "docs" / "reference" / "strategy-contract.md"
FRAGMENTS = (
    *("and", "or", "but", "nor", "also", "then", "instead", "once", "like", "beside"),
    *("this", "that", "these", "those", "it", "its", "the same", "such", "so many"),
    *("of", "to", "from", "for", "by", "with", "without", "at", "on", "in", "into", "over", "as"),
    *("after", "before", "between", "since", "until", "under", "through", "about", "per"),
    *("comes?", "lasts", "gets?", "goes", "stands?", "holds?", "takes?", "is", "are", "was"),
    *(
        "were",
        "has",
        "have",
        "read",
        "stored",
        "given",
        "drawn",
        "driven",
        "kept",
        "left",
        "passed",
    ),
)
BEGINNING = re.compile(rf"({'|'.join(FRAGMENTS)})\b", re.IGNORECASE)


def descriptions(schema: Any, path: str) -> Iterator[tuple[str, str]]:
    """Where each description of a JSON Schema stands, and what it says."""
    if isinstance(schema, list):
        schema = dict(enumerate(schema))
    for key, value in schema.items() if isinstance(schema, dict) else ():
        if key == "description" and isinstance(value, str):
            yield path, value
        else:
            yield from descriptions(value, f"{path}.{key}")


def of_columns() -> Iterator[tuple[str, str]]:
    """What stands in the columns of tables that runs write, and of tables that scenarios name."""
    for name, columns in TABLES.items():
        yield from ((f"{name}.{column.name}", column.meaning) for column in columns)
    for kind in (LineColumns, LocationColumns, PodColumns, StartColumns, TransportColumns):
        hints = get_type_hints(kind, include_extras=True)
        for name in kind.__struct_fields__:
            yield f"{kind.__name__}.{name}", hints[name].__metadata__[-1].description


def of_the_contract() -> Iterator[tuple[str, str]]:
    """What the tables of the page for writers of strategies say beside each name."""
    column = 0
    for line in CONTRACT.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)]
        if "meaning" in cells:
            column = cells.index("meaning")
        elif len(cells) <= column:
            column = 0
        elif column and cells[1] != "---":
            yield cells[1], cells[column]


SOURCES = {
    "scenarios, strategies, floors": lambda: descriptions(json_schema()["$defs"], "scenario"),
    "studies": lambda: descriptions(study_schema()["$defs"], "study"),
    "tables": of_columns,
    "contract of strategies": of_the_contract,
    "metrics": lambda: ((name, meaning) for name, (_, meaning) in METRIC_CATALOGUE.items()),
}


@pytest.mark.parametrize("source", SOURCES)
def test_a_meaning_begins_as_something_complete(source: str) -> None:
    meanings = list(SOURCES[source]())
    assert meanings
    assert [f"{at}: {text}" for at, text in meanings if not text or BEGINNING.match(text)] == []


@pytest.mark.parametrize("text", ["and its row", "Its mean.", "As battery.reserve.", "in cells"])
def test_a_fragment_is_refused(text: str) -> None:
    assert BEGINNING.match(text)


@pytest.mark.parametrize("text", ["iteration", "order", "What a visit takes.", "tick of the end"])
def test_what_is_complete_is_not(text: str) -> None:
    assert not BEGINNING.match(text)
