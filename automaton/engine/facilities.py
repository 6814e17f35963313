"""The floor and its facilities: slots for loads, stations that work on parts, chargers.

C cells with the border, s slots, m orders, K types of robots. NIL (-1) means none.
"""

from __future__ import annotations

from typing import Any, Final

from automaton.engine.jit.structs import (
    CONSTANT,
    DERIVED,
    MEASURED,
    NIL,
    SCRATCH,
    STATE,
    STATIC,
    Array,
    Struct,
    field,
    nested,
)

ACTION_COUNT: Final = 20  # number of actions in automaton.engine.state
MICRO: Final = 1_000_000  # parts of a tick in which handling times at stations are summed
# Strategies by number: one per layer, then further allocations for some types of robots.
STRATEGY_COUNT: Final = 8


class Rules(Struct, role=STATIC):
    """The scenario's constants."""

    seed: Any = field("uint64", "seed of all random draws of a run")
    following: int = field(
        "int64", "FOLLOWING_*: when a robot may begin to move into a cell that another one holds"
    )
    nearest_access: int = field(
        "int64", "1: loads are picked up and dropped from the nearest access cell"
    )
    stop: int = field("int64", "what ends the run: STOP_PARKED, STOP_DELIVERED, ...")
    leave: int = field("int64", "1: a robot with nothing to do leaves the floor where it stands")
    radius: int = field(
        "int64",
        "how far strategies see, in cells; NIL: everything; ORDER_LIST: only the order list and "
        "the neighbouring cells",
    )
    circle: int = field("int64", "shape of the radius; 1: circle (Euclid), 0: square (Chebyshev)")
    in_system: int = field("int64", "number of orders kept open by a closed loop; 0: no loop")
    assigned: int = field(
        "int64", "1: order k is for robot k mod n only, whose next order is known when one is done"
    )
    skip_reached: int = field(
        "int64", "1: if `assigned`, a robot skips an order at whose first stop it stands"
    )
    priorities: Array = field("(p,) int16", "priorities of the orders, highest first")
    join: int = field("int64", "1: lines join trips under way; 0: each line is a trip of its own")
    under: int = field(
        "int64", "1: robots without a load drive under pods; 0: only the robot that lifts the pod"
    )
    loaded_types: int = field(
        "int64", "added to the type of a robot with a load; 0: loads do not change driving"
    )
    own_zones: int = field(
        "int64", "1: strategies see only the orders and stations in zones of robots in sight"
    )
    refinement: int = field("int64", "ticks of the run per tick of the scenario; 1: not refined")
    stride: int = field(
        "int64", "strategies decide, and robots begin operations, only in every `stride`-th tick"
    )
    tick_us: int = field("int64", "microseconds per tick; 0: unknown")
    cell_milli: int = field(
        "int64", "side of a cell in thousandths of the scenario's unit of length; 0: unknown"
    )
    duration: Array = field(f"(K, {ACTION_COUNT}) int32", "ticks of each action, by type of robot")
    payload: Array = field("(K,) int32", "weight of the heaviest order for robots of a type")
    wait: Array = field(
        "(5,) int32",
        "random waits: from, to without a load; from, to with one; retries before right of way is "
        "asked",
    )
    period: Array = field(
        f"({STRATEGY_COUNT},) int32", "ticks between periodic calls of a strategy; 0: never"
    )
    holders: Array = field(f"({STRATEGY_COUNT},) uint8", "1 = the strategy reads traffic.holder")
    allocations: int = field("int64", "number of allocation strategies")
    allocation: Array = field("(K,) uint8", "number of the allocation strategy of a robot type")
    steered: Array = field("(1,) uint8", "1 = right of way steers the robots: they keep no routes")
    watches_chargers: Array = field(
        "(1,) uint8", "1 = charging is asked about idle robots when a place at a charger is free"
    )
    table_bytes: int = field("int64", "memory for distance tables, in bytes")
    slowdown: int = field("int64", "1: a move in a zone with m robots takes m times as long")
    extra_tick: int = field("int64", "probability that a move takes an extra tick, times 2**32")
    handling_jitter: int = field("int64", "largest random delay of a pick or drop, ticks")
    battery: int = field("int64", "1: robots run on batteries")
    drain: Array = field(
        f"(K, {ACTION_COUNT}, 2) int64",
        "units of charge used per tick of each action; [.., 1] loaded",
    )
    curve: Array = field(
        "(K, pieces, 2) int32", "charging curve: charge, units gained per tick above it"
    )
    reserve: Array = field("(K,) int64", "charge that plans must keep in reserve")
    tow_after: int = field("int64", "ticks after which a robot that is down is towed; NIL: never")
    repair: int = field("int64", "ticks from towing until the robot returns; NIL: never")
    repaired: int = field(
        "int64", "charge with which a robot returns; NIL: its own, or the reserve if it ran empty"
    )
    may_fail: int = field("int64", "1: robots may break down or run empty")
    faults: Array = field("(f, 2) int64", "planned faults, by tick: tick, identity of the robot")
    breakdown: int = field("int64", "probability of a fault per tick on the floor, times 2**32")
    repair_in_place: Array = field(
        "(r,) int32", "ticks of a repair in place, entries equally likely; r = 0: robots are towed"
    )


