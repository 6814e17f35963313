"""What the robots of a scenario can do on its floor: start cells, reachable cells and served slots.

Each fact is found once per type of robots. A type can do an order if it carries the weight and reaches
both ends, and comes back. For random orders, all that could be drawn count.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import Any, Final, Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.engine.state import NIL, Array
from automaton.errors import Keys
from automaton.floor.floor_plan import STORAGE, FloorPlan
from automaton.floor.reachability import (
    Driving,
    Mask,
    dead_ends_of,
    has_storage,
    rack_stands,
    reached,
    slot_access,
    to_and_from,
)
from automaton.scenario.order_lines import transports_of
from automaton.scenario.orders import ENDS
from automaton.scenario.robot_types import RobotType, floor_by_type, rows_of, type_of_each, types_of
from automaton.scenario.schema import Scenario
from automaton.strategy.lookup import (
    ROUTED,
    SLOW_STEERED,
    STEERED,
    TAKES_SHORTEST_ROUTES,
    declares,
    default_for,
    parameters_type,
)
from automaton.world.gate_cells import cells_to_start

TWO_WAY_SHARE: Final = 0.5  # of pairs of cells; in one-way aisles neither planner is always better
NO_ZONING: Final = "none"
# Flat cells of robots 0, 1, ...
Start = Literal["parking-bays", "random", "racks"] | tuple[int, ...]


class Service(NamedTuple):
    """The cells and types that serve slots; shared by all runs with the same starts."""

    reachable: npt.NDArray[np.uint8]  # (K, C) 1 = reached by type k from its start, and back
    access: npt.NDArray[np.int32]  # (s, 4) the neighbours of a slot that any type reaches, or NIL
    accessible: npt.NDArray[np.uint8]  # (K, s) 1 = robots of type k reach one of them


@lru_cache(maxsize=64)
def service_for(
    floor_plan: FloorPlan,
    types: tuple[RobotType, ...],
    homes: tuple[int, ...],
) -> Service:
    """The service of a fleet; `homes`: (K,) the start cell of a robot of each type."""
    plans = floor_by_type(floor_plan, rows_of(types, False)).floor_plans
    each = zip(plans, homes, types, strict=True)
    within = np.stack([to_and_from(floor, home, one.rail) for floor, home, one in each])
    beside = slot_access(floor_plan)
    access = np.where(np.logical_or.reduce(within)[beside], beside, NIL).astype(np.int32)
    serves = ((access != NIL) & within[:, access]).any(axis=2)
    service = Service(within.astype(np.uint8), access, serves.astype(np.uint8))
    for array in service:
        array.setflags(write=False)
    return service


class FleetOnFloor:
    """The robots of a scenario on its floor."""

    def __init__(self, scenario: Scenario, floor_plan: FloorPlan, start: Start) -> None:
        self.scenario = scenario
        self.floor_plan = floor_plan
        self.start = start
        self.types = types_of(scenario)
        self.type_of = type_of_each(scenario.fleet)  # (n,) by identity
        self.counts = np.bincount(self.type_of, minlength=len(self.types)).tolist()
        self.rail = all(one.rail for one in self.types)  # all turn only on turntables
        self.drives_under = scenario.pods.under == "empty"  # pods that other robots will lift
        # (K, C) cells where robots of a type must not begin; in storage they would block a pod.
        self.closed = floor_by_type(floor_plan, rows_of(self.types, False)).closed
        if not self.drives_under:
            self.closed = self.closed | (floor_plan.kind.reshape(-1) == STORAGE)
        self.payload = max(robot_type.payload for robot_type in self.types)
        # Ticks of the fastest robots, without a load or with one.
        self.least_move = min(move for one in self.types for move in one.moves)
        self.least_loaded_move = min(one.moves.loaded for one in self.types)
        self.least_loaded_turn = min(one.turns.loaded for one in self.types)
        self.least_pick = min(one.durations.pick for one in self.types)
        self.least_drop = min(one.durations.drop for one in self.types)

    @cached_property
    def starts(self) -> list[npt.NDArray[np.int64]]:
        """The cells where robots of each type may begin."""
        if isinstance(self.start, tuple):
            cells = np.array(self.start, np.int64)
            return [cells[self.type_of == number] for number in range(len(self.types))]
        if self.start == "parking-bays":
            homes = self.floor_plan.bays[:, 1].astype(np.int64)
            return [homes[numbers] for numbers in self.first_open(homes)]
        if self.start == "racks":
            cells = np.unique(rack_stands(self.floor_plan)).astype(np.int64)
        else:
            cells = np.flatnonzero(self.floor_plan.drivable)
            cells = cells_to_start(self.scenario, self.floor_plan, cells)
        return [cells[~closed[cells]] for closed in self.closed]

    def first_open(self, cells: npt.NDArray[Any]) -> list[npt.NDArray[np.intp]]:
        """For each type the indices of the first cells open to it, one for each of its robots.

        Types choose one after another; the last ones may get too few cells.
        """
        free = np.ones(len(cells), np.bool_)
        chosen = []
        for closed, count in zip(self.closed, self.counts, strict=True):
            chosen.append(np.flatnonzero(free & ~closed[cells])[:count])
            free[chosen[-1]] = False
        return chosen

    @cached_property
    def service(self) -> Service:
        """The service of the fleet from the first cells where robots may begin."""
        homes = tuple(int(cells[0]) for cells in self.starts)
        return service_for(self.floor_plan, self.types, homes)

    @cached_property
    def within(self) -> Mask:
        """(K, C) the cells that robots of each type reach from their starts, and return from."""
        return self.service.reachable.astype(np.bool_)

    @cached_property
    def served(self) -> Mask:
        """(K, s) the slots that robots of each type reach from their starts, and return from.

        Where areas or storage matter, also with their loads, from sources to targets.
        """
        return served_with_load(self.service.access, self.loaded)

    @cached_property
    def loaded(self) -> Mask:
        """(K, C) the cells that robots of each type reach with a load and can leave to a target."""
        return self.with_load(self.service)

    def with_load(self, service: Service) -> Mask:
        """(K, C) the same cells for robots with other starts."""
        within = service.reachable.astype(np.bool_)
        if not has_closed_ways(self.floor_plan, self.types):
            return within
        return reached_with_load(self.floor_plan, self.types, within, self.load_ends)

    @cached_property
    def load_ends(self) -> LoadEnds:
        """The ends between which loads are carried; all slots if robots may hand loads over."""
        slots, listed = self.floor_plan.slots.astype(np.int64), self.scenario.orders.listed or ()
        stops = [
            self.floor_plan.cell(*xy) for line in listed if line.has_load for xy in line.stop_cells
        ]
        at = np.array(stops, np.int64)
        if self.hands_over:
            return LoadEnds(slots, slots, at)
        ways = list(self.orders())
        ends = [np.concatenate([slots[:0], *(way[k] for way in ways)]) for k in (2, 3)]
        return LoadEnds(np.unique(ends[0]), np.unique(ends[1]), at)

    @property
    def hands_over(self) -> bool:
        """Whether robots may hand loads over."""
        zoning = self.scenario.strategy.zoning
        return (zoning if isinstance(zoning, str) else zoning.get("name")) != NO_ZONING

    def parted(self) -> tuple[str, int, int] | None:
        """A type and two cells: it picks up a load in one and cannot carry it to the other."""
        if all(one.closed_empty == one.closed_loaded for one in self.types):
            return None
        plans = floor_by_type(self.floor_plan, rows_of(self.types, True)).floor_plans
        every = self.load_ends
        ways = {(tuple(way.source.tolist()), tuple(way.target.tolist())) for way in self.orders()}
        if self.hands_over:
            ways = {(tuple(every.sources.tolist()), tuple(every.targets.tolist()))}
        for kind, robot_type in enumerate(self.types):
            known: dict[int, Mask] = {}
            for way in sorted(ways):
                begin, end = (
                    stands(self.floor_plan, np.array(cells), every.stops, self.loaded[kind])
                    for cells in way
                )
                pair = parted_ends(
                    plans[len(self.types) + kind], begin, end, robot_type.rail, known
                )
                if pair != (NIL, NIL):
                    return robot_type.name, *pair
        return None

    @cached_property
    def slot_of(self) -> dict[int, int]:
        """The number of the slot in a flat cell."""
        return {cell: slot for slot, cell in enumerate(self.floor_plan.slots.tolist())}

    def orders(self, by_ends: bool = False) -> Iterator[Way]:
        """All orders of the scenario with a load; of equal listed ones, the first.

        `by_ends`: also without orders whose two ends both occur in earlier orders.
        """
        orders, floor_plan = self.scenario.orders, self.floor_plan
        known: set[tuple[Any, ...]] = set()
        for index, line in transports_of(self.scenario, floor_plan):
            weight, (begin, end) = line.weight, line.ends
            apart = ((begin, None, weight), (None, end, weight))
            facts = apart if by_ends else ((begin, end, weight),)
            if known.issuperset(facts):
                continue
            known.update(facts)
            source, target = (np.array([floor_plan.cell(*end)]) for end in line.ends)
            yield Way(("orders", "list", index), f"order {index}", source, target, line.weight)
        stations = floor_plan.stations.astype(np.int64)
        for row, parts in enumerate(orders.parts or ()):
            name = parts.name or f"parts {row + 1}"
            for here, then in itertools.pairwise(parts.route):
                what = f"the leg of {name} from station {here} to {then}"
                source, target = stations[[here - 1]], stations[[then - 1]]
                yield Way(("orders", "parts", row), what, source, target, parts.weight)
        if orders.generator in ENDS:
            slots = floor_plan.slots.astype(np.int64)
            kinds = floor_plan.kind.reshape(-1)[slots]
            served = self.service.accessible.any(axis=0)
            begin, end = (slots[(kinds == kind) & served] for kind in ENDS[orders.generator])
            if orders.generator == "picture-loads":
                begin = begin[floor_plan.loads.reshape(-1)[begin] == 1]
            weight = orders.weight if isinstance(orders.weight, int) else orders.weight.most
            keys: Keys = ("orders", "generator")
            yield Way(keys, "an order", begin, end, weight, orders.generator == "visits")

    def abilities(self, way: Way) -> list[Mask]:
        """(2, K, most ends) whether a type can begin at each source, and end at each target."""
        carries = np.array([robot_type.payload >= way.weight for robot_type in self.types])
        return [
            self.served[:, [self.slot_of[cell] for cell in cells.tolist()]] & carries[:, None]
            for cells in (way.source, way.target)
        ]

    def impossible(self) -> tuple[Way, str, int] | None:
        """The first order that no robot can do: "begins" or "ends" in the cell; "", NIL: too heavy."""
        for way in self.orders(by_ends=True):
            if way.weight > self.payload:
                return way, "", NIL
            ends = zip(
                ("begins", "ends"), (way.source, way.target), self.abilities(way), strict=True
            )
            for verb, cells, able in ends:
                lost = np.flatnonzero(~able.any(axis=0))
                if lost.size:
                    return way, verb, int(cells[lost[0]])
        return None

    def handed_over(self) -> str:
        """A sentence about the first order that no single type can carry; "" if there is none."""
        if len(self.types) == 1:
            return ""
        for way in self.orders():
            begins, ends = self.abilities(way)
            together = begins.astype(int).T @ ends.astype(int)
            lost = np.argwhere(together == 0)
            if lost.size and not way.stays:
                source, target = way.source[lost[0][0]], way.target[lost[0][1]]
                (x, y), (u, v) = self.floor_plan.xy(source), self.floor_plan.xy(target)
                return (
                    f"{way.what} from [{x}, {y}] to [{u}, {v}] cannot be carried all the way by "
                    "any single type of robot; only zoning hands orders over from one type to "
                    "another"
                )
        return ""


class Way(NamedTuple):
    """Orders from some slots to some slots."""

    keys: Keys
    what: str  # name in errors
    source: npt.NDArray[np.int64]  # flat cells
    target: npt.NDArray[np.int64]
    weight: int  # of the heaviest order
    stays: bool = False  # each ends where it begins: a visit


# Cells that robots with a load reach on their way from sources to targets, over cells open to them.
#
# Areas may be closed to robots with a load, or without one. Then a slot is served only from cells that
# a robot may enter with a load and reaches without one from its start, and returns from. Each such
# cell beside the source of an order must have a way to each such cell beside its target. On a floor
# with storage: a way to all stations, and back.


class LoadEnds(NamedTuple):
    """The cells between which loads are carried."""

    sources: Array  # flat cells of slots
    targets: Array
    stops: Array  # flat cells in which robots stand with a load on their way


def loaded_driving(robot_type: RobotType) -> Driving:
    """How robots of a type drive with a load."""
    return Driving(
        headings=robot_type.headings,
        move=robot_type.moves.loaded,
        turn=robot_type.turns.loaded,
        rail=robot_type.rail,
        loaded=True,
    )


def has_closed_ways(floor_plan: FloorPlan, types: tuple[RobotType, ...]) -> bool:
    """Whether robots with a load and without one can reach different cells."""
    return has_storage(floor_plan) or any(one.closed_empty != one.closed_loaded for one in types)


def reached_with_load(
    floor_plan: FloorPlan, types: tuple[RobotType, ...], within: Mask, ends: LoadEnds
) -> Mask:
    """(K, C) the cells that robots of each type reach with a load and can leave to a target.

    `within`: (K, C) the cells that they reach without a load from their starts, and return from.
    """
    by_row = floor_by_type(floor_plan, rows_of(types, True))
    result = within.copy()
    for kind, rail in enumerate(one.rail for one in types):
        plan = by_row.floor_plans[len(types) + kind]
        result[kind] &= ~by_row.closed[len(types) + kind]
        if has_storage(floor_plan):
            for station in floor_plan.stations.tolist():
                result[kind] &= to_and_from(plan, station, rail)
            continue
        begin, end = (stands(floor_plan, cells, ends.stops, result[kind]) for cells in ends[:2])
        result[kind] &= reached(plan, begin, rail) & reached(plan, end, rail, backwards=True)
    return result


def stands(floor_plan: FloorPlan, slots: Array, stops: Array, usable: Mask) -> list[int]:
    """The usable cells among the cells that serve slots (flat) and the stops."""
    number = np.full(floor_plan.kind.size, NIL, np.int64)
    number[floor_plan.slots] = np.arange(len(floor_plan.slots))
    access = slot_access(floor_plan)[number[slots]].reshape(-1)
    cells = np.unique(np.concatenate([access[access != NIL], stops])).astype(np.int64)
    result: list[int] = cells[usable[cells]].tolist()
    return result


def served_with_load(access: Array, loaded: Mask) -> Mask:
    """(K, s) whether robots of each type serve a slot from a cell that they also reach with a load.

    `access`: (s, 4) cells beside slots, or NIL.
    """
    served: Mask = ((access != NIL) & loaded[:, access]).any(axis=2)
    return served


def parted_ends(
    plan: FloorPlan, begin: list[int], end: list[int], rail: bool, known: dict[int, Mask]
) -> tuple[int, int]:
    """A pick cell and a drop cell without a way between them; else (NIL, NIL).

    `plan`: with the exits open to robots with a load. `known`: cells reached from a cell on this plan;
    new results are added.
    """
    left, ends = set(begin), np.array(end, np.int64)
    while left and len(ends):
        first = min(left)
        if first not in known:
            known[first] = reached(plan, [first], rail)
        lost = ends[~known[first][ends]]
        if lost.size:
            return first, int(lost[0])
        left.remove(first)
        if not left:
            break
        # A robot that reaches this cell reaches all cells that are reachable from it.
        before = reached(plan, [first], rail, backwards=True)
        left = {cell for cell in left if not before[cell]}
    return NIL, NIL


# The default right of way: the best one for the scenario by the declarations of the strategies.


class Default(NamedTuple):
    """A default right of way, with the reason if it is not the usual one, else ""."""

    name: str
    why: str


def with_right_of_way(scenario: Scenario, fleet: FleetOnFloor) -> Scenario:
    """The scenario with its right of way filled in."""
    if scenario.strategy.right_of_way is not None:
        return scenario
    name = default_right_of_way(scenario, fleet).name
    strategy = msgspec.structs.replace(scenario.strategy, right_of_way=name)
    return msgspec.structs.replace(scenario, strategy=strategy)


def default_right_of_way(scenario: Scenario, fleet: FleetOnFloor) -> Default:
    """The default right of way of this scenario."""
    why_not = why_not_steered(scenario, fleet)
    if why_not:
        return Default(default_for("right_of_way", ROUTED), why_not)
    planner = default_for("right_of_way", SLOW_STEERED)
    parameters: Any = parameters_type("right_of_way", planner)()
    if (
        has_slow_actions(scenario, fleet.floor_plan)
        and not scenario.floor.has_gates  # plans of several ticks may jam there: bad-day
        and two_way_share(fleet.floor_plan) >= TWO_WAY_SHARE
        and parameters.check_scenario(scenario, fleet.floor_plan) is None
    ):
        why = "turns or moves take several ticks, and most connections are open in both directions"
        return Default(planner, why)
    return Default(default_for("right_of_way", STEERED), "")


def why_not_steered(scenario: Scenario, fleet: FleetOnFloor) -> str:
    """Why the default right of way follows routes; "" if it steers robots."""
    routing: Any = scenario.strategy.routing
    name = str(routing["name"] if isinstance(routing, dict) else routing)
    if not declares("routing", name, TAKES_SHORTEST_ROUTES):
        return f"robots follow the routes of routing {name}"
    if scenario.information != "everything":
        return "robots do not see all other robots"
    if has_ringless_part(fleet):
        return "the floor has no ring on which robots can pass each other"
    return ""


def has_slow_actions(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether a turn or a move takes 2 ticks or more, speed limits included."""
    types = types_of(scenario)
    longest = max(ticks for one in types for ticks in (*one.moves, *one.turns))
    return max(longest, int(floor_plan.min_move_ticks.max(initial=0))) > 1


def two_way_share(floor_plan: FloorPlan) -> float:
    """The share of connections between neighbouring cells that are open in both directions."""
    exits = floor_plan.exits.reshape(-1)
    one_way = both_ways = 0
    for direction, offset in enumerate(floor_plan.offsets[:2]):
        there = exits >> direction & 1
        back = np.roll(exits, -offset) >> (direction ^ 2) & 1
        both_ways += int((there & back).sum())
        one_way += int((there ^ back).sum())
    return both_ways / max(1, both_ways + one_way)


def has_ringless_part(fleet: FleetOnFloor) -> bool:
    """Whether some robots drive in a part of the floor without a ring of cells."""
    return bool((dead_ends_of(fleet.floor_plan).ringless & fleet.within.any(axis=0)).any())
