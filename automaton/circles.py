"""Find wait cycles in a state: robots that wait for each other, and so the robots of a deadlock."""

from __future__ import annotations

import numpy as np

from automaton.world.state import NIL, Array, World


def circles(world: World, still: Array) -> list[tuple[int, ...]]:
    """Identities of the robots of each wait cycle, each waiting for the next, the least one first.

    `still`: storage indices of robots that have got nowhere for long. One that is to enter a cell
    for one robot waits for who stands there or enters it. No robot waits for two, so every walk
    along those who keep each other ends, or comes to one wait cycle.
    """
    keeper = keepers(world, still)
    found: list[tuple[int, ...]] = []
    seen: set[int] = set()
    for first in still.tolist():
        walk: list[int] = []
        i = first
        while i in keeper and i not in seen:
            seen.add(i)
            walk.append(i)
            i = keeper[i]
        if i in walk:
            found.append(_named(world, walk[walk.index(i) :]))
    return sorted(found)


def keepers(world: World, still: Array) -> dict[int, int]:
    """Who keeps each of these robots from its next cell, by storage indices."""
    robots, grid = world.robots, world.grid
    holder: dict[int, int] = {}
    for place in (robots.cell, robots.claim):
        held = np.flatnonzero(place != NIL)
        holder |= dict(zip(place[held].tolist(), held.tolist(), strict=True))
    keeper = {}
    for i in still.tolist():
        if robots.cell[i] == NIL or robots.route_index[i] >= robots.route_length[i]:
            continue
        wanted = int(robots.cell[i] + grid.offset[robots.route[i, robots.route_index[i]]])
        if int(grid.cell_flags[wanted]) >> 5 & 3 == 1 and holder.get(wanted, i) != i:
            keeper[i] = holder[wanted]
    return keeper


def _named(world: World, circle: list[int]) -> tuple[int, ...]:
    names = [int(world.robots.identity[i]) for i in circle]
    least = names.index(min(names))
    return (*names[least:], *names[:least])
