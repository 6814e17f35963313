"""The trials of De Ryck et al.: their floor and fleets, task sets, assigned routes, the worked example.

Places are the positions 1..17 of the paper's figure minus one. A tick is a second, robots drive 1 m/s,
and makespans are in seconds. A task set of a seed (section 5.1) has n distinct stations, the first of a
shuffle drawn for each n; it is the same for every method, number of robots and floor. With epsilon the
objective is epsilon x sum + (1 - epsilon) x longest.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import factorial
from typing import Any, Final

import numpy as np

from automaton.engine.random_numbers import random_between
from automaton.engine.state import BATTERY_FULL, Array
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.floor_section import generator_type
from strategies.allocation.auction import bundles, metaheuristics, sequential
from strategies.allocation.auction.bundles import bundles_for
from strategies.allocation.auction.market import (
    BID_SCALE,
    INF_COST,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    AuctionScratch,
    BatteryRules,
    FleetLists,
    TaskCosts,
    battery_of,
    fleet_of,
    scratch_for,
    visits,
)
from strategies.allocation.auction.metaheuristics import generations, population_for
from strategies.allocation.auction.quotes import clear_counts, settle_all
from strategies.allocation.auction.sequential import (
    BID_MIXED,
    WINNER_DIFFERENCE,
    WINNER_FEWEST_BIDDERS,
    WINNER_LOWEST_BID,
    WINNER_REGRET,
)

CHARGE_PERCENT: Final = BATTERY_FULL // 100
DEPOT_POSITIONS: Final = (1, 2, 3, 17, 1, 2)  # starts of robots 1..6; robots 5 and 6 share a depot
STATION_POSITIONS: Final = tuple(range(4, 17))
STREAM_TASK_SETS: Final = 14  # number of the stream of random draws
MOST_TASKS: Final = 10
OPTIMUM: Final = "optimum"
AGAIN: Final = "LB, all bid again"  # the same lists as LB, with more work
PICTURE_ROBOTS: Final = 3
PICTURE_TASKS: Final = 10
PICTURE_SEED: Final = 12  # the seed of the first twenty with the largest difference
PICTURE_CELL_WIDTH: Final = 7  # characters of a cell

# Section 4: robot 1 is at position 3 with 100 % charge, robot 2 at position 1 with 45 %; driving takes
# 0.5 % per second, charging adds 5 % per second.
EXAMPLE_STARTS: Final = (3, 1)
EXAMPLE_CHARGES: Final = (BATTERY_FULL, 45 * CHARGE_PERCENT)
EXAMPLE_LISTS: Final = ((7, 8, 13), (5, 4, 9))
EXAMPLE_NEW_TASK: Final = 14
EXAMPLE_DRAIN: Final = CHARGE_PERCENT // 2  # per second
EXAMPLE_RATE: Final = 5 * CHARGE_PERCENT  # per second
HALF: Final = BID_SCALE // 2  # epsilon

EXAMPLE_SETTINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    "as printed": {},
    "charging ignored": {"policy": POLICY_NO_CHARGING},
    "reserve 10 %": {"reserve": 10 * CHARGE_PERCENT},
    "reserve 20 %": {"reserve": 20 * CHARGE_PERCENT},
    "never strand": {"end_reach": True},
    "chargers 1, 2, 3": {"chargers": (1, 2, 3)},
    "joint": {"policy": POLICY_JOINT},
    "comb floor": {"lanes": "comb"},
}

Cell = tuple[int, int]


@cache
def seconds(lanes: str = "full") -> Array:
    """(17, 17) int32 seconds between positions."""
    return generator_type("depots")(lanes=lanes).metres().astype(np.int32)  # type: ignore[attr-defined, no-any-return]


def place(position: int) -> int:
    """The place of a position in the paper."""
    return position - 1


def work_of(tasks: Sequence[int], between: Array, drain: int = 0) -> TaskCosts:
    """Tasks at these positions; drain: units per second of driving."""
    return visits(between, between * drain, [place(task) for task in tasks])


def rules(
    between: Array,
    drain: int,
    rate: int | Sequence[tuple[int, int]],
    chargers: Sequence[int] = (2,),
    policy: int = POLICY_NO_CHARGING,
    **settings: Any,
) -> BatteryRules:
    """The rules of a battery; rate: units per second of charging, or the pieces of a curve."""
    curve = ((0, rate),) if isinstance(rate, int) else tuple(rate)
    places = [place(charger) for charger in chargers]
    return battery_of(between.astype(np.int64) * drain, places, curve, policy=policy, **settings)


NO_BATTERY: Final[Mapping[str, BatteryRules]] = {
    lanes: rules(seconds(lanes), 0, 1, ()) for lanes in ("full", "comb")
}


def fleet_at(
    positions: Sequence[int], tasks: int, charge: int | Sequence[int] = BATTERY_FULL
) -> FleetLists:
    """Robots at these positions with empty lists."""
    return fleet_of([place(position) for position in positions], tasks, charge)


def scratch_of(fleet: FleetLists, tasks: int, chargers: int = 1) -> AuctionScratch:
    """Scratch memory for auctions of a number of tasks among this fleet."""
    robots, longest = fleet.order.shape
    return scratch_for(robots, tasks, longest, chargers)


def give(fleet: FleetLists, robot: int, tasks: Sequence[int]) -> None:
    """Set the list of a robot to these tasks, given by number."""
    fleet.order[robot, : len(tasks)] = tasks
    fleet.length[robot] = len(tasks)


def empty(
    task_costs: TaskCosts, battery: BatteryRules, fleet: FleetLists, scratch: AuctionScratch
) -> None:
    """Empty all lists."""
    fleet.length[:] = 0
    settle_all(task_costs, battery, fleet, scratch)


def listed(fleet: FleetLists, robot: int) -> list[int]:
    """The tasks of a robot by number."""
    found: list[int] = fleet.order[robot, : fleet.length[robot]].tolist()
    return found


# Section 5.1: task sets, and their solutions by each method.


@cache
def task_set(seed: int, n: int, number: int = 0) -> tuple[int, ...]:
    """n distinct random stations: the first n of a Fisher-Yates shuffle."""
    left = list(STATION_POSITIONS)
    address = number * (MOST_TASKS + 1) + n
    with np.errstate(over="ignore"):
        for i in range(n):
            j = random_between(i, len(left) - 1, np.uint64(seed), STREAM_TASK_SETS, address, i)
            left[i], left[int(j)] = left[int(j)], left[i]
    return tuple(left[:n])


@dataclass(frozen=True)
class Instance:
    """A task set and robots with empty lists."""

    task_costs: TaskCosts
    battery: BatteryRules
    fleet: FleetLists
    scratch: AuctionScratch
    items: Array
    epsilon: int
    seed: int

    @property
    def market(self) -> tuple[TaskCosts, BatteryRules, FleetLists, AuctionScratch]:
        return self.task_costs, self.battery, self.fleet, self.scratch

    @property
    def robots(self) -> int:
        return len(self.fleet.place)

    @property
    def tasks(self) -> int:
        return len(self.items)


def instance(lanes: str, robots: int, n: int, seed: int, epsilon: int = 0) -> Instance:
    """The task set of a seed, and a number of robots at their depots."""
    task_costs = work_of(task_set(seed, n), seconds(lanes))
    fleet = fleet_at(DEPOT_POSITIONS[:robots], n)
    items = np.arange(n, dtype=np.int32)
    scratch = scratch_of(fleet, n)
    return Instance(task_costs, NO_BATTERY[lanes], fleet, scratch, items, epsilon, seed)


def auction(one: Instance, winner: int, everybody: int = 0) -> None:
    """The sequential auction with this winner rule; everybody = 1: all robots bid again."""
    rules = BID_MIXED, one.epsilon, winner, everybody
    sequential.sequential(*one.market, one.items, one.tasks, *rules)


def auction_and_search(one: Instance) -> None:
    """The sequential auction by lowest bids, then local search."""
    auction(one, WINNER_LOWEST_BID)
    metaheuristics.improve(*one.market, one.epsilon)


def optimum(one: Instance) -> None:
    """The optimal lists."""
    workspace = bundles_for(one.robots, one.tasks)
    bundles.exact(*one.market, workspace, one.items, one.tasks, one.epsilon)


def best_allotment(one: Instance) -> None:
    """The best of all m^n allotments, if each robot inserts its tasks in the order of arrival."""
    workspace = bundles_for(one.robots, one.tasks)
    bundles.combinatorial(*one.market, workspace, one.items, one.tasks, one.epsilon)


def evolve(one: Instance, each_gene: int) -> None:
    """The paper's genetic algorithm."""
    population = population_for(one.robots, one.tasks, one.tasks)
    rounds = generations(one.robots, one.tasks)
    address = np.uint64(one.seed), one.tasks  # a seed has a task set for each number of tasks
    arguments = (one.items, one.tasks, one.epsilon, rounds, each_gene, *address)
    with np.errstate(over="ignore"):
        metaheuristics.genetic(*one.market, population, *arguments)