class Grid(Struct, role=CONSTANT):
    """The floor, static; flat index c = y * width + x, with a border wall one cell wide."""

    width: int = field("int64", "cells in a row, border included")
    headings: int = field(
        "int64", "poses per cell: the most headings that any robot type distinguishes"
    )
    kind: Array = field("(C,) uint8", "kind of each cell; values in automaton.floor.floor_plan")
    cell_flags: Array = field(
        "(C,) uint8", "bits 0-3 exits E S W N, bit 4 may turn, bits 5-6 capacity (0 unlimited)"
    )
    type_cell_flags: Array = field(
        "(K, C) uint8",
        "cell_flags for robots of type k, with their exits; bit 7: no path crosses the cell",
        role=CONSTANT,
    )
    drivable: Array = field("(F,) int32", "drivable cells, ascending")
    offset: Array = field(
        "(4,) int64", "difference of flat indices from a cell to its neighbour E, S, W, N"
    )
    slot: Array = field("(C,) int32", "the slot in this cell, or NIL")
    traffic_zone: Array = field(
        "(C, 2) int32",
        "traffic zone of a robot that travels in direction d: [c, d >> 1], or NIL",
        role=CONSTANT,
    )
    traffic_zone_count: int = field(
        "int64", "number of traffic zones (automaton.floor.traffic_zones)"
    )
    move_weight: Array = field(
        "(X,) int32",
        "weights of moves when ways are chosen, in 1/100: [4 c + d]; X = 0: all are 1",
        role=CONSTANT,
    )
    least_weight: int = field(
        "int64", "the least weight of a move, in 1/100; 100 where all weights are 1"
    )
    wait_weight: Array = field(
        "(W,) int32", "weight of a tick of waiting in a cell, in 1/100", role=CONSTANT
    )
    min_move_ticks: Array = field(
        "(M,) uint16",
        "least ticks of a move from cell c in direction d: [4 c + d]; M = 0: no limits",
        role=CONSTANT,
    )
    type_headings: Array = field(
        "(K,) int64",
        "headings that robots of type k distinguish: 1 omni, 2 rail (axes), 4 differential",
        role=CONSTANT,
    )


class Slots(Struct, role=DERIVED):
    """Cells that hold loads: shelves one each; destinations, racks, docks and stations any number.

    Where robots may fail, the last n slots are spare: each holds a load left behind by a robot.
    """

    cell: Array = field(
        "(s,) int32", "cell of the slot; NIL: a spare slot without a load", digest=43, header=True
    )
    unbounded: Array = field("(s,) uint8", "1 = the slot holds any number of loads; 0: a shelf")
    content: Array = field("(s,) int32", "order whose load is on a shelf, or NIL", digest=41)
    reserved_by: Array = field(
        "(s,) int32", "identity of the robot that reserved the slot, or NIL", default=NIL, digest=42
    )
    access: Array = field(
        "(s, 4) int32", "drivable neighbours E, S, W, N, or NIL; of a station: its own cell"
    )
    accessible: Array = field(
        "(K, s) uint8", "1 = robots of this type can reach an access cell of the slot"
    )
    first_spare: int = field("int64", "number of the first spare slot; s: none", role=STATIC)
    reachable: Array = field(
        "(K, C) uint8", "1 = robots of this type can reach the cell and return home", role=CONSTANT
    )


