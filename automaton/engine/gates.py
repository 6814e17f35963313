"""Gates: whether they are closed, shut or full, how long a move in a lift takes, and whom they
admit."""

import numpy as np

from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import AT_GATE, LIVE, is_before, is_empty
from automaton.engine.state import (
    GATE_BLOCK,
    GATE_CLOSING,
    GATE_DOOR,
    GATE_LIFT,
    GOAL_NONE,
    GOAL_PARK,
    NEVER,
    NIL,
    NO_STEP,
)


@kernel
def has_gates(view):
    """Whether there are gates on the floor."""
    return view.gates.kind.shape[0] > 0


@kernel
def is_gated(view, cell):
    """Whether a cell has a gate."""
    return view.gates.cell_first[cell] != view.gates.cell_first[cell + 1]


@kernel
def index_in(gates, cell, gate):
    """The index of a cell in a gate, or NIL: not in it."""
    for entry in range(gates.cell_first[cell], gates.cell_first[cell + 1]):
        if gates.cell_gate[entry] == gate:
            return entry
    return NIL


@kernel
def is_closed_now(view, gate):
    """Whether a closing is in effect."""
    row = view.gates.first_closing[gate] + view.gates.closing[gate]
    tick = view.clock.tick
    return (
        row < view.gates.first_closing[gate + 1]
        and view.gates.closings[row, 0] <= tick < view.gates.closings[row, 1]
    )


@kernel
def closed_until(view, cell, known):
    """The tick in which a closed cell opens again; 0 if it is not closed now.

    `known`: count only closings whose duration routing may know.
    """
    gates, until = view.gates, np.int64(0)
    if gates.kind.shape[0] == 0:
        return until
    for entry in range(gates.cell_first[cell], gates.cell_first[cell + 1]):
        gate = gates.cell_gate[entry]
        if gates.kind[gate] == GATE_CLOSING and is_closed_now(view, gate):
            if gates.known[gate] or not known:
                row = gates.first_closing[gate] + gates.closing[gate]
                until = max(until, gates.closings[row, 1])
    return until


@kernel
def is_shut(view, gate):
    """Whether a closing or a shut door admits no robot."""
    if view.gates.kind[gate] == GATE_CLOSING:
        return is_closed_now(view, gate)
    return view.gates.kind[gate] == GATE_DOOR and (view.gates.open_from[gate] > view.clock.tick)


@kernel
def gate_before(view, i, to):
    """The gate that keeps robot i out of an adjacent cell in this tick, however others move; or NIL."""
    gates, cell = view.gates, np.int64(view.robots.cell[i])
    if gates.kind.shape[0] == 0:
        return np.int64(NIL)
    for entry in range(gates.cell_first[to], gates.cell_first[to + 1]):
        gate = np.int64(gates.cell_gate[entry])
        if cell != NIL and index_in(gates, cell, gate) != NIL:
            continue
        if is_shut(view, gate):
            return gate
        if gates.kind[gate] < GATE_BLOCK:
            continue
        if gates.robots[gate] >= gates.max_robots[gate]:
            return gate
        if gates.kind[gate] == GATE_LIFT:
            if gates.mouth[gate] != to or gates.open_from[gate] > view.clock.tick:
                return gate
            if gates.caller[gate] != view.robots.identity[i]:
                return gate
        elif gates.same_way[gate] and gates.robots[gate]:
            if gates.mouth[gate] != NIL and gates.mouth[gate] != to:
                return gate
    return np.int64(NIL)


@kernel
def opens_soon(view, gate, i):
    """Whether a gate that blocks robot i opens to it by itself: a door, or a lift that comes for it."""
    gates = view.gates
    if gates.kind[gate] != GATE_LIFT:
        return gates.kind[gate] == GATE_DOOR
    is_for_it = gates.caller[gate] == NIL or gates.caller[gate] == view.robots.identity[i]
    return gates.robots[gate] == 0 and is_for_it


