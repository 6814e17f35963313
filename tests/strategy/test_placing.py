"""Where pods are stored: the distance tables give the same slot as a search of the floor."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from example_counts import examples
from pod_floors import CLASSES, drawn_pods

from automaton.engine.state import NIL
from automaton.engine.table_rows import forget
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.strategy.placing import ANY_CLASS, nearest_free, searched_free
from automaton.world.resolve import resolve

FLOORS = examples(40)
GOODS = "goods-60x40"
ROOM_FOR_FEW = "world.distance_tables=700 KiB"  # a table of this floor takes 15 kB


def fill_at_random(run: Simulation, chance: Random) -> None:
    """Empty most slots, take some of them, and forget some tables."""
    slots, tables = run.world.slots, run.workspace.tables
    for slot in range(int(slots.first_spare)):
        slots.content[slot] = chance.choice((NIL, NIL, NIL, 0))
        slots.reserved_by[slot] = chance.choice((NIL, NIL, NIL, 0))
    for row in range(len(tables.owner)):
        if chance.random() < 0.3:
            forget(tables, row)


def searches(run: Simulation) -> int:
    return int(run.workspace.generation[0])


def compare(run: Simulation, chance: Random) -> int:
    """Ask for a slot for each robot on the floor; in how many cases that took no search."""
    looked_up = 0
    for i in np.flatnonzero(run.world.robots.cell != NIL):
        wanted, left = chance.randrange(ANY_CLASS, len(CLASSES)), chance.random() < 0.5
        asked = (run.world.read_only(), run.decisions.allocation, run.workspace, i, wanted, left)
        before = searches(run)
        slot = nearest_free(*asked)
        looked_up += slot != NIL and searches(run) == before
        assert slot == searched_free(*asked), (i, wanted, left)
    return looked_up


def test_on_random_floors_tables_and_searches_agree() -> None:
    looked_up = floors = 0
    for number in range(FLOORS):
        chance = Random(number)
        try:
            run = Simulation(drawn_pods(number))
        except InputError:
            continue
        floors += 1
        run.run(chance.randint(1, 150))
        for _ in range(5):
            fill_at_random(run, chance)
            looked_up += sum(compare(run, chance) for _ in range(3))
    assert floors > FLOORS // 3 and looked_up > floors


@pytest.mark.parametrize(("settings", "is_searched"), [((), False), ((ROOM_FOR_FEW,), True)])
def test_the_floor_is_searched_where_memory_for_tables_is_short(
    settings: tuple[str, ...], is_searched: bool
) -> None:
    """Once the tables of all free slots are there, no search is needed."""
    run, chance = Simulation(resolve(GOODS, settings)), Random(1)
    run.run(500)
    for _ in range(60):
        compare(run, chance)
    before, robots = searches(run), int((run.world.robots.cell != NIL).sum())
    looked_up = compare(run, chance)
    assert (looked_up < robots) == is_searched
    assert (searches(run) > before + robots) == is_searched, "one of each is that of the comparison"