Method = Callable[[Instance], None]

METHODS: Final[dict[str, Method]] = {
    OPTIMUM: optimum,
    "m^n": best_allotment,
    "LB": lambda one: auction(one, WINNER_LOWEST_BID),
    AGAIN: lambda one: auction(one, WINNER_LOWEST_BID, 1),
    "BD": lambda one: auction(one, WINNER_DIFFERENCE),
    "FB": lambda one: auction(one, WINNER_FEWEST_BIDDERS),
    "regret": lambda one: auction(one, WINNER_REGRET),
    "LB+search": auction_and_search,
    "arrival": lambda one: (
        sequential.by_arrival(*one.market, one.items, one.tasks, BID_MIXED, one.epsilon) and None
    ),
    "parallel": lambda one: (
        sequential.parallel(*one.market, one.items, one.tasks, BID_MIXED, one.epsilon) and None
    ),
    "GA": lambda one: evolve(one, 0),
    "GA each gene": lambda one: evolve(one, 1),
}


@dataclass(frozen=True)
class Solved:
    """The solution of an instance by a method."""

    objective: float  # seconds
    bids: int
    positions: int  # of lists, tried for insertion
    lists: tuple[tuple[int, ...], ...]  # stations of each robot


@cache
def solve(lanes: str, robots: int, n: int, seed: int, method: str, epsilon: int) -> Solved:
    """Solve the task set of a seed with a method."""
    one = instance(lanes, robots, n, seed, epsilon)
    empty(*one.market)
    clear_counts(one.scratch)
    METHODS[method](one)
    stations = task_set(seed, n)
    return Solved(
        metaheuristics.objective(one.fleet, epsilon) / 1000,
        int(one.scratch.count.bids),
        int(one.scratch.count.positions),
        tuple(tuple(stations[task] for task in listed(one.fleet, r)) for r in range(robots)),
    )