class Chargers(Struct, role=STATIC):
    """Chargers: k cells where robots charge."""

    cell: Array = field("(k,) int32", "cell of the charger")
    charger_at: Array = field("(C,) int32", "the charger in a cell, or NIL")
    places: Array = field("(k,) int32", "number of robots that can charge at once")
    exit_cell: Array = field(
        "(k,) int32",
        "scratch: the cell into which its occupant intends to move, or NIL",
        default=NIL,
        role=SCRATCH,
    )
    first_ticket: Array = field(
        "(k,) int64", "scratch: the lowest ticket in its queue", role=SCRATCH
    )
    busy_ticks: Array = field("(k,) int64", "ticks that robots spent charging", role=MEASURED)
    queue_ticks: Array = field(
        "(k,) int64", "ticks lost on the way to the charger, wherever robots stood", role=MEASURED
    )
    longest_queue: Array = field(
        "(k,) int64", "most robots that stood on the way to the charger in one tick", role=MEASURED
    )
    waiting: Array = field(
        "(k,) int64", "scratch: robots that stand on the way to it", role=SCRATCH
    )


class Stations(Struct, role=STATIC):
    """k stations that process parts, one at a time, first in, first out; j jobs.

    A job is one part at one station.
    """

    at: Array = field("(s,) int32", "number of the station in a slot, or NIL")
    slot: Array = field("(k,) int32", "slot of the station")
    in_service: Array = field("(k,) int32", "the current job, or NIL", default=NIL, digest=44)
    queue_tail: Array = field(
        "(k,) int32", "last job of the queue, or NIL", default=NIL, digest=45, recorded=False
    )
    job_done_tick: Array = field("(k,) int64", "tick in which the current job is done", digest=46)
    part_arrivals: Array = field("(p,) int32", "first job of each part, by arrival tick")
    station: Array = field("(j,) int32", "station of the job")
    processing_time: Array = field("(j,) int32", "duration of the job, in ticks", header=True)
    part: Array = field("(j,) int32", "number of the part")
    releases_order: Array = field(
        "(j,) int32", "order that is released when the job is done; NIL: none"
    )
    next_in_queue: Array = field(
        "(j,) int32", "the next job in the queue, or NIL", default=NIL, digest=47, recorded=False
    )
    arrival_tick: Array = field(
        "(j,) int32", "arrival tick of the part; NIL: unknown", hidden=NIL, digest=48, header=True
    )
    completion_tick: Array = field(
        "(j,) int32", "tick in which the job was done, or NIL", default=NIL, digest=49
    )
    job_of_order: Array = field(
        "(m,) int32", "the job that begins when an order is delivered, or NIL"
    )


class Stops(Struct, role=STATIC):
    """The stops of all orders, one order after another; v stops.

    Those of order k are `orders.first_stop[k]` to `orders.first_stop[k + 1]`, end excluded; of a
    trip, up to the first stop without a cell.
    """

    cell: Array = field(
        "(v,) int32", "where a robot must stand; NIL: not known yet", role=DERIVED, header=True
    )
    ticks: Array = field(
        "(v,) int32",
        "duration in ticks; 0: it is enough to stand there at the end of a tick",
        role=DERIVED,
        header=True,
    )
    done: Array = field("(v,) int32", "tick of completion, or NIL", default=NIL, digest=60)
    arrived: Array = field(
        "(v,) int32",
        "tick in which the robot that last came for the stop arrived there, or NIL",
        default=NIL,
        role=MEASURED,
    )