@kernel
def is_in_full_gate(view, cell):
    """Whether a cell is in a block or lift that is full."""
    gates = view.gates
    if gates.kind.shape[0] == 0:
        return False
    for entry in range(gates.cell_first[cell], gates.cell_first[cell + 1]):
        gate = gates.cell_gate[entry]
        if gates.kind[gate] >= GATE_BLOCK and gates.robots[gate] >= gates.max_robots[gate]:
            return True
    return False


@kernel
def set_cabin_ticks(world):
    """Set the ticks of moves in lifts: their share of the travel time from one mouth to the next."""
    robots, traffic = world.robots, world.traffic
    for i in range(robots.cell.shape[0]):
        intent = np.int64(traffic.intent[U(i)])
        if intent & LIVE:
            ticks = world.gates.cabin_ticks[U(robots.cell[U(i)]), U(intent & 3)]
            if ticks:
                traffic.move_ticks[U(i)] = ticks


@kernel
def is_cabin_move(world, i, direction):
    """Whether the last or current move of robot i takes the ticks of a lift."""
    cell = np.int64(world.robots.cell[U(i)])
    if world.robots.claim[U(i)] == NIL:
        cell -= world.grid.offset[U(direction)]
    return world.gates.cabin_ticks[U(cell), U(direction)] != 0


# Gates in a tick: which robots enter, which are held, which doors open, where cabins go.
#
# A robot whose move a gate refuses does not take part in the motion of this tick. Entrants of a
# block or lift are ranked like claimants of a cell: by priority, then by a hash of tick and
# identity.


@kernel
def update_gates(world):
    """Before any decision: closings advance, doors shut, cabins stay where they were left."""
    gates, tick = world.gates, world.clock.tick
    count_robots(world)
    for gate in range(gates.kind.shape[0]):
        if gates.kind[gate] == GATE_CLOSING:
            first, end = gates.first_closing[gate], gates.first_closing[gate + 1]
            row = first + gates.closing[gate]
            while row < end and gates.closings[row, 1] <= tick:
                row += 1
            gates.closing[gate] = row - first
        elif gates.kind[gate] == GATE_DOOR:
            if gates.robots[gate]:
                gates.used[gate] = tick
            unused_since = max(gates.used[gate], gates.open_from[gate])
            if gates.open_from[gate] <= tick and tick > unused_since + gates.hold_ticks[gate]:
                gates.open_from[gate] = NEVER
        elif gates.kind[gate] == GATE_LIFT and gates.robots[gate]:
            gates.open_from[gate] = NEVER
            gates.caller[gate] = NIL


@kernel
def count_robots(world):
    """Count the robots in each gate, and locate the cabins of occupied lifts."""
    gates, robots = world.gates, world.robots
    gates.robots[:] = 0
    for i in range(robots.cell.shape[0]):
        cell, claim = np.int64(robots.cell[U(i)]), np.int64(robots.claim[U(i)])
        if cell == NIL:
            continue
        for entry in range(gates.cell_first[cell], gates.cell_first[cell + 1]):
            gate = gates.cell_gate[entry]
            gates.robots[gate] += 1
            if gates.cell_index[entry] != NIL:
                gates.mouth[gate] = cell
        if claim == NIL or claim == cell:
            continue
        for entry in range(gates.cell_first[claim], gates.cell_first[claim + 1]):
            if index_in(gates, cell, gates.cell_gate[entry]) == NIL:
                gates.robots[gates.cell_gate[entry]] += 1


@kernel
def hold_at_gates(world):
    """Cancel the moves that gates refuse: call after all intents are known, before claims are made."""
    gates, robots, traffic = world.gates, world.robots, world.traffic
    entrants = 0
    for i in range(robots.cell.shape[0]):
        if robots.cell[U(i)] == NIL:
            continue
        gates.held[U(i)] = NIL
        intent = np.int64(traffic.intent[U(i)])
        if intent & LIVE == 0:
            continue
        cell, direction = np.int64(robots.cell[U(i)]), intent & 3
        if (np.int64(world.grid.cell_flags[U(cell)]) >> direction) & 1:
            entrants = ask(world, i, cell, cell + world.grid.offset[U(direction)], entrants)
    if entrants:
        let_in(world)
    for i in range(robots.cell.shape[0]):
        if gates.held[U(i)] != NIL and robots.cell[U(i)] != NIL:
            traffic.intent[U(i)] = AT_GATE | (np.int64(traffic.intent[U(i)]) & 3)


