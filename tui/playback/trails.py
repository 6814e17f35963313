"""The cells that each robot came through last.

Behind a robot lies the part of its route that it has driven, whatever was skipped or rewound; what it
drove before its present route is known from the states that were shown before.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from automaton.engine.state import NIL, Array
from automaton.runs.simulation import Simulation

TRAIL_CELLS: Final = 8
MAX_GAP_TICKS: Final = 64  # between two states that are still one way


class Past(NamedTuple):
    """What was known of all robots at a tick."""

    tick: int
    position: Array  # (n,) the cell where it is, or which it enters
    steps: Array  # (n,) driven on its route
    cells: Array  # (n, TRAIL_CELLS)


class Trails:
    """The trails of one run."""

    def __init__(self) -> None:
        self._past: Past | None = None

    def at(self, simulation: Simulation) -> Array:
        """(n, TRAIL_CELLS) int32 by identity, the last cell first, then NIL."""
        past, tick = self._past, simulation.tick
        if past is not None and past.tick == tick and len(past.steps) == _robots(simulation):
            return past.cells
        position, steps, cells = _driven(simulation)
        if past is not None and 0 < tick - past.tick <= MAX_GAP_TICKS:
            cells = _with_older(position, cells, steps, past)
        self._past = Past(tick, position, steps, cells)
        return cells


def _robots(simulation: Simulation) -> int:
    return len(simulation.world.robots.cell)


def _driven(simulation: Simulation) -> tuple[Array, Array, Array]:
    """Where robots are, the steps that they have driven of their routes, and the cells of the last."""
    robots, offset = simulation.world.robots, simulation.world.grid.offset
    i = robots.at_index
    position = np.where(robots.claim[i] == NIL, robots.cell[i], robots.claim[i])
    steps = np.where(position == NIL, 0, robots.route_index[i])
    at = steps[:, None] - 1 - np.arange(TRAIL_CELLS)
    back = offset[robots.route[i[:, None], np.maximum(at, 0)]]
    cells = position[:, None] - np.cumsum(back, axis=1)
    return position, steps, np.where(at >= 0, cells, NIL).astype(np.int32)


def _with_older(position: Array, cells: Array, steps: Array, past: Past) -> Array:
    """Trails that go on with those of before where the present route began."""
    before = np.concatenate((past.position[:, None], past.cells), axis=1)
    now = np.concatenate((position[:, None], cells), axis=1)
    on_route = np.minimum(steps, TRAIL_CELLS)
    since = np.clip(steps - past.steps, 0, TRAIL_CELLS)
    same = (steps >= past.steps) & (_of(now, since) == past.position)  # it is still on that route
    stood = _of(now, on_route) == past.position  # it began its new route there
    first = np.where(same, 1 + np.minimum(past.steps, TRAIL_CELLS), stood)
    at = first[:, None] + np.arange(TRAIL_CELLS) - on_route[:, None]
    older = np.take_along_axis(before, np.clip(at, 0, TRAIL_CELLS), axis=1)
    known = (np.arange(TRAIL_CELLS) >= on_route[:, None]) & (at <= TRAIL_CELLS)
    return np.where(known, older, cells)


def _of(rows: Array, columns: Array) -> Array:
    """One value of each row."""
    values: Array = np.take_along_axis(rows, columns[:, None], axis=1)[:, 0]
    return values
