"""Designs of streets, the stretches that they consist of, and the runs that judge them.

#########    A stretch ends at obstacles, not at crossings: this floor has three of them, two rows
#.......#    and one column. A design has weights for all moves of a floor; the search varies one
#.#####.#    number for each stretch and direction.
#.......#
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import EAST, SOUTH, FloorPlan

Row = dict[str, Any]  # metrics of a run by name; None for a metric that the run does not have


class StreetDesign(NamedTuple):
    """Weights of the moves of a floor and of waiting, in hundredths; closed moves."""

    moves: NDArray[np.int32]  # (cells, 4), directions as in floor.floor_plan.DIRECTIONS
    waits: NDArray[np.int32]  # (cells,)
    closed: NDArray[np.bool_]  # (cells, 4)


class Stretch(NamedTuple):
    """A maximal straight run of cells, with the moves along it in one direction and against it.

    Moves along leave cells[:-1] in direction `along`, moves against leave cells[1:] in the opposite one.
    """

    cells: tuple[int, ...]  # flat, at least two, in the direction of `along`
    along: int  # direction of the moves along the stretch: east or south


class StreetRuns(Protocol):
    """Runs of designs."""

    def __call__(
        self, designs: Sequence[StreetDesign], seeds: Sequence[int], robots: int | None = None
    ) -> list[list[Row]]:
        """A row for each design and seed, in this order."""


def stretches(floor_plan: FloorPlan) -> list[Stretch]:
    """The stretches of a floor: rows, then columns, each in reading order.

    Neighbours belong together if a robot can move from one to the other, in whatever direction.
    """
    exits, maximal = floor_plan.exits.reshape(-1), []
    for along in (EAST, SOUTH):
        offset = floor_plan.offsets[along]
        joined = exits >> along & 1 | np.roll(exits, -offset) >> (along ^ 2) & 1
        for first in np.flatnonzero(joined & ~np.roll(joined, offset) & 1).tolist():
            cells = [first]
            while joined[cells[-1]]:
                cells.append(cells[-1] + offset)
            maximal.append(Stretch(tuple(cells), along))
    return maximal
