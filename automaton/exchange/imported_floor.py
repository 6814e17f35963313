"""Files of other programs: recognize their kind, report on an import, and write its files.

A file is recognized by its content, not by its name: its first bytes, or the top-level keys of JSON. Its
reader gets the path and the options of the command, and returns an ImportedFloor, or a Problem with
tasks.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
import yaml

from automaton.documents.report_document import Block, CharacterPicture, Heading, Listed, Table
from automaton.errors import InputError
from automaton.exchange.problem import Problem
from automaton.floor.drawn_floors import MAX_FLOOR_SIDE
from automaton.scenario.document import MAX_NODES
from automaton.strategy.lookup import IMPORTED, SLOW_STEERED, STEERED, default_for
from automaton.units import count, number

MAX_FLOOR_FILE_BYTES: Final = 64 * 2**20
HEAD_BYTES: Final = 65_536

FOLDER: Final = "folder"
MAP: Final = "map"
SCEN: Final = "scen"
LEAGUE: Final = "league"
LIF: Final = "lif"
OPENTCS: Final = "opentcs"
ROS: Final = "ros"
GUIDANCE: Final = "guidance"

FILE_KINDS: Final = {  # kind: its name
    LIF: "VDMA LIF",
    OPENTCS: "openTCS plant model",
    ROS: "map of ROS",
    MAP: "MovingAI map",
    SCEN: "MovingAI scenario",
    LEAGUE: "problem of the League of Robot Runners",
    GUIDANCE: "guidance graph (GGO)",
}
BEGINNINGS: Final = (  # kind, and a pattern of its first lines
    (MAP, re.compile(rb"\s*type\s+\w+\s")),
    (SCEN, re.compile(rb"\s*version\s+\d")),
    (OPENTCS, re.compile(rb"\s*<")),
    (
        ROS,
        re.compile(rb"(?sm)(?!\s*\{)(?=.*^[ \t]*image[ \t]*:)(?=.*^[ \t]*resolution[ \t]*:)"),
    ),
    (ROS, re.compile(rb"P[25]\s|\x89PNG")),  # the image instead of the file that names it
)
KIND_OF_SUFFIX: Final = {
    **{".map": MAP, ".scen": SCEN, ".json": LEAGUE, ".lif": LIF, ".xml": OPENTCS},
    **{".yaml": ROS, ".yml": ROS},
}
LIF_KEYS: Final = frozenset(("layouts", "origins", "metaInformation"))
GUIDANCE_KEYS: Final = frozenset(("layout", "n_row", "n_col"))
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"

MAX_PICTURE: Final = (200, 120)  # largest floor that a terminal shows, in columns and rows
RED: Final = "bold red"
ROUTING: Final = "shortest"
FREE, WALL = ".", "#"
MAX_WRITTEN_CELLS: Final = 2_000_000  # of a written floor: a scenario has at most 8 MB
MAX_WRITTEN_VALUES: Final = MAX_NODES - 10_000  # of sections; the rest: names, legend
MAX_INLINE: Final = 50  # names of cells; more are written to a separate file


def kind_of(path: Path) -> str:
    """Return one of the kinds above. Raises InputError for anything else."""
    file = str(path)
    if os.path.isdir(path):
        return FOLDER
    if not os.path.exists(path):
        raise InputError("no such file", file)
    if not os.path.isfile(path):
        raise InputError("is not a regular file", file)
    head = read_bytes(path, HEAD_BYTES, cut=True).removeprefix(BYTE_ORDER_MARK)
    for kind, beginning in BEGINNINGS:
        if beginning.match(head):
            return kind
    if head.lstrip().startswith(b"{"):
        keys = _top_keys(path, head)
        return LIF if LIF_KEYS & keys else GUIDANCE if GUIDANCE_KEYS & keys else LEAGUE
    kind = KIND_OF_SUFFIX.get(path.suffix.lower(), "")
    if not kind:
        known = ", ".join(FILE_KINDS.values())
        raise InputError(
            f"is not in one of the formats that are read: {known}, or a folder with map.txt, "
            "agents_K.csv and tasks_one.csv",
            file,
        )
    return kind


def read_bytes(path: Path, most: int = MAX_FLOOR_FILE_BYTES, cut: bool = False) -> bytes:
    """Read a file of at most `most` bytes; `cut`: only its beginning. Raises InputError."""
    try:
        with path.open("rb") as file:
            data = file.read(most + (not cut))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", str(path)) from None
    if len(data) > most:
        raise InputError(f"has more than {most // 2**20} MiB, the limit", str(path))
    return data


def _top_keys(path: Path, head: bytes) -> set[str]:
    """Return the keys of a JSON object; if it is broken, those of a kind of file."""
    content = head if len(head) < HEAD_BYTES else read_bytes(path)
    try:
        data: dict[str, Any] = msgspec.json.decode(content, type=dict[str, msgspec.Raw])
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return {key for key in LIF_KEYS | GUIDANCE_KEYS if f'"{key}"'.encode() in head}
    return set(data)


# The report.


class EdgeRow(NamedTuple):
    """An edge of a graph and its drawing."""

    name: str
    metres: float
    cells: int
    drawn: float  # metres
    ticks_wanted: float
    ticks: int

    @property
    def error(self) -> float:
        """The error of the drawn length, as a share of the length."""
        return self.drawn / self.metres - 1

    @property
    def time_error(self) -> float:
        """The error of the time that a robot takes, as a share of that time."""
        return self.ticks / self.ticks_wanted - 1

    @property
    def speed_error(self) -> float:
        """The error of the speed on the drawn edge, as a share of the speed."""
        return (1 + self.error) / (1 + self.time_error) - 1

    def json(self) -> dict[str, Any]:
        """The row as `--json` has it."""
        return {
            "edge": self.name,
            "metres": round(self.metres, 6),
            "cells": self.cells,
            "error_cm": round(100 * (self.drawn - self.metres), 4),
            "error_percent": round(100 * self.error, 4),
            "ticks_wanted": round(self.ticks_wanted, 4),
            "ticks": self.ticks,
            "time_error_percent": round(100 * self.time_error, 4),
            "speed_error_percent": round(100 * self.speed_error, 4),
        }


@dataclass(frozen=True)
class ImportReport:
    """The report on an import, in the terms of the imported file."""

    format: str  # "VDMA LIF 1.0.0"
    facts: Mapping[str, str | int | float]  # results by name
    edges: tuple[EdgeRow, ...] = ()  # worst first
    lost: Mapping[str, int] = field(default_factory=dict)  # unused parts, with counts
    notes: tuple[str, ...] = ()  # sentences
    picture: str = ""
    marks: Mapping[tuple[int, int], str] = field(default_factory=dict)  # (x, y): digit of an edge
    refusal: str = ""  # reason why nothing is written

    def json(self) -> dict[str, Any]:
        """The report as `--json` prints it."""
        return {
            "format": self.format,
            **self.facts,
            "edges": [row.json() for row in self.edges],
            "lost": dict(self.lost),
            "notes": list(self.notes),
            "refused": self.refusal or None,
        }

    def blocks(self) -> Iterator[Block]:
        """The report as a document."""
        yield CharacterPicture(self.picture_rows())
        yield Heading(self.format, 3)
        yield fact_table(self.facts)
        if self.edges:
            yield edge_table(self.edges, self.marks)
        if self.lost:
            yield Heading("lost", 3)
            yield fact_table({key: f"{times:,}" for key, times in self.lost.items()})
        yield Listed(self.notes, mark="")

    def picture_rows(self) -> list[list[tuple[str, str]]]:
        """The floor, row by row, as (text, style): marks of edges in red. [] if it is too large."""
        rows = self.picture.splitlines()
        if len(rows) > MAX_PICTURE[1] or max(map(len, rows), default=0) > MAX_PICTURE[0]:
            return []
        return [
            [(self.marks.get((x, y), symbol), RED * ((x, y) in self.marks)) for x, symbol in row]
            for y, row in enumerate(map(enumerate, rows))
        ]


def fact_table(facts: Mapping[str, str | int | float]) -> Table:
    """A table of names and values."""
    return Table(("", ""), [(key, str(value)) for key, value in facts.items()], left=2)


def edge_table(edges: tuple[EdgeRow, ...], marks: Mapping[tuple[int, int], str]) -> Table:
    """The table of edges; the first ones with their digits in the picture."""
    marked = set(marks.values())
    head = ("", "edge", "metres", "cells", "cm", "%", "ticks wanted", "drawn", "time %")
    rows = [
        (
            str(place) if str(place) in marked else "",
            row.name,
            f"{row.metres:.3f}",
            number(row.cells),
            f"{_signless(100 * (row.drawn - row.metres), 1)}",
            f"{_signless(100 * row.error, 2)}",
            f"{row.ticks_wanted:.2f}",
            number(row.ticks),
            f"{_signless(100 * row.time_error, 1)}",
        )
        for place, row in enumerate(edges, 1)
    ]
    return Table(head, rows, left=2)


def _signless(value: float, digits: int) -> str:
    """A number with its sign; 0 without one."""
    text = f"{value:+.{digits}f}"
    return text[1:] if not text.strip("+-0.") else text


# A problem as a scenario, its starts and its tasks.
#
# Robots are differential, begin facing east, and take as many ticks for a turn as for a move, usually
# one; one robot fits in a cell. So the right of way is the planner for slow actions. The strategies are
# named, so that `--set strategy.right_of_way=...` compares others. From 2024 on a task may change robots
# until it is begun, so tasks are matched again in each tick.


def imported_files(problem: Problem, stem: str, ticks: int) -> dict[str, str]:
    """Return the texts of the files STEM.yaml, STEM-starts.csv and STEM.tasks, by name.

    `ticks`: length of a run.
    """
    starts, tasks = f"{stem}-starts.csv", f"{stem}.tasks"
    return {
        starts: starts_text(problem),
        tasks: tasks_text(problem),
        f"{stem}.yaml": scenario_text(problem, starts, tasks, ticks),
    }


def scenario_text(problem: Problem, starts: str, tasks: str, ticks: int) -> str:
    """Return the scenario of a problem; `starts` and `tasks`: the files that it names."""
    grid = problem.grid
    size = f"{count(problem.robots, 'robot')} on {grid.width} x {grid.height} cells"
    orders: dict[str, object] = {"tasks": tasks, "repeat": problem.repeat}
    if problem.assignment == "pool":
        orders["revealed"] = problem.revealed
    orders["assign"] = problem.assignment
    allocation: object = default_for("allocation", IMPORTED)
    if problem.assignment == "pool":
        allocation = {"name": allocation, "reassign": 1}
    if problem.skip_reached:
        orders["skip_reached"] = True
    fleet = {"robots": problem.robots, "kinematics": "differential", "start": {"file": starts}}
    when = "on-targets" if problem.on_targets else "never" if problem.repeat else "delivered"
    # PIBT solves more one-shot problems than a planner of several actions.
    robots = STEERED if problem.on_targets else SLOW_STEERED
    strategy = {
        "allocation": allocation,
        "routing": ROUTING,
        "right_of_way": default_for("right_of_way", robots),
    }
    sections = {
        "name": problem.name[:200],
        "summary": f"{size}, {count(len(problem.tasks), 'task')}, imported.",
        "fleet": fleet | {"heading": "east"},
        "durations": {"move": problem.action_ticks, "turn": problem.action_ticks},
        # Squares of a cell overlap where one follows another around a corner.
        **({} if problem.robot_size is None else {"world": {"following": "none"}}),
        "orders": orders,
        **({} if problem.delays is None else {"faults": {"delays": dict(problem.delays)}}),
        "strategy": strategy,
        "stop": {"when": when, "max_duration": ticks},
        "seed": 1,
    }
    lines = [f"{key}: {flow(value)}" for key, value in sections.items()]
    symbols = np.where(grid.free, FREE, WALL)
    return "\n".join(
        [*lines, "layout:", "  picture: |", *(f"    {''.join(r)}" for r in symbols), ""]
    )


def starts_text(problem: Problem) -> str:
    """Return the starts as a CSV file."""
    width = problem.grid.width
    rows = [f"{cell % width},{cell // width}" for cell in problem.starts.tolist()]
    return "\n".join(["x,y", *rows, ""])


def tasks_text(problem: Problem) -> str:
    """Return the tasks as a file of tasks: a count, then the cells of each."""
    rows = [",".join(map(str, task)) for task in problem.tasks]
    return "\n".join([str(len(rows)), *rows, ""])


class _PlainDumper(yaml.SafeDumper):
    """A dumper that repeats data instead of writing aliases."""

    def ignore_aliases(self, data: object) -> bool:
        """Never write aliases."""
        return True


def flow(value: object) -> str:
    """Return a value as YAML in one line."""
    text: str = yaml.dump(
        value,
        Dumper=_PlainDumper,
        default_flow_style=True,
        sort_keys=False,
        width=10**6,
        allow_unicode=True,
    )
    return text.removesuffix("\n").removesuffix("\n...")


# A floor as a scenario.


@dataclass(frozen=True)
class ImportOptions:
    """The options of `automaton import`; None: left out. Lengths in m, times in s."""

    cell: Fraction | None = None
    tick: Fraction | None = None
    speed: Fraction | None = None  # m/s
    layout: str | None = None
    type: str | None = None
    accept: float = 0.05  # the largest error of an edge, as a share
    robots: int | None = None
    ticks: int | None = None  # length of a run
    robot: Fraction | None = None  # width in m, for images; length in m, for graphs
    unknown: str = "wall"  # meaning of unknown area: wall or free


class NamedTable(NamedTuple):
    """A file beside the scenario, which a key of a section names."""

    section: str
    key: str
    ending: str  # of its name, after the stem
    text: str


@dataclass(frozen=True)
class ImportedFloor:
    """A floor that was read; `sections`: the scenario without the layout."""

    picture: str  # rows with line ends
    legend: Mapping[str, Mapping[str, Any]]
    sections: Mapping[str, Any]
    report: ImportReport
    locations: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # name: (x, y)
    comments: tuple[str, ...] = field(default=())  # comments at the top of the scenario
    tables: tuple[NamedTable, ...] = ()

    def files(self, stem: str, floor: str | None = None) -> dict[str, str]:
        """Return the texts of the files, STEM.yaml last; `floor`: the file for the picture."""
        out, named = {}, {name: list(cell) for name, cell in self.locations.items()}
        lines = [f"# {text}" for text in self.comments]
        sections = dict(self.sections)
        for section, key, ending, text in self.tables:
            out[f"{stem}{ending}"] = text
            sections[section] = {key: f"{stem}{ending}", **sections.get(section, {})}
        for key, value in sections.items():
            lines += section_lines(key, value)
        if len(named) > MAX_INLINE:
            out[f"{stem}-locations.csv"] = locations_text(named)
            lines.append(f"locations: {flow(f'{stem}-locations.csv')}")
        elif named:
            lines += ["locations:", *(f"  {flow(key)}: {cell}" for key, cell in named.items())]
        lines.append("layout:")
        if self.legend:
            lines.append("  legend:")
            lines += [f"    {flow(key)}: {flow(dict(entry))}" for key, entry in self.legend.items()]
        if floor is None:
            lines += ["  picture: |", *(f"    {row}" for row in self.picture.splitlines())]
        else:
            out[floor] = self.picture
            lines.append(f"  file: {flow(floor)}")
        return {**out, f"{stem}.yaml": "\n".join([*lines, ""])}


def locations_text(locations: Mapping[str, list[int]]) -> str:
    """Return names of cells as a CSV file."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(("name", "x", "y"))
    writer.writerows((name, *cell) for name, cell in locations.items())
    return out.getvalue()


