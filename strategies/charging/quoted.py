"""Charging by quotes: the rule that prices a robot's list in an auction also sends it to charge.

A robot is checked when it is free, has taken an order, or finds no order. The strategy's policy quotes
its list: the order that it has taken but not begun, then its plan. If the quote has a charging stop
before the first task, the robot gives the order back and goes to charge. If the list is infeasible,
tasks are removed from its end until the rest is feasible. Works with any allocation.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from automaton.strategy.api import (
    ACTION_WAIT,
    BATTERY_FULL,
    BATTERY_PERCENT,
    GOAL_CHARGE,
    NIL,
    ORDER_WAITING,
    REASON_IDLE,
    REASON_PERIODIC,
    Strategy,
    Struct,
    World,
    charging_ticks,
    field,
    first_cell,
    kernel,
)
from strategies.allocation.auction.floor_market import (
    FloorMarket,
    count_before,
    count_queues,
    enter_task,
    enter_waits,
    make_floor_market,
    measure_distances,
)
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_FILL_UP,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
)
from strategies.allocation.auction.quotes import quote, select_robot_type
from strategies.charging.charging_parameters import FillUp, Insertion, Opportunity, Threshold

# Reserve of an idle robot beyond the path to a charger, if waiting uses energy:
IDLE_ENERGY_MARGIN = BATTERY_FULL // 20


class ChargingState(Struct):
    """A parameter and scratch; nothing persists between calls."""

    idle_below: int = field("int64", "charge below which idle robots go to charge")
    market: FloorMarket  # scratch for the list of one robot


@kernel
def decide(view, batch, decisions, memory, workspace):
    """A strategy that sends robots to chargers."""
    state = ChargingState.of(memory)
    choose_charging(view, batch, decisions.charging, state.market, workspace, state.idle_below)


class Quoted(Strategy):
    """A charging strategy with a policy of quotes; allocations read it, too."""

    layer: ClassVar[str] = "charging"
    compiled: ClassVar[Any] = decide
    parameters: Any
    idle_below = 0  # idle robots with less charge go to charge

    def __init__(self, parameters: Any = None) -> None:
        super().__init__(parameters)
        self.period = self.parameters.check_idle_every

    def policy(self) -> dict[str, int]:
        """The settings of a quote: policy, end_reach, threshold and target."""
        raise NotImplementedError

    @property
    def queues(self) -> bool:
        """Whether robots already sent to a charger count in a quote."""
        queues: bool = self.parameters.count_queues
        return queues

    def reset(self, view: World) -> ChargingState:
        """Allocate scratch for the list of one robot."""
        longest = view.robots.order_queue.shape[1] + 1
        market = make_floor_market(view, 1, longest, longest, self.policy(), self.queues)
        return ChargingState(idle_below=self.idle_below, market=market)


class InsertCharging(Quoted):
    """Optimal insertion (De Ryck et al., section 3.3): charge where and as much as the list needs."""

    Parameters: ClassVar[Any] = Insertion

    def policy(self) -> dict[str, int]:
        hierarchical = self.parameters.mode == "hierarchical"
        policy = POLICY_HIERARCHICAL if hierarchical else POLICY_JOINT
        end_reach = int(self.parameters.never_strand)
        return {"policy": policy, "end_reach": end_reach, "threshold": 0, "target": BATTERY_FULL}


class FillUpCharging(Quoted):
    """Charge up to a target where it is cheapest for the list; charge left at the end is credited."""

    Parameters: ClassVar[Any] = FillUp

    def policy(self) -> dict[str, int]:
        target = round(self.parameters.target * BATTERY_PERCENT)
        return {"policy": POLICY_FILL_UP, "end_reach": 1, "threshold": 0, "target": target}


class ThresholdCharging(Quoted):
    """Threshold-100 (De Ryck et al., section 5.2): below a threshold, charge to 100 % at the nearest."""

    Parameters: ClassVar[Any] = Threshold

    def policy(self) -> dict[str, int]:
        alone = self.parameters.mode == "threshold-only"
        policy = POLICY_THRESHOLD if alone else POLICY_THRESHOLD_REACHABLE
        threshold = round(self.parameters.threshold * BATTERY_PERCENT)
        return {"policy": policy, "end_reach": 0, "threshold": threshold, "target": BATTERY_FULL}


class OpportunityCharging(InsertCharging):
    """Idle robots charge at free chargers, and leave for any order that they can finish.

    They are checked when they become idle and when a charger becomes free.
    """

    Parameters: ClassVar[Any] = Opportunity
    watches_chargers = True

    def __init__(self, parameters: Any = None) -> None:
        super().__init__(parameters)
        self.idle_below = round(self.parameters.start_below * BATTERY_PERCENT)

    def policy(self) -> dict[str, int]:
        policy = POLICY_HIERARCHICAL
        return {"policy": policy, "end_reach": 1, "threshold": 0, "target": BATTERY_FULL}


@kernel
def choose_charging(view, batch, out, market, workspace, idle_below):
    """Decide for a batch; idle robots below `idle_below` go to a free charger and stay available."""
    robots = view.robots
    count_queues(view, market)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if robots.load[i] != NIL or robots.goal_type[i] == GOAL_CHARGE or robots.retreat_moves[i]:
            continue
        tasks = enter_list(view, workspace, market, i)
        if batch.reason[k] == REASON_PERIODIC and (tasks or robots.busy[i]):
            continue
        if tasks == 0 and robots.charge[i] == BATTERY_FULL:
            continue
        home = market.costs.begin[0]
        if tasks == 0:
            robot_type = market.costs.robot_type
            market.cell[robot_type, home] = robots.home[i]
            market.cell[robot_type, home + 1] = robots.home[i]
        measure_distances(view, workspace, market, robots.type[i], 1, max(tasks, 1))
        enter_waits(view, market)
        compare_queues(market.battery.wait)
        if tasks:
            charge_for_list(view, out, market, k, tasks)
        elif batch.reason[k] != REASON_IDLE or idle_below > 0:
            charge_when_idle(view, out, market, k, np.int64(home), idle_below)
        if out.goal_cell[k] >= 0:
            count_decision(view, out, market, k, i)


@kernel
def enter_list(view, workspace, market, i):
    """Fill the market with robot i and its list; return the number of tasks."""
    robots, orders = view.robots, view.orders
    market.robot[0] = i
    select_robot_type(market.costs, market.battery, robots.type[i])
    market.cell[robots.type[i], 0] = first_cell(robots, i)
    market.fleet.charge[0] = robots.charge[i]
    tasks = np.int64(0)
    if robots.order[i] != NIL:
        enter_task(view, workspace, market, robots.type[i], tasks, np.int64(robots.order[i]))
        tasks += 1
    for p in range(robots.order_queue_length[i]):
        order = np.int64(robots.order_queue[i, p])
        waits = orders.state[order] == ORDER_WAITING and orders.reserved_by[order] == NIL
        if waits and tasks < market.order.shape[0]:
            enter_task(view, workspace, market, robots.type[i], tasks, order)
            tasks += 1
    for task in range(tasks):
        market.fleet.order[0, task] = task
    return tasks


@kernel
def charge_for_list(view, out, market, k, tasks):
    """Decision k: go to a charger if the quote of the list begins with a stop."""
    charge = np.int64(market.fleet.charge[0])
    order = market.fleet.order[0]
    plan = market.scratch.plan
    length = np.int64(tasks)
    cost = quote(market.costs, market.battery, market.scratch, 0, 0, charge, order, length)
    while cost >= INF_COST and length > 1:
        length -= 1
        cost = quote(market.costs, market.battery, market.scratch, 0, 0, charge, order, length)
    if cost >= INF_COST:
        nearest = best_charger(market, charge)
        if nearest != NIL and charge < BATTERY_FULL:
            send(view, out, k, nearest, BATTERY_FULL, 0)
    elif plan.stops > 0 and plan.position[0] == 0 and plan.duration[0] > 0:
        send(view, out, k, np.int64(plan.charger[0]), np.int64(plan.level[0]), 0)


@kernel
def charge_when_idle(view, out, market, k, home, idle_below):
    """Decision k: an idle robot charges at a free charger, or before all chargers get out of reach.

    The robot is at home or about to drive there; from home it must still reach a charger.
    """
    battery, robot_type = market.battery, market.costs.robot_type
    ticks, energy = market.costs.ticks[robot_type], market.costs.energy[robot_type]
    reach = battery.reach[robot_type]
    charge = np.int64(market.fleet.charge[0])
    nearest = best_charger(market, charge)
    if nearest == NIL or battery.policy == POLICY_NO_CHARGING:
        return
    stands_free = view.rules.drain[robot_type, ACTION_WAIT, 0] == 0
    low = battery.reserve[robot_type] + (0 if stands_free else IDLE_ENERGY_MARGIN)
    later = charge - energy[0, home] - reach[home]
    now = charge - reach[0]
    filled = BATTERY_FULL - energy[battery.charger[nearest], home] - reach[home]
    at_home = energy[0, home] == 0
    stands_there = ticks[0, battery.charger[nearest]] == 0  # it is useless to any other robot
    worth_it = not at_home or filled >= low  # else it would return with as little charge
    if charge < BATTERY_FULL and (stands_there or (min(later, now) < low and worth_it)):
        send(view, out, k, nearest, BATTERY_FULL, 1)
    elif charge < idle_below:
        free = free_charger(view, market)
        if free != NIL:
            send(view, out, k, free, BATTERY_FULL, 1)


@kernel
def best_charger(market, charge):
    """The reachable charger at which the robot can begin soonest, or NIL."""
    best, least = np.int64(NIL), np.int64(INF_COST)
    robot_type = market.costs.robot_type
    ticks, energy = market.costs.ticks[robot_type], market.costs.energy[robot_type]
    for c in range(market.battery.charger.shape[0]):
        place = market.battery.charger[c]
        soonest = np.int64(ticks[0, place]) + market.battery.wait[c]
        if energy[0, place] <= charge and soonest < least:
            best, least = np.int64(c), soonest
    return best


@kernel
def free_charger(view, market):
    """The nearest charger with a place to which no robot was sent, or NIL."""
    chargers, robot_type = view.chargers, market.costs.robot_type
    best, least = np.int64(NIL), np.int64(INF_COST)
    for c in range(chargers.cell.shape[0]):
        place = market.battery.charger[c]
        ticks = np.int64(market.costs.ticks[robot_type, 0, place])
        enough = market.costs.energy[robot_type, 0, place] <= view.robots.charge[market.robot[0]]
        if market.sent[c] < chargers.places[c] and enough and ticks < least:
            best, least = np.int64(c), ticks
    return best


@kernel
def compare_queues(wait):
    """Subtract the shortest wait from all waits.

    A robot that must charge chooses the shorter queue; it must not postpone charging because all
    chargers have queues (orders then waited 10 % longer).
    """
    if wait.shape[0] == 0:
        return
    shortest = np.int64(wait[0])
    for c in range(wait.shape[0]):
        shortest = min(shortest, np.int64(wait[c]))
    for c in range(wait.shape[0]):
        wait[c] -= shortest


@kernel
def send(view, out, k, charger, level, yields):
    """Decision k: charge at this charger up to a level."""
    out.goal_cell[k] = view.chargers.cell[charger]
    out.charge_target[k] = level
    out.charging_interruptible[k] = yields


@kernel
def count_decision(view, out, market, k, i):
    """Reserve the charger of decision k for robot i, ahead of the robots of later decisions."""
    charger = view.chargers.charger_at[out.goal_cell[k]]
    market.sent[charger] += 1
    curve, target = view.rules.curve[view.robots.type[i]], np.int64(out.charge_target[k])
    ticks = charging_ticks(curve, np.int64(view.robots.charge[i]), target)
    count_before(market, charger, ticks)
