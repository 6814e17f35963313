"""The result of a search as files: the streets, and the scenario with them."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from automaton.atomic_write import atomic_writer
from automaton.floor.floor_plan import DIRECTIONS, WEIGHT_UNIT, FloorPlan
from automaton.scenario.changing_floor import OPEN_MOVE
from automaton.scenario.reading import document_of
from automaton.scenario.street_files import STREET_COLUMNS, street_table
from automaton.studies.street_search.designs import StreetDesign
from automaton.studies.sweeps.sweep_plan import files_at, texts_of
from automaton.tables.table_run import ScenarioDumper

STREETS_FILE: Final = "streets.csv"


def scenario_path(folder: Path, name: str) -> Path:
    """The file of a scenario with streets; `name`: of the scenario."""
    plain = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "scenario"
    return folder / f"{plain}-streets.yaml"


def write_streets(
    folder: Path, drawn: FloorPlan, floor_plan: FloorPlan, design: StreetDesign
) -> list[dict[str, Any]]:
    """Write the file of streets; return the streets with which a scenario has to overwrite it.

    `drawn`: the floor without streets; `floor_plan`: with the moves that a scenario closes and opens and
    with its capacities, in which a file cannot have opened moves and capacities.
    """
    before, after = (
        plan.exits.reshape(-1, 1) >> np.arange(4) & 1 > 0 for plan in (drawn, floor_plan)
    )
    closed, opened = before & (design.closed | ~after), after & ~before & ~design.closed
    cells = np.flatnonzero(floor_plan.drivable).tolist()
    at = [floor_plan.xy(cell) for cell in cells]
    moves = np.where(before, design.moves, WEIGHT_UNIT)[cells] / WEIGHT_UNIT
    waits = design.waits[cells] / WEIGHT_UNIT
    text = street_table(DIRECTIONS, moves, waits, at, STREETS_FILE, closed[cells])
    with atomic_writer(folder / STREETS_FILE) as file:
        file.write((text or ",".join(STREET_COLUMNS) + "\n").encode())
    capacity = floor_plan.capacity.reshape(-1)
    is_other = (capacity != drawn.capacity.reshape(-1)) & floor_plan.drivable.reshape(-1)
    rules: list[dict[str, Any]] = []
    for cell in np.flatnonzero(is_other | opened.any(axis=1)).tolist():
        place = {"at": list(floor_plan.xy(cell))}
        ways = np.flatnonzero(opened[cell]).tolist()
        room = {"capacity": int(capacity[cell])} if is_other[cell] else {}
        rules.append(place | dict.fromkeys((DIRECTIONS[way] for way in ways), OPEN_MOVE) | room)
        weights = {DIRECTIONS[way]: int(design.moves[cell, way]) / WEIGHT_UNIT for way in ways}
        rules += [place | weights] if weights else []
    return rules


def write_scenario(
    path: Path, scenario: str, settings: Sequence[Any], then: list[dict[str, Any]]
) -> None:
    """Write a scenario with the file of streets; its own files are named from the folder of `path`.

    `then`: streets that overwrite those of the file.
    """
    document = document_of(scenario, settings)
    names = {
        text: os.path.relpath(paths[0].parent / os.path.basename(text), path.parent)
        for text in texts_of({key: one for key, one in document.data.items() if key != "streets"})
        if not os.path.isabs(text) and (paths := files_at(text, [document.folder]))
    }
    streets = {"file": STREETS_FILE} | ({"then": then} if then else {})
    data = {**renamed(document.data, names), "streets": streets}
    text = yaml.dump(data, Dumper=ScenarioDumper, sort_keys=False, allow_unicode=True)
    with atomic_writer(path) as file:
        file.write(text.encode())


def renamed(data: Any, names: dict[str, str]) -> Any:
    """Data with other names of files."""
    if isinstance(data, dict):
        return {key: renamed(value, names) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [renamed(value, names) for value in data]
    return names.get(data, data) if isinstance(data, str) else data
