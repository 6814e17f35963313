"""The compiled reset: a world gets the arrays of a world at tick 0, and what its seed draws.

What depends on the seed is found by comparing worlds of several seeds. Where kernels can draw all of it
(random starts, and the stops of tours), and the result equals worlds that are built, an episode begins
without Python.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Final

import numpy as np
from numba import types

from automaton.engine.jit.kernel import jit_is_on
from automaton.engine.jit.struct_types import copy_bytes, struct_at
from automaton.engine.jit.structs import WORDS_PER_ROW, Array, Struct, field, registered_address
from automaton.engine.random_numbers import STREAM_ORDERS, STREAM_STARTS, STREAM_VISITS
from automaton.environments.stepped_worlds import SteppedWorld
from automaton.strategy.api import (
    CONSTANT,
    STATIC,
    World,
    kernel,
    pop,
    push,
    random_between,
    random_bits,
)
from automaton.world.demand import DRAW_STOP, MAX_STOPS, tour_cells
from automaton.world.starts import START_NEVER, first_headings, start_order

PROBE_SEEDS: Final = (3, 2**62 + 11, 77_777, 5, 1_000_003)  # seeds whose worlds are compared
START_ARRAYS: Final = {
    *("world.robots.cell", "world.robots.home", "world.traffic.occupancy"),
    *("world.robots.heading", "world.robots.travel"),
}
HEADING_ARRAY: Final = "world.robots.heading"
STOPS_ARRAY: Final = "world.stops.cell"
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
    assign: int = field("int64", "POOL or ROUND_ROBIN")


class Copies(Struct):
    """What is copied into a world: k arrays."""

    rows: Array = field("(k, 3) int64", "addresses: to, from; bytes")
    seed: Array = field("(1,) uint64", "the seed, from which its words are copied")


world_at, draws_at, copies_at = (struct_at(one) for one in (World, Draws, Copies))


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
                draw = random_between(0, others - 1, seed, STREAM_ORDERS, DRAW_STOP + place, order)
                at = (at + 1 + draw) % many if place else draw
            else:
                number, robot = order // robots, order % robots
                bits = random_bits(seed, STREAM_VISITS, number * MAX_STOPS + place, robot)
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


class Restorer:
    """Brings worlds of an environment to tick 0.

    `draws` is None if the kernels cannot draw what depends on the seed.
    """

    def __init__(self, template: SteppedWorld) -> None:
        self._template = template
        self._arrays = arrays_of(template)
        self.draws = self._checked_draws()

    def _checked_draws(self) -> Draws | None:
        """The draws, if they give the worlds of the probes."""
        resolved = self._template.resolved
        if len(resolved.days) > 1 or resolved.coarse is not None:
            return None
        fresh = [
            arrays_of(SteppedWorld(resolved, seed, self._template.workspace))
            for seed in PROBE_SEEDS
        ]
        differing = {name for one in fresh for name in one if not is_equal(one, self._arrays, name)}
        known = START_ARRAYS | {STOPS_ARRAY}
        if differing - known or any(one.keys() != self._arrays.keys() for one in fresh):
            return None
        draws = draws_for(self._template, differing)
        if draws is None:
            return None
        world = SteppedWorld(resolved, 0, self._template.workspace)
        copies = self.copies(world)
        arrays = arrays_of(world)
        for seed, wanted in zip(PROBE_SEEDS, fresh, strict=True):
            copies.seed[0] = seed
            restored(world, draws, copies)
            if not all(is_equal(arrays, wanted, name) for name in wanted):
                return None
        return draws

    def copies(self, world: SteppedWorld) -> Copies:
        """What is copied into a world; it must live as long as the template."""
        pairs = [
            (array, self._arrays[name][1])
            for name, (declared, array) in arrays_of(world).items()
            if declared.role not in (CONSTANT, STATIC) and array.nbytes
        ]
        rows = [(address_of(to), address_of(source), to.nbytes) for to, source in pairs]
        seed = np.zeros(1, np.uint64)
        for rules in {id(one): one for one in (world.world.rules, world.view.rules)}.values():
            row = rules._fields.index("seed")
            rows.append((rules._address + 8 * WORDS_PER_ROW * row, address_of(seed), 8))
        return Copies.sized(rows=np.array(rows, np.int64), seed=seed)


def restored(world: SteppedWorld, draws: Draws, copies: Copies) -> None:
    """Bring a world to tick 0 of the episode of `copies.seed`."""
    seed = copies.seed[0]
    for rules in (world.world.rules, world.view.rules):
        rules.__dict__["seed"] = seed
    world.seed = int(seed)
    with np.errstate(over="ignore"):
        compiled_restore()(*map(registered_address, (world.world, draws, copies)))


def arrays_of(one: SteppedWorld) -> dict[str, tuple[Any, Array]]:
    """Declaration and array by name of what a run changes, or of what a seed draws."""
    structs = {"world": one.world, "visible": one.visible_world}
    structs |= {f"state {number}": state for number, state in enumerate(one.states)}
    structs |= {f"shown {number}": state for number, state in enumerate(one.parts.behind[0])}
    arrays: dict[str, tuple[Any, Array]] = {}
    known: set[int] = set()
    for part, struct in structs.items():
        for name, declared, array in struct.arrays():
            if not name.startswith("grid.") and id(array) not in known:
                known.add(id(array))
                arrays[f"{part}.{name}"] = declared, array
    return arrays


def is_equal(
    one: dict[str, tuple[Any, Array]], other: dict[str, tuple[Any, Array]], name: str
) -> bool:
    """Whether two worlds have equal arrays of this name."""
    return name in one and name in other and np.array_equal(one[name][1], other[name][1])


def address_of(array: Array) -> int:
    """The address of the memory of an array."""
    return int(array.__array_interface__["data"][0])


def draws_for(template: SteppedWorld, differing: set[str]) -> Draws | None:
    """The draws behind these arrays; None if kernels do not know the generator."""
    resolved, world = template.resolved, template.world
    scenario, grid = resolved.scenario, world.grid
    cells = np.zeros(0, np.int32)
    order = np.zeros(0, np.uint8)
    headings = np.zeros(0, np.uint8)
    if differing & START_ARRAYS:
        if resolved.start != "random" or len(resolved.fleet.types) > 1:
            return None
        cells, order = start_order(resolved)
        if HEADING_ARRAY in differing:
            headings = first_headings(grid, np.arange(len(grid.kind)))
    stops, first = np.zeros(0, np.int32), np.zeros(1, np.int64)
    begins = np.zeros(len(grid.kind), np.uint8)
    if STOPS_ARRAY in differing:
        if scenario.orders.generator != "tours":
            return None
        reachable = world.slots.reachable[: len(resolved.fleet.types)]
        groups = tour_cells(resolved, reachable)
        stops = np.concatenate(groups).astype(np.int32)
        first = np.cumsum([0, *map(len, groups)])
        begins[groups[0]] = 1
    floor = template.empty_floor
    return Draws.sized(
        cells=cells,
        order=order,
        headings=headings,
        occupancy=world.traffic.occupancy | (floor & ROOM_BOTH_LANES).astype(np.uint16),
        stops=stops,
        first=first.astype(np.int64),
        begins=begins,
        assign=ASSIGN_ROUND_ROBIN if scenario.orders.assign == "round-robin" else ASSIGN_POOL,
    )
