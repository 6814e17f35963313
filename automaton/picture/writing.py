"""A world as text: the tick, the map, then a line for every robot and for orders that have moved.

    tick 40, seed 1, 8 order changes, 6 seen by allocation

    b+-+d
    bA$|d      the floor's symbols; robots A to Z over them; 's' an empty shelf, '$' a full one
    b+-+#      '@' several robots, or one beyond the 26th; '*' a cell that a long move has claimed

    A (0, 1) vertical, fetches 3 from (1, 1) via (2, 1), moved; route nESS

Everything that a digest covers is in the picture but the work at stations and the zones that robots
serve: `partition_picture` tells of these, and is not read back. Nor are there the memory of strategies,
and the counters behind the metrics (tallies, and when and from where an order was taken).
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from automaton.picture.floor import Drawing, floor_drawing, legend_entry
from automaton.picture.orders import order_line
from automaton.picture.robots import name_of, robot_line
from automaton.units import count
from automaton.world.plan import FloorPlan
from automaton.world.state import CHANGES, DELIVERED, NIL, SEEN_CHANGES, TICK, TICKETS, World

if TYPE_CHECKING:
    from automaton.simulation import Simulation

CROWD = "@"
CLAIMED = "*"
EMPTY_SHELF, FULL_SHELF = "s", "$"


def picture_of(
    subject: Simulation | World, plan: FloorPlan | None = None, brief: bool = False
) -> str:
    """The picture of a simulation, or of a world on the floor `plan`; no newline at its end.

    brief: for people; delivered orders are counted. It cannot be read back.
    """
    world, plan = (subject, plan) if isinstance(subject, World) else _of_simulation(subject)
    if plan is None:
        raise TypeError("the picture of a world needs its plan: picture_of(world, plan)")
    lines = [head_line(world), "", *map_rows(world, plan), "", *legend_lines(plan)]
    lines += [robot_line(world, plan, int(i), brief) for i in world.robots.at_index]
    delivered = world.orders.state == DELIVERED
    for order in np.flatnonzero(~delivered) if brief else range(len(delivered)):
        line = order_line(world, plan, int(order))
        if line is not None:
            lines.append(line)
    if brief and delivered.any():
        lines.append(f"{count(int(np.count_nonzero(delivered)), 'order')} delivered")
    return "\n".join(lines)


def _of_simulation(simulation: Simulation) -> tuple[World, FloorPlan]:
    return simulation.world, simulation.resolved.plan


def head_line(world: World) -> str:
    """When it is, how often orders and reservations have changed, and what allocation saw of it."""
    clock = world.clock
    seen = "none" if clock[SEEN_CHANGES] == NIL else str(clock[SEEN_CHANGES])
    seed, changes = int(world.rules.seed), clock[CHANGES]
    text = f"tick {clock[TICK]}, seed {seed}, {changes} order changes, {seen} seen by allocation"
    return text + (f", {clock[TICKETS]} tickets" if clock[TICKETS] else "")


def map_rows(world: World, plan: FloorPlan) -> list[str]:
    """The rows of the floor with its loads and robots."""
    text, first = _canvas(plan)
    for slot, cell in enumerate(world.slots.cell.tolist()):
        if not world.slots.endless[slot]:
            x, y = plan.xy(cell)
            text[y, x + first] = EMPTY_SHELF if world.slots.content[slot] == NIL else FULL_SHELF
    robots = world.robots
    for claim in robots.claim[robots.claim != NIL].tolist():
        x, y = plan.xy(claim)
        text[y, x + first] = CLAIMED
    held: dict[int, str] = {}
    for i, cell in enumerate(np.where(robots.cell == NIL, robots.bay, robots.cell).tolist()):
        if cell == NIL:
            continue  # off the floor
        name = name_of(int(robots.identity[i]))
        held[cell] = CROWD if cell in held or len(name) > 1 else name
    for cell, mark in held.items():
        x, y = plan.xy(cell)
        text[y, x + first] = mark
    return ["".join(row) for row in text]


def legend_lines(plan: FloorPlan) -> list[str]:
    """What the symbols of the map mean that are not built in; empty, or with a blank line last."""
    legend = _drawing(plan).legend
    lines = []
    for mark, symbol in legend:
        entry = legend_entry(symbol)
        said = [f"{key} {_words(value)}" for key, value in entry.items()]
        lines.append(f"{mark} is {', '.join(said)}")
    return [*lines, ""] if lines else []


def _words(value: object) -> str:
    if isinstance(value, list):
        return " ".join(value) or "none"
    return str(value)


def _canvas(plan: FloorPlan) -> tuple[NDArray[np.str_], int]:
    """(height, columns) characters of the empty floor, and the column of x = 0."""
    picture = _drawing(plan).picture
    text = np.array([list(row) for row in picture.split("\n")])
    for cell in plan.starts:  # robots are drawn where they are now
        x, y = plan.xy(cell)
        text[y, x + text.shape[1] - plan.width] = "."
    return text, text.shape[1] - plan.width


@lru_cache(maxsize=16)
def _drawing(plan: FloorPlan) -> Drawing:
    return floor_drawing(plan)
