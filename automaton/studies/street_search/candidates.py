"""The file of the candidates of a search: a line for each generation, written before it is run.

A search that was cut off continues with these candidates, so that it ends as one that was not.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.studies.sweeps.run_keys import hashed

Numbers = NDArray[np.float64]
CANDIDATES_FILE: Final = "candidates.jsonl"


class CandidateLog:
    """The candidates of each generation, in a file, where a line is one generation.

    `asked`: what determines the candidates. A damaged line and those after it are dropped.
    Raises InputError for a file of another search.
    """

    def __init__(self, folder: Path, asked: dict[str, Any], recompute: bool = False) -> None:
        self.path = folder / CANDIDATES_FILE
        self.damaged_from: int | None = None  # the first generation that was lost
        lines = self.path.read_bytes().splitlines() if self.path.exists() else []
        records = [record_of(line) for line in lines]
        before = records[0] if records else None
        if before is not None and not recompute:
            check_same(before, asked, self.path)
        if records and before is None and not recompute:
            self.damaged_from = 1
        self.generations: list[Numbers] = []
        for number, record in enumerate(records[1:] if before == asked else (), 1):
            if record is None or record.get("generation") != number:
                self.damaged_from = number
                break
            self.generations.append(np.array(record["numbers"]))
        lines_left = [line_of(asked)]
        lines_left += [line_of(known) for known in map(self._record, range(len(self.generations)))]
        self._replace(lines_left)

    def _record(self, index: int) -> dict[str, Any]:
        return {"generation": index + 1, "numbers": self.generations[index].tolist()}

    def _replace(self, lines: Iterable[str]) -> None:
        part = self.path.with_name(f"{self.path.name}.writing")
        part.write_text("".join(lines), encoding="utf-8")
        os.replace(part, self.path)

    def candidates(self, number: int, sample: Callable[[], Numbers]) -> Numbers:
        """The candidates of a generation (from 1): those of the file, else sampled and written."""
        if number > len(self.generations):
            self.generations.append(sample())
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line_of(self._record(number - 1)))
                file.flush()
                os.fsync(file.fileno())
        return self.generations[number - 1]


def line_of(record: dict[str, Any]) -> str:
    """A record as a line, with a checksum."""
    return json.dumps({**record, "checksum": hashed(record)}) + "\n"


def record_of(line: bytes) -> dict[str, Any] | None:
    """The record of a line without its checksum; None if it is damaged."""
    try:
        record = json.loads(line)
        checksum = record.pop("checksum")
    except (ValueError, AttributeError, KeyError, TypeError):
        return None
    return record if checksum == hashed(record) else None


def check_same(before: dict[str, Any], asked: dict[str, Any], path: Path) -> None:
    """Raise InputError if the candidates are those of another search."""
    for key, value in asked.items():
        if before.get(key) != value:
            raise InputError(
                f"holds the candidates of a search with {key} {before.get(key)}, not {value}; use "
                "another folder, or --recompute to search again",
                str(path),
            )
