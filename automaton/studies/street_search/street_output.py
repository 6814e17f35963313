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
from automaton.scenario.reading import document_of
from automaton.scenario.street_files import street_table
from automaton.studies.street_search.designs import StreetDesign
from automaton.studies.sweeps.sweep_plan import files_at, texts_of
from automaton.tables.table_run import ScenarioDumper

STREETS_FILE: Final = "streets.csv"


def scenario_path(folder: Path, name: str) -> Path:
    """The file of a scenario with streets; `name`: of the scenario."""
    plain = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "scenario"
    return folder / f"{plain}-streets.yaml"


def write_streets(folder: Path, floor_plan: FloorPlan, design: StreetDesign) -> None:
    """Write the file of streets."""
    cells = np.flatnonzero(floor_plan.drivable).tolist()
    at = [floor_plan.xy(cell) for cell in cells]
    moves, waits = design.moves[cells] / WEIGHT_UNIT, design.waits[cells] / WEIGHT_UNIT
    text = street_table(DIRECTIONS, moves, waits, at, STREETS_FILE, design.closed[cells])
    with atomic_writer(folder / STREETS_FILE) as file:
        file.write(text.encode())


def write_scenario(path: Path, scenario: str, settings: Sequence[Any]) -> None:
    """Write a scenario with the file of streets; its own files are named from the folder of `path`."""
    document = document_of(scenario, settings)
    names = {
        text: os.path.relpath(paths[0].parent / os.path.basename(text), path.parent)
        for text in texts_of({key: one for key, one in document.data.items() if key != "streets"})
        if not os.path.isabs(text) and (paths := files_at(text, [document.folder]))
    }
    data = {**renamed(document.data, names), "streets": {"file": STREETS_FILE}}
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