@kernel
def ask_gates_of_bays(world):
    """Find the robots that gates hold in their parking bay; they are checked before all moves."""
    gates, robots, tick = world.gates, world.robots, world.clock.tick
    entrants = 0
    for i in range(robots.cell.shape[0]):
        if robots.cell[i] != NIL:
            continue
        gates.held[i] = NIL
        home = np.int64(robots.home[i])
        if robots.parked[i] and wants_out(world, i) and is_gated(world, home):
            if is_empty(world.traffic, home, np.int64(robots.heading[i]), tick):
                entrants = ask(world, i, np.int64(NIL), home, entrants)
    if entrants:
        let_in(world)


@kernel
def wants_out(world, i):
    """Whether robot i, parked, is about to leave its parking bay."""
    robots, tick = world.robots, world.clock.tick
    if robots.busy[i] or robots.goal_type[i] in (GOAL_NONE, GOAL_PARK):
        return False
    if world.clock.halted_until >= tick and world.service_zones.halt[i] >= tick:
        return False
    if world.rules.steered[0]:
        return robots.step[i] < NO_STEP
    has_route = robots.route_index[i] < robots.route_length[i]
    return has_route or robots.goal_cell[i] == robots.home[i]


@kernel
def enter_from_bay(world, cell):
    """A robot has left its parking bay into a cell: it counts against robots that try to enter now."""
    for entry in range(world.gates.cell_first[cell], world.gates.cell_first[cell + 1]):
        world.gates.robots[world.gates.cell_gate[entry]] += 1


@kernel
def ask(world, i, cell, to, entrants):
    """Robot i tries to go from a cell (NIL: its parking bay) into another; returns the number of
    entrants."""
    gates = world.gates
    for entry in range(gates.cell_first[to], gates.cell_first[to + 1]):
        gate = np.int64(gates.cell_gate[entry])
        if cell != NIL and index_in(gates, cell, gate) != NIL:
            continue
        if gates.kind[gate] == GATE_DOOR:
            use_door(world, gate)
        if is_shut(world, gate):
            gates.held[U(i)] = gate
            return entrants
        if gates.kind[gate] >= GATE_BLOCK:
            gates.entrant[entrants] = i
            gates.entrant_cell[entrants] = to
            gates.next_entrant[entrants] = gates.first_entrant[gate]
            gates.first_entrant[gate] = entrants
            entrants += 1
    return entrants


@kernel
def use_door(world, gate):
    """A robot requests a door: the door begins to open, or stays open."""
    gates, tick = world.gates, world.clock.tick
    gates.used[gate] = tick
    if gates.open_from[gate] == NEVER:
        gates.open_from[gate] = tick + gates.opening_ticks[gate]


@kernel
def let_in(world):
    """Decide which entrants of each block and lift may enter; hold the others."""
    gates = world.gates
    for gate in range(gates.kind.shape[0]):
        if gates.first_entrant[gate] == NIL:
            continue
        if gates.kind[gate] == GATE_LIFT:
            let_into_lift(world, gate)
        else:
            let_into_block(world, gate)
        gates.first_entrant[gate] = NIL


@kernel
def best_entrant(world, gate, mouth):
    """The first-ranked entrant of a gate into this cell (NIL: into any cell); or NIL."""
    gates = world.gates
    best, entry = NIL, gates.first_entrant[gate]
    while entry != NIL:
        i = np.int64(gates.entrant[entry])
        fits = mouth == NIL or gates.entrant_cell[entry] == mouth
        if fits and gates.held[i] == NIL:
            if best == NIL or is_before(
                world.robots, world.clock.coarse_tick, i, np.int64(gates.entrant[best])
            ):
                best = entry
        entry = gates.next_entrant[entry]
    return best


