"""What robots that negotiate remember, tell each other, and reckon with; and who hears whom."""

import numpy as np

from automaton.engine.facilities import MESSAGE_WORDS
from automaton.engine.jit.structs import Struct, field
from automaton.engine.state import NIL, Array
from automaton.strategy.kernels import kernel, position
from strategies.zoning.decentralized.negotiation import NegotiatedParts
from strategies.zoning.design.zone_workspace import ZoneRules, ZoneSpace
from strategies.zoning.queues.reassignment import is_running

NANO = 1_000_000_000  # loads are told in this part of a minute
DEGREES = 1 << 12  # more robots than any robot has in range
BIAS = NANO // 10  # that consensus begins with

# Words of a message.
VALUE = 0  # and 1: what consensus has come to, by even and odd steps: value * DEGREES + degree
REDESIGN = 2  # tick in which the redesign began, 0 before the first
LEADER = 3  # who leads next, as far as this robot knows
TURN = 4  # the number of that turn
TURNS = 5  # turns that this robot led
DONE = 6  # 1: the redesign is over

LEADERS = 33  # stream of the draws of the next leader


class NegotiatorState(Struct):
    """Parameters of robots that negotiate, and what each of them remembers."""

    rules: ZoneRules
    range: int = field("int64", "cells: how far messages reach")
    tolerance: int = field("int64", "nano-minutes that a load may be from the mean")
    patience: int = field("int64", "ticks since the last calm before a redesign")
    hysteresis: int = field("int64", "ticks in or out of tolerance until that counts")
    look_every: int = field("int64", "ticks")
    average_every: int = field("int64", "ticks")
    rounds: int = field("int64", "steps of a consensus")
    turns: int = field("int64", "turns that each robot leads in a redesign")
    iterations: int = field("int64", "exchanges in a turn")
    hot: float = field("float64", "temperature at the beginning of a redesign")
    cold: float = field("float64", "and at its end")
    scale: float = field("float64", "minutes, k of Algorithm 4")
    pause: int = field("int64", "ticks that robots stand still in a redesign")
    sharing: int = field("int64", "1: robots out of tolerance share orders")
    share_every: int = field("int64", "ticks")
    drop_near: int = field(
        "int64", "cells: an order whose station is so near a transfer station goes there; 0: none"
    )
    age: int = field("int64", "weights of Algorithm 2, in thousandths")
    job: int = field("int64")
    first_try: int = field("int64", "tries in which the first zones are not found")

    next_look: Array = field("(n,) int64", "tick of the next look; 0: robot has not begun")
    next_average: Array = field("(n,) int64", "tick of the next consensus")
    next_share: Array = field("(n,) int64", "tick of the next sharing")
    step: Array = field("(n,) int64", "of the consensus that goes on, or NIL")
    mean: Array = field("(n,) int64", "of the last consensus, in nano-minutes; NIL: none yet")
    in_tolerance: Array = field("(n,) int64", "1 in tolerance, 0 out of it, NIL unknown")
    since: Array = field("(n,) int64", "tick since which that is so")
    calm: Array = field("(n,) int64", "tick of the last calm, or of the last redesign")
    led: Array = field("(n,) int64", "turns led in this redesign")
    redesigns: Array = field("(n,) int64", "redesigns that it ended")
    shared_orders: Array = field("(n,) int64", "orders that it gave away")
    messages: Array = field("(n,) int64", "messages that it heard")

    zones: ZoneSpace
    parts: NegotiatedParts


@kernel
def is_near(view, i, j, far):
    """Whether two robots are at most so many cells apart, as the crow flies, and both in order."""
    if i == j or not is_running(view, j):
        return False
    here, there = position(view, i), position(view, j)
    if there == NIL:
        return False
    width = view.grid.width
    across, down = here % width - there % width, here // width - there // width
    return across * across + down * down <= far * far


@kernel
def find_robots_in_range(view, reach, i, far):
    """Mark the zones of a robot and of those in range; returns how many of these there are."""
    count = 0
    for zone in range(reach.shape[0]):
        reach[zone] = 0
        server = np.int64(view.service_zones.server[zone])
        if server == NIL:
            continue
        j = np.int64(view.robots.at_index[server])
        if j == i or is_near(view, i, j, far):
            reach[zone] = 1
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, far):
            count += 1
    return count


@kernel
def begin_message(view, out, k, i):
    """Begin to say something new: what robot i says stays as it is but for what is changed now."""
    if out.sends_message[k] == 0:
        out.sends_message[k] = 1
        for word in range(MESSAGE_WORDS):
            out.messages[k, word] = view.service_zones.messages[i, word]
