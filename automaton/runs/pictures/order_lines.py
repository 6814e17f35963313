"""An order's line in a picture, needed once it is not where it was at the start.

    order 7 delivered to (11, 4) in tick 123, picked up 3 times
    order 8 under way; stops in ticks 12 31

Which robot has an order stands in that robot's line; a carried order has a line only if it was set
down on its way before. An order without a load has one as soon as a stop is done.
"""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from automaton.engine.state import (
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_STARTED,
    ORDER_WAITING,
    World,
)
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.asked_orders import has_lines
from automaton.runs.pictures.phrases import Facts, Phrase, Value, read_facts, write_facts

ORDER_NUMBERS = ("state", "delivered", "legs")

STATE_PHRASES = (
    Phrase("delivered to {current_slot} in tick {delivered}", state=ORDER_DELIVERED),
    Phrase("lies at {current_slot} as load {spare} for {target}", state=ORDER_WAITING),
    Phrase("waits on {current_slot} for {target}", state=ORDER_WAITING),
    Phrase("on its way to {target}", state=ORDER_CARRIED),
    Phrase("on its way", state=ORDER_CARRIED),
    Phrase("done in tick {delivered}", state=ORDER_DELIVERED),
    Phrase("waits again", state=ORDER_WAITING),
    Phrase("under way", state=ORDER_STARTED),
)
PHRASE_GROUPS = (STATE_PHRASES, (Phrase("picked up {legs} time(s)"),))
# Values that a line leaves out: an order with a line was picked up once.
LEFT_OUT: Final[Facts] = {
    **{"state": NIL, "delivered": NIL, "legs": 1, "spare": NIL},
    **{"current_slot": None, "target": None},
}
ORDER_LINE = re.compile(
    r"order (?P<number>\d+) (?P<facts>[^;]+)(?:; stops in ticks (?P<stops>[\d ]+))?"
)


def order_line(world: World, floor_plan: FloorPlan, order: int) -> str | None:
    """The line of an order, None if nothing about it needs to be said."""
    facts = order_facts(world, floor_plan, order)
    if facts["current_slot"] == facts["source"] and facts["legs"] == 0:
        return None  # where it was at the start
    stops_done = int(world.orders.stops_done[order])
    if facts["state"] == ORDER_CARRIED and facts["legs"] == 1 and not stops_done:
        return None  # the robot's line says it
    name = "trip" if has_lines(world) else "order"
    line = f"{name} {order} {', '.join(write_facts(PHRASE_GROUPS, facts, LEFT_OUT))}"
    first = int(world.orders.first_stop[order])
    ticks = world.stops.done[first : first + stops_done].tolist()
    return line + (f"; stops in ticks {' '.join(map(str, ticks))}" if ticks else "")


def order_facts(world: World, floor_plan: FloorPlan, order: int) -> Facts:
    """What the world holds of an order, slots as (x, y)."""
    orders = world.orders

    def xy(slot: int) -> Value:
        return None if slot == NIL else floor_plan.xy(int(world.slots.cell[slot]))

    facts: Facts = {name: int(getattr(orders, name)[order]) for name in ORDER_NUMBERS}
    for name in ("current_slot", "target", "source"):
        facts[name] = xy(int(getattr(orders, name)[order]))
    current_slot = int(orders.current_slot[order])
    facts["spare"] = (
        current_slot - world.slots.first_spare if current_slot >= world.slots.first_spare else NIL
    )
    return facts


class OrderLine(NamedTuple):
    """What an order's line says."""

    number: int
    facts: Facts
    stops: list[int]  # the ticks in which its stops were done


def read_order(text: str) -> OrderLine:
    """What an order's line gives. Raises InputError."""
    match = ORDER_LINE.fullmatch(text)
    if match is None:
        raise InputError(f"'{text}' is not a line about an order, such as order 7 waits on (3, 4)")
    facts = read_facts(PHRASE_GROUPS, match["facts"], f"order {match['number']}")
    if "state" not in facts:
        raise InputError(f"order {match['number']}: is it delivered, waiting, or on its way?")
    stops = [int(tick) for tick in (match["stops"] or "").split()]
    return OrderLine(int(match["number"]), LEFT_OUT | facts, stops)
