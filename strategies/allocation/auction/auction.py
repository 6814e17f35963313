"""Auctions (De Ryck et al.): orders are sold to the robots that can do them at the least cost.

A robot bids the cost of its list of orders with one more order, including charging, as quoted by the
scenario's charging strategy. A free robot takes the first order of its list. There is an auction if an
order is for sale (it is new or returned, or its robot failed), and if a robot has no orders ahead or
new orders have come since the last auction. The loop returns to Python for an auction; all code that
runs per bid is compiled.

Lists are those of the world (robots.order_queue). `out` is allocation's decisions, which receive new
lists; lists written earlier in the same tick count.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

import numpy as np

from automaton.strategy.api import (
    BATTERY_FULL,
    CMD_PARK,
    GOAL_CHARGE,
    KEEP,
    NIL,
    ORDER_WAITING,
    REASON_PERIODIC,
    SCRATCH,
    STATUS_UP,
    STORAGE_POLICIES,
    Array,
    Batch,
    Decisions,
    Memory,
    Strategy,
    Struct,
    Workspace,
    World,
    allocation_of,
    can_do,
    field,
    has_place,
    is_open,
    kernel,
    place_load,
    places_load,
    take_order,
    types_of_robots,
)
from strategies.allocation.allocation_parameters import MAX_LISTED_ORDERS, Auctions, EpsilonSchedule
from strategies.allocation.auction.bundles import Bundles, bundles_for, combinatorial, exact
from strategies.allocation.auction.floor_market import (
    FloorMarket,
    count_queues,
    enter_robot,
    enter_task,
    enter_waits,
    make_floor_market,
    measure_distances,
)
from strategies.allocation.auction.market import INF_COST, POLICY_NO_CHARGING
from strategies.allocation.auction.metaheuristics import (
    AllotmentPopulation,
    generations,
    genetic,
    improve,
    population_for,
)
from strategies.allocation.auction.quotes import settle_all
from strategies.allocation.auction.sequential import (
    BID_AVERAGE,
    BID_AVERAGE_ADDED,
    BID_MIXED,
    WINNER_DIFFERENCE,
    WINNER_FEWEST_BIDDERS,
    WINNER_LOWEST_BID,
    WINNER_REGRET,
    assign_once,
    by_arrival,
    parallel,
    sequential,
)
from strategies.linear_sum_assignment import Assignment, assignment_for

MAX_BUNDLED: Final = 10  # maximum items of a combinatorial auction, or of an exact allotment
MAX_BRED: Final = 12  # maximum items of a genetic one
MAX_SOLD: Final = {"combinatorial": MAX_BUNDLED, "exact": MAX_BUNDLED, "genetic": MAX_BRED}
BID_RULES: Final = {"mixed": BID_MIXED, "average": BID_AVERAGE_ADDED, "average-paper": BID_AVERAGE}
WINNER_RULES: Final = {
    "lowest": WINNER_LOWEST_BID,
    "difference": WINNER_DIFFERENCE,
    "fewest": WINNER_FEWEST_BIDDERS,
    "regret": WINNER_REGRET,
}
BUSY: Final = 3  # open orders per robot at which epsilon "load" is 1
ORDER_PLANNED = 2  # mark in order_taken of the decisions: the order is in a robot's plan


class AuctionState(Struct):
    """Counters, expected ends of lists, and the auctioneer; n robots, at most S orders per auction."""

    # Counted in the row of a robot of the batch:
    auctions: Array = field("(n,) int64")
    bids: Array = field("(n,) int64")
    messages: Array = field("(n,) int64")
    due: Array = field("(n,) int64", "tick at which a robot's list is expected to be done, or 0")
    delivered: int = field(
        "() int64", "all entries of orders.release_sequence before it are delivered"
    )
    unsold: int = field("() int64", "orders left unsold by the last auction")
    auctioneer: int = field("() int64", "the current auctioneer")
    rounds: int = field("() int64", "number of auctions")
    limit: int = field("int64", "orders in a robot's list")
    sellable: Array = field("(S,) int32", "the orders for sale", role=SCRATCH)
    market: FloorMarket
    # Scratch of the mechanism besides the market; empty for other mechanisms.
    bundles: Bundles
    population: AllotmentPopulation
    assignment: Assignment


def auction_state(view: World, parameters: Auctions, charging: Strategy | None) -> AuctionState:
    """Scratch for a market of all robots, their lists, and the orders of an auction."""
    robots, most = view.robots.order_queue.shape
    limit = min(parameters.max_orders_per_robot, most, max(1, MAX_LISTED_ORDERS // robots))
    items, mechanism = parameters.max_items, parameters.mechanism
    planned = view.robots.order_queue_length  # a branch may begin with other plans
    tasks = max(robots * limit, int(planned.sum())) + items
    longest = max(limit, int(planned.max())) + items
    policy = {"policy": POLICY_NO_CHARGING, "end_reach": 0, "threshold": 0, "target": BATTERY_FULL}
    queues = True
    quoted: Any = getattr(charging, "policy", None)
    if view.rules.battery and quoted is not None:
        policy, queues = quoted(), bool(getattr(charging, "queues", True))
    by_bundles, is_bred = mechanism in ("combinatorial", "exact"), mechanism == "genetic"
    return AuctionState.sized(
        {"n": robots, "S": items},
        limit=limit,
        market=make_floor_market(view, robots, tasks, longest, policy, queues),
        bundles=bundles_for(robots, min(items, MAX_BUNDLED)) if by_bundles else bundles_for(0, 0),
        population=population_for(robots, min(items, MAX_BRED), longest)
        if is_bred
        else population_for(0, 0, 0),
        assignment=assignment_for(max(robots, items) if mechanism == "assignment" else 0),
    )


class Auction(Strategy):
    """Auctions assign orders to robots, with or without a central auctioneer."""

    layer = "allocation"
    Parameters = Auctions
    parameters: Auctions
    counters: ClassVar = {name: name for name in ("auctions", "bids", "messages")}

    def reset(self, view: World) -> AuctionState:
        """Return the state before the first auction."""
        return auction_state(view, self.parameters, self.other_layers.get("charging"))

    def decide(
        self, view: World, batch: Batch, decisions: Decisions, memory: Memory, workspace: Workspace
    ) -> None:
        """Hold an auction if needed, and decide the next order of each robot."""
        out, state = decisions.allocation, AuctionState.of(memory)
        drop_lost_orders(view, out, int(batch.strategy))
        if self.parameters.reauction_after is not None:
            self._take_back_late(view, batch, out, state, workspace)
        own = view.rules.allocation[view.robots.type] == batch.strategy
        if self.parameters.while_charging == "release" and has_empty_list(view, batch, out):
            charging = (view.robots.goal_type == GOAL_CHARGE) & (view.robots.order_queue_length > 0)
            charging &= own
            out.order_queue_length[charging] = state.due[charging] = 0
        mark_planned(view, out)
        count, delivered = find_items(view, out, state.delivered, state.sellable)
        state.delivered = delivered
        if count and (count != state.unsold or has_empty_list(view, batch, out)):
            if self.parameters.mechanism == "exact":  # its search starts without lists
                count = self._take_back(view, out, state, own)
            for center, items in self._auctioneers(view, state, int(count)):
                self._sell(view, batch, out, state, workspace, center, items)
            state.unsold, _ = find_items(view, out, delivered, state.sellable)
        policy = STORAGE_POLICIES.index(self.parameters.storage)
        serve(view, batch, out, workspace, state.due, policy)

    def _take_back_late(
        self, view: World, batch: Batch, out: Any, state: AuctionState, workspace: Workspace
    ) -> None:
        """Put lists up for sale again if their delay exceeds the limit."""
        if not (state.due > 0).any():
            return
        market, tolerance = state.market, self.parameters.reauction_after or 0
        strategy = int(batch.strategy)
        robots = open_auction(view, out, workspace, market, strategy, state.sellable, 0)
        for r in range(robots):
            i = int(market.robot[r])
            due = int(state.due[i])
            done = int(view.clock.tick) + int(market.fleet.cost[r])
            if due and market.fleet.length[r] and done > due + tolerance:
                out.order_queue_length[i] = state.due[i] = 0

    def _take_back(self, view: World, out: Any, state: AuctionState, own: Any) -> int:
        """Put all planned orders of the strategy's robots up for sale; return the number for sale."""
        out.order_queue_length[own] = 0
        out.order_taken[out.order_taken == ORDER_PLANNED] = 0
        mark_planned(view, out)
        count, _ = find_items(view, out, state.delivered, state.sellable)
        return int(count)

    def _auctioneers(
        self, view: World, state: AuctionState, count: int
    ) -> list[tuple[int, np.ndarray[Any, Any]]]:
        """The cell of each auctioneer, and the orders that it sells."""
        robot_type, items = self.parameters.auctioneer, state.sellable[:count].copy()
        if robot_type == "central":
            return [(NIL, items)]
        robots = len(view.robots.cell)
        state.rounds += 1
        if robot_type == "fixed":
            seats = [self._cell(view, i) for i in range(min(self.parameters.auctioneers, robots))]
            nearest = self._nearest(view, seats, items)
            return [(seat, items[nearest == k]) for k, seat in enumerate(seats)]
        if robot_type == "time":
            state.auctioneer = view.clock.tick // self.parameters.auctioneer_term % robots
        else:
            state.auctioneer = state.rounds % robots
        return [(self._cell(view, int(state.auctioneer)), items)]

    def _cell(self, view: World, identity: int) -> int:
        """The cell of the robot with this identity."""
        i = view.robots.at_index[identity]
        cell = int(view.robots.cell[i])
        return int(view.robots.home[i]) if cell == NIL else cell

    def _nearest(self, view: World, seats: list[int], items: Any) -> Any:
        """(k,) the auctioneer nearest to each order; ties: the first."""
        width = view.grid.width
        at = view.slots.cell[view.orders.current_slot[items]]
        seat = np.array(seats)[:, None]
        across, down = abs(at % width - seat % width), abs(at // width - seat // width)
        return np.maximum(across, down).argmin(0)

    def _sell(
        self,
        view: World,
        batch: Batch,
        out: Any,
        state: AuctionState,
        workspace: Workspace,
        center: int,
        items: Any,
    ) -> None:
        """The auction of one auctioneer; its region is doubled while orders stay unsold."""
        asked, strategy = int(batch.robot[0]), int(batch.strategy)  # the row of the counters
        bidders = int((view.rules.allocation[view.robots.type] == strategy).sum())
        parameters, market = self.parameters, state.market
        most = MAX_SOLD.get(parameters.mechanism)
        items = items[:most]
        radius = NIL if parameters.announcement_radius is None else parameters.announcement_radius
        center = NIL if parameters.region == "order" else center
        if center == NIL and parameters.region == "auctioneer":
            radius = NIL  # the central auctioneer reaches all robots
        while len(items):
            robots = open_auction(view, out, workspace, market, strategy, items, len(items))
            market.fleet.capacity[:robots], market.fleet.capacity[robots:] = state.limit, 0
            announce_items(view, market, robots, len(items), center, radius)
            self._hold(view, state, bidders, len(items))
            enter_plans(view, out, market, robots, state.due)
            state.auctions[asked] += 1
            state.bids[asked] += market.scratch.count.bids
            state.messages[asked] += market.scratch.count.messages
            items = items[market.scratch.sold[: len(items)] == NIL]
            if radius == NIL or radius >= view.grid.width + len(view.grid.kind) // view.grid.width:
                return
            radius *= 2

    def _hold(self, view: World, state: AuctionState, bidders: int, count: int) -> None:
        """Sell this number of items of the market to its robots by the rules of the scenario."""
        given, market = self.parameters, state.market
        market_parts = (market.costs, market.battery, market.fleet, market.scratch)
        rule, epsilon = BID_RULES[given.bid_rule], self._epsilon(view, bidders, count)
        if given.mechanism == "arrival":
            by_arrival(*market_parts, market.item, count, rule, epsilon)
        elif given.mechanism == "parallel":
            parallel(*market_parts, market.item, count, rule, epsilon)
        elif given.mechanism == "assignment":
            assign_once(*market_parts, state.assignment, market.item, count, rule, epsilon)
        elif given.mechanism == "sequential" or not self._allot(
            view, state, market_parts, bidders, count, epsilon
        ):
            winner = WINNER_RULES[given.winner_rule]
            sequential(*market_parts, market.item, count, rule, epsilon, winner, 0)
        if given.local_search:
            improve(*market_parts, epsilon)

    def _allot(
        self,
        view: World,
        state: AuctionState,
        market_parts: Any,
        bidders: int,
        count: int,
        epsilon: int,
    ) -> bool:
        """Search complete allotments; False, with unchanged lists, if none does every item."""
        fleet, item = state.market.fleet, state.market.item
        before = fleet.order.copy(), fleet.length.copy()
        if self.parameters.mechanism == "combinatorial":
            value = combinatorial(*market_parts, state.bundles, item, count, epsilon)
        elif self.parameters.mechanism == "exact":
            value = exact(*market_parts, state.bundles, item, count, epsilon)
        else:
            turns, number = generations(bidders, count), int(state.auctions.sum())
            draws = (turns, 0, np.uint64(view.rules.seed), number)
            with np.errstate(over="ignore"):
                value = genetic(*market_parts, state.population, item, count, epsilon, *draws)
        if value < INF_COST:
            return True
        fleet.order[:], fleet.length[:] = before
        settle_all(*market_parts)
        return False

    def _epsilon(self, view: World, bidders: int, count: int) -> int:
        """The weight of MiniSum in the bids of this auction, in thousandths."""
        given = self.parameters.epsilon
        if isinstance(given, EpsilonSchedule):
            share = min(1.0, int(view.clock.tick) / given.until)
            return round(1000 * (given.first + share * (given.last - given.first)))
        if given == "load":
            return min(1000, 1000 * count // (BUSY * bidders))
        return round(1000 * given)


# Lists: orders for sale, and orders of robots.


@kernel
def planned_count(view, out, i):
    """The number of orders in the list of robot i, from the decisions if these set the list."""
    return np.int64(
        view.robots.order_queue_length[i]
        if out.order_queue_length[i] == KEEP
        else out.order_queue_length[i]
    )


@kernel
def planned_order(view, out, i, k):
    """The order at place k of the list of robot i, from the decisions if these set the list."""
    if out.order_queue_length[i] != KEEP:
        return np.int64(out.order_queue[i, k])
    return np.int64(view.robots.order_queue[i, k])


@kernel
def copy_plan(view, out, i):
    """Initialize the decisions with the plan of robot i."""
    if out.order_queue_length[i] != KEEP:
        return
    out.order_queue_length[i] = view.robots.order_queue_length[i]
    for k in range(view.robots.order_queue_length[i]):
        out.order_queue[i, k] = view.robots.order_queue[i, k]


@kernel
def mark_planned(view, out):
    """Mark the orders that are in plans."""
    for i in range(view.robots.cell.shape[0]):
        for k in range(planned_count(view, out, i)):
            out.order_taken[planned_order(view, out, i, k)] = ORDER_PLANNED


@kernel
def drop_lost_orders(view, out, strategy):
    """Remove orders taken by robots of other strategies from the lists of the strategy's robots."""
    if view.rules.allocations == 1:
        return
    orders = view.orders
    for i in range(view.robots.cell.shape[0]):
        if allocation_of(view, i) != strategy:
            continue
        count, remaining = np.int64(view.robots.order_queue_length[i]), 0
        for p in range(count):
            order = np.int64(view.robots.order_queue[i, p])
            if orders.state[order] == ORDER_WAITING and orders.reserved_by[order] == NIL:
                out.order_queue[i, remaining] = order
                remaining += 1
        if remaining < count:
            out.order_queue_length[i] = remaining


@kernel
def is_for_sale(view, out, order):
    """Whether an order waits and is in no robot's hands or plan."""
    orders = view.orders
    return (
        orders.state[order] == ORDER_WAITING
        and orders.reserved_by[order] == NIL
        and out.order_taken[order] == 0
    )


@kernel
def find_items(view, allocation, since, out):
    """Write orders for sale to `out`, in release order; return (their number, the next `since`).

    `since`: all entries of orders.release_sequence before it are delivered.
    """
    found = np.int64(0)
    first = np.int64(since)
    done = True
    for k in range(since, view.clock.next_release):
        order = np.int64(view.orders.release_sequence[k])
        done = done and view.orders.delivered[order] != NIL
        first = k + 1 if done else first
        if is_for_sale(view, allocation, order):
            out[found] = order
            found += 1
            if found == out.shape[0]:
                break
    return found, first


@kernel
def has_empty_list(view, batch, out):
    """Whether a robot of the batch has no orders ahead."""
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if not places_load(batch.reason[k]) and batch.reason[k] != REASON_PERIODIC:
            if planned_count(view, out, i) == 0:
                return True
    return False


# One auction: fill the market, announce items, and write the resulting lists.


@kernel
def open_auction(view, out, workspace, market, strategy, sellable, count):
    """Fill the market: the strategy's robots in order, their plans as lists, sellable[:count] as items.

    Returns the number of robots in the market.
    """
    robots, fleet = view.robots, market.fleet
    taking_part = np.int64(0)
    tasks = np.int64(0)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        hidden = robots.cell[i] == NIL and robots.home[i] == NIL  # beyond the visible orders
        if robots.status[i] != STATUS_UP or hidden or allocation_of(view, i) != strategy:
            continue
        r = taking_part
        enter_robot(view, workspace, market, r, i)
        for k in range(planned_count(view, out, i)):
            for robot_type in range(types_of_robots(view)):
                enter_task(
                    view, workspace, market, robot_type, tasks, planned_order(view, out, i, k)
                )
            fleet.order[r, k] = tasks
            fleet.length[r] = k + 1
            tasks += 1
        taking_part += 1
    for r in range(taking_part, fleet.place.shape[0]):  # down: no list, no bids
        fleet.length[r] = 0
        fleet.ready[r] = 0
        fleet.may_bid[r, :] = 0
    for k in range(count):
        for robot_type in range(types_of_robots(view)):
            enter_task(view, workspace, market, robot_type, tasks, np.int64(sellable[k]))
        market.item[k] = tasks
        tasks += 1
    for r in range(taking_part):
        for task in range(tasks):
            fleet.may_bid[r, task] = can_do(view, market.robot[r], market.order[task])
    for robot_type in range(types_of_robots(view)):
        measure_distances(view, workspace, market, robot_type, taking_part, tasks)
    count_queues(view, market)
    enter_waits(view, market)
    settle_all(market.costs, market.battery, fleet, market.scratch)
    return taking_part


@kernel
def announce_items(view, market, robots, count, center, radius):
    """Announce each item to robots within this radius in cells of its center; NIL: of its own cell.

    radius NIL: all robots. Distances are Chebyshev distances from the cells of robots.
    """
    width = view.grid.width
    for r in range(robots):
        i = market.robot[r]
        cell = np.int64(view.robots.cell[i])
        cell = np.int64(view.robots.home[i]) if cell == NIL else cell
        for k in range(count):
            task = market.item[k]
            at = center
            if center == NIL:
                at = np.int64(market.cell[market.fleet.robot_type[r], market.costs.begin[task]])
            across, down = abs(cell % width - at % width), abs(cell // width - at // width)
            near = radius == NIL or max(across, down) <= radius
            able = can_do(view, i, market.order[task])
            market.fleet.may_bid[r, task] = 1 if near and able else 0


@kernel
def enter_plans(view, out, market, robots, due):
    """Write the lists of the market to the plans, and their expected ends to `due`: (n,) int64."""
    fleet = market.fleet
    for r in range(robots):
        i = np.int64(market.robot[r])
        length = np.int64(fleet.length[r])
        out.order_queue_length[i] = length
        for k in range(length):
            order = np.int64(market.order[fleet.order[r, k]])
            out.order_queue[i, k] = order
            out.order_taken[order] = ORDER_PLANNED
        known = length > 0 and fleet.cost[r] < INF_COST
        due[i] = view.clock.tick + fleet.cost[r] if known else 0


# Next orders of robots.


@kernel
def serve(view, batch, out, workspace, due, policy):
    """Decide for a batch: loads go to their targets, free robots take the next order of their lists.

    due[i] = 0 if robot i's list is done; (n,) int64. `policy`: an index of STORAGE_POLICIES.
    """
    carries_pods = view.trips.pod.shape[0] > 0
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            place_load(view, out, workspace, k, i, policy)
            continue
        if batch.reason[k] == REASON_PERIODIC:
            continue
        if not (take_next_trip(view, out, k, i) if carries_pods else take_next(view, out, k, i)):
            out.command[k] = CMD_PARK
            due[i] = 0


@kernel
def take_next(view, out, k, i):
    """Decision k: robot i takes the first waiting order of its list; False without one."""
    copy_plan(view, out, i)
    count = np.int64(out.order_queue_length[i])
    for p in range(count):
        order = np.int64(out.order_queue[i, p])
        waits = view.orders.state[order] == ORDER_WAITING and view.orders.reserved_by[order] == NIL
        if waits and can_do(view, i, order):
            take_order(view, out, k, i, order)
            for q in range(p + 1, count):
                out.order_queue[i, q - p - 1] = out.order_queue[i, q]
            out.order_queue_length[i] = count - p - 1
            return True
    out.order_queue_length[i] = 0
    return False


@kernel
def take_next_trip(view, out, k, i):
    """Decision k, if orders are trips of pods: robot i takes a trip, or waits; False if it has none.

    The next trip of the pod above the robot is reserved for it and comes first. Then follows the first
    trip of its list whose station has a place; earlier trips stay in the list.
    """
    offered = np.int64(view.trips.offered[view.robots.identity[i]])
    if offered != NIL and is_open(view, out, i, offered):
        take_order(view, out, k, i, offered)
        return True
    copy_plan(view, out, i)
    count, remaining, taken = np.int64(out.order_queue_length[i]), 0, False
    for p in range(count):
        order = np.int64(out.order_queue[i, p])
        if view.orders.state[order] != ORDER_WAITING or view.orders.reserved_by[order] != NIL:
            continue
        if not taken and has_place(view, order) and can_do(view, i, order):
            take_order(view, out, k, i, order)
            taken = True
            continue
        out.order_queue[i, remaining] = order
        remaining += 1
    out.order_queue_length[i] = remaining
    return taken or remaining > 0
