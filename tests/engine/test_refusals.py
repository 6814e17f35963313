"""Each rule of decisions, broken on purpose: the checks name the rule that a decision breaks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from small_runs import SmallRun

from automaton.engine.commit import (
    bar_to_charging,
    bar_to_dropping,
    bar_to_goal,
    bar_to_taking,
    plan_flaw,
)
from automaton.engine.operations import route_flaw
from automaton.engine.refusals import DECISION_RULES, LATEST_REFUSALS, STEP_BITS
from automaton.engine.right_of_way import bar_to_step
from automaton.engine.state import (
    BATTERY_FULL,
    NIL,
    ORDER_DELIVERED,
    ORDER_STARTED,
    ORDER_WAITING,
)
from automaton.engine.zoning import flaw_of
from automaton.runs.simulation import Simulation
from automaton.strategy.api import (
    CMD_GO,
    CMD_HOLD,
    CMD_PARK,
    CMD_RETREAT,
    CMD_STEP,
    CMD_TURN,
    CMD_WAIT,
    Strategy,
)
from automaton.world.resolve import resolve


def name_of(rule: Any) -> str:
    """The name of a rule; "" if none is broken."""
    return "" if rule == NIL else DECISION_RULES[int(rule)].name


class Loaded:
    """A run of `depots` in which robot `i` has a load and robot `j` has neither load nor order."""

    def __init__(self) -> None:
        self.run = Simulation(resolve("depots", ["orders.count=40"]))
        robots = self.run.world.robots
        while not (robots.load != NIL).any():
            self.run.run(self.run.tick + 1)
        self.world, self.robots = self.run.world, robots
        self.out = self.run.decisions.allocation
        self.out.order_taken[:] = 0
        self.i = int(np.flatnonzero(robots.load != NIL)[0])
        self.j = int(np.flatnonzero(robots.load == NIL)[0])
        robots.order[self.j] = NIL
        waiting = (self.world.orders.state == ORDER_WAITING) & (
            self.world.orders.reserved_by == NIL
        )
        self.order = int(np.flatnonzero(waiting)[0])
        self.slot = int(self.world.orders.target[self.robots.load[self.i]])

    def cut_off(self) -> None:
        """From now on no robot reaches any cell."""
        none = np.zeros_like(self.world.slots.reachable)
        self.world = self.world.replaced(slots=self.world.slots.replaced(reachable=none))

    def access(self, slot: int) -> int:
        """A cell from which a slot is served."""
        return int(self.world.slots.access[slot].max())

    def taking(self, order: int, robot: int | None = None) -> str:
        return name_of(
            bar_to_taking(self.world, self.j if robot is None else robot, order, self.out)
        )

    def dropping(self, slot: int, cell: int | None = None, robot: int | None = None) -> str:
        goal = self.access(slot) if cell is None else cell
        robot = self.i if robot is None else robot
        return name_of(bar_to_dropping(self.world, robot, slot, goal))

    def charging(self, robot: int, cell: int, target: int = BATTERY_FULL) -> str:
        return name_of(bar_to_charging(self.world, robot, cell, target))


@pytest.fixture
def loaded() -> Loaded:
    return Loaded()


def test_the_order_that_a_robot_takes_waits_and_is_its_own(loaded: Loaded) -> None:
    world, order = loaded.world, loaded.order
    assert loaded.taking(order) == ""
    assert loaded.taking(order, loaded.i) == "order with a load"
    assert loaded.taking(len(world.orders.state)) == "order"
    world.orders.weight[order] = 2**31 - 1
    world.rules.payload[:] = 5
    assert loaded.taking(order) == "payload"
    world.orders.weight[order] = 1
    loaded.world = world.replaced(rules=world.rules.replaced(assigned=1))
    is_own = order % len(loaded.robots.cell) == loaded.robots.identity[loaded.j]
    assert loaded.taking(order) == ("" if is_own else "assigned order")
    loaded.world = world
    world.orders.reserved_by[order] = loaded.robots.identity[loaded.i]
    assert loaded.taking(order) == "reserved order"
    world.orders.state[order] = ORDER_DELIVERED
    assert loaded.taking(order) == "order waits"


def test_an_order_begins_where_its_load_is_and_the_robot_can_get(loaded: Loaded) -> None:
    world, order = loaded.world, loaded.order
    cell = loaded.access(int(world.orders.current_slot[order]))
    assert name_of(bar_to_goal(world, loaded.j, order, cell)) == ""
    assert name_of(bar_to_goal(world, loaded.j, order, 0)) == "first goal"
    loaded.cut_off()
    assert name_of(bar_to_goal(loaded.world, loaded.j, order, cell)) == "way to an order"


def test_a_load_is_dropped_at_an_empty_slot_that_no_other_robot_has_reserved(
    loaded: Loaded,
) -> None:
    world, slot = loaded.world, loaded.slot
    assert loaded.dropping(slot) == ""
    assert loaded.dropping(slot, robot=loaded.j) == "drop-off without a load"
    assert loaded.dropping(len(world.slots.cell), 0) == "slot"
    assert loaded.dropping(slot, 0) == "cell of a drop-off"
    world.slots.unbounded[slot] = 0
    world.slots.reserved_by[slot] = loaded.robots.identity[loaded.j]
    assert loaded.dropping(slot) == "reserved slot"
    world.slots.content[slot] = 0
    assert loaded.dropping(slot) == "full slot"
    world.slots.unbounded[slot] = 1
    world.stations.at[slot] = NIL
    world.orders.target[loaded.robots.load[loaded.i]] = NIL
    assert loaded.dropping(slot) == "target"
    loaded.cut_off()
    assert loaded.dropping(slot) == "way to a slot"


def test_a_plan_holds_orders_that_wait(loaded: Loaded) -> None:
    out, world = loaded.out, loaded.world
    if out.order_queue.shape[1] == 0:
        assert name_of(plan_flaw(world, out, 0, np.int64(1))[0]) == "length of a plan"
        return
    for order, expected in ((loaded.order, ""), (10**6, "order of a plan")):
        out.order_queue[0, 0] = order
        assert name_of(plan_flaw(world, out, 0, np.int64(1))[0]) == expected


def test_a_robot_charges_at_a_charger_in_reach_without_load_or_order(loaded: Loaded) -> None:
    world = loaded.world
    charger = int(world.chargers.cell[0])
    assert loaded.charging(loaded.j, charger) == ""
    assert loaded.charging(loaded.j, charger, 0) == "charge target"
    assert loaded.charging(loaded.j, charger, BATTERY_FULL + 1) == "charge target"
    assert loaded.charging(loaded.i, charger) == "charging with a load"
    assert loaded.charging(loaded.j, NIL) == "end of charging"
    assert loaded.charging(loaded.j, 0) == "charger"
    loaded.cut_off()
    assert loaded.charging(loaded.j, charger) == "way to a charger"


def test_robots_on_rails_turn_only_on_turntables() -> None:
    run = SmallRun("A.\n..", kinematics="rail")
    i = run.index("A")
    assert {name_of(bar_to_step(run.world, i, way)) for way in (0, 1)} == {"", "turn of a step"}
    steps = np.array([0, 1], np.uint8)
    rules = {name_of(route_flaw(run.world, i, steps[k:], 1)[0]) for k in (0, 1)}
    assert rules == {"", "turn of a route"}


def test_the_value_of_a_route_is_the_step_and_its_direction() -> None:
    run = SmallRun("A..\n...")
    rule, value = route_flaw(run.world, run.index("A"), np.array([0, 0, 7], np.uint8), 3)
    assert name_of(rule) == "direction of a route"
    assert (value >> STEP_BITS, value & 255) == (2, 7)
    rule, value = route_flaw(run.world, run.index("A"), np.array([0, 0, 0], np.uint8), 3)
    assert (name_of(rule), value >> STEP_BITS) == ("exit of a route", 2)
    assert name_of(route_flaw(run.world, run.index("A"), np.zeros(3, np.uint8), -4)[0]) == (
        "length of a route"
    )


def test_a_point_is_in_one_zone() -> None:
    run = Simulation(resolve("factory"))
    run.run(200)
    design = run.decisions.zoning.design.copied()
    now = run.world.service_zones.design
    for name in ("zone", "owner", "ends", "points", "path", "transfer"):
        getattr(design, name)[:] = getattr(now, name)
    design.segments = int(now.segments)
    assert name_of(flaw_of(run.world, design)[0]) == ""
    used = int(design.segments)
    if used >= 2:
        other = next(k for k in range(used) if design.owner[k] != design.owner[0])
        design.path[0, 1] = design.path[other, 1]
        assert name_of(flaw_of(run.world, design)[0]) in ("overlap", "path of a segment")


def test_the_latest_decisions_are_a_ring_and_the_counts_are_whole() -> None:
    run = Simulation(resolve("tabletop-mini", ["strategy.routing=example_strategies:Nowhere"]))
    run.run(200)
    refusals = run.world.refusals
    total = int(refusals.count.total)
    assert total > LATEST_REFUSALS
    assert refusals.by_rule.sum() == total == run.world.tally.illegal.sum()
    ticks = np.sort(refusals.latest[:, 0])
    assert ticks[-1] == run.tick and ticks[0] >= run.tick - LATEST_REFUSALS
    assert (refusals.first[:, 0] == np.sort(refusals.first[:, 0])).all()


def test_who_has_begun_an_order_gets_no_other_and_is_not_sent_to_charge(loaded: Loaded) -> None:
    world, robots = loaded.world, loaded.robots
    begun = int(robots.load[loaded.i])
    robots.order[loaded.j] = begun
    world.orders.state[begun] = ORDER_STARTED
    assert loaded.taking(loaded.order) == "order begun"
    assert loaded.charging(loaded.j, int(world.chargers.cell[0])) == "charging with an order"


def test_a_pod_is_served_first_and_then_stored_at_a_storage_place() -> None:
    run = Simulation(resolve("goods-mini"))
    robots, world = run.world.robots, run.world
    seen = set()
    while not run.finished and len(seen) < 2:
        run.run(run.tick + 1)
        for i in np.flatnonzero(robots.load != NIL).tolist():
            for slot in range(len(world.slots.cell)):
                for cell in set(world.slots.access[slot].tolist()) - {NIL}:
                    seen.add(name_of(bar_to_dropping(world, i, slot, cell)))
        seen &= {"open stops", "place of a pod"}
    assert seen == {"open stops", "place of a pod"}


class Orders(Strategy):
    """A right of way that gives all robots one command."""

    layer = "right_of_way"
    period = 1

    def __init__(self, command: int, value: int, steers: bool) -> None:
        super().__init__()
        self.command, self.value, self.steers = command, value, steers

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        out = decisions.right_of_way
        out.command[: batch.count], out.value[: batch.count] = self.command, self.value


@pytest.mark.parametrize(
    ("command", "value", "steers", "rule"),
    [
        (CMD_STEP, 4, False, "direction of a step"),
        (CMD_STEP, 3, False, "exit of a step"),
        (CMD_STEP, 0, False, "turn of a step"),
        (CMD_WAIT, 0, False, "wait"),
        (CMD_RETREAT, 20_000, False, "retreat"),
        (CMD_GO, 0, False, "command of right of way"),
        (CMD_GO, -1, True, "direction"),
        (CMD_GO, 3, True, "exit"),
        (CMD_GO, 0, True, "turn"),
        (CMD_HOLD, 4, True, "hold"),
        (CMD_WAIT, 20_000, True, "wait"),
        (CMD_STEP, 0, True, "command of steering"),
        (CMD_TURN, 2, True, "quarter turn"),
        (CMD_TURN, 1, False, "place of a turn"),
    ],
)
def test_each_rule_of_right_of_way(command: int, value: int, steers: bool, rule: str) -> None:
    strategy = Orders(command, value, steers)
    run = SmallRun("A.\n..", kinematics="rail", strategies={"right_of_way": strategy}).tick()
    row = run.world.refusals.first[0].tolist()
    assert (row[0], row[1], name_of(row[2]), row[4]) == (1, 0, rule, 1)
    assert row[3] == (command if "command" in rule else value)


def test_a_robot_with_an_order_does_not_park() -> None:
    class Parks(Strategy):
        layer = "allocation"

        def decide(self, view: Any, batch: Any, out: Any, memory: Any, workspace: Any) -> None:
            out.allocation.command[: batch.count] = CMD_PARK

    run = SmallRun("A$d", strategies={"allocation": Parks()})
    run.world.robots.order[0] = 0
    run.tick()
    assert name_of(run.world.refusals.first[0, 2]) == "parking with work"