def ratio(lanes: str, robots: int, n: int, seed: int, method: str, epsilon: int = 0) -> float:
    """The objective of a method as a multiple of the optimum."""
    best = solve(lanes, robots, n, seed, OPTIMUM, epsilon).objective
    return solve(lanes, robots, n, seed, method, epsilon).objective / best


def sequences(robots: int, n: int) -> int:
    """The number of ways to put n tasks into the lists of m robots: (n + m - 1)! / (m - 1)!."""
    return factorial(n + robots - 1) // factorial(robots - 1)


# Figures 2 and 3: assigned routes, as text.


def pictures() -> list[tuple[str, str]]:
    """(title, drawing) of one task set, solved by the auction and optimally."""
    return [
        (
            f"{title}: {PICTURE_TASKS} tasks, {PICTURE_ROBOTS} robots (seed {PICTURE_SEED})",
            described(method),
        )
        for title, method in (
            ("Figure 2, the sequential auction", "LB"),
            ("Figure 3, the optimum", OPTIMUM),
        )
    ]


def described(method: str) -> str:
    """The drawing, and below it each robot's list with its seconds."""
    solved = solve("full", PICTURE_ROBOTS, PICTURE_TASKS, PICTURE_SEED, method, 0)
    lines = [drawing(solved.lists)]
    for r, stations in enumerate(solved.lists):
        path = " ".join(map(str, (DEPOT_POSITIONS[r], *stations)))
        lines.append(f"{name(r)}: {path}: {way_length(solved, r)} s")
    lines.append(f"all done after {solved.objective:g} s")
    return "\n".join(lines)


