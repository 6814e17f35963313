"""Cheapest pair first: the robot and the order that are nearest to each other, then those of the others.

Exact ticks on the empty floor count, from where the robot is free to drive on to where the order
begins. Orders without a load that are not begun may be given to other robots again: every `reassign`
ticks all robots and orders that are not under way are matched again, and a robot keeps its order unless
a cheaper pair parts them. A load that was picked up goes to its own target, a pod into storage.
"""

import numpy as np

from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import (
    ACTION_MOVE,
    ACTION_TURN,
    CMD_PARK,
    NIL,
    REASON_PERIODIC,
    Array,
)
from automaton.strategy.contract import Strategy
from automaton.strategy.kernels import (
    POLICIES,
    is_due,
    kernel,
    place_load,
    places_load,
    take_order,
)
from strategies.allocation.allocation_parameters import GreedyParameters
from strategies.allocation.greedy.candidates import (
    Marks,
    OpenOrders,
    Seekers,
    clear_candidates,
    collect_seekers,
    mark_orders,
    update_open_orders,
    weigh_rest,
)
from strategies.allocation.greedy.nearest import PairHeap, Pairs, Search, match


class GreedyState(Struct):
    """Parameters, the open orders, and room for matching."""

    rest: int = field("int64", "weight of what follows on a first stop, in thousandths")
    active: int = field("int64", "robots that may have an order at once; NIL: all")
    parks: int = field("int64", "1: robots without an order drive home")
    storage: int = field("int64", "where pods are stored: its place among POLICIES")
    keeps_off: Array = field(
        "(1,) uint8", "1 = `active` keeps robots from open orders now", role=SCRATCH
    )
    open_orders: OpenOrders
    marks: Marks
    seekers: Seekers
    search: Search
    heap: PairHeap
    pairs: Pairs


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.allocation, GreedyState.of(memory)
    collect_seekers(view, batch, state.seekers, is_due(view, np.int64(batch.strategy[0])))
    if state.seekers.count[0] > 0:
        first = update_open_orders(view, state.open_orders)
        if state.open_orders.rest.shape[0]:
            weigh_rest(view, workspace, state.open_orders, first, state.rest)
        mark_orders(view, out, state.open_orders, state.marks, state.seekers)
        allowed = robots_allowed(view, state)
        match(view, workspace.stop, state, allowed)
        state.keeps_off[0] = is_kept_off(state, allowed)
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            place_load(view, out, workspace, k, i, state.storage)
    for k in range(state.seekers.count[0]):
        enter_decision(view, out, state, batch, np.int64(state.seekers.robot[k]))
    clear_candidates(state.marks, state.seekers)


@kernel
def robots_allowed(view, state):
    """How many robots that have no order may get one; NIL: all."""
    if state.active == NIL:
        return np.int64(NIL)
    have = 0
    for i in range(view.robots.order.shape[0]):
        have += view.robots.order[i] != NIL
    return max(np.int64(state.active) - have, np.int64(0))


@kernel
def is_kept_off(state, allowed):
    """Whether `active` alone keeps robots from orders that are left; `allowed`: as for match."""
    left = np.int64(state.marks.count[1])
    for k in range(state.seekers.count[0]):
        i = np.int64(state.seekers.robot[k])
        if state.pairs.place[i] != NIL:
            left -= 1
            allowed -= state.seekers.place[i] == NIL
    return state.active != NIL and allowed <= 0 and left > 0


@kernel
def enter_decision(view, out, state, batch, i):
    """What robot i, which seeks, does: its new order, or nothing."""
    k, place = np.int64(state.seekers.entry[i]), np.int64(state.pairs.place[i])
    if place != NIL:
        order = np.int64(state.open_orders.order[place])
        if order != view.robots.order[i]:
            take_order(view, out, k, i, order)
    elif view.robots.order[i] == NIL and state.parks and state.keeps_off[0] == 0:
        if batch.reason[k] != REASON_PERIODIC:
            out.command[k] = CMD_PARK


class Greedy(Strategy):
    """The cheapest pair of a free robot and an open order first; `reassign` parts pairs again."""

    layer = "allocation"
    Parameters = GreedyParameters
    compiled = decide

    def __init__(self, parameters=None):
        super().__init__(parameters)
        self.period = self.parameters.reassign or 0

    def reset(self, view):
        parameters, robots = self.parameters, len(view.robots.cell)
        cells, headings = len(view.grid.kind), int(view.grid.headings)
        places = most_open_orders(view)
        with_loads = bool((view.orders.source != NIL).any())
        poses = cells * headings
        steps = view.rules.duration[:, [ACTION_MOVE, ACTION_TURN]]
        limit = view.grid.min_move_ticks.max(initial=0)
        sizes = {"p": places, "C": cells, "P": poses, "robots": robots}
        sizes |= {"k": 4 * places if with_loads else places, "h": robots, "E": 4 * poses + 8}
        sizes |= {
            "w": len(view.orders.state) if parameters.rest or len(view.rules.priorities) > 1 else 0,
            "power of two": 1 << int(max(steps.max(), limit)).bit_length(),
        }
        return GreedyState(
            rest=round(1000 * parameters.rest),
            active=NIL if parameters.active is None else parameters.active,
            parks=int(parameters.idle == "park"),
            storage=POLICIES.index(parameters.storage),
            keeps_off=np.zeros(1, np.uint8),
            open_orders=OpenOrders.sized(sizes),
            marks=Marks.sized(sizes),
            seekers=Seekers.sized(sizes),
            search=Search.sized(sizes),
            heap=PairHeap.sized(sizes),
            pairs=Pairs.sized(sizes),
        )


def most_open_orders(view):
    """How many orders can be known and not done at once."""
    if view.rules.in_system:
        return int(view.rules.in_system)
    orders = len(view.orders.state)
    return min(orders, len(view.robots.cell)) if view.rules.assigned else orders
