"""The digest of a state: 64 bits that are equal exactly when the states are, whatever the storage.

Per array the sum mod 2^64 of hash(array, identity of the element, value): robots by identity,
orders and slots by index. A pure function of the state after a tick; strategy memory, scratch,
what follows from other arrays (occupancy) and what is kept for metrics (tallies, when and from
where an order was taken) are left out.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import mix
from automaton.world.state import NIL, TICK

ROBOT_FIELDS = (
    "cell claim heading travel action busy priority load order slot goal stand level try_drop "
    "length at withdrawing blocked hold parked zone need reason route_reason asked_at route "
    "yields charge status until ticket plan charging_reason"
).split()
ORDER_FIELDS = "state place source target by released delivered legs".split()
SLOT_FIELDS = "content by cell".split()
STATION_FIELDS = "first last until".split()
WORK_FIELDS = "behind came done".split()
ZONING_FIELDS = "design queue stop direct leg server halt wake said".split()
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
    *(f"zoning.{name}" for name in ZONING_FIELDS),
    "tick",
)


@kernel
def add_element(out, first, count, values, element):
    """Add the values of one element to the digests of the arrays first .. first + count - 1."""
    for k in range(count):
        address = mix((np.uint64(first + k) << np.uint64(40)) ^ np.uint64(element))
        out[first + k] += mix(address ^ np.uint64(values[k]))


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
        v[1] = o.place[i]
        v[2] = o.source[i]
        v[3] = o.target[i]
        v[4] = o.by[i]
        v[5] = o.released[i]
        v[6] = o.delivered[i]
        v[7] = o.legs[i]
        add_element(out, first, 8, v, i)
    first += ORDER_COUNT
    for i in range(world.slots.content.shape[0]):
        v[0] = world.slots.content[i]
        v[1] = world.slots.by[i]
        v[2] = world.slots.cell[i]
        add_element(out, first, 3, v, i)
    first += SLOT_COUNT
    s = world.stations
    for k in range(s.first.shape[0]):
        v[0] = s.first[k]
        v[1] = s.last[k]
        v[2] = s.until[k]
        add_element(out, first, 3, v, k)
    first += STATION_COUNT
    for j in range(s.done.shape[0]):
        v[0] = s.behind[j]
        v[1] = s.came[j]
        v[2] = s.done[j]
        add_element(out, first, 3, v, j)
    digest_zoning(world, out, first + WORK_COUNT)
    out[out.shape[0] - 1] = mix(np.uint64(world.clock[TICK]))


@kernel
def add_value(out, array, element, value):
    """Add one value of an array to its digest."""
    address = mix((np.uint64(array) << np.uint64(40)) ^ np.uint64(element))
    out[array] += mix(address ^ np.uint64(value))


@kernel
def digest_zoning(world, out, first):
    """Arrays by robot go by identity, the others by index."""
    zoning = world.zoning
    if zoning.queue.shape[0] == 0:
        return
    out[first] = np.uint64(design_sum(zoning.design))
    for order in range(zoning.queue.shape[0]):
        add_value(out, first + 1, order, np.int64(zoning.queue[order]))
        add_value(out, first + 2, order, np.int64(zoning.stop[order]))
        add_value(out, first + 3, order, np.int64(zoning.direct[order]))
        add_value(out, first + 4, order, np.int64(zoning.leg[order]))
    for zone in range(zoning.server.shape[0]):
        add_value(out, first + 5, zone, np.int64(zoning.server[zone]))
    for i in range(zoning.halt.shape[0]):
        identity = np.int64(world.robots.identity[i])
        add_value(out, first + 6, identity, zoning.halt[i])
        add_value(out, first + 7, identity, zoning.wake[i])
        for word in range(zoning.said.shape[1]):
            element = identity * zoning.said.shape[1] + word
            add_value(out, first + 8, element, zoning.said[i, word])


@kernel
def design_sum(design):
    """A hash of a design."""
    total = np.uint64(design.segments[0])
    for station in range(design.zone.shape[0]):
        total = mix(total ^ np.uint64(np.int64(design.zone[station])))
    for segment in range(design.segments[0]):
        total = mix(total ^ np.uint64(design.owner[segment]))
        for k in range(design.points[segment]):
            total = mix(total ^ np.uint64(design.path[segment, k]))
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            for station in range(design.zone.shape[0]):
                total = mix(total ^ np.uint64(design.transfer[a, b, station]))
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
        v[10] = r.goal[i]
        v[11] = r.stand[i]
        v[12] = r.level[i]
        v[13] = r.try_drop[i]
        v[14] = r.length[i]
        v[15] = r.at[i]
        v[16] = r.withdrawing[i]
        v[17] = r.blocked[i]
        v[18] = r.hold[i]
        v[19] = r.parked[i]
        v[20] = r.zone[i]
        v[21] = r.need[i]
        v[22] = r.reason[i]
        v[23] = r.route_reason[i]
        v[24] = r.asked_at[i]
        v[25] = r.route_sum[i]
        v[26] = r.yields[i]
        v[27] = r.charge[i]
        v[28] = r.status[i]
        v[29] = r.until[i]
        v[30] = r.ticket[i]
        v[31] = plan_sum(r, i)
        v[32] = r.charging_reason[i]
        add_element(out, 0, ROBOT_COUNT, v, r.identity[i])


@kernel
def plan_sum(r, i):
    """A hash of the plan of robot i."""
    total = np.uint64(r.planned[i])
    for k in range(r.planned[i]):
        total = mix(total ^ np.uint64(r.plan[i, k]))
    return np.int64(total >> np.uint64(1))


@kernel
def combine(digests):
    """One digest of the whole state from the digests of its arrays."""
    whole = np.uint64(0)
    for k in range(digests.shape[0]):
        whole = mix(whole ^ digests[k])
    return whole