def name(r: int) -> str:
    """A, B, C, ..."""
    return chr(ord("A") + r)


def way_length(solved: Solved, r: int) -> int:
    """Seconds of robot r's route; a cell takes ten seconds."""
    return 10 * (len(route((DEPOT_POSITIONS[r], *solved.lists[r]))) - 1)


def drawing(lists: Sequence[Sequence[int]]) -> str:
    """The floor; a cell shows the robots that cross it, a station its number and * for a task."""
    floor = generator_type("depots")()
    floor_plan: FloorPlan = floor.build()  # type: ignore[attr-defined]
    at = {cell: position for position, cell in floor.places().items()}  # type: ignore[attr-defined]
    drivers: dict[Cell, str] = {}
    for r, stations in enumerate(lists):
        for cell in dict.fromkeys(route((DEPOT_POSITIONS[r], *stations))):
            drivers[cell] = drivers.get(cell, "") + name(r)
    tasks = {station for stations in lists for station in stations}
    rows = []
    for y in range(floor_plan.height):
        cells = []
        for x in range(floor_plan.width):
            position = at.get((x, y))
            sign = "" if position is None else f"{position}{'*' if position in tasks else ''} "
            drivable = floor_plan.drivable[y + 1, x + 1]
            cells.append(
                f"{sign + drivers.get((x, y), '' if sign or not drivable else '.'):{PICTURE_CELL_WIDTH}}"
            )
        rows.append("".join(cells).rstrip())
    return "\n".join(rows)


def route(positions: Sequence[int]) -> list[Cell]:
    """The cells of the shortest ways between consecutive positions."""
    floor = generator_type("depots")()
    floor_plan: FloorPlan = floor.build()  # type: ignore[attr-defined]
    places: dict[int, Cell] = floor.places()  # type: ignore[attr-defined]
    cells = [places[positions[0]]]
    for start, target in itertools.pairwise(positions):
        cells += way(floor_plan, places[start], places[target])[1:]
    return cells


def way(floor_plan: FloorPlan, start: Cell, target: Cell) -> list[Cell]:
    """A shortest way over cells, including both ends."""
    begin, goal = floor_plan.cell(*start), floor_plan.cell(*target)
    exits = floor_plan.exits.reshape(-1)
    before, queue = {begin: begin}, deque([begin])
    while goal not in before:
        cell = queue.popleft()
        for direction, neighbour in enumerate(floor_plan.neighbours(cell)):
            if exits[cell] >> direction & 1 and neighbour not in before:
                before[neighbour] = cell
                queue.append(neighbour)
    path = [goal]
    while path[-1] != begin:
        path.append(before[path[-1]])
    return [floor_plan.xy(cell) for cell in reversed(path)]


# Section 4: two robots with lists, and a new task at position 14.


@dataclass(frozen=True)
class Bid:
    """The bid of one robot for the new task; costs in seconds, levels in units."""

    before: int | None  # c1; None if its own list is infeasible
    cost: float | None  # c2 and the MiniMax bid; None without a feasible plan
    added: float | None  # the MiniSum bid
    mixed: float | None
    order: tuple[int, ...]  # positions in the order of driving, chargers included
    arrival: int | None  # level on arrival at the first charger
    charging: int  # seconds
    end: int  # level


