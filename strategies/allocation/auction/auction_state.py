"""What auctions remember of a run, and the room that they work in."""

from __future__ import annotations

from typing import Any, Final

from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import Array, World
from automaton.strategy.layer import Strategy
from strategies.allocation.auction.auction_parameters import MAX_LISTED_ORDERS, Auctions
from strategies.allocation.auction.bundle_workspace import (
    Bundles,
    Population,
    bundles_for,
    population_for,
)
from strategies.allocation.auction.floor_market import FloorMarket, make_floor_market
from strategies.allocation.auction.market import BATTERY_FULL, POLICY_NO_CHARGING
from strategies.linear_sum_assignment import Assignment, assignment_for

MAX_BUNDLED: Final = 10  # items of a combinatorial auction, or of an exact allotment
MAX_BRED: Final = 12  # and of a genetic one
MAX_SOLD: Final = {"combinatorial": MAX_BUNDLED, "exact": MAX_BUNDLED, "genetic": MAX_BRED}


class AuctionState(Struct):
    """Counts, when lists are due, and who sells; n robots, an auction of at most S orders."""

    # Counted in the row of a robot that was asked when the auctions were held:
    auctions: Array = field("(n,) int64")
    bids: Array = field("(n,) int64")
    messages: Array = field("(n,) int64")
    due: Array = field("(n,) int64", "tick at which a robot's list was to be done, or 0")
    delivered: Array = field("(1,) int64", "orders.release_sequence is delivered before this entry")
    unsold: Array = field("(1,) int64", "orders that the last auction left")
    auctioneer: Array = field("(1,) int64", "the robot that sells now")
    rounds: Array = field("(1,) int64", "auctions so far")
    limit: int = field("int64", "orders in a robot's list")
    sellable: Array = field("(S,) int32", "the orders for sale", role=SCRATCH)
    market: FloorMarket
    # What the mechanism works in besides the market; others have no room.
    bundles: Bundles
    population: Population
    assignment: Assignment


def auction_state(view: World, parameters: Auctions, charging: Strategy | None) -> AuctionState:
    """Room for a market of all robots, their lists, and the orders of an auction."""
    robots, most = view.robots.order_queue.shape
    limit = min(parameters.max_orders_per_robot, most, max(1, MAX_LISTED_ORDERS // robots))
    # A branch brings the plans of another strategy.
    planned, items, mechanism = (
        view.robots.order_queue_length,
        parameters.max_items,
        parameters.mechanism,
    )
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
