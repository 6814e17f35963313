"""Adaptive planning: carry or pass on, decided again for each load by what the robot itself
observed.

Grzejszczak & Nocon ask, as future work, for robots that switch between the two strategies by their
own observations. Here a robot works in an alley as in the cooperative strategy; one that can reserve
none stays home instead of adding to the traffic. With each load it picks up it chooses:

    carry (independent)   2 * way to the load's target * (1 + lost / driven)
    pass (cooperative)    tables before the target * (pick + try + drop + a few moves)

and takes the cheaper one, in ticks. Carrying means to drive there and back; passing means that the
load is handled once more at every table before its target, by whichever robot. `lost / driven` is
the robot's own share of ticks lost to others (waits, refused moves, retreats) over ticks driven
(moves, turns) since the start, with 200 driven ticks of benefit of the doubt: who is often blocked
passes loads on, who drives freely carries them. The robots need no communication beyond the order
list.

Why it helps: passing costs the same everywhere, carrying grows with the way. Far from the target the
brigade handles a load too often (this is why it needs 9,400 ticks for one robot and ten tables),
near the target carrying turns too often. The rule takes the better end of both.
"""

import numpy as np

from automaton.engine.state import (
    ACTION_BLOCKED,
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_RETREAT,
    ACTION_TRY_DROP,
    ACTION_TURN,
    ACTION_WAIT,
    NIL,
    REASON_ORDER_RETURNED,
    REASON_PERIODIC,
)
from automaton.strategy.kernels import (
    deliver,
    distance,
    dropoff_cell,
    kernel,
    places_load,
    position,
)
from automaton.strategy.layer import Strategy
from strategies.allocation.cooperative import AlleyState, alley_state, pass_right, take_in_alley

MOVES_PER_PASS = 4  # along the alley, from one load to the next
PRIOR_TICKS = 200  # driven ticks that a robot starts with


@kernel
def tables_between(view, x, target):
    """Columns of shelves to the right of x and to the left of the target's column."""
    width = view.grid.width
    count, last = 0, NIL
    for slot in range(view.slots.cell.shape[0]):
        column = view.slots.cell[slot] % width
        if x < column < target and column != last and view.slots.unbounded[slot] == 0:
            count += 1
            last = column
    return count


@kernel
def ticks_of(view, i, action):
    """Ticks that robot i spent in an action so far, with and without load."""
    return view.tally.ticks[i, action, 0] + view.tally.ticks[i, action, 1]


@kernel
def is_carrying_cheaper(view, workspace, i):
    """Whether carrying the load to its target costs fewer ticks than passing it on."""
    here = position(view, i)
    width = view.grid.width
    target = np.int64(view.orders.target[view.robots.load[i]])
    tables = tables_between(view, here % width, view.slots.cell[target] % width)
    if tables == 0:
        return True
    robot_type = view.robots.type[i]
    duration = view.rules.duration[robot_type]
    handling = duration[ACTION_PICK] + duration[ACTION_TRY_DROP] + duration[ACTION_DROP]
    passing = tables * (handling + MOVES_PER_PASS * duration[ACTION_MOVE])
    heading = np.int64(view.robots.heading[i])
    way = distance(
        view, workspace, robot_type, here, heading, dropoff_cell(view, robot_type, target, here)
    )
    lost = (
        ticks_of(view, i, ACTION_WAIT)
        + ticks_of(view, i, ACTION_BLOCKED)
        + ticks_of(view, i, ACTION_RETREAT)
    )
    driven = PRIOR_TICKS + ticks_of(view, i, ACTION_MOVE) + ticks_of(view, i, ACTION_TURN)
    return 2 * way * (driven + lost) < passing * driven


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.allocation, AlleyState.of(memory)
    for k in range(batch.count[0]):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        reason = batch.reason[k]
        if places_load(reason) and is_carrying_cheaper(view, workspace, i):
            deliver(view, out, k, i)
        elif places_load(reason):
            pass_right(view, out, state, k, i)
        elif reason != REASON_PERIODIC:
            take_in_alley(view, out, state, workspace, k, i, reason == REASON_ORDER_RETURNED)


class Adaptive(Strategy):
    """Each robot passes a load on or carries it, whichever costs less by its own experience."""

    layer = "allocation"
    compiled = decide

    def reset(self, view):
        return alley_state(view)