@kernel
def hold_entrants(world, gate):
    """Hold all entrants that a gate has not admitted."""
    gates = world.gates
    entry = gates.first_entrant[gate]
    while entry != NIL:
        i = np.int64(gates.entrant[entry])
        if gates.held[i] == NIL:
            gates.held[i] = gate
        entry = gates.next_entrant[entry]


@kernel
def let_into_block(world, gate):
    """The best-ranked entrants enter while there is room; in a one-way block, over one cell."""
    gates = world.gates
    room = gates.max_robots[gate] - gates.robots[gate]
    mouth = np.int64(NIL)
    if gates.same_way[gate]:
        mouth = np.int64(gates.mouth[gate]) if gates.robots[gate] else mouth
        if mouth == NIL:
            best = best_entrant(world, gate, NIL)
            if best != NIL and room > 0:
                mouth = np.int64(gates.entrant_cell[best])
                gates.mouth[gate] = mouth
    head = NIL  # admitted entries, removed from the list
    while room > 0:
        best = best_entrant(world, gate, mouth)
        if best == NIL:
            break
        head = move_entry(gates, gate, best, head)
        room -= 1
    hold_entrants(world, gate)


@kernel
def move_entry(gates, gate, entry, head):
    """Move an entry from the list of a gate to the head of another list; returns the new head."""
    before = gates.first_entrant[gate]
    if before == entry:
        gates.first_entrant[gate] = gates.next_entrant[entry]
    else:
        while gates.next_entrant[before] != entry:
            before = gates.next_entrant[before]
        gates.next_entrant[before] = gates.next_entrant[entry]
    gates.next_entrant[entry] = head
    return entry


@kernel
def let_into_lift(world, gate):
    """The robot that called enters when the cabin is there; a lift that was not called is called."""
    gates, tick = world.gates, world.clock.tick
    if gates.robots[gate] == 0:
        caller = find_caller(world, gate)
        if caller == NIL:
            return
        if gates.open_from[gate] <= tick:
            move_entry(gates, gate, caller, NIL)
    hold_entrants(world, gate)


@kernel
def find_caller(world, gate):
    """The entry of the robot for which the cabin comes; NIL: no robot tries to enter.

    First the robot that called; else one at the same mouth; else one for which the cabin is called.
    """
    gates, tick = world.gates, world.clock.tick
    entry = gates.first_entrant[gate]
    while entry != NIL:
        i = np.int64(gates.entrant[entry])
        calls = world.robots.identity[i] == gates.caller[gate]
        if calls and gates.held[i] == NIL and gates.entrant_cell[entry] == gates.mouth[gate]:
            return entry
        entry = gates.next_entrant[entry]
    is_called = gates.caller[gate] != NIL
    best = best_entrant(world, gate, np.int64(gates.mouth[gate]) if is_called else NIL)
    if best == NIL and is_called:
        best = best_entrant(world, gate, NIL)
    if best == NIL:
        return NIL
    to = np.int64(gates.entrant_cell[best])
    if not is_called or to != gates.mouth[gate]:
        begins = max(tick, gates.open_from[gate]) if is_called else tick
        way = abs(
            gates.cell_index[index_in(gates, to, gate)]
            - gates.cell_index[index_in(gates, np.int64(gates.mouth[gate]), gate)]
        )
        gates.open_from[gate] = begins + gates.travel_ticks[gate] * way + gates.opening_ticks[gate]
        gates.mouth[gate] = to
    gates.caller[gate] = world.robots.identity[gates.entrant[best]]
    return best


@kernel
def note_closing(world, i):
    """Count a lost tick of robot i; returns whether it has waited long enough to plan around a
    closing."""
    gates = world.gates
    gate, identity = np.int64(gates.held[i]), np.int64(world.robots.identity[i])
    if gates.kind[gate] != GATE_CLOSING or gates.replan_after.shape[0] == 0:
        return False
    row = gates.first_closing[gate] + gates.closing[gate]
    if gates.waited_for[identity] != row:
        gates.waited_for[identity] = row
        gates.waited[identity] = 0
    gates.waited[identity] += world.rules.stride
    return gates.waited[identity] == gates.replan_after[0]
