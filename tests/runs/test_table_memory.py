"""The memory for distance tables decides nothing but the speed, and says what it lacks."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from reference_costs import CostSet
from reference_paths import FAR

from automaton.runs.simulation import Simulation, tables_in
from automaton.strategy.api import (
    NIL,
    DistanceTables,
    InputError,
    Strategy,
    Struct,
    cost_at,
    cost_in,
    table_of,
    weighted_table_of,
    weighted_tables,
)
from automaton.units import bytes_of, memory
from automaton.world.resolve import resolve


def test_a_run_with_room_for_few_tables_is_the_same_run() -> None:
    """tabletop-1 has more goals than these rows, so that tables are computed again and again."""
    large = Simulation(resolve("tabletop-1", ["fleet.robots=3"]))
    small = Simulation(resolve("tabletop-1", ["fleet.robots=3", "world.distance_tables=2 KiB"]))
    large.run()
    small.run()
    goals = np.count_nonzero(large.workspace.tables.owner != NIL)
    assert small.workspace.tables.status.rows < goals
    assert small.digest == large.digest


def test_runs_on_one_floor_have_the_room_that_each_asks_for() -> None:
    for budget in ("2 KiB", "1 GiB", "2 KiB"):
        run = Simulation(resolve("tabletop-1", [f"world.distance_tables={budget}"]))
        assert run.workspace.tables.pool.nbytes <= bytes_of(budget)
        del run


@pytest.mark.parametrize(
    ("budget", "says"),
    [
        (
            "1 KiB",
            r"is 1 KiB, but a table of the [\d,]+ cells of this floor takes [\d.]+ KiB; set it",
        ),
        ("1 GB", r"must be a number above 0 and KiB, MiB, GiB or TiB, .*, found '1 GB'"),
        ("0 MiB", "must be a number above 0"),
        ("1024", "must be a number above 0"),
    ],
)
def test_memory_that_is_none_or_holds_no_table_is_refused(budget: str, says: str) -> None:
    with pytest.raises(InputError, match=r"world\.distance_tables " + says):
        resolve("warehouse-100", [f"world.distance_tables={budget}"])


def test_memory_is_written_as_it_is_read() -> None:
    for text in ("1 KiB", "1.5 MiB", "512 MiB", "1 GiB"):
        assert memory(bytes_of(text)) == memory(bytes_of(text.replace(" ", ""))) == text
    assert memory(1) == "0.1 KiB"
    assert memory(bytes_of("3 MiB") + 1) == "3.1 MiB"


def test_more_memory_than_the_machine_has_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def build_tables(*_: Any) -> None:
        raise MemoryError

    monkeypatch.setattr("automaton.world.prepared_floor.build_tables", build_tables)
    with pytest.raises(InputError, match="is 3 TiB, more than this machine can give; set it lower"):
        Simulation(resolve("tabletop-mini", ["world.distance_tables=3 TiB"]))


def test_tables_of_a_strategy_take_as_much_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def build_tables(*_: Any) -> None:
        raise MemoryError

    view = Simulation(resolve("tabletop-mini", ["world.distance_tables=3 MiB"])).view
    monkeypatch.setattr("automaton.strategy.weighted_tables.build_tables", build_tables)
    with pytest.raises(
        InputError, match=r"is 3 MiB, and the tables of a strategy .* same amount again"
    ):
        weighted_tables(view, np.full((len(view.grid.kind), 4), 2), 2)


def test_a_table_of_the_lattice_takes_no_more_than_one_of_ticks() -> None:
    """So that what `check` says of the one holds for the other."""
    settings = ["strategy.right_of_way.name=epibt", "strategy.right_of_way.guidance=lattice"]
    run = Simulation(resolve("sorting", [*settings, "fleet.robots=2"]))
    (lattice,) = tables_in(run._states)
    assert (lattice.is_narrow, run.workspace.tables.is_narrow) == (1, 1)
    assert lattice.pool.size == run.workspace.tables.pool.size


class KeepsAll(Strategy):
    """Allocation that wants the tables to all cells of the floor in one tick."""

    layer = "allocation"

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        for cell in view.grid.drivable.tolist():
            table = table_of(view, workspace, 0, cell)
            assert cost_at(view, workspace, table, cell, 0) == (0 if table != NIL else FAR)


def test_a_tick_that_needs_more_tables_than_fit_ends_the_run_in_a_sentence() -> None:
    settings = [f"strategy.allocation={__name__}:KeepsAll", "fleet.robots=2"]
    enough = Simulation(resolve("tabletop-1", settings))
    enough.run(until=1)
    table = 4 * len(enough.view.grid.drivable)  # bytes: two axes
    rows = bytes_of("2 KiB") // table
    scarce = Simulation(resolve("tabletop-1", [*settings, "world.distance_tables=2 KiB"]))
    sentence = (
        rf"tick 1 needs more distance tables than fit in world.distance_tables (2 KiB), which holds "
        rf"{rows - 1} tables of {memory(table)}; set it to {memory(3 * table)} to hold one table "
        r"for each of 2 robots"
    )
    with pytest.raises(InputError, match=re.escape(sentence)):
        scarce.run()


class Guided(Struct):
    """The state of a strategy with weights of its own."""

    tables: DistanceTables


class PrefersEast(Strategy):
    """Allocation for whose robots a step east costs 2, any other 6; it notes what it finds."""

    layer = "allocation"

    def reset(self, view: Any) -> Guided:
        step = np.full((len(view.grid.kind), 4), 6)
        step[:, 0] = 2
        return Guided.sized(tables=weighted_tables(view, step, 3))

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        tables = Guided.of(memory).tables
        goal = int(view.grid.drivable[0])
        table = weighted_table_of(view, tables, 0, goal)
        cells = [(cell, axis) for cell in view.grid.drivable.tolist() for axis in (0, 1)]
        FOUND.update({pose: int(cost_in(tables, table, *pose)) for pose in cells})


FOUND: dict[tuple[int, int], int] = {}


def test_a_strategy_has_tables_with_weights_of_its_own() -> None:
    run = Simulation(resolve("tabletop-1", [f"strategy.allocation={__name__}:PrefersEast"]))
    run.run(until=1)
    floor_plan = run.resolved.floor_plan
    step = {(c, d): 2 if d == 0 else 6 for c in range(floor_plan.kind.size) for d in range(4)}
    costs = CostSet(floor_plan, "rail", step, 3).costs_to(int(run.view.grid.drivable[0]))
    assert {pose: costs.get(pose, FAR) for pose in FOUND} == FOUND


@pytest.mark.parametrize(
    ("shape", "cost", "says"),
    [((1, 4), 1, "cannot reshape"), (None, 0, "a step must cost at least 1")],
)
def test_weights_that_are_no_costs_of_this_floor_are_refused(
    shape: Any, cost: int, says: str
) -> None:
    view = Simulation(resolve("tabletop-1")).view
    with pytest.raises(ValueError, match=says):
        weighted_tables(view, np.full(shape or (len(view.grid.kind), 4), cost), 1)
