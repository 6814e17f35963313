"""The digest of a state: 64 bits that identify the state, independent of the storage order.

Per array the sum mod 2^64 of hash(array, identity of the element, value): robots by identity,
orders and slots by index. A pure function of the state after a tick. It excludes strategy memory,
scratch, derived arrays (occupancy), and data for metrics (tallies, when and from where an order was
taken).
"""

import numpy as np

from automaton.engine.jit.field_kernels import digest_names, digesting
from automaton.engine.jit.kernel import kernel
from automaton.engine.random_numbers import splitmix64
from automaton.engine.state import NIL, World

DIGEST_NAMES = digest_names(World)
FIRST_OPTIONAL = 60  # number of the first optional array


@kernel
def add_value(out, array, element, value):
    """Add one value of an array to its digest."""
    address = splitmix64((np.uint64(array) << np.uint64(40)) ^ np.uint64(element))
    out[array] += splitmix64(address ^ np.uint64(value))


@kernel
def code_of_cell(robots, i):
    """The cell of robot i; off the floor, the cell to which it returns."""
    if robots.cell[i] == NIL and robots.bay[i] == NIL:
        return -2 - np.int64(robots.home[i])
    return np.int64(robots.cell[i])


@kernel
def code_of_route(robots, i):
    """The hash of the route of robot i."""
    return robots.route_hash[i]


@kernel
def hash_of_design(service_zones):
    """A hash of the design of the zones."""
    design = service_zones.design
    total = np.uint64(design.segments)
    for station in range(design.zone.shape[0]):
        total = splitmix64(total ^ np.uint64(np.int64(design.zone[station])))
    for segment in range(design.segments):
        total = splitmix64(total ^ np.uint64(design.owner[segment]))
        for k in range(design.points[segment]):
            total = splitmix64(total ^ np.uint64(design.path[segment, k]))
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            for station in range(design.zone.shape[0]):
                total = splitmix64(total ^ np.uint64(design.transfer[a, b, station]))
    return total


@kernel
def hash_of_order_queue(r, i):
    """A hash of the plan of robot i."""
    total = np.uint64(r.order_queue_length[i])
    for k in range(r.order_queue_length[i]):
        total = splitmix64(total ^ np.uint64(r.order_queue[i, k]))
    return np.int64(total >> np.uint64(1))


@kernel
def hash_of_tick(world):
    """A hash of the tick."""
    return splitmix64(np.uint64(world.clock.tick))


VALUES = (code_of_cell, code_of_route, hash_of_order_queue, hash_of_design, hash_of_tick)
digest_arrays = digesting(World, add_value, VALUES)


@kernel
def digest_world(world, out):
    """Write the digests of all arrays, in the order of DIGEST_NAMES, to out: (D,) uint64."""
    digest_arrays(world, out)


@kernel
def combine(digests):
    """One digest of the whole state from the digests of its arrays.

    Empty arrays from FIRST_OPTIONAL on are left out, so features that a scenario does not use do
    not change its digests.
    """
    whole = np.uint64(0)
    for k in range(digests.shape[0]):
        if k < FIRST_OPTIONAL or digests[k]:
            whole = splitmix64(whole ^ digests[k])
    return whole
