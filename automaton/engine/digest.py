"""The digest of a state: 64 bits that are equal exactly when the states are, whatever the storage.

Per array the sum mod 2^64 of hash(array, identity of the element, value): robots by identity,
orders and slots by index. A pure function of the state after a tick; strategy memory, scratch,
what follows from other arrays (occupancy) and what is kept for metrics (tallies, when and from
where an order was taken) are left out.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.random_numbers import splitmix64
from automaton.engine.state import CLOCK_TICK, NIL

ROBOT_FIELDS = (
    "cell claim heading travel action busy priority load order slot goal_type goal_cell charge_target "
    "try_drop route_length route_index retreat_moves failed_retries retry_state parked service_zone need "
    "reason route_reason seen_revision route "
    "charging_interruptible charge status status_until ticket order_queue charging_reason"
).split()
ORDER_FIELDS = "state current_slot source target reserved_by release_tick delivered legs".split()
SLOT_FIELDS = "content reserved_by cell".split()
STATION_FIELDS = "in_service queue_tail job_done_tick".split()
WORK_FIELDS = "next_in_queue arrival_tick completion_tick".split()
ZONING_FIELDS = (
    "design queue next_slot skips_transfer picked_from server halt wake messages".split()
)
ROBOT_COUNT = len(ROBOT_FIELDS)
ORDER_COUNT = len(ORDER_FIELDS)
SLOT_COUNT = len(SLOT_FIELDS)
STATION_COUNT = len(STATION_FIELDS)
WORK_COUNT = len(WORK_FIELDS)
DIGEST_NAMES = (
    *(f"robots.{name}" for name in ROBOT_FIELDS),
    *(f"orders.{name}" for name in ORDER_FIELDS),
    *(f"slots.{name}" for name in SLOT_FIELDS),
    *(f"stations.{name}" for name in (*STATION_FIELDS, *WORK_FIELDS)),
    *(f"service_zones.{name}" for name in ZONING_FIELDS),
    "tick",
)


@kernel
def add_element(out, first, count, values, element):
    """Add the values of one element to the digests of the arrays first .. first + count - 1."""
    for k in range(count):
        address = splitmix64((np.uint64(first + k) << np.uint64(40)) ^ np.uint64(element))
        out[first + k] += splitmix64(address ^ np.uint64(values[k]))


@kernel
def digest_world(world, out, v):
    """Write the digests of all arrays, in the order of DIGEST_NAMES, into out: (D,) uint64.

    `v`: (D,) int64, scratch.
    """
    out[:] = np.uint64(0)
    digest_robots(world.robots, out, v)
    first = ROBOT_COUNT
    o = world.orders
    for i in range(o.state.shape[0]):
        v[0] = o.state[i]
        v[1] = o.current_slot[i]
        v[2] = o.source[i]
        v[3] = o.target[i]
        v[4] = o.reserved_by[i]
        v[5] = o.release_tick[i]
        v[6] = o.delivered[i]
        v[7] = o.legs[i]
        add_element(out, first, 8, v, i)
    first += ORDER_COUNT
    for i in range(world.slots.content.shape[0]):
        v[0] = world.slots.content[i]
        v[1] = world.slots.reserved_by[i]
        v[2] = world.slots.cell[i]
        add_element(out, first, 3, v, i)
    first += SLOT_COUNT
    s = world.stations
    for k in range(s.in_service.shape[0]):
        v[0] = s.in_service[k]
        v[1] = s.queue_tail[k]
        v[2] = s.job_done_tick[k]
        add_element(out, first, 3, v, k)
    first += STATION_COUNT
    for j in range(s.completion_tick.shape[0]):
        v[0] = s.next_in_queue[j]
        v[1] = s.arrival_tick[j]
        v[2] = s.completion_tick[j]
        add_element(out, first, 3, v, j)
    digest_zoning(world, out, first + WORK_COUNT)
    out[out.shape[0] - 1] = splitmix64(np.uint64(world.clock[CLOCK_TICK]))


@kernel
def add_value(out, array, element, value):
    """Add one value of an array to its digest."""
    address = splitmix64((np.uint64(array) << np.uint64(40)) ^ np.uint64(element))
    out[array] += splitmix64(address ^ np.uint64(value))


@kernel
def digest_zoning(world, out, first):
    """Arrays by robot go by identity, the others by index."""
    service_zones = world.service_zones
    if service_zones.queue.shape[0] == 0:
        return
    out[first] = np.uint64(design_sum(service_zones.design))
    for order in range(service_zones.queue.shape[0]):
        add_value(out, first + 1, order, np.int64(service_zones.queue[order]))
        add_value(out, first + 2, order, np.int64(service_zones.next_slot[order]))
        add_value(out, first + 3, order, np.int64(service_zones.skips_transfer[order]))
        add_value(out, first + 4, order, np.int64(service_zones.picked_from[order]))
    for zone in range(service_zones.server.shape[0]):
        add_value(out, first + 5, zone, np.int64(service_zones.server[zone]))
    for i in range(service_zones.halt.shape[0]):
        identity = np.int64(world.robots.identity[i])
        add_value(out, first + 6, identity, service_zones.halt[i])
        add_value(out, first + 7, identity, service_zones.wake[i])
        for word in range(service_zones.messages.shape[1]):
            element = identity * service_zones.messages.shape[1] + word
            add_value(out, first + 8, element, service_zones.messages[i, word])


@kernel
def design_sum(design):
    """A hash of a design."""
    total = np.uint64(design.segments[0])
    for station in range(design.zone.shape[0]):
        total = splitmix64(total ^ np.uint64(np.int64(design.zone[station])))
    for segment in range(design.segments[0]):
        total = splitmix64(total ^ np.uint64(design.owner[segment]))
        for k in range(design.points[segment]):
            total = splitmix64(total ^ np.uint64(design.path[segment, k]))
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            for station in range(design.zone.shape[0]):
                total = splitmix64(total ^ np.uint64(design.transfer[a, b, station]))
    return total


@kernel
def digest_robots(r, out, v):
    for i in range(r.cell.shape[0]):
        v[0] = r.cell[i]
        if r.cell[i] == NIL and r.bay[i] == NIL:
            v[0] = -2 - r.home[i]  # off the floor, and it comes back there
        v[1] = r.claim[i]
        v[2] = r.heading[i]
        v[3] = r.travel[i]
        v[4] = r.action[i]
        v[5] = r.busy[i]
        v[6] = r.priority[i]
        v[7] = r.load[i]
        v[8] = r.order[i]
        v[9] = r.slot[i]
        v[10] = r.goal_type[i]
        v[11] = r.goal_cell[i]
        v[12] = r.charge_target[i]
        v[13] = r.try_drop[i]
        v[14] = r.route_length[i]
        v[15] = r.route_index[i]
        v[16] = r.retreat_moves[i]
        v[17] = r.failed_retries[i]
        v[18] = r.retry_state[i]
        v[19] = r.parked[i]
        v[20] = r.service_zone[i]
        v[21] = r.need[i]
        v[22] = r.reason[i]
        v[23] = r.route_reason[i]
        v[24] = r.seen_revision[i]
        v[25] = r.route_hash[i]
        v[26] = r.charging_interruptible[i]
        v[27] = r.charge[i]
        v[28] = r.status[i]
        v[29] = r.status_until[i]
        v[30] = r.ticket[i]
        v[31] = order_queue_hash(r, i)
        v[32] = r.charging_reason[i]
        add_element(out, 0, ROBOT_COUNT, v, r.identity[i])


@kernel
def order_queue_hash(r, i):
    """A hash of the plan of robot i."""
    total = np.uint64(r.order_queue_length[i])
    for k in range(r.order_queue_length[i]):
        total = splitmix64(total ^ np.uint64(r.order_queue[i, k]))
    return np.int64(total >> np.uint64(1))


@kernel
def combine(digests):
    """One digest of the whole state from the digests of its arrays."""
    whole = np.uint64(0)
    for k in range(digests.shape[0]):
        whole = splitmix64(whole ^ digests[k])
    return whole
