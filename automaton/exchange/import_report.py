"""The report of an import: what a layout has become, how far off its edges are, and what is lost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from automaton.units import number

MAX_PICTURE: Final = (200, 120)  # columns and rows of a floor that a terminal still shows
RED: Final = "bold red"


class EdgeRow(NamedTuple):
    """One edge of a graph, and how it is drawn."""

    name: str
    metres: float
    cells: int
    drawn: float  # metres
    ticks_wanted: float
    ticks: int

    @property
    def error(self) -> float:
        """How much too long it is drawn, as a share of its length."""
        return self.drawn / self.metres - 1

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
        }


@dataclass(frozen=True)
class ImportReport:
    """What an import reports, in the words of the file that was read."""

    format: str  # "VDMA LIF 1.0.0"
    facts: Mapping[str, str | int | float]  # what it has become, by name
    edges: tuple[EdgeRow, ...] = ()  # the worst first
    lost: Mapping[str, int] = field(default_factory=dict)  # what was read and not used: how often
    notes: tuple[str, ...] = ()  # sentences
    picture: str = ""
    marks: Mapping[tuple[int, int], str] = field(default_factory=dict)  # (x, y): digit of an edge
    refusal: str = ""  # why nothing is written

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

    def lines(self) -> list[str]:
        """The report as lines of text, but for the picture."""
        width = max(map(len, self.facts), default=0)
        lines = [self.format, *(f"  {key:<{width}}  {value}" for key, value in self.facts.items())]
        if self.edges:
            lines += ["", *edge_table(self.edges, self.marks)]
        if self.lost:
            width = max(map(len, self.lost))
            lines += ["", "lost", *(f"  {key:<{width}}  {n:,}" for key, n in self.lost.items())]
        if self.notes:
            lines += ["", *self.notes]
        return lines

    def picture_rows(self) -> list[list[tuple[str, str]]]:
        """The floor, row by row, as (text, style): marks of edges in red. [] if it is too large."""
        rows = self.picture.splitlines()
        if len(rows) > MAX_PICTURE[1] or max(map(len, rows), default=0) > MAX_PICTURE[0]:
            return []
        return [
            [(self.marks.get((x, y), symbol), RED * ((x, y) in self.marks)) for x, symbol in row]
            for y, row in enumerate(map(enumerate, rows))
        ]


def edge_table(edges: tuple[EdgeRow, ...], marks: Mapping[tuple[int, int], str]) -> list[str]:
    """The table of edges; the first ones with the digits that stand for them in the picture."""
    marked = set(marks.values())
    head = ("", "edge", "metres", "cells", "cm", "%", "ticks wanted", "drawn")
    rows = [head]
    for place, row in enumerate(edges, 1):
        rows.append(
            (
                str(place) if str(place) in marked else "",
                row.name,
                f"{row.metres:.3f}",
                number(row.cells),
                f"{_signless(100 * (row.drawn - row.metres), 1)}",
                f"{_signless(100 * row.error, 2)}",
                f"{row.ticks_wanted:.2f}",
                number(row.ticks),
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if place < 2 else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _signless(value: float, digits: int) -> str:
    """A number with its sign; 0 has none."""
    text = f"{value:+.{digits}f}"
    return text[1:] if not text.strip("+-0.") else text
