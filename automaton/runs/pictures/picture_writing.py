"""A world as text: the tick, the map, then a line for every robot and for orders that have moved.

    tick 40, seed 1, 8 order changes, 6 seen by allocation

    b+-+d
    bA$|d      the floor's symbols; robots A to Z over them; 's' an empty shelf, '$' a full one
    b+-+#      '@' several robots, or one beyond the 26th; '*' a cell that a long move has claimed;
               storage 'p' with a pod, 'q' without

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

from automaton.engine.state import (
    CLOCK_ALLOCATION_REVISION,
    CLOCK_REVISION,
    CLOCK_TICK,
    CLOCK_TICKETS_ISSUED,
    NIL,
    ORDER_DELIVERED,
    World,
)
from automaton.floor.cells import STORAGE
from automaton.floor.floor_drawing import Drawing, floor_drawing, legend_entry
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.asked_orders import asked_orders
from automaton.runs.pictures.order_lines import order_line
from automaton.runs.pictures.robot_lines import name_of, robot_line
from automaton.units import count

if TYPE_CHECKING:
    from automaton.runs.simulation import Simulation

CROWD = "@"
CROWD_LEGEND = (
    "@ is a robot whose name is a number (letters end with robot 25), or several in a cell"
)
CLAIMED = "*"
EMPTY_SHELF, FULL_SHELF = "s", "$"
EMPTY_STORAGE, POD = "q", "p"


def picture_of(
    subject: Simulation | World, floor_plan: FloorPlan | None = None, brief: bool = False
) -> str:
    """The picture of a simulation, or of a world on the floor `floor_plan`; no newline at its end.

    brief: for people; delivered orders are counted. It cannot be read back.
    """
    world, floor_plan = (
        (subject, floor_plan) if isinstance(subject, World) else _of_simulation(subject)
    )
    if floor_plan is None:
        raise TypeError("the picture of a world needs its plan: picture_of(world, plan)")
    rows = map_rows(world, floor_plan)
    lines = [head_line(world), "", *rows, "", *legend_lines(floor_plan)]
    if brief and any(CROWD in row for row in rows):
        lines += [CROWD_LEGEND, ""]
    lines += [robot_line(world, floor_plan, int(i), brief) for i in world.robots.at_index]
    delivered = world.orders.state == ORDER_DELIVERED
    for order in np.flatnonzero(~delivered) if brief else range(len(delivered)):
        line = order_line(world, floor_plan, int(order))
        if line is not None:
            lines.append(line)
    done = int(np.count_nonzero(asked_orders(world).done != NIL))
    if brief and done:
        lines.append(f"{count(done, 'order')} delivered")
    return "\n".join(lines)


def _of_simulation(simulation: Simulation) -> tuple[World, FloorPlan]:
    return simulation.world, simulation.resolved.floor_plan


def head_line(world: World) -> str:
    """When it is, how often orders and reservations have changed, and what allocation saw of it."""
    clock = world.clock
    seen = (
        "none" if clock[CLOCK_ALLOCATION_REVISION] == NIL else str(clock[CLOCK_ALLOCATION_REVISION])
    )
    seed, changes = int(world.rules.seed), clock[CLOCK_REVISION]
    text = (
        f"tick {clock[CLOCK_TICK]}, seed {seed}, {changes} order changes, {seen} seen by allocation"
    )
    return text + (
        f", {clock[CLOCK_TICKETS_ISSUED]} tickets" if clock[CLOCK_TICKETS_ISSUED] else ""
    )


def map_rows(world: World, floor_plan: FloorPlan) -> list[str]:
    """The rows of the floor with its loads and robots."""
    text, first = _canvas(floor_plan)
    for slot, cell in enumerate(world.slots.cell.tolist()):
        if not world.slots.unbounded[slot]:
            x, y = floor_plan.xy(cell)
            signs = (EMPTY_SHELF, FULL_SHELF)
            if floor_plan.kind[y + 1, x + 1] == STORAGE:
                signs = (EMPTY_STORAGE, POD)
            text[y, x + first] = signs[int(world.slots.content[slot] != NIL)]
    robots = world.robots
    for claim in robots.claim[robots.claim != NIL].tolist():
        x, y = floor_plan.xy(claim)
        text[y, x + first] = CLAIMED
    held: dict[int, str] = {}
    for i, cell in enumerate(np.where(robots.cell == NIL, robots.bay, robots.cell).tolist()):
        if cell == NIL:
            continue  # off the floor
        name = name_of(int(robots.identity[i]))
        held[cell] = CROWD if cell in held or len(name) > 1 else name
    for cell, mark in held.items():
        x, y = floor_plan.xy(cell)
        text[y, x + first] = mark
    return ["".join(row) for row in text]


def legend_lines(floor_plan: FloorPlan) -> list[str]:
    """What the symbols of the map mean that are not built in; empty, or with a blank line last."""
    legend = _drawing(floor_plan).legend
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


def _canvas(floor_plan: FloorPlan) -> tuple[NDArray[np.str_], int]:
    """(height, columns) characters of the empty floor, and the column of x = 0."""
    picture = _drawing(floor_plan).picture
    text = np.array([list(row) for row in picture.split("\n")])
    for cell in floor_plan.starts:  # robots are drawn where they are now
        x, y = floor_plan.xy(cell)
        text[y, x + text.shape[1] - floor_plan.width] = "."
    return text, text.shape[1] - floor_plan.width


@lru_cache(maxsize=16)
def _drawing(floor_plan: FloorPlan) -> Drawing:
    return floor_drawing(floor_plan)
