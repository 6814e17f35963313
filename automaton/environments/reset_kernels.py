"""The compiled reset of a world: arrays are copied, and kernels draw what depends on the seed.

The draws are those of `automaton.world`: random starts, and the stops of tours.
"""

from functools import cache
from typing import Any, Final

import numpy as np
from numba import types

from automaton.engine.jit.kernel import jit_is_on
from automaton.engine.jit.struct_types import copy_bytes, struct_at
from automaton.engine.random_numbers import STREAM_ORDERS, STREAM_STARTS, STREAM_VISITS
from automaton.strategy.api import (
    Array,
    Struct,
    World,
    field,
    kernel,
    pop,
    push,
    random_between,
    random_bits,
)

START_NEVER: Final = 2  # automaton.world.starts
ASSIGN_POOL: Final = 0  # any robot may do an order
ASSIGN_ROUND_ROBIN: Final = 1  # order k is for robot k mod n
DRAW_BITS: Final = 31
ROOM_BOTH_LANES: Final = 96  # bits of occupancy
ROOM_ONE_LANE: Final = 32


class Draws(Struct):
    """What a seed draws: n robots, c drivable cells, C cells, g cells of stops in k groups."""

    cells: Array = field("(c,) int32", "drivable cells, if starts are drawn")
    order: Array = field("(c,) uint8", "when robots begin there (automaton.world.starts)")
    keys: Array = field("(c,) int64", "scratch: a heap of draws")
    headings: Array = field("(h,) uint8", "heading of a robot that begins in a cell; h = 0: kept")
    occupancy: Array = field("(C,) uint16", "occupancy without robots")
    stops: Array = field("(g,) int32", "cells of stops, group by group; g = 0: kept")
    first: Array = field("(k,) int64", "first cell of each group, and the end of the last one")
    begins: Array = field(
        "(C,) uint8", "1 = a robot that begins here visits the second group first"
    )
    assign: int = field("int64", "ASSIGN_POOL or ASSIGN_ROUND_ROBIN")
    address: int = field("int64", "of draws: of a first stop; in turn, the most stops of an order")


class Copies(Struct):
    """What is copied into a world: k arrays."""

    rows: Array = field("(k, 3) int64", "addresses: to, from; bytes")
    seed: Array = field("(1,) uint64", "the seed, from which its words are copied")


world_at, draws_at, copies_at = (struct_at(one, True) for one in (World, Draws, Copies))


def restore_world(world_address, draws_address, copies_address):
    """Bring a world to tick 0 of the episode of `copies.seed`."""
    world, draws, copies = (
        world_at(world_address),
        draws_at(draws_address),
        copies_at(copies_address),
    )
    for k in range(copies.rows.shape[0]):
        copy_bytes(copies.rows[k, 0], copies.rows[k, 1], copies.rows[k, 2])
    seed = copies.seed[0]
    if draws.cells.shape[0]:
        draw_starts(world, draws, seed)
    if draws.stops.shape[0]:
        draw_stops(world, draws, seed)


@kernel
def draw_starts(world, draws, seed):
    """Robots begin in the cells of the least draws, as in `random_cells`."""
    robots, occupancy, heap = world.robots, world.traffic.occupancy, draws.keys
    size = 0
    for k in range(draws.cells.shape[0]):
        if draws.order[k] != START_NEVER:
            draw = random_between(0, 2**DRAW_BITS - 1, seed, STREAM_STARTS, 0, k)
            push(heap, size, np.int64(draws.order[k]) << 2 * DRAW_BITS | draw << DRAW_BITS | k)
            size += 1
    for cell in range(occupancy.shape[0]):
        occupancy[cell] = draws.occupancy[cell]
    for i in range(robots.cell.shape[0]):
        place = pop(heap, size) & (2**DRAW_BITS - 1)
        size -= 1
        cell = np.int64(draws.cells[place])
        robots.cell[i] = cell
        robots.home[i] = cell
        if draws.headings.shape[0]:
            robots.heading[i] = draws.headings[cell]
            robots.travel[i] = draws.headings[cell]
        capacity = np.int64(world.grid.cell_flags[cell]) >> 5 & 3
        if capacity == 1:
            occupancy[cell] &= np.uint16(~ROOM_BOTH_LANES & 65535)
        elif capacity == 2:
            lane = ROOM_ONE_LANE << (np.int64(robots.heading[i]) >> 1)
            occupancy[cell] &= np.uint16(~lane & 65535)


@kernel
def draw_stops(world, draws, seed):
    """Draw the stops of tours, as in `drawn_stops` and `stops_of_robots`."""
    orders, stops, robots = world.orders, world.stops, world.robots.cell.shape[0]
    groups = draws.first.shape[0] - 1
    for order in range(orders.state.shape[0]):
        begin, at = np.int64(orders.first_stop[order]), np.int64(0)
        count = np.int64(orders.first_stop[order + 1]) - begin
        for place in range(count):
            if draws.assign == ASSIGN_POOL:
                many = draws.stops.shape[0]
                others = many - 1 if place else many
                draw = random_between(
                    0, others - 1, seed, STREAM_ORDERS, draws.address + place, order
                )
                at = (at + 1 + draw) % many if place else draw
            else:
                number, robot = order // robots, order % robots
                bits = random_bits(seed, STREAM_VISITS, number * draws.address + place, robot)
                share = (np.float64(bits >> np.uint64(11)) + 0.5) * 2.0**-53
                turned = draws.begins[world.robots.home[robot]]
                group = (number * count + place + turned) % groups
                first = draws.first[group]
                at = first + np.int64(share * (draws.first[group + 1] - first))
            stops.cell[begin + place] = draws.stops[at]


@cache
def compiled_restore() -> Any:
    """`restore_world`, compiled or loaded once per process."""
    if not jit_is_on():
        return restore_world
    return kernel(restore_world, signature=types.void(*[types.int64] * 3))
