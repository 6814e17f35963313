"""An order's line in a picture, needed once it is not where it was at the start.

    order 7 delivered to (11, 4) in tick 123, picked up 3 times

Which robot has an order stands in that robot's line; a carried order has a line only if it was set
down on its way before.
"""

from __future__ import annotations

import re

from automaton.errors import InputError
from automaton.picture.phrases import Facts, Phrase, Value, read_facts, write_facts
from automaton.world.plan import FloorPlan
from automaton.world.state import CARRIED, DELIVERED, NIL, WAITING, World

NUMBERS = ("state", "delivered", "legs")

STATE = (
    Phrase("delivered to {place} in tick {delivered}", state=DELIVERED),
    Phrase("lies at {place} as load {spare} for {target}", state=WAITING),
    Phrase("waits on {place} for {target}", state=WAITING),
    Phrase("on its way to {target}", state=CARRIED),
)
GROUPS = (STATE, (Phrase("picked up {legs} time(s)"),))
LINE = re.compile(r"order (?P<number>\d+) (?P<facts>[^;]+)")


def order_line(world: World, plan: FloorPlan, order: int) -> str | None:
    """The line of an order, None if nothing about it needs to be said."""
    facts = order_facts(world, plan, order)
    if facts["place"] == facts["source"] and facts["legs"] == 0:
        return None  # where it was at the start
    if facts["state"] == CARRIED and facts["legs"] == 1:
        return None  # the robot's line says it
    return f"order {order} {', '.join(write_facts(GROUPS, facts, default_facts(facts)))}"


def order_facts(world: World, plan: FloorPlan, order: int) -> Facts:
    """What the world holds of an order, slots as (x, y)."""
    orders = world.orders

    def xy(slot: int) -> Value:
        return None if slot == NIL else plan.xy(int(world.slots.cell[slot]))

    facts: Facts = {name: int(getattr(orders, name)[order]) for name in NUMBERS}
    for name in ("place", "target", "source"):
        facts[name] = xy(int(getattr(orders, name)[order]))
    place = int(orders.place[order])
    facts["spare"] = place - world.slots.spare if place >= world.slots.spare else NIL
    return facts


def default_facts(facts: Facts) -> Facts:
    """The values that a line leaves out: an order with a line was picked up once."""
    numbers: Facts = {"state": NIL, "delivered": NIL, "legs": 1, "spare": NIL}
    return numbers | {"place": None, "target": None}


def read_order(text: str) -> tuple[int, Facts]:
    """Number and values that an order's line gives. Raises InputError."""
    match = LINE.fullmatch(text)
    if match is None:
        raise InputError(f"'{text}' is no line about an order, such as order 7 waits on (3, 4)")
    facts = read_facts(GROUPS, match["facts"], f"order {match['number']}")
    if "state" not in facts:
        raise InputError(f"order {match['number']}: is it delivered, waiting, or on its way?")
    return int(match["number"]), default_facts(facts) | facts
