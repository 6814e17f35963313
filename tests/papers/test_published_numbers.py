"""The page of published numbers: its columns are those of the studies; generated floors repeat rows."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from automaton.papers.fleet_study import BEST_KNOWN, PRINTED_TASKS
from automaton.papers.guidance_study import PRINTED_TASKS_PER_TICK, REPRODUCTION
from automaton.papers.reproduction_study import reproduce

PAGE = Path(__file__).parents[2] / "docs" / "papers" / "published-numbers.md"
SEEDS = 3


def rows(section: str) -> Iterator[list[str]]:
    """The cells of each row of the table in a section, without its head."""
    text = PAGE.read_text().partition(f"## {section}\n")[2].partition("\n## ")[0]
    for line in re.findall(r"(?m)^\|(.*)\|$", text)[2:]:
        yield [cell.strip() for cell in line.split("|")]


def number(cell: str) -> float | None:
    return None if cell == "-" else float(cell.replace(",", ""))


def test_published_columns_are_those_of_the_studies() -> None:
    fleets = {int(row[0]): number(row[1]) for row in rows("Tasks of EPIBT's authors")}
    assert fleets == PRINTED_TASKS
    league = {row[0]: number(row[2]) for row in rows("The League of Robot Runners")}
    assert {league[f"2024 {name}"] for name in BEST_KNOWN} == set(BEST_KNOWN.values())
    printed = {(row[0], row[2]): number(row[3]) for row in rows("Guidance graphs")}
    assert {case: tasks for case, tasks in printed.items() if tasks} == PRINTED_TASKS_PER_TICK


@pytest.mark.parametrize("setup", ["2", "10"])
def test_generated_floors_give_the_numbers_of_the_page(setup: str) -> None:
    ours = {row[2]: number(row[4]) for row in rows("Guidance graphs") if row[0] == setup}
    made = reproduce(REPRODUCTION, seeds=SEEDS, workers=1, tables=[f"setup-{setup}"])
    for row in made.rows():
        assert row.mean == pytest.approx(ours[row.case["weights"]], rel=0.03)  # 5 standard errors
    assert len(made.rows()) == 2