class Gates(Struct, role=STATIC):
    """Gates let robots into cells only at some times: g gates; without gates all sizes are 0.

    A gate has cells, and a cell may have several gates. All gates are numbered together, in the
    order of their kinds. Fields with a digest number change from tick to tick; the others are
    constant.
    """

    kind: Array = field("(g,) uint8", "kind of the gate: GATE_*")
    cell_first: Array = field(
        "(c + 1,) int32", "gates of cell k: cell_gate[cell_first[k]: cell_first[k + 1]]"
    )
    cell_gate: Array = field("(e,) int32", "gates by cell, in ascending order in each cell")
    cell_index: Array = field(
        "(e,) int32", "lift: index of the last mouth up to the cell, by path; else NIL", default=NIL
    )
    first_closing: Array = field(
        "(g + 1,) int32",
        "closings of gate k: closings[first_closing[k]: first_closing[k + 1]]",
        header=True,
    )
    closings: Array = field(
        "(x, 2) int64", "closings by gate and tick: first tick, tick after the last", header=True
    )
    known: Array = field("(g,) uint8", "1 = routing may know how long a closing lasts")
    replan_after: Array = field(
        "(a,) int64", "lost ticks after which a robot is rerouted around a closing; empty: never"
    )
    max_robots: Array = field("(g,) int32", "number of robots that a block can hold")
    same_way: Array = field(
        "(g,) uint8", "1 = a block is one-way: robots in it at the same time entered over one cell"
    )
    opening_ticks: Array = field(
        "(g,) int64", "ticks that a door, or the doors of a lift, take to open"
    )
    hold_ticks: Array = field("(g,) int64", "ticks without use after which a door shuts")
    travel_ticks: Array = field("(g,) int64", "ticks of a cabin from one mouth to the next")
    cabin_ticks: Array = field(
        "(c, 4) int32", "ticks of a move in a lift, by direction E S W N; 0: as usual"
    )
    closing: Array = field("(g,) int32", "the current or next closing of a gate, from 0", digest=75)
    open_from: Array = field(
        "(g,) int64", "tick from which a door, or a lift at its mouth, lets robots in", digest=76
    )
    used: Array = field("(g,) int64", "last tick in which a door was used or requested", digest=77)
    mouth: Array = field(
        "(g,) int32", "cell last entered (of a block), or cell of the cabin (of a lift)", digest=78
    )
    caller: Array = field(
        "(g,) int32", "identity of the robot that called a lift, or NIL", default=NIL, digest=79
    )
    waited: Array = field(
        "(r,) int64", "ticks lost in front of one closed gate, by identity", digest=80
    )
    waited_for: Array = field(
        "(r,) int32",
        "row of `closings` for which `waited` counts, by identity of the robot, or NIL",
        default=NIL,
        digest=81,
    )
    robots: Array = field("(g,) int32", "robots in it when the tick began", role=SCRATCH)
    held: Array = field(
        "(n,) int32",
        "the gate that blocked a robot in this tick, or NIL",
        default=NIL,
        role=SCRATCH,
    )
    first_entrant: Array = field(
        "(g,) int32", "first entry in the list of its entrants", default=NIL, role=SCRATCH
    )
    entrant: Array = field("(y,) int32", "storage index of a robot", role=SCRATCH)
    entrant_cell: Array = field("(y,) int32", "the cell that it tries to enter", role=SCRATCH)
    next_entrant: Array = field("(y,) int32", "the next entry of the same gate", role=SCRATCH)


# Pods, order lines served by carrying pods to stations, and the resulting trips.
#
# p pods, k stations, l lines of q orders. A *trip* lifts one pod, carries it to some stations and
# stores it again. It is an order of the world, known from the tick in which a line asks for it.
# Trips have as many numbers as lines; w = l times the maximum number of stops of a trip. Orders of
# a list may carry pods without lines: then arrays of trips are indexed by order and stop of the
# list, and arrays of lines are empty. NIL (-1) means none.


