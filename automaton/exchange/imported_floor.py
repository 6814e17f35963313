"""A floor as read from a file of another program, and as files of ours.

A reader gets the path and the options of the command, and returns an ImportedFloor: the picture, its
legend, the other sections of the scenario and the report.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final

from automaton.errors import InputError
from automaton.exchange.import_report import ImportReport
from automaton.exchange.imported_scenario import flow
from automaton.floor.drawn_floors import MAX_SIDE
from automaton.scenario.document import MAX_NODES

MAX_CELLS: Final = 2_000_000  # of a floor that is written: a scenario has 8 MB at most
MAX_VALUES: Final = MAX_NODES - 10_000  # of sections; the rest is for names and the legend
MAX_INLINE: Final = 50  # names of cells; more are written to a file of their own


@dataclass(frozen=True)
class ImportOptions:
    """What the options of `automaton import` say; None: left out. Lengths in m, times in s."""

    cell: Fraction | None = None
    tick: Fraction | None = None
    speed: Fraction | None = None  # m/s
    layout: str | None = None
    type: str | None = None
    accept: float = 0.05  # the largest error of an edge, as a share
    robots: int | None = None
    ticks: int | None = None  # after which a run ends
    robot: Fraction | None = None  # width in m, for images
    unknown: str = "wall"  # what area is of which an image says nothing: wall or free


@dataclass(frozen=True)
class ImportedFloor:
    """A floor that was read; `sections` of the scenario hold everything but the layout."""

    picture: str  # rows, each with its end of line
    legend: Mapping[str, Mapping[str, Any]]
    sections: Mapping[str, Any]
    report: ImportReport
    locations: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # name: (x, y)
    comments: tuple[str, ...] = field(default=())  # at the top of the scenario

    def files(self, stem: str, floor: str | None = None) -> dict[str, str]:
        """Return the texts of the files, STEM.yaml last; `floor`: the file for the picture."""
        out, named = {}, {name: list(cell) for name, cell in self.locations.items()}
        lines = [f"# {text}" for text in self.comments]
        for key, value in self.sections.items():
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
    """Return a section of a scenario; lists and mappings of mappings get a line for each entry."""
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
    """Raises InputError for a floor with too many cells; `advice`: what helps."""
    if max(width, height) > MAX_SIDE or width * height > MAX_CELLS:
        raise InputError(
            f"the floor would have {width:,} x {height:,} cells; a side has at most {MAX_SIDE:,}, "
            f"an imported floor {MAX_CELLS:,} cells: {advice}",
            file,
        )


def check_values(sections: Mapping[str, Any], file: str) -> None:
    """Raises InputError for sections with more values than a scenario may have."""
    most = {key: _values(value) for key, value in sections.items()}
    total = sum(most.values())
    if total > MAX_VALUES:
        longest = max(most, key=lambda key: most[key])
        raise InputError(
            f"the scenario would have {total:,} values, most of them in {longest}; at most "
            f"{MAX_VALUES:,} are allowed",
            file,
        )


def _values(value: Any) -> int:
    """Count a value and those in it, keys included."""
    if isinstance(value, Mapping):
        return 1 + sum(1 + _values(inner) for inner in value.values())
    return 1 + sum(map(_values, value)) if isinstance(value, list) else 1
