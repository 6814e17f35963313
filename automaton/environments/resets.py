"""The compiled reset: a world gets the arrays of a world at tick 0, and what its seed draws.

What depends on the seed is found by comparing worlds of several seeds. Where kernels can draw all of it
(random starts, and the stops of tours), and the result equals worlds that are built, an episode begins
without Python.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from automaton.engine.jit.structs import (
    CONSTANT,
    STATIC,
    WORDS_PER_ROW,
    Array,
    registered_address,
)
from automaton.environments.reset_kernels import (
    ASSIGN_POOL,
    ASSIGN_ROUND_ROBIN,
    ROOM_BOTH_LANES,
    Copies,
    Draws,
    compiled_restore,
)
from automaton.environments.stepped_worlds import SteppedWorld
from automaton.world.demand import DRAW_STOP, MAX_STOPS, tour_cells
from automaton.world.starts import first_headings, start_order

PROBE_SEEDS: Final = (3, 2**62 + 11, 77_777, 5, 1_000_003)  # seeds whose worlds are compared
START_ARRAYS: Final = {
    *("world.robots.cell", "world.robots.home", "world.traffic.occupancy"),
    *("world.robots.heading", "world.robots.travel"),
}
HEADING_ARRAY: Final = "world.robots.heading"
STOPS_ARRAY: Final = "world.stops.cell"


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
    structs: dict[str, Any] = {"world": one.world, "visible": one.visible_world}
    structs |= {f"state {number}": state for number, state in enumerate(one.states)}
    structs |= {f"shown {number}": state for number, state in enumerate(one.visible_states)}
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
    in_turn = scenario.orders.assign == "round-robin"
    floor = template.empty_floor
    return Draws.sized(
        cells=cells,
        order=order,
        headings=headings,
        occupancy=world.traffic.occupancy | (floor & ROOM_BOTH_LANES).astype(np.uint16),
        stops=stops,
        first=first.astype(np.int64),
        begins=begins,
        assign=ASSIGN_ROUND_ROBIN if in_turn else ASSIGN_POOL,
        address=MAX_STOPS if in_turn else DRAW_STOP,
    )