class Pods(Struct, role=STATIC):
    """Pods; each is in a slot or on a robot."""

    slot: Array = field(
        "(p,) int32", "slot of the pod; NIL: on a robot", default=NIL, digest=61, header=True
    )
    home: Array = field("(p,) int32", "slot where the pod stood at the start")
    pod_class: Array = field("(p,) int16", "class of the pod, from 0")
    trip: Array = field("(p,) int32", "current trip of the pod, or NIL", default=NIL, digest=62)
    first_line: Array = field(
        "(p,) int32",
        "first line (or order of a list) that waits for the next trip of the pod, or NIL",
        default=NIL,
        digest=63,
    )
    last_line: Array = field(
        "(p,) int32", "last line or order that waits for the next trip", default=NIL, role=DERIVED
    )
    stored: Array = field(
        "(p,) int32", "pods stored in this tick for which lines wait", role=DERIVED
    )
    slot_class: Array = field("(s,) int16", "the class of a storage cell, from 0; other slots: NIL")
    weight: Array = field(
        "(p,) int32", "weight; a robot must be able to carry it", default=1, header=True
    )
    open_lines: Array = field("(p,) int32", "open lines for a pod: known, not done", role=DERIVED)
    sku_first: Array = field(
        "(skus + 1,) int32", "pods with SKU u: sku_pod[sku_first[u]: sku_first[u + 1]]", header=True
    )
    sku_pod: Array = field("(held,) int32", "pods by SKU and number", header=True)


class Lines(Struct, role=STATIC):
    """Order lines: what orders need from pods at stations."""

    order: Array = field("(l,) int32", "order to which the line belongs", header=True)
    pod: Array = field(
        "(l,) int32", "pod that the line asks for; NIL: any with its SKU", default=NIL, header=True
    )
    sku: Array = field(
        "(l,) int32", "the SKU needed from any pod, or NIL", default=NIL, header=True
    )
    taken_from: Array = field(
        "(l,) int32", "pod that serves the line; NIL: not known yet", default=NIL, role=DERIVED
    )
    station: Array = field(
        "(l,) int32", "station that the line asks for; NIL: any", default=NIL, header=True
    )
    release_tick: Array = field("(l,) int32", "tick from which the line is known", header=True)
    due: Array = field("(l,) int32", "tick in which the line is due, or NEVER", header=True)
    priority: Array = field("(l,) int16", "priority: the largest comes first", header=True)
    sequence: Array = field("(l,) int32", "the lines, in the sequence in which they are known")
    handling: Array = field(
        "(h, l) int64", "millionths of a tick that the line takes, by rule of handling", header=True
    )
    served_at: Array = field(
        "(l,) int32", "station that serves the line; NIL: not known yet", default=NIL, digest=64
    )
    following: Array = field(
        "(l,) int32",
        "the next line of the same stop, or the next one that waits for the same pod, or NIL",
        default=NIL,
        role=DERIVED,
    )
    trip: Array = field("(l,) int32", "trip of the line; NIL: none yet", default=NIL, digest=65)
    done: Array = field("(l,) int32", "tick of completion, or NIL", default=NIL, digest=66)
    left: Array = field("(q,) int32", "number of lines of an order that are not done", role=DERIVED)
    order_station: Array = field(
        "(q,) int32", "the station of an order's latest line, or NIL", default=NIL, role=DERIVED
    )
    order_done: Array = field(
        "(q,) int32", "tick in which an order was done, or NIL", default=NIL, role=DERIVED
    )


class Trips(Struct, role=DERIVED):
    """What trips have beyond the fields of all orders; and, by identity, where robots have places."""

    pod: Array = field("(l,) int32", "pod of the trip; NIL: not known yet", default=NIL)
    following: Array = field(
        "(listed,) int32", "order of a list: the next one for the same pod, or NIL", default=NIL
    )
    begun: Array = field("(l,) int32", "number of stops of the trip that were begun", digest=67)
    station: Array = field("(w,) int32", "the station of a stop, or NIL", default=NIL, digest=68)
    handling: Array = field("(w,) int64", "handling time of a stop, in millionths of a tick")
    first_line: Array = field("(w,) int32", "the first line of a stop, or NIL", default=NIL)
    last_line: Array = field("(w,) int32", "the last line of a stop", default=NIL)
    place: Array = field(
        "(r,) int32", "the station at which a robot has a place, or NIL", default=NIL, digest=69
    )
    leaving: Array = field(
        "(r,) int32",
        "further station where a robot keeps a place until it has left the station's cell, or NIL",
        default=NIL,
        digest=70,
    )
    offered: Array = field(
        "(r,) int32",
        "trip of the pod above a robot, if it is reserved for this robot; else NIL",
        default=NIL,
        digest=71,
    )


