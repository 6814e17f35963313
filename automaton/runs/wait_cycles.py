"""Find wait cycles in a state: robots that wait for each other, and so the robots of a deadlock."""

from __future__ import annotations

import numpy as np

from automaton.engine.blocker_cycles import walk_to_cycle
from automaton.engine.state import NIL, Array, World


def find_wait_cycles(world: World, last_worked: Array) -> list[tuple[int, ...]]:
    """Identities of the robots of each wait cycle, each waiting for the next, the least one first.

    `last_worked`: storage indices of robots that have got nowhere for long. One that is to enter a cell
    for one robot waits for who stands there or enters it.
    """
    blockers = blockers_of(world, last_worked)
    robots, cycles = world.robots, []
    identity, color = np.full(len(robots.cell), NIL, np.int32), np.zeros(len(robots.cell), np.int32)
    for i, blocker in blockers.items():
        identity[i] = robots.identity[blocker]
    for start in blockers:
        first = NIL if color[start] else int(walk_to_cycle(identity, robots.at_index, color, start))
        if first != NIL:
            cycle = [first]
            while blockers[cycle[-1]] != first:
                cycle.append(blockers[cycle[-1]])
            cycles.append(_identities(world, cycle))
    return sorted(cycles)


def blockers_of(world: World, last_worked: Array) -> dict[int, int]:
    """Return which robot blocks the next cell of each of these robots, by storage indices."""
    robots, grid = world.robots, world.grid
    holder: dict[int, int] = {}
    for place in (robots.cell, robots.claim):
        held = np.flatnonzero(place != NIL)
        holder |= dict(zip(place[held].tolist(), held.tolist(), strict=True))
    blocker = {}
    for i in last_worked.tolist():
        if robots.cell[i] == NIL or robots.route_index[i] >= robots.route_length[i]:
            continue
        wanted = int(robots.cell[i] + grid.offset[robots.route[i, robots.route_index[i]]])
        if int(grid.cell_flags[wanted]) >> 5 & 3 == 1 and holder.get(wanted, i) != i:
            blocker[i] = holder[wanted]
    return blocker


def _identities(world: World, cycle: list[int]) -> tuple[int, ...]:
    names = [int(world.robots.identity[i]) for i in cycle]
    least = names.index(min(names))
    return (*names[least:], *names[:least])
