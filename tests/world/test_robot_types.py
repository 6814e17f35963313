"""Robots of several types: how fast they are, what they carry, where they may not go."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from panel_harness import busy, moment, of_cell, of_robot, shown

from automaton.commands.check import described
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.headless import run_once
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.strategy import lookup, paths
from automaton.strategy.api import ACTION_MOVE, CMD_TAKE_ORDER, NIL, ORDER_DELIVERED, Strategy
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve
from automaton.world.scenario_warnings import scenario_warnings
from tui.widgets.inspector import Inspector
from tui.widgets.robot_table import ROBOT_TABLE_COLUMNS

TUG = {"name": "tug", "robots": 1, "move_time_factor": 3, "payload": 5}
SHUTTLE = {"name": "shuttle", "payload": 2}

# The short way from the left to the right leads through the middle row.
FLOOR = """\
.......
s..#..s
..#.#..
d..#..d
......."""
MIDDLE = """\
.....
s...d
.....
s...d
....."""


def scene(picture: str, starts: list[tuple[int, int]], **parts: Any) -> Resolved:
    """A scenario on a drawn floor; `types` and further keys of the fleet, and the other parts."""
    fleet = {"robots": len(starts), "kinematics": "omni", "start": starts}
    fleet |= {key: parts.pop(key) for key in ("types",) if key in parts}
    scenario = {
        "name": "types",
        "layout": {"picture": picture},
        "fleet": fleet,
        "orders": {"list": [{"from": (0, 1), "to": (4, 1)}]},
        "stop": {"when": "delivered", "max_duration": 2000},
        **parts,
    }
    return resolve(msgspec.convert(scenario, Scenario))


def ran(resolved: Resolved, until: int | None = None) -> Simulation:
    """Run it, recorded and validated; nothing may be illegal."""
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    simulation.run(until)
    report = validate_stored(recorder.recording())
    assert report.valid, report.violations[:3]
    assert not simulation.world.tally.illegal.any()
    return simulation


def visited(simulation: Simulation, robot: int) -> set[tuple[int, int]]:
    """The cells where a robot was, one by one; the simulation is at tick 0."""
    cells = set()
    while not simulation.finished and simulation.tick < 2000:
        simulation.run(simulation.tick + 1)
        cells.add(simulation.resolved.floor_plan.xy(int(simulation.world.robots.cell[robot])))
    return cells


def two(heavy: int = 1, **more: Any) -> Resolved:
    """A tug at (1, 0), a shuttle at (1, 4), and an order at each of two shelves."""
    orders = {
        "list": [
            {"from": (0, 1), "to": (4, 1), "weight": heavy},
            {"from": (0, 3), "to": (4, 3)},
        ]
    }
    return scene(MIDDLE, [(1, 0), (1, 4)], **{"types": (TUG, SHUTTLE), "orders": orders, **more})


# Pace.


def test_a_slow_robot_takes_its_own_ticks_for_a_move_and_is_not_slowed_by_that() -> None:
    alike = ran(scene(MIDDLE, [(1, 0)]))
    slow = ran(scene(MIDDLE, [(1, 0)], types=({"name": "tug", "move_time_factor": 3},)))
    moves = int(alike.world.tally.operations[0, ACTION_MOVE].sum())
    assert int(slow.world.tally.operations[0, ACTION_MOVE].sum()) == moves
    assert slow.tick == alike.tick + 2 * moves
    assert not slow.world.tally.slowdown_ticks.any()


def test_distances_are_in_the_ticks_of_the_robot_that_drives() -> None:
    run = Simulation(two())
    for robot, factor in ((0, 3), (1, 1)):
        target = run.resolved.floor_plan.cell(3, int(2 - 2 * robot + 2))
        start = paths.position(run.view, robot)
        steps = sum(
            abs(a - b)
            for a, b in zip(*map(run.resolved.floor_plan.xy, (start, target)), strict=True)
        )
        assert paths.distance(run.view, run.workspace, robot, target) == factor * steps
    robots, cells = np.arange(2), [run.resolved.floor_plan.cell(x, 2) for x in range(1, 4)]
    rows = paths.distances(run.view, run.workspace, robots[:, None], cells)
    assert rows.tolist() == [
        [paths.distance(run.view, run.workspace, robot, cell) for cell in cells] for robot in (0, 1)
    ]
    with pytest.raises(IndexError, match="there is no cell 9000: the last one is"):
        paths.distances(run.view, run.workspace, robots, 9000)


def test_slow_zones_multiply_the_pace() -> None:
    lane = "s......d"
    orders = {"list": [{"from": (0, 0), "to": (7, 0)}]}
    world = {"slowdown": "zones"}
    types = ({"name": "tug", "move_time_factor": 2},)
    simulation = ran(scene(lane, [(1, 0), (5, 0)], types=types, orders=orders, world=world), 3)
    tally = simulation.world.tally
    assert (tally.operations[0, ACTION_MOVE].sum(), tally.ticks[0, ACTION_MOVE].sum()) == (1, 4), (
        "2 robots, 2 ticks"
    )
    assert tally.slowdown_ticks[0] == 2


# Payload.


def test_heavy_orders_go_to_who_can_carry_them() -> None:
    simulation = ran(two(heavy=4))
    assert simulation.world.orders.dispatched_type.tolist() == [0, 1]
    assert simulation.finished


@pytest.mark.parametrize(
    "allocation",
    [
        *("independent", "cooperative", "adaptive", "first-come", "shortest-job", "auction"),
        "strategies.allocation.independent:IndependentPython",
        {"name": "auction", "mechanism": "combinatorial"},
        {"name": "auction", "mechanism": "exact"},
        {"name": "auction", "mechanism": "genetic"},
    ],
)
@pytest.mark.parametrize("closed", [False, True])
def test_every_allocation_takes_only_what_its_robots_can_do(allocation: Any, closed: bool) -> None:
    """Order 0 is too heavy for the shuttle; the tug cannot serve (4, 3) from the closed east."""
    areas = {"east": {"from": (3, 2), "to": (4, 4), "closed_to": ["tug"]}} if closed else {}
    simulation = ran(two(4, areas=areas, strategy={"allocation": allocation}))
    assert simulation.finished
    assert simulation.world.orders.dispatched_type[0] == 0
    if closed:
        assert simulation.world.orders.dispatched_type[1] == 1


# Areas.


def test_routes_lead_around_an_area_that_is_closed_to_the_type() -> None:
    """The tug goes round by the row below, the shuttle straight on."""
    closed = {"clean-room": {"from": (3, 0), "to": (3, 1), "closed_to": ["tug"]}}
    lane = "s.....d\n.......\n......."
    for name, through in (("tug", False), ("shuttle", True)):
        areas = {} if through else closed
        for routing in ("shortest", "astar", "traffic-avoidance", "congestion"):
            resolved = scene(
                lane,
                [(1, 0)],
                types=({"name": name},),
                areas=areas,
                orders={"list": [{"from": (0, 0), "to": (6, 0)}]},
                strategy={"routing": routing},
            )
            cells = visited(Simulation(resolved), 0)
            assert ((3, 0) in cells) == through, (name, routing)


def test_robots_begin_in_open_cells() -> None:
    closed = {"north": {"from": (0, 0), "to": (4, 2), "closed_to": ["tug"]}}
    parts: dict[str, Any] = {"types": ({**TUG, "robots": 2}, SHUTTLE), "areas": closed}
    for seed in range(10):
        scenario = {
            "name": "drawn",
            "layout": {"picture": MIDDLE},
            "fleet": {
                "robots": 4,
                "kinematics": "omni",
                "start": "random",
                "types": parts["types"],
            },
            "areas": closed,
            "orders": {"list": [{"from": (0, 3), "to": (4, 3)}]},
            "seed": seed,
        }
        simulation = Simulation(resolve(msgspec.convert(scenario, Scenario)))
        rows = [
            simulation.resolved.floor_plan.xy(int(cell))[1] for cell in simulation.world.robots.cell
        ]
        assert min(rows[:2]) > 2


def test_a_bay_that_opens_on_a_closed_cell_is_for_others() -> None:
    bays = "b....\nb...d\n#s..."
    closed = {"top": {"from": (0, 0), "to": (3, 0), "closed_to": ["tug"]}}
    scenario = {
        "name": "bays",
        "layout": {"picture": bays},
        "fleet": {
            "robots": 2,
            "kinematics": "omni",
            "types": ({"name": "tug", "robots": 1}, SHUTTLE),
        },
        "areas": closed,
        "orders": {"list": [{"from": (0, 2), "to": (3, 1)}]},
    }
    simulation = Simulation(resolve(msgspec.convert(scenario, Scenario)))
    xy = simulation.resolved.floor_plan.xy
    assert [xy(int(cell)) for cell in simulation.world.robots.bay] == [(-1, 1), (-1, 0)]


def test_a_charger_in_a_closed_area_is_none() -> None:
    """The near charger stands in an area that is closed to the tug: it takes the far one."""
    floor = "..c...\ns....d\n..c..."
    resolved = scene(
        floor,
        [(1, 0)],
        types=({"name": "tug"},),
        areas={"bay": {"from": (2, 0), "to": (2, 0), "closed_to": ["tug"]}},
        orders={"list": [{"from": (0, 1), "to": (5, 1)}]},
        battery={"drain": {"move": 1}, "charge_rate": 5, "initial_charge": 4},
        strategy={"charging": "insertion"},
    )
    cells = visited(Simulation(resolved), 0)
    assert (2, 0) not in cells and (2, 2) in cells


# What is illegal.


@pytest.mark.parametrize("what", ["weight", "area"])
def test_what_a_robot_cannot_do_is_an_illegal_answer(what: str) -> None:
    class Greedy(Strategy):
        """Takes order 0 whatever it weighs, from wherever it lies."""

        layer = "allocation"

        def decide(
            self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any
        ) -> None:
            out = decisions.allocation
            out.command[0], out.order[0] = CMD_TAKE_ORDER, 0
            out.goal_cell[0] = view.slots.access[view.orders.current_slot[0]].max()

    heavy = 6 if what == "weight" else 1
    areas = {"west": {"from": (0, 0), "to": (1, 2), "closed_to": ["tug"]}} if what == "area" else {}
    resolved = scene(
        MIDDLE,
        [(2, 0), (2, 4)],
        types=(TUG, {"name": "shuttle"}),
        areas=areas,
        orders={"list": [{"from": (0, 1), "to": (4, 1), "weight": heavy}]},
    )
    simulation = Simulation(resolved, strategies=[None, None, Greedy(), None, None])
    simulation.run(3)
    assert simulation.world.tally.illegal[2] >= 1
    assert simulation.world.robots.order[0] == NIL


def test_a_route_into_a_closed_cell_is_illegal() -> None:
    class Straight(Strategy):
        """Drives east."""

        layer = "routing"

        def decide(
            self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any
        ) -> None:
            for k in range(batch.count):
                decisions.routing.route_length[k] = 1
                decisions.routing.steps[k, 0] = 0

    resolved = two(areas={"east": {"from": (2, 0), "to": (2, 0), "closed_to": ["tug"]}})
    allocation = lookup.load("allocation", "independent")()
    simulation = Simulation(resolved, strategies=[None, None, allocation, Straight(), None])
    simulation.run(2)
    assert simulation.world.tally.illegal[3] >= 1
    assert resolved.floor_plan.xy(int(simulation.world.robots.cell[0])) == (1, 0)


# What users see.


def test_reports_tell_of_types() -> None:
    resolved = two(4, areas={"east": {"from": (3, 2), "to": (4, 4), "closed_to": ["tug"]}})
    outcome = run_once(resolved)
    assert [row["type"] for row in outcome.robots] == ["tug", "shuttle"]
    assert [(row["type"], row["robots"], row["delivered"]) for row in outcome.types] == [
        ("tug", 1, 1),
        ("shuttle", 1, 1),
    ]
    assert described(resolved).endswith("2 robots (tug 1, shuttle 1), east closed to tug, ok")


def test_the_viewer_tells_types_and_closed_cells() -> None:
    types = "fleet.types=[{name: tug, robots: 1, move_time_factor: 2, payload: 3}, {name: shuttle}]"
    areas = "areas={lane: {from: [4, 0], to: [4, 1], closed_to: [tug]}}"
    view = moment(50, "crossing", types, areas)
    assert "type tug: 2 x durations.move, carries up to 3" in shown(Inspector(), of_robot(view, 0))
    assert "type shuttle" in shown(Inspector(), of_robot(view, 1))
    assert "closed to tug" in shown(Inspector(), of_cell(view, 4, 0))
    assert "closed to" not in shown(Inspector(), of_cell(view, 5, 0))
    columns = {column.title: column for column in ROBOT_TABLE_COLUMNS if column.there(view)}
    assert [columns["type"].text(view, robot) for robot in (0, 1)] == ["tug", "shuttle"]
    assert "type" not in {column.title for column in ROBOT_TABLE_COLUMNS if column.there(busy())}


def test_an_order_that_needs_both_types_is_doubted() -> None:
    """The tug cannot leave the left half, the shuttle not the right one."""
    areas = {
        "left": {"from": (0, 0), "to": (1, 4), "closed_to": ["shuttle"]},
        "right": {"from": (3, 0), "to": (4, 4), "closed_to": ["tug"]},
    }
    resolved = scene(
        MIDDLE, [(1, 0), (3, 4)], types=({"name": "tug", "robots": 1}, SHUTTLE), areas=areas
    )
    assert any(
        "carried all the way by any single type" in sentence
        for sentence in scenario_warnings(resolved)
    )
    assert not scenario_warnings(two())


def test_one_type_that_may_do_all_is_what_a_fleet_without_types_is() -> None:
    for name in ("tabletop-1", "depots", "warehouse-100-trial"):
        plain = resolve(name)
        typed = resolve(name, ["fleet.types=[{name: any}]"])
        runs = Simulation(plain), Simulation(typed)
        for run in runs:
            run.run(400)
        assert runs[0].digest == runs[1].digest, name


# Properties.


@st.composite
def fleets(draw: st.DrawFn) -> Resolved:
    """Two types on the floor with a way through the middle, with a strategy for each layer."""
    factor, payload = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    closed = draw(st.sampled_from([(3, 0, 3, 0), (3, 4, 3, 4), (2, 0, 4, 1), (0, 2, 1, 2)]))
    weights = draw(st.lists(st.integers(1, 3), min_size=2, max_size=2))
    orders = [
        {"from": (0, 1), "to": (6, 3), "weight": weights[0]},
        {"from": (6, 1), "to": (0, 3), "weight": weights[1]},
    ]
    scenario = {
        "name": "drawn",
        "layout": {"picture": FLOOR},
        "fleet": {
            "robots": 3,
            "kinematics": draw(st.sampled_from(["omni", "differential"])),
            "start": [(1, 0), (5, 4), (1, 4)],
            "types": [
                {
                    "name": "tug",
                    "robots": draw(st.integers(1, 2)),
                    "move_time_factor": factor,
                    "payload": payload,
                    "kinematics": draw(st.sampled_from(["omni", "differential"])),
                },
                {"name": "shuttle"},
            ],
        },
        "areas": {"shut": {"from": closed[:2], "to": closed[2:], "closed_to": ["tug"]}},
        "orders": {"list": orders},
        "strategy": {
            "allocation": draw(st.sampled_from(["independent", "first-come", "auction"])),
            "routing": draw(st.sampled_from(["shortest", "astar", "congestion"])),
        },
        "stop": {"when": "never", "max_duration": 300},
        "seed": draw(st.integers(0, 99)),
    }
    return resolve(msgspec.convert(scenario, Scenario))


@settings(max_examples=60)
@given(fleets())
def test_no_rule_of_types_is_ever_broken(resolved: Resolved) -> None:
    simulation = ran(resolved)
    done = simulation.world.orders.state == ORDER_DELIVERED
    kinds = simulation.world.orders.dispatched_type[done]
    carried = simulation.world.rules.payload[kinds]
    assert (simulation.world.orders.weight[done] <= carried).all()


@settings(max_examples=20)
@given(fleets(), st.permutations(range(3)))
def test_storage_changes_nothing(resolved: Resolved, storage: list[int]) -> None:
    plain, stored = Simulation(resolved), Simulation(resolved, storage=np.array(storage))
    for run in (plain, stored):
        run.run(200)
    assert plain.digest == stored.digest
