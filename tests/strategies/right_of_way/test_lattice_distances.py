"""Tables of distances in 16 bits: the same as a search in plain Python, whatever the memory."""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures

from automaton.build.prepared_floor import floor_for
from automaton.engine.state import NIL
from automaton.floor.drawn_floors import draw_floor
from strategies.right_of_way.epibt.lattice_distances import (
    FAR,
    distance_from,
    distance_tables,
    heading_patterns,
    row_to,
)

MIB = 1 << 20


def test_headings_add_one_of_nineteen_patterns() -> None:
    pattern, number = heading_patterns()
    assert len(set(pattern.tolist())) == 19
    assert all(number[pattern[k]] == k for k in range(19))


def plain_costs(grid: Any, goal: int, guided: bool) -> dict[tuple[int, int], int]:
    """Dijkstra over poses, from the goal backwards."""
    costs = {(goal, heading): 0 for heading in range(4)}
    queue = [(0, goal, heading) for heading in range(4)]
    while queue:
        cost, cell, heading = heapq.heappop(queue)
        if cost > costs[cell, heading]:
            continue
        before = cell - int(grid.offset[heading])
        ways = [(cell, (heading + 1) % 4, 1), (cell, (heading - 1) % 4, 1)]
        if int(grid.cell_flags[before]) >> heading & 1:
            y, x = divmod(before, int(grid.width))
            runs = (0 if y % 2 == 0 else 2) if heading % 2 == 0 else (1 if x % 2 else 3)
            ways.append((before, heading, 3 if guided and heading != runs else 1))
        for to, turned, ticks in ways:
            if cost + ticks < costs.get((to, turned), FAR):
                costs[to, turned] = cost + ticks
                heapq.heappush(queue, (cost + ticks, to, turned))
    return costs


FLOORS = pictures("......>v<^#", 6, 5)


@settings(max_examples=30, deadline=None)
@given(picture=FLOORS, guided=st.booleans(), data=st.data())
def test_a_row_holds_the_costs_of_a_plain_search(picture: str, guided: bool, data: Any) -> None:
    floor_plan = draw_floor("......\n" + picture)
    grid = floor_for(floor_plan, "differential", 1, 1, "undirected").grid
    tables = distance_tables(grid, guided, MIB)
    goal = data.draw(st.sampled_from(tables.drivable.tolist()))
    costs = plain_costs(grid, goal, guided)
    row = row_to(grid.read_only(), np.zeros(1, np.int64), tables, 0, goal, 1)
    for cell in tables.drivable.tolist():
        for heading in range(4):
            cost = distance_from(tables, row, cell, heading)
            assert cost == costs.get((cell, heading), FAR), (cell, heading)


def test_with_little_memory_rows_are_made_again_but_not_those_of_this_tick() -> None:
    floor_plan = draw_floor("." * 8)
    grid = floor_for(floor_plan, "differential", 1, 1, "undirected").grid
    tables = distance_tables(grid, False, budget=2 * 8 * 3)
    goals, stop = tables.drivable.tolist(), np.zeros(1, np.int64)
    assert len(tables.owner) == 3
    first = row_to(grid.read_only(), stop, tables, 0, goals[0], 1)
    for tick, goal in enumerate(goals * 2, start=2):
        assert row_to(grid.read_only(), stop, tables, 0, goals[0], tick) == first
        row = row_to(grid.read_only(), stop, tables, 0, goal, tick)
        ways = [distance_from(tables, row, cell, 0) for cell in goals]
        at = goals.index(goal)
        behind = range(2 + 1, 2 + 8 - at)
        assert ways == [*range(at, -1, -1), *behind]


def test_a_search_that_is_stopped_leaves_no_row() -> None:
    grid = floor_for(draw_floor("...."), "differential", 1, 1, "undirected").grid
    tables = distance_tables(grid, False, MIB)
    goal = int(tables.drivable[0])
    assert row_to(grid.read_only(), np.ones(1, np.int64), tables, 0, goal, 1) == NIL
    row = row_to(grid.read_only(), np.zeros(1, np.int64), tables, 0, goal, 1)
    assert distance_from(tables, row, int(tables.drivable[3]), 2) == 3
