"""The cells from which robots can come back: the largest part of a floor with ways to and fro."""

from __future__ import annotations

from automaton.exchange.graphs.roads import Cell
from automaton.floor.cells import DIRECTION_VECTORS


def largest_part(exits: dict[Cell, int]) -> set[Cell]:
    """Return the largest set of cells that all reach each other; of equal ones the first.

    The algorithm is R. Tarjan's (Depth-first search and linear graph algorithms, 1972), without
    recursion.
    """
    order: dict[Cell, int] = {}
    low: dict[Cell, int] = {}
    stack: list[Cell] = []
    on_stack: set[Cell] = set()
    best: list[Cell] = []
    for first in exits:
        if first in order:
            continue
        order[first] = low[first] = len(order)
        stack.append(first)
        on_stack.add(first)
        ways = [(first, iter(neighbours(exits, first)))]
        while ways:
            cell, ahead = ways[-1]
            for there in ahead:
                if there not in order:
                    order[there] = low[there] = len(order)
                    stack.append(there)
                    on_stack.add(there)
                    ways.append((there, iter(neighbours(exits, there))))
                    break
                if there in on_stack:
                    low[cell] = min(low[cell], order[there])
            else:
                ways.pop()
                if ways:
                    low[ways[-1][0]] = min(low[ways[-1][0]], low[cell])
                if low[cell] == order[cell]:
                    part = _cut(stack, cell)
                    on_stack.difference_update(part)
                    best = part if len(part) > len(best) else best
    return set(best)


def neighbours(exits: dict[Cell, int], cell: Cell) -> list[Cell]:
    """Return the cells to which robots drive from a cell."""
    ahead = [
        (cell[0] + dx, cell[1] + dy)
        for direction, (dx, dy) in enumerate(DIRECTION_VECTORS)
        if exits[cell] >> direction & 1
    ]
    return [there for there in ahead if there in exits]


def _cut(stack: list[Cell], cell: Cell) -> list[Cell]:
    """Take what lies on a stack from a cell on."""
    part = [stack.pop()]
    while part[-1] != cell:
        part.append(stack.pop())
    return part
