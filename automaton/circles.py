"""Find wait cycles in a state: robots that wait for each other, and so the robots of a deadlock."""

from __future__ import annotations

import numpy as np

from automaton.kernels.blocker_cycles import walk_to_cycle
from automaton.world.state import NIL, Array, World


def circles(world: World, still: Array) -> list[tuple[int, ...]]:
    """Identities of the robots of each wait cycle, each waiting for the next, the least one first.

    `still`: storage indices of robots that have got nowhere for long. One that is to enter a cell
    for one robot waits for who stands there or enters it.
    """
    keeper = keepers(world, still)
    robots, found = world.robots, []
    blocker, color = np.full(len(robots.cell), NIL, np.int32), np.zeros(len(robots.cell), np.int32)
    for i, other in keeper.items():
        blocker[i] = robots.identity[other]
    for start in keeper:
        first = (
            int(walk_to_cycle(blocker, robots.at_index, color, start)) if not color[start] else NIL
        )
        if first != NIL:
            circle = [first]
            while keeper[circle[-1]] != first:
                circle.append(keeper[circle[-1]])
            found.append(_named(world, circle))
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