def bids_for(setting: str) -> list[Bid]:
    """The bids of both robots."""
    chosen: dict[str, Any] = {"policy": POLICY_HIERARCHICAL, "chargers": (2,), "lanes": "full"}
    chosen |= EXAMPLE_SETTINGS[setting]
    between = seconds(chosen.pop("lanes"))
    tasks = [*EXAMPLE_LISTS[0], *EXAMPLE_LISTS[1], EXAMPLE_NEW_TASK]
    task_costs = work_of(tasks, between, EXAMPLE_DRAIN)
    battery = rules(between, EXAMPLE_DRAIN, EXAMPLE_RATE, **chosen)
    fleet = fleet_at(EXAMPLE_STARTS, len(tasks), EXAMPLE_CHARGES)
    scratch = scratch_of(fleet, len(tasks), len(battery.charger))
    give(fleet, 0, (0, 1, 2))
    give(fleet, 1, (3, 4, 5))
    settle_all(task_costs, battery, fleet, scratch)
    market = (task_costs, battery, fleet, scratch)
    found = []
    for r in range(2):
        offers = [
            sequential.bid(*market, r, len(tasks) - 1, BID_MIXED, epsilon)
            for epsilon in (0, BID_SCALE, HALF)
        ]
        cost, added, mixed = (None if offer >= INF_COST else offer / BID_SCALE for offer in offers)
        before = int(fleet.cost[r]) if fleet.cost[r] < INF_COST else None
        if cost is None:
            found.append(Bid(before, None, None, None, (), None, 0, 0))
            continue
        sequential.award(*market, r, len(tasks) - 1)
        plan = scratch.plan
        order = [tasks[task] for task in fleet.order[r, : fleet.length[r]]]
        for position, charger in reversed(stops_of(scratch)):
            order.insert(position, chosen["chargers"][charger])
        arrival = int(scratch.plan.arrival[0]) if scratch.plan.stops else None
        charged, end = int(plan.charging), int(plan.end_charge)
        found.append(Bid(before, cost, added, mixed, tuple(order), arrival, charged, end))
    return found


def stops_of(scratch: AuctionScratch) -> list[tuple[int, int]]:
    """(position in the list, charger number) of the charging stops of the plan."""
    plan = scratch.plan
    return [(int(plan.position[k]), int(plan.charger[k])) for k in range(plan.stops)]


def winner(offers: list[Bid]) -> int | None:
    """The number of the robot with the lowest bid, from 1."""
    made = [(one.mixed, r) for r, one in enumerate(offers, 1) if one.mixed is not None]
    return min(made)[1] if made else None


def steps() -> Iterator[str]:
    """The example as printed, step by step."""
    offers, free = bids_for("as printed"), bids_for("charging ignored")
    for r, (one, direct) in enumerate(zip(offers, free, strict=True)):
        path = (EXAMPLE_STARTS[r], *EXAMPLE_LISTS[r])
        yield (
            f"robot {r + 1} at {EXAMPLE_STARTS[r]} with {EXAMPLE_CHARGES[r] // CHARGE_PERCENT} %: "
            f"{named_path(path[1:])}: c1 = {legs(path)} = {one.before} s"
        )
        with_it = (EXAMPLE_STARTS[r], *direct.order)
        yield (
            f"  with {EXAMPLE_NEW_TASK}: {named_path(direct.order)}: {legs(with_it)} = "
            f"{direct.cost:g} s; {direct.end / CHARGE_PERCENT:g} % at the end"
        )
        if one.arrival is not None:
            at = one.order.index(2) + 1
            there, onward = (EXAMPLE_STARTS[r], *one.order[:at]), one.order[at - 1 :]
            yield (
                f"  charging: {named_path(one.order)}: to the charger {legs(there)} = "
                f"{driven(there)} s, arriving with {one.arrival / CHARGE_PERCENT:g} %; "
                f"on from it {legs(onward)} = {driven(onward)} s; "
                f"{one.charging} s of charging; c2 = {one.cost:g} s"
            )
        yield (
            f"  bids: MiniSum {one.added:g}, MiniMax {one.cost:g}, "
            f"with epsilon 0.5: {one.mixed:g} (charging ignored: {direct.mixed:g})"
        )
    yield f"robot {winner(offers)} wins; with charging ignored it would be robot {winner(free)}"


def named_path(path: tuple[int, ...]) -> str:
    return "[" + ", ".join(map(str, path)) + "]"


def legs(path: tuple[int, ...]) -> str:
    """The seconds of the legs as a sum in words."""
    return " + ".join(str(driven(path[i : i + 2])) for i in range(len(path) - 1))


def driven(path: tuple[int, ...]) -> int:
    """Seconds along these positions."""
    return sum(int(seconds()[a - 1, b - 1]) for a, b in itertools.pairwise(path))
