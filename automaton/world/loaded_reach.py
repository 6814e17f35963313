"""Where robots with a load get to: from where loads lie to where they go, over what is open to them.

Areas may be closed to robots with a load, or to those without one. Then a slot is served only from
cells that a robot reaches without a load, from where it begins and back, and in which it may be with
one; and from any such cell beside its slot an order has a way to any one beside its target.
On a floor with storage that is: to all stations, and back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.engine.state import NIL, Array
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.loaded_ways import has_storage, to_and_from
from automaton.floor.reachability import Mask, reached, slot_access
from automaton.scenario.robot_types import RobotType, floor_by_type, rows_of


class LoadEnds(NamedTuple):
    """Between which cells loads are carried."""

    sources: Array  # flat cells of slots
    targets: Array
    stops: Array  # flat cells in which robots stand with a load on their way


def has_closed_ways(floor_plan: FloorPlan, types: tuple[RobotType, ...]) -> bool:
    """Whether robots with a load get to other cells than those without one."""
    return has_storage(floor_plan) or any(one.closed_empty != one.closed_loaded for one in types)


def reached_with_load(
    floor_plan: FloorPlan, types: tuple[RobotType, ...], within: Mask, ends: LoadEnds
) -> Mask:
    """(K, C) the cells that robots of each type get to with a load, and on from there.

    `within`: (K, C) those that they get to without one, from where they begin and back.
    """
    by_row = floor_by_type(floor_plan, rows_of(types, True))
    result = within.copy()
    for kind, rail in enumerate(one.rail for one in types):
        plan = by_row.floor_plans[len(types) + kind]
        result[kind] &= ~by_row.closed[len(types) + kind]
        if has_storage(floor_plan):
            for station in floor_plan.stations.tolist():
                result[kind] &= to_and_from(plan, station, rail)
            continue
        begin, end = (stands(floor_plan, cells, ends.stops, result[kind]) for cells in ends[:2])
        result[kind] &= reached(plan, begin, rail) & reached(plan, end, rail, backwards=True)
    return result


def stands(floor_plan: FloorPlan, slots: Array, stops: Array, usable: Mask) -> list[int]:
    """The usable cells from which slots, by flat cell, are served, and the stops."""
    number = np.full(floor_plan.kind.size, NIL, np.int64)
    number[floor_plan.slots] = np.arange(len(floor_plan.slots))
    access = slot_access(floor_plan)[number[slots]].reshape(-1)
    cells = np.unique(np.concatenate([access[access != NIL], stops])).astype(np.int64)
    result: list[int] = cells[usable[cells]].tolist()
    return result


def served_with_load(access: Array, loaded: Mask) -> Mask:
    """(K, s) whether robots of each type serve a slot from a cell that they get to with a load too.

    `access`: (s, 4) cells beside slots, or NIL.
    """
    served: Mask = ((access != NIL) & loaded[:, access]).any(axis=2)
    return served


def parted_ends(
    plan: FloorPlan, begin: list[int], end: list[int], rail: bool, known: dict[int, Mask]
) -> tuple[int, int]:
    """A cell where loads are picked up and one where they are dropped, without a way; else (NIL, NIL).

    `plan`: with the exits that are open to robots with a load. `known`: what is reached from cells, on
    this plan; what is found is added.
    """
    left, ends = set(begin), np.array(end, np.int64)
    while left and len(ends):
        first = min(left)
        if first not in known:
            known[first] = reached(plan, [first], rail)
        lost = ends[~known[first][ends]]
        if lost.size:
            return first, int(lost[0])
        left.remove(first)
        if not left:
            break
        # Whoever gets to that cell gets wherever one gets from there.
        before = reached(plan, [first], rail, backwards=True)
        left = {cell for cell in left if not before[cell]}
    return NIL, NIL
