"""A world as text: the tick, the map, then a line for every robot and for every order that has moved.

    tick 40, seed 1, 8 order changes, 6 seen by allocation

    b+-+d
    bA$|d      the floor's symbols with robots A to Z on top; 's' an empty shelf, '$' a full one
    b+-+#      '@' several robots, or one beyond the 26th; '*' a cell claimed by a long move;
               storage 'p' with a pod, 'q' without

    A (0, 1) vertical, fetches 3 from (1, 1) via (2, 1), moved; route nESS

The picture contains everything that a digest covers, except the work at stations and the service
zones: `partition_picture` shows the zones and cannot be read back. The picture also omits the memory
of strategies and the counters behind the metrics (tallies, and when and where orders were taken).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.engine.drive import count_robots, set_move_ticks
from automaton.engine.faults import open_slot
from automaton.engine.motion import LIVE, REFUSED, move_all
from automaton.engine.random_numbers import splitmix64
from automaton.engine.state import (
    ACTION_MOVE,
    GOAL_PARK,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    ORDER_WAITING,
    STATUS_REMOVED,
    STATUS_UP,
    World,
)
from automaton.errors import InputError, alternatives
from automaton.floor.drawn_floors import Drawing, Legend, draw_floor, floor_drawing, legend_entry
from automaton.floor.floor_plan import DIRECTIONS, STORAGE, FloorPlan
from automaton.runs.pictures.picture_lines import (
    NEEDS,
    DrawnOrder,
    Facts,
    Pair,
    RobotLine,
    Value,
    identity_of,
    name_of,
    numbers_of,
    order_line,
    read_order,
    read_robot,
    robot_line,
)
from automaton.runs.progress import asked_orders
from automaton.runs.simulation import Simulation
from automaton.runs.state_copy import hold_cells
from automaton.scenario.schema import Durations, Fleet, Orders, Scenario, WorldRules
from automaton.units import count
from automaton.world.building import build_world
from automaton.world.resolved import Resolved

CROWD = "@"
CROWD_LEGEND = (
    "@ is a robot whose name is a number (letters end with robot 25), or several in a cell"
)
CLAIMED = "*"
EMPTY_SHELF, FULL_SHELF = "s", "$"
EMPTY_STORAGE, POD = "q", "p"


def picture_of(
    subject: Simulation | World, floor_plan: FloorPlan | None = None, brief: bool = False
) -> str:
    """The picture of a simulation, or of a world on the floor `floor_plan`; no newline at the end.

    brief: a shorter picture for people that only counts delivered orders; it cannot be read back.
    """
    world, floor_plan = (
        (subject, floor_plan) if isinstance(subject, World) else _of_simulation(subject)
    )
    if floor_plan is None:
        raise TypeError(
            "the picture of a world needs its floor plan: picture_of(world, floor_plan)"
        )
    rows = map_rows(world, floor_plan)
    lines = [head_line(world), "", *rows, "", *legend_lines(floor_plan)]
    if brief and any(CROWD in row for row in rows):
        lines += [CROWD_LEGEND, ""]
    lines += [robot_line(world, floor_plan, int(i), brief) for i in world.robots.at_index]
    delivered = world.orders.state == ORDER_DELIVERED
    for order in np.flatnonzero(~delivered) if brief else range(len(delivered)):
        line = order_line(world, floor_plan, int(order))
        if line is not None:
            lines.append(line)
    done = int(np.count_nonzero(asked_orders(world).done != NIL))
    if brief and done:
        lines.append(f"{count(done, 'order')} delivered")
    return "\n".join(lines)


def _of_simulation(simulation: Simulation) -> tuple[World, FloorPlan]:
    return simulation.world, simulation.resolved.floor_plan


def head_line(world: World) -> str:
    """The tick, the number of changes of orders and reservations, and the last one allocation saw."""
    clock = world.clock
    seen = "none" if clock.allocation_revision == NIL else str(clock.allocation_revision)
    seed, changes = int(world.rules.seed), clock.revision
    text = f"tick {clock.tick}, seed {seed}, {changes} order changes, {seen} seen by allocation"
    return text + (f", {clock.tickets_issued} tickets" if clock.tickets_issued else "")


def map_rows(world: World, floor_plan: FloorPlan) -> list[str]:
    """The rows of the floor with its loads and robots."""
    text, first = _canvas(floor_plan)
    for slot, cell in enumerate(world.slots.cell.tolist()):
        if not world.slots.unbounded[slot]:
            x, y = floor_plan.xy(cell)
            signs = (EMPTY_SHELF, FULL_SHELF)
            if floor_plan.kind[y + 1, x + 1] == STORAGE:
                signs = (EMPTY_STORAGE, POD)
            text[y, x + first] = signs[int(world.slots.content[slot] != NIL)]
    robots = world.robots
    for claim in robots.claim[robots.claim != NIL].tolist():
        x, y = floor_plan.xy(claim)
        text[y, x + first] = CLAIMED
    held: dict[int, str] = {}
    for i, cell in enumerate(np.where(robots.cell == NIL, robots.bay, robots.cell).tolist()):
        if cell == NIL:
            continue  # off the floor
        name = name_of(int(robots.identity[i]))
        held[cell] = CROWD if cell in held or len(name) > 1 else name
    for cell, mark in held.items():
        x, y = floor_plan.xy(cell)
        text[y, x + first] = mark
    return ["".join(row) for row in text]


def legend_lines(floor_plan: FloorPlan) -> list[str]:
    """The meanings of symbols that are not built in, followed by a blank line; empty without any."""
    legend = _drawing(floor_plan).legend
    lines = []
    for mark, symbol in legend:
        entry = legend_entry(symbol)
        said = [f"{key} {_words(value)}" for key, value in entry.items()]
        lines.append(f"{mark} is {', '.join(said)}")
    return [*lines, ""] if lines else []


def _words(value: object) -> str:
    if isinstance(value, list):
        return " ".join(value) or "none"
    return str(value)


def _canvas(floor_plan: FloorPlan) -> tuple[NDArray[np.str_], int]:
    """(height, columns) characters of the empty floor, and the column of x = 0."""
    picture = _drawing(floor_plan).picture
    text = np.array([list(row) for row in picture.split("\n")])
    for cell in floor_plan.starts:  # robots are drawn later, at their present cells
        x, y = floor_plan.xy(cell)
        text[y, x + text.shape[1] - floor_plan.width] = "."
    return text, text.shape[1] - floor_plan.width


@lru_cache(maxsize=16)
def _drawing(floor_plan: FloorPlan) -> Drawing:
    return floor_drawing(floor_plan)


# Reading a text as a world: this restores the exact state that `picture_of` has drawn.
#
# Everything that a digest covers is restored, so the run continues with the same digests if its
# strategies have no memory. The memory of strategies and the counters behind the metrics (tallies, and
# when and where orders were taken) start afresh.


PLACE = "the picture"
FIRST_LINE = re.compile(
    r"tick (\d+), seed (\d+), (\d+) order changes, (\d+|none) seen by allocation"
    r"(?:, (\d+) tickets)?"
)
BEGINNING = "tick 0, seed 1, 0 order changes, none seen by allocation"
LEGEND_LINE = re.compile(r"\S is kind .*")


class Said(NamedTuple):
    """The content of a picture."""

    tick: int
    seed: int
    changes: int
    seen: int
    tickets: int
    robots: dict[int, RobotLine]  # by identity
    orders: dict[int, DrawnOrder]


def world_from(text: str, resolved: Resolved) -> Simulation:
    """Restore a simulation from its picture; floor, rules and strategies come from `resolved`.

    Raises InputError if a line cannot be read, or if the picture contradicts itself or the scenario
    (the restored world is drawn again and compared).
    """
    lines = [line.rstrip() for line in text.strip("\n").split("\n")]
    said = read_lines(lines)
    simulation = Simulation(resolved, said.seed)
    world, floor_plan = simulation.world, resolved.floor_plan
    if world.rules.assigned:
        raise InputError(
            "a picture does not show which orders are known if orders are assigned to robots"
        )
    if len(world.pods.slot):
        raise InputError(
            "a picture does not show where each pod is and which orders and lines wait for it; "
            "use a recording, or run the scenario to this tick"
        )
    check_names(said, world)
    for identity, line in said.robots.items():
        set_robot(world, floor_plan, int(world.robots.at_index[identity]), line)
    for order in said.orders.values():
        set_order(world, floor_plan, order.number, order.facts)
        set_stops(world, order)
    set_reservations(world)
    set_clock(world, said, resolved)
    hold_cells(world)
    check_against(lines, picture_of(simulation).split("\n"))
    return simulation


def read_lines(lines: list[str]) -> Said:
    """Read all lines except the map. Raises InputError with the line number."""
    head = FIRST_LINE.fullmatch(lines[0])
    if head is None:
        raise InputError(f"the first line must be like: {BEGINNING}", PLACE, 1)
    seen = NIL if head[4] == "none" else int(head[4])
    said = Said(int(head[1]), int(head[2]), int(head[3]), seen, int(head[5] or 0), {}, {})
    body = [number for number, line in enumerate(lines) if not line][1:2]  # the map lies between
    for number in range(body[0] if body else len(lines), len(lines)):
        line = lines[number]
        try:
            if line.startswith("order "):
                order = read_order(line)
                said.orders[order.number] = order
            elif line and not LEGEND_LINE.fullmatch(line):
                robot = read_robot(line, said.tick)
                said.robots[robot.identity] = robot
        except InputError as error:
            raise error.at(PLACE, number + 1) from None
    return said


def check_names(said: Said, world: World) -> None:
    """Raise InputError unless the robots and orders of the picture are those of the scenario."""
    robots, orders = len(world.robots.cell), len(world.orders.state)
    missing = [name_of(identity) for identity in range(robots) if identity not in said.robots]
    if missing:
        raise InputError(f"{PLACE} has no line for robot {missing[0]}")
    surplus = [name_of(identity) for identity in said.robots if identity >= robots]
    if surplus:
        raise InputError(f"{PLACE} has a robot {surplus[0]}, but the scenario has only {robots}")
    numbers = [*said.orders, *(_number(facts["order"]) for _, facts, _, _ in said.robots.values())]
    if max(numbers, default=0) >= orders:
        raise InputError(f"{PLACE} has an order {max(numbers)}, but the scenario has only {orders}")


def set_robot(world: World, floor_plan: FloorPlan, i: int, line: RobotLine) -> None:
    """Set the robot at storage index i to the state of its line."""
    robots, facts = world.robots, line.facts
    for name in numbers_of(type(robots)):
        getattr(robots, name)[i] = facts[name]
    robots.service_zone[i] = _number(facts["service_zone"]) - 1
    for name in ("cell", "claim", "goal_cell"):
        getattr(robots, name)[i] = _cell(floor_plan, facts[name])
    if facts["left"] is not None:
        robots.home[i] = _cell(floor_plan, facts["left"])
    if facts["goal_type"] == GOAL_PARK:
        robots.goal_cell[i] = robots.home[i]
    robots.slot[i] = _slot(world, floor_plan, facts["slot"])
    robots.need[i] = sum(bit for name, bit in NEEDS.items() if facts[name])
    set_order_queue(world, i, line.plan)
    steps, driven = line.route
    if len(steps) > robots.route.shape[1]:
        raise InputError(f"{PLACE} has a route of more than {robots.route.shape[1]} steps")
    robots.route[i, : len(steps)] = steps
    robots.route_length[i] = len(steps)
    robots.route_index[i] = driven
    robots.route_hash[i] = route_hash(steps)


def set_order_queue(world: World, i: int, orders: list[int]) -> None:
    """Set the planned orders of a robot."""
    if len(orders) > world.robots.order_queue.shape[1]:
        raise InputError(
            f"{PLACE} has a plan of more than {world.robots.order_queue.shape[1]} orders"
        )
    if max(orders, default=0) >= len(world.orders.state):
        raise InputError(f"{PLACE} has a plan with an order {max(orders)}, which does not exist")
    world.robots.order_queue[i, : len(orders)] = orders
    world.robots.order_queue_length[i] = len(orders)


def route_hash(steps: list[int]) -> int:
    """The hash of a route, as the world computes it for the digest."""
    total = np.uint64(0)
    with np.errstate(over="ignore"):
        for s, step in enumerate(steps):
            total += np.uint64(splitmix64(np.uint64(s << 8 | step)))
    return int(total >> np.uint64(1))


def set_order(world: World, floor_plan: FloorPlan, order: int, facts: Facts) -> None:
    """Set an order to the state of its line."""
    orders = world.orders
    for name in ("state", "delivered", "legs"):
        getattr(orders, name)[order] = facts[name]
    spare = _number(facts["spare"])
    if spare == NIL:
        orders.current_slot[order] = _slot(world, floor_plan, facts["current_slot"])
        return
    slot, cell = world.slots.first_spare + spare, _cell(floor_plan, facts["current_slot"])
    if slot >= len(world.slots.cell) or not open_slot(world, slot, cell):
        raise InputError(
            f"{PLACE} has a load {spare} on the floor that no robot can have left there"
        )
    orders.current_slot[order] = slot


def set_stops(world: World, line: DrawnOrder) -> None:
    """Mark the first stops of an order as done in the ticks of its line."""
    orders = world.orders
    first, end = orders.first_stop[line.number : line.number + 2].tolist()
    if len(line.stops) > end - first:
        raise InputError(
            f"{PLACE} has {len(line.stops)} stops of order {line.number}, which has {end - first}"
        )
    world.stops.done[first : first + len(line.stops)] = line.stops
    orders.stops_done[line.number] = len(line.stops)


def set_reservations(world: World) -> None:
    """Derive reservations of orders and slots, and contents of slots, from robots and orders."""
    robots, orders, slots = world.robots, world.orders, world.slots
    for i, identity in enumerate(robots.identity.tolist()):
        load, order, slot = int(robots.load[i]), int(robots.order[i]), int(robots.slot[i])
        if order != NIL:
            orders.reserved_by[order] = identity
        if load != NIL:
            orders.state[load] = ORDER_CARRIED
            orders.current_slot[load] = NIL
            orders.legs[load] = max(1, int(orders.legs[load]))
        if slot != NIL and not slots.unbounded[slot]:
            slots.reserved_by[slot] = identity
    slots.content[:] = NIL
    for order, slot in enumerate(orders.current_slot.tolist()):
        if slot != NIL and not slots.unbounded[slot]:
            slots.content[slot] = order


def set_clock(world: World, said: Said, resolved: Resolved) -> None:
    """Set the tick, and derive the counters from robots and orders."""
    robots, clock = world.robots, world.clock
    clock.tick = said.tick
    clock.coarse_tick = (said.tick - 1) // world.rules.refinement + 1
    clock.revision = said.changes
    clock.allocation_revision = said.seen
    is_open = world.orders.state != ORDER_DELIVERED
    clock.undelivered = int(np.count_nonzero(is_open))
    clock.first_open = int(np.argmax(is_open)) if is_open.any() else len(is_open)
    clock.unparked = int(np.count_nonzero(robots.parked == 0))
    orders = world.orders
    if world.rules.in_system:
        restore_closed_loop(world, said.tick)
    known = orders.release_tick <= said.tick
    orders.state[known & (orders.state == ORDER_UNRELEASED)] = ORDER_WAITING
    clock.next_release = int(np.count_nonzero(known))
    clock.known_orders = len(known)
    clock.next_fault = int(np.count_nonzero(world.rules.faults[:, 0] <= said.tick))
    clock.tickets_issued = said.tickets
    is_down = (robots.status != STATUS_UP) & (robots.status != STATUS_REMOVED)
    clock.robots_down = int(np.count_nonzero(is_down))
    clock.needing_charging = int(np.count_nonzero(robots.need & NEED_CHARGING))
    asking = robots.need & NEED_ALLOCATION != 0
    clock.fresh_allocation = int(np.count_nonzero(asking & (robots.seen_revision == NIL)))
    clock.needing_route = int(np.count_nonzero(robots.need & NEED_ROUTE))
    clock.needing_right_of_way = int(np.count_nonzero(robots.need & NEED_RIGHT_OF_WAY))
    when = resolved.scenario.stop.when
    over = when == "delivered" or (when == "parked" and clock.unparked == 0)
    clock.finished = int(said.tick > 0 and clock.undelivered == 0 and over)


def restore_closed_loop(world: World, tick: int) -> None:
    """Restore release ticks: each delivery releases the next order in sequence one tick later."""
    orders, first = world.orders, world.rules.in_system
    later = orders.release_sequence[first:]
    before = np.sort(orders.delivered[(orders.delivered != NIL) & (orders.delivered < tick)])
    shown = min(len(later), len(before))
    orders.release_tick[later[:shown]] = before[:shown] + 1


def check_against(lines: list[str], drawn: list[str]) -> None:
    """Raise InputError for the first line that the restored world would draw differently."""
    for number in range(max(len(lines), len(drawn))):
        said = lines[number] if number < len(lines) else ""
        should = drawn[number].rstrip() if number < len(drawn) else ""
        if said != should:
            raise InputError(
                f"this line contradicts the rest of the picture or the scenario: "
                f"it is '{said}', but should be '{should}'",
                PLACE,
                number + 1,
            )


def _number(value: Value) -> int:
    return value if isinstance(value, int) else NIL


def _cell(floor_plan: FloorPlan, value: Value) -> int:
    if not isinstance(value, tuple):
        return NIL
    return floor_plan.cell(*_on_floor(floor_plan, value))


def _slot(world: World, floor_plan: FloorPlan, value: Value) -> int:
    if not isinstance(value, tuple):
        return NIL
    slot = int(world.grid.slot[floor_plan.cell(*_on_floor(floor_plan, value))])
    if slot == NIL:
        raise InputError(f"{PLACE} has a load at {value}, where there is no shelf or destination")
    return slot


def _on_floor(floor_plan: FloorPlan, value: Pair) -> Pair:
    if not floor_plan.holds(*value):
        raise InputError(f"{PLACE} mentions {value}, which is not on the floor")
    return value


# Stories: a few robots on a tiny floor, moved tick by tick to test the rules of occupancy.
#
# >>> moved("AB.", A="east", B="east") '.AB'
#
# Robots are drawn on free floor and drive in any direction without turning. The other symbols of
# floors have their usual meaning, so an aisle for two is 'A==B'. A Story continues from tick to tick.


Following = Literal["convoy", "handover", "none"]


class Story:
    """Robots drawn in a picture, which move as requested if the rules allow it.

    `following`, `move` (ticks of a move), `slow` (the mode of zones that slow moves down; "" for
    none), `priority` by robot, and `storage` (the order in which robots are stored, which must not
    matter) set the rules; `tick` decides ties.
    """

    def __init__(
        self,
        picture: str,
        *,
        following: Following = "convoy",
        move: int = 1,
        slow: str = "",
        priority: Mapping[str, int] | None = None,
        storage: Sequence[int] | None = None,
        legend: Legend = (),
        tick: int = 0,
    ) -> None:
        self.floor_plan = draw_floor(picture.strip("\n"), legend)
        if not self.floor_plan.starts:
            raise InputError("the picture of a story has no robots; draw them as A, B, C ...")
        order = None if storage is None else np.array(storage, np.int32)
        self.world, _ = build_world(_scenario(self, following, move, slow), 1, order)
        self.world.clock.tick = tick
        for name, value in (priority or {}).items():
            self.world.robots.priority[self._index(name)] = value

    def tick(self, **wants: str) -> str:
        """Execute one tick with the requested moves (A="east"); return the picture after it.

        Robots in a long move continue by themselves and request nothing.
        """
        traffic, robots = self.world.traffic, self.world.robots
        traffic.intent[:] = 0
        for name, direction in wants.items():
            if direction not in DIRECTIONS:
                raise InputError(
                    f"'{direction}' is not a direction; try {alternatives(DIRECTIONS)}"
                )
            i = self._index(name)
            if robots.busy[i]:
                raise InputError(f"robot {name} is still on its way")
            traffic.intent[i] = LIVE | DIRECTIONS.index(direction)
        traffic.move_ticks[:] = self.world.rules.duration[0, ACTION_MOVE]
        self.world.clock.tick += 1
        with np.errstate(over="ignore"):
            count_robots(self.world.grid, robots, traffic.zone_occupancy)
            set_move_ticks(self.world)
            move_all(self.world.grid, self.world.rules, robots, traffic, self.world.clock.tick)
        return self.picture

    @property
    def picture(self) -> str:
        """The floor and the robots now; '*': claimed by a long move, '@': several robots."""
        return "\n".join(map_rows(self.world, self.floor_plan))

    @property
    def refused(self) -> str:
        """The robots whose move was refused in the last tick, such as "BC"."""
        who = self.world.robots.identity[self.world.traffic.intent & REFUSED != 0]
        return "".join(name_of(identity) for identity in sorted(who.tolist()))

    def _index(self, name: str) -> int:
        if len(name) != 1 or not 0 <= identity_of(name) < len(self.floor_plan.starts):
            raise InputError(f"there is no robot {name} in this story")
        return int(self.world.robots.at_index[identity_of(name)])


def moved(picture: str, **wants: str) -> str:
    """The picture after one tick with the requested moves."""
    return Story(picture).tick(**wants)


def _scenario(story: Story, following: Following, move: int, slow: str) -> Resolved:
    floor_plan = story.floor_plan
    scenario = Scenario(
        name="story",
        layout={},
        fleet=Fleet(robots=len(floor_plan.starts), kinematics="omni"),
        durations=Durations(move=move),
        orders=Orders(generator="full-shelves"),
        world=WorldRules(
            following=following,
            traffic_zones=slow or "undirected",  # type: ignore[arg-type]
            slowdown="zones" if slow else "none",
        ),
    )
    return Resolved(scenario, floor_plan, strategies={}, start=floor_plan.starts, source="")