class PodStations(Struct, role=STATIC):
    """The stations to which pods are carried, by number."""

    cell: Array = field("(k,) int32", "cell of the station", header=True)
    places: Array = field(
        "(k,) int32", "most trips at the station or on the way; NIL: no limit", header=True
    )
    taken: Array = field("(k,) int32", "number of places in use", digest=72)
    open_lines: Array = field("(k,) int32", "number of open lines: known and not done", digest=73)
    rule: Array = field("(k,) int32", "rule of handling: a row of lines.handling", header=True)
    visit: Array = field(
        "(k,) int64", "base duration of a visit, in millionths of a tick", header=True
    )
    station_at: Array = field("(c,) int32", "the station in a cell, or NIL")
    queue_at: Array = field("(c,) int32", "station whose queue contains a cell, or NIL")
    queue_way: Array = field("(c,) uint8", "direction from a cell of a queue to the next one")
    held_back: Array = field(
        "(c,) uint8", "1 = its occupant queues there or is at the station", role=SCRATCH
    )
    ticks_from: Array = field(
        "(d, s) int32",
        "least ticks with a load from a slot to each station; no rows if no line has a SKU",
        header=True,
    )
    breaks: Array = field(
        "(b, 3) int64", "breaks by tick: station, first tick, tick after the last"
    )
    served_ticks: Array = field("(k,) int64", "ticks with a robot in service", role=MEASURED)
    starved_ticks: Array = field(
        "(k,) int64",
        "idle ticks: open lines, no break, and no robot in the cell or queue",
        role=MEASURED,
    )
    visited_at: Array = field(
        "(k,) int64", "last tick in which a robot was in the station's cell or queue", role=MEASURED
    )
    queue_ticks: Array = field("(k,) int64", "ticks that robots lost in the queue", role=MEASURED)
    longest_queue: Array = field(
        "(k,) int64", "most robots that lost the same tick in the queue", role=MEASURED
    )
    waiting: Array = field(
        "(k,) int64", "robots that lost tick `waiting_at` in the queue", role=MEASURED
    )
    waiting_at: Array = field("(k,) int64", "last tick lost in the queue", role=MEASURED)


# Zones that robots serve: the roads between stations, a zone design, and the assignment of robots.
#
# P critical points, S stations, Z zones, M segments (at most one for each station), s slots, m
# orders, n robots. A station is a single slot, or a group of slots (shelves, racks) served from
# near one point. NIL (-1) means none. Without a zoning strategy all arrays are empty. Source of the
# terms: Keith & La, "Dynamic Zoning of Industrial Environments with Autonomous Mobile Robots",
# after Ho & Liao.


MESSAGE_WORDS: Final = 8  # numbers in the message that a robot sends to those in range


class Roads(Struct, role=STATIC):
    """Critical points (stations, crossings, corners, dead ends) and the straight roads between them."""

    cell: Array = field("(P,) int32", "flat cell of the point")
    next: Array = field("(P, 4) int32", "the next point when driving E, S, W, N, or NIL")
    step: Array = field("(P, 4) int32", "distance to the next point E, S, W, N, in cells")
    station: Array = field("(P,) int32", "the station at the point, or NIL")
    point: Array = field("(S,) int32", "the point of each station")
    hop: Array = field(
        "(P, P) int32", "the next point on the shortest path to another point, or NIL"
    )
    between: Array = field(
        "(S, S) int32", "length of the shortest path of two stations in cells, whatever the zones"
    )


