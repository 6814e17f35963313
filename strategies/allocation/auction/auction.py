"""Auctions (De Ryck et al.): orders are sold to the robots that do them at the least cost.

A robot bids what its list of orders costs with one more, charging included, as the scenario's
charging strategy quotes it. Whoever is free takes the first order of its list. There is an auction
when an order is for sale - it came in, was given back, or its robot failed - and a robot has
nothing ahead of it, or orders have come since the last one. The loop leaves compiled code for it;
all that is done for each bid is compiled.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

import numpy as np

from automaton.engine.state import (
    CLOCK_TICK,
    GOAL_CHARGE,
    NIL,
    Batch,
    Decisions,
    Memory,
    Workspace,
    World,
)
from automaton.strategy.layer import Strategy, memory_of
from strategies.allocation.auction.assignment import assign_once
from strategies.allocation.auction.auction_parameters import (
    MAX_LISTED_ORDERS,
    Auctions,
    EpsilonSchedule,
)
from strategies.allocation.auction.auction_round import (
    ORDER_PLANNED,
    announce_items,
    enter_plans,
    find_items,
    mark_planned,
    open_auction,
)
from strategies.allocation.auction.bids import BID_AVERAGE, BID_AVERAGE_ADDED, BID_MIXED
from strategies.allocation.auction.bundle_workspace import (
    assignment_for,
    bundles_for,
    generations,
    population_for,
)
from strategies.allocation.auction.bundles import combinatorial
from strategies.allocation.auction.exact import exact
from strategies.allocation.auction.floor_market import make_floor_market
from strategies.allocation.auction.genetic_auction import genetic
from strategies.allocation.auction.local_search import improve
from strategies.allocation.auction.market import (
    BATTERY_FULL,
    COUNT_BIDS,
    COUNT_MESSAGES,
    INF_COST,
    POLICY_NO_CHARGING,
)
from strategies.allocation.auction.quotes import settle_all
from strategies.allocation.auction.sequential import by_arrival, parallel, sequential
from strategies.allocation.auction.winners import (
    WINNER_DIFFERENCE,
    WINNER_FEWEST_BIDDERS,
    WINNER_LOWEST_BID,
    WINNER_REGRET,
)
from strategies.allocation.order_queues import has_empty_list, serve

BID_RULES: Final = {"mixed": BID_MIXED, "average": BID_AVERAGE_ADDED, "average-paper": BID_AVERAGE}
WINNER_RULES: Final = {
    "lowest": WINNER_LOWEST_BID,
    "difference": WINNER_DIFFERENCE,
    "fewest": WINNER_FEWEST_BIDDERS,
    "regret": WINNER_REGRET,
}
MAX_BUNDLED: Final = 10  # items of a combinatorial auction, or of an exact allotment
MAX_BRED: Final = 12  # and of a genetic one
MAX_SOLD: Final = {"combinatorial": MAX_BUNDLED, "exact": MAX_BUNDLED, "genetic": MAX_BRED}
BUSY: Final = 3  # open orders for each robot at which epsilon "load" is 1

# memory.per_robot
HELD = 0  # auctions, bids and messages, in the row of a robot that was asked when they were held
BID = 1
SENT = 2
DUE = 3  # tick at which its list was to be done

# memory.shared
SINCE = 0  # entries of orders.release_sequence before it are delivered
LEFT = 1  # orders that the last auction left unsold
ROLE = 2  # the robot that is the auctioneer
ROUND = 3  # auctions so far


class Auction(Strategy):
    """Orders go to robots by auctions, with a central auctioneer or without one."""

    layer = "allocation"
    Parameters = Auctions
    parameters: Auctions
    counters: ClassVar = {"auctions": HELD, "bids": BID, "messages": SENT}

    def reset(self, view: World) -> Memory:
        """Room for a market of all robots, their lists, and the orders of an auction."""
        robots, most = view.robots.order_queue.shape
        given = self.parameters
        self._limit = min(given.max_orders_per_robot, most, max(1, MAX_LISTED_ORDERS // robots))
        # A branch brings the plans of another strategy.
        order_queue_length = view.robots.order_queue_length
        tasks = max(robots * self._limit, int(order_queue_length.sum())) + given.max_items
        longest = max(self._limit, int(order_queue_length.max())) + given.max_items
        charging = self.other_layers.get("charging")
        policy = {
            "policy": POLICY_NO_CHARGING,
            "end_reach": 0,
            "threshold": 0,
            "target": BATTERY_FULL,
        }
        queues = True
        quoted: Any = getattr(charging, "policy", None)
        if view.rules.battery and quoted is not None:
            policy, queues = quoted(), bool(getattr(charging, "queues", True))
        self._market = make_floor_market(view, robots, tasks, longest, policy, queues)
        self._sellable = np.zeros(given.max_items, np.int32)
        self._tools = self._prepared(robots, longest)
        return memory_of(view, per_robot=4, shared=4)

    def _prepared(self, robots: int, longest: int) -> Any:
        """What the kind of auction works in besides the market."""
        robot_type, horizon = self.parameters.mechanism, self.parameters.max_items
        if robot_type in ("combinatorial", "exact"):
            return bundles_for(robots, min(horizon, MAX_BUNDLED))
        if robot_type == "genetic":
            return population_for(robots, min(horizon, MAX_BRED), longest)
        if robot_type == "assignment":
            return assignment_for(max(robots, horizon))
        return None

    def decide(
        self, view: World, batch: Batch, decisions: Decisions, memory: Memory, workspace: Workspace
    ) -> None:
        """Hold an auction if there is reason to, and give out what robots do next."""
        out = decisions.allocation
        self._counted = int(batch.robot[0])
        if self.parameters.reauction_after is not None:
            self._take_back_late(view, out, memory, workspace, self.parameters.reauction_after)
        if self.parameters.while_charging == "release" and has_empty_list(view, batch, out):
            charging = (view.robots.goal_type == GOAL_CHARGE) & (view.robots.order_queue_length > 0)
            out.order_queue_length[charging] = memory.per_robot[charging, DUE] = 0
        mark_planned(view, out)
        count, since = find_items(view, out, memory.shared[SINCE], self._sellable)
        memory.shared[SINCE] = since
        if count and (count != memory.shared[LEFT] or has_empty_list(view, batch, out)):
            if self.parameters.mechanism == "exact":  # it knows no lists to begin with
                count = self._take_back(view, out, since)
            for center, items in self._auctioneers(view, memory, int(count)):
                self._sell(view, out, memory, workspace, center, items)
            memory.shared[LEFT], _ = find_items(view, out, since, self._sellable)
        serve(view, batch, out, memory, DUE)

    def _take_back_late(
        self, view: World, out: Any, memory: Memory, workspace: Workspace, tolerance: int
    ) -> None:
        """Lists that will be done so much later than was predicted are for sale again."""
        if not (memory.per_robot[:, DUE] > 0).any():
            return
        market = self._market
        robots = open_auction(view, out, workspace, market, self._sellable, 0)
        for r in range(robots):
            i = int(market.robot[r])
            due = int(memory.per_robot[i, DUE])
            done = int(view.clock[CLOCK_TICK]) + int(market.fleet.cost[r])
            if due and market.fleet.length[r] and done > due + tolerance:
                out.order_queue_length[i] = memory.per_robot[i, DUE] = 0

    def _take_back(self, view: World, out: Any, since: int) -> int:
        """Put all that is planned up for sale again; returns how many orders are."""
        out.order_queue_length[:] = 0
        out.order_taken[out.order_taken == ORDER_PLANNED] = 0
        count, _ = find_items(view, out, since, self._sellable)
        return int(count)

    def _auctioneers(
        self, view: World, memory: Memory, count: int
    ) -> list[tuple[int, np.ndarray[Any, Any]]]:
        """Who sells which orders: the cell where the auctioneer is, and what it sells."""
        robot_type, items = self.parameters.auctioneer, self._sellable[:count].copy()
        if robot_type == "central":
            return [(NIL, items)]
        robots = len(view.robots.cell)
        memory.shared[ROUND] += 1
        if robot_type == "fixed":
            seats = [self._cell(view, i) for i in range(min(self.parameters.auctioneers, robots))]
            nearest = self._nearest(view, seats, items)
            return [(seat, items[nearest == k]) for k, seat in enumerate(seats)]
        if robot_type == "time":
            memory.shared[ROLE] = view.clock[CLOCK_TICK] // self.parameters.auctioneer_term % robots
        else:
            memory.shared[ROLE] = memory.shared[ROUND] % robots
        return [(self._cell(view, int(memory.shared[ROLE])), items)]

    def _cell(self, view: World, identity: int) -> int:
        """Where the robot with this number is."""
        i = view.robots.at_index[identity]
        cell = int(view.robots.cell[i])
        return int(view.robots.home[i]) if cell == NIL else cell

    def _nearest(self, view: World, seats: list[int], items: Any) -> Any:
        """(k,) the seat nearest to where each order lies; ties: the first."""
        width = view.grid.width
        at = view.slots.cell[view.orders.current_slot[items]]
        seat = np.array(seats)[:, None]
        across, down = abs(at % width - seat % width), abs(at // width - seat // width)
        return np.maximum(across, down).argmin(0)

    def _sell(
        self, view: World, out: Any, memory: Memory, workspace: Workspace, center: int, items: Any
    ) -> None:
        """One auctioneer's auction; its region is doubled while orders are left unsold."""
        parameters, market = self.parameters, self._market
        most = MAX_SOLD.get(parameters.mechanism)
        items = items[:most]
        radius = NIL if parameters.announcement_radius is None else parameters.announcement_radius
        center = NIL if parameters.region == "order" else center
        if center == NIL and parameters.region == "auctioneer":
            radius = NIL  # the central auctioneer reaches all robots
        while len(items):
            robots = open_auction(view, out, workspace, market, items, len(items))
            market.fleet.capacity[:robots], market.fleet.capacity[robots:] = self._limit, 0
            announce_items(view, market, robots, len(items), center, radius)
            self._hold(view, memory, len(items))
            enter_plans(view, out, market, robots, memory, DUE, self._counted)
            counts = memory.per_robot[self._counted]
            counts[HELD] += 1
            counts[BID] += market.scratch.count[COUNT_BIDS]
            counts[SENT] += market.scratch.count[COUNT_MESSAGES]
            items = items[market.scratch.sold[: len(items)] == NIL]
            if radius == NIL or radius >= view.grid.width + len(view.grid.kind) // view.grid.width:
                return
            radius *= 2

    def _hold(self, view: World, memory: Memory, count: int) -> None:
        """Sell so many items of the market by the rules of the scenario."""
        given, market = self.parameters, self._market
        market_parts = (market.costs, market.battery, market.fleet, market.scratch)
        rule, epsilon = BID_RULES[given.bid_rule], self._epsilon(view, count)
        if given.mechanism == "arrival":
            by_arrival(*market_parts, market.item, count, rule, epsilon)
        elif given.mechanism == "parallel":
            parallel(*market_parts, market.item, count, rule, epsilon)
        elif given.mechanism == "assignment":
            assign_once(*market_parts, self._tools, market.item, count, rule, epsilon)
        elif given.mechanism == "sequential" or not self._allot(
            view, market_parts, memory, count, epsilon
        ):
            winner = WINNER_RULES[given.winner_rule]
            sequential(*market_parts, market.item, count, rule, epsilon, winner, 0)
        if given.local_search:
            improve(*market_parts, epsilon)

    def _allot(
        self, view: World, market_parts: Any, memory: Memory, count: int, epsilon: int
    ) -> bool:
        """Look at whole allotments; False, with the lists as before, if none does every item."""
        fleet, tools, item = self._market.fleet, self._tools, self._market.item
        before = fleet.order.copy(), fleet.length.copy()
        if self.parameters.mechanism == "combinatorial":
            value = combinatorial(*market_parts, tools, item, count, epsilon)
        elif self.parameters.mechanism == "exact":
            value = exact(*market_parts, tools, item, count, epsilon)
        else:
            auction = int(memory.per_robot[:, HELD].sum())
            turns = generations(len(view.robots.cell), count)
            with np.errstate(over="ignore"):
                value = genetic(
                    *market_parts, tools, item, count, epsilon, turns, 0, view.rules.seed, auction
                )
        if value < INF_COST:
            return True
        fleet.order[:], fleet.length[:] = before
        settle_all(*market_parts)
        return False

    def _epsilon(self, view: World, count: int) -> int:
        """Thousandths of MiniSum in the bids of this auction."""
        given = self.parameters.epsilon
        if isinstance(given, EpsilonSchedule):
            share = min(1.0, int(view.clock[CLOCK_TICK]) / given.until)
            return round(1000 * (given.first + share * (given.last - given.first)))
        if given == "load":
            return min(1000, 1000 * count // (BUSY * len(view.robots.cell)))
        return round(1000 * given)
