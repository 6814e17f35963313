"""Copies of a study's own files: with them a folder of results can be read, and repeated, anywhere.

Scenarios and the files that they name are copied to where they lie as seen from the study. What is
shipped is not copied, nor what is named by an absolute path or lies outside the study's folder.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from automaton.build.resolve import Resolved
from automaton.errors import InputError
from automaton.scenario.document import Document
from automaton.scenario.reading import SHIPPED_FOLDER
from automaton.strategy.entry import files_of
from automaton.studies.sweeps.result_store import ROWS_FOLDER, STUDY_FILE
from automaton.studies.sweeps.run_keys import DRAWN_ELSEWHERE, MANIFEST
from automaton.studies.sweeps.study import Study, study_document
from automaton.studies.sweeps.sweep_plan import SweepPlan, scenario_file

Copies = Mapping[str, bytes]  # place in a folder of results -> content
RESERVED_FILE_NAMES: Final = (MANIFEST, STUDY_FILE, ROWS_FOLDER)


def copies_of(study: str | Path | Study, plan: SweepPlan) -> Copies:
    """The files that a plan was made of, apart from the study itself. Raises InputError."""
    document = Document(data={}) if isinstance(study, Study) else study_document(study)
    found: dict[str, Path] = {}
    for point, resolved in zip(plan.points, plan.scenarios, strict=True):
        name, file = Path(point.scenario), scenario_file(document, point.scenario)
        if not name.is_absolute() and ".." not in name.parts:
            home = file.parents[len(name.parts) - 1]
            for own in (file, *files_named(resolved, file.parent)):
                found |= placed(own, home)
    try:
        return {place: file.read_bytes() for place, file in found.items()}
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {why}", str(error.filename)) from None


def files_named(resolved: Resolved, folder: Path) -> Iterator[Path]:
    """The files that a scenario in a folder names: of its floor, its orders and its strategies."""
    layout = resolved.scenario.layout
    yield from (folder / layout[form] for form in DRAWN_ELSEWHERE if form in layout)
    yield from (Path(file) for file, _ in resolved.files)
    for choice in resolved.strategies.values():
        yield from files_of(choice.parameters)


def placed(file: Path, home: Path) -> dict[str, Path]:
    """{place: file} if it is a file below `home`, and is not shipped."""
    path = Path(os.path.abspath(file))
    if not path.is_file() or path.resolve().is_relative_to(SHIPPED_FOLDER):
        return {}
    for top in (Path(os.path.abspath(home)), home.resolve()):
        if path.is_relative_to(top):
            place = path.relative_to(top)
            return {} if place.parts[0] in RESERVED_FILE_NAMES else {place.as_posix(): path}
    return {}