class Design(Struct, role=STATE):
    """A zone design; a segment is a path of points from one station of its zone to another."""

    zone: Array = field("(S,) int32", "the zone of each station", default=NIL)
    segments: int = field("() int64", "number of segments in use, which come first")
    owner: Array = field("(M,) int32", "zone of a segment", default=NIL)
    ends: Array = field("(M, 2) int32", "two stations that a segment joins", default=NIL)
    points: Array = field("(M,) int32", "number of points of a segment, including both ends")
    path: Array = field("(M, P) int32", "points of a segment", default=NIL)
    held: Array = field(
        "(P,) int32", "the zone of the station or segment that has the point, or NIL", default=NIL
    )
    transfer: Array = field(
        "(Z, Z, S) uint8", "1 = a transfer station between two zones; symmetric"
    )


class ServiceZones(Struct):
    """The service zones of a world."""

    roads: Roads
    design: Design = nested(digest=50, by="hash_of_design")
    station_of: Array = field("(s,) int32", "the station of a slot, or NIL", role=DERIVED)
    accessible: Array = field(
        "(Z, S) uint8",
        "1 = the robot with the number of the zone can reach the station",
        default=1,
        role=STATIC,
    )
    has_priority: Array = field(
        "(Z, S) uint8", "1 = the robot of the zone has priority at the station", role=STATIC
    )
    server: Array = field(
        "(Z,) int32", "identity of the robot that serves a zone", hidden=NIL, digest=55
    )
    queue: Array = field(
        "(m,) int32",
        "zone whose queue contains the order; NIL: none yet; -2 - z: none now, as a robot of zone "
        "z dropped its load on the way",
        default=NIL,
        digest=51,
    )
    next_slot: Array = field(
        "(m,) int32", "slot where the load is dropped next, or NIL", default=NIL, digest=52
    )
    skips_transfer: Array = field(
        "(m,) uint8", "1 = load sharing: the load goes without transfer stations", digest=53
    )
    picked_from: Array = field(
        "(m,) int32", "slot of the last pick-up, or NIL", default=NIL, digest=54, recorded=False
    )
    halt: Array = field("(n,) int64", "last tick of the halt of a robot", default=NIL, digest=56)
    wake: Array = field(
        "(n,) int64",
        "tick from which zoning is asked about a robot, or NIL",
        default=NIL,
        digest=57,
        recorded=False,
    )
    messages: Array = field(
        f"(n, {MESSAGE_WORDS}) int64",
        "the message that each robot sends to robots in range",
        digest=58,
        recorded=False,
    )


def empty_design(points: int, stations: int, zones: int) -> Design:
    """A design in which no station has a zone."""
    return Design.sized({"P": points, "S": stations, "Z": zones, "M": stations})


def design_for(roads: Roads, zones: int) -> Design:
    """An empty design for these roads."""
    return empty_design(len(roads.cell), len(roads.point), zones)


class Delays(Struct, role=STATIC):
    """Delays: how often they begin, how long they last, and which robots have one.

    A delayed robot begins nothing; a move or a turn under way may take longer by its delay. d =
    number of robots if the scenario has delays, else 0.
    """

    probability: int = field(
        "int64", "probability per robot and tick that a delay begins, times 2**32"
    )
    poisson: int = field(
        "int64", "1: a Poisson number of robots begin a delay, those with the lowest hashes"
    )
    ticks: Array = field("(t,) int32", "durations of delays; all entries are equally likely")
    counts: Array = field(
        "(c,) int64",
        "entry k: probability that a robot adds at most k to the delays of a tick, times 2**32",
    )
    lengthens: Array = field("(A,) uint8", "1 = a delay that begins during this action extends it")
    until: Array = field(
        "(d,) int64", "last tick of the delay, by identity; or 0", digest=74, recorded=False
    )
    lasted: Array = field("(d,) int64", "delayed ticks, by identity", role=MEASURED)
    hash: Array = field("(h,) uint64", "hashes of robots that may begin a delay", role=SCRATCH)