def section_lines(key: str, value: Any) -> list[str]:
    """Return a section of a scenario; lists and mappings of mappings have a line for each entry."""
    if not isinstance(value, Mapping) or not any(map(_is_long, value.values())):
        return [f"{key}: {flow(value)}"]
    lines = [f"{key}:"]
    for name, inner in value.items():
        if isinstance(inner, list) and _is_long(inner):
            lines += [f"  {flow(name)}:", *(f"    - {flow(entry)}" for entry in inner)]
        else:
            lines.append(f"  {flow(name)}: {flow(inner)}")
    return lines


def _is_long(value: Any) -> bool:
    """Whether a value is a mapping, or a list of mappings."""
    return isinstance(value, Mapping) or (
        isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)
    )


def check_size(width: int, height: int, file: str, advice: str) -> None:
    """Raises InputError for a floor with too many cells; `advice`: a remedy."""
    if max(width, height) > MAX_FLOOR_SIDE or width * height > MAX_WRITTEN_CELLS:
        raise InputError(
            f"the floor would have {width:,} x {height:,} cells; a side has at most {MAX_FLOOR_SIDE:,}, "
            f"an imported floor {MAX_WRITTEN_CELLS:,} cells: {advice}",
            file,
        )


def check_values(sections: Mapping[str, Any], file: str) -> None:
    """Raises InputError for sections with more values than a scenario may have."""
    most = {key: _values(value) for key, value in sections.items()}
    total = sum(most.values())
    if total > MAX_WRITTEN_VALUES:
        longest = max(most, key=lambda key: most[key])
        raise InputError(
            f"the scenario would have {total:,} values, most of them in {longest}; at most "
            f"{MAX_WRITTEN_VALUES:,} are allowed",
            file,
        )


def _values(value: Any) -> int:
    """Count a value and its parts, keys included."""
    if isinstance(value, Mapping):
        return 1 + sum(1 + _values(inner) for inner in value.values())
    return 1 + sum(map(_values, value)) if isinstance(value, list) else 1
