"""The inspector: all facts about the robot, cell, zone or order that was chosen last."""

from __future__ import annotations

import numpy as np

from automaton.engine.state import (
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    ORDER_WAITING,
)
from automaton.floor.floor_plan import (
    ANY_LOADS,
    BAY,
    CHARGER,
    DIRECTIONS,
    DRIVABLE,
    STORAGE,
    UNLIMITED,
    WEIGHT_UNIT,
    FloorPlan,
)
from automaton.units import count
from automaton.world.floor_parts import places_of_chargers
from tui.playback.panel_view import OrderChosen, View
from tui.registration import layer_named
from tui.widgets.panel import (
    Facts,
    Line,
    Link,
    Parts,
    TextPanel,
    cell_link,
    dim,
    fact_lines,
    line,
    order_link,
    robot_link,
    several,
    tick_link,
    title,
    wrapped,
)
from tui.widgets.pod_facts import (
    due_facts,
    has_pods,
    makes_trips,
    ordered_pod,
    pod_station_facts,
    slot_place,
    state_word,
    storage_facts,
    trip_lines,
)
from tui.widgets.robot_facts import charger_lines, closed_to, robot_lines
from tui.widgets.zone_facts import order_zone, part_of_order, station_facts, zone_facts, zone_lines

GUIDE = (
    "Click a robot, a shelf or any other cell of the map.",
    "/ finds robots, loads, cells and zones; ( and ) go to the previous and the next robot.",
    "i inspects the cell under the mouse, or in the middle of the map.",
    "Underlined words are links: click one, or move to it with up and down and press enter.",
)


class Inspector(TextPanel):
    """All facts about the last choice.

    An order takes precedence until another choice is made, then a zone, a robot, a cell.
    """

    order = NIL
    _chosen = (NIL, NIL, NIL)

    def panel_lines(self, view: View, width: int) -> list[Line]:
        """The facts about the choice."""
        chosen = (view.robot, view.cell, view.zone)
        if chosen != self._chosen:
            self._chosen, self.order = chosen, NIL
        if self.order != NIL:
            back = [line("back to ", robot_link(view.robot))] if view.robot != NIL else []
            return [*order_lines(view, self.order, width), (), *back]
        if view.zone != NIL:
            return zone_lines(view, view.zone, width)
        if view.robot != NIL:
            return robot_lines(view, view.robot, width, self.signs)
        if view.cell != NIL:
            return cell_lines(view, view.cell, width)
        told = [made for text in GUIDE for made in wrapped(line(dim(text)), width)]
        return [line(title("nothing is selected")), *told]

    def cache_key(self, view: View) -> tuple[object, ...]:
        return (*super().cache_key(view), self.order)

    def show_order(self, order: int) -> bool:
        """Show an order until another robot, cell or zone is chosen."""
        self.order = order
        if self.view is not None:
            self.show(self.view)
        return True

    def follow(self, link: Link, column: int = 0) -> None:
        """Show an order here; a link to the chosen robot or cell ends that."""
        kind, number = link
        if kind == "order":
            self.show_order(number)
            self.post_message(OrderChosen(number))
            return
        if kind in ("robot", "cell", "zone"):
            self.show_order(NIL)
        super().follow(link, column)


# A cell.


def cell_lines(view: View, cell: int, width: int) -> list[Line]:
    """Everything about one cell."""
    kind = view.floor_plan.kind_of(cell)
    x, y = view.floor_plan.xy(cell)
    lines = [line(title(f"cell ({x}, {y}) "), kind.name.replace("-", " ")), line(dim(kind.meaning))]
    facts: Facts = [
        *_ground(view, cell),
        *(pod_station_facts if has_pods(view) else station_facts)(view, cell),
        *zone_facts(view, cell),
        *_traffic(view, cell),
        *_stored(view, cell),
    ]
    lines += fact_lines(facts, width)
    if kind.code == CHARGER:
        lines += charger_lines(view, cell, width)
    return lines


def _ground(view: View, cell: int) -> Facts:
    floor_plan = view.floor_plan
    kind = int(floor_plan.kind.reshape(-1)[cell])
    if kind == BAY:
        homes = floor_plan.bays[floor_plan.bays[:, 0] == cell, 1]
        return [("opens on", [cell_link(floor_plan, int(home)) for home in homes])]
    if not DRIVABLE[kind]:
        return []
    exits, capacity = (
        int(floor_plan.exits.reshape(-1)[cell]),
        int(floor_plan.capacity.reshape(-1)[cell]),
    )
    ways: list[list[str]] = [[], []]  # to cells that robots drive through, and into storage
    for direction, (name, beside) in enumerate(
        zip(DIRECTIONS, floor_plan.neighbours(cell), strict=True)
    ):
        if exits >> direction & 1:
            ways[int(floor_plan.kind.flat[beside]) == STORAGE].append(name)
    exits_said = ", ".join(ways[0]), f"{', '.join(ways[1])} into storage" * bool(ways[1])
    room = "any number of robots" if capacity == UNLIMITED else count(capacity, "robot")
    if kind == CHARGER and capacity == UNLIMITED:
        scenario = view.run.resolved.scenario
        places = places_of_chargers(scenario, floor_plan)[cell]
        room = count(places, "robot") if places < scenario.fleet.robots else room
    return [
        ("exits", ["; ".join(filter(None, exits_said)) or "none"]),
        ("closed to", [", ".join(closed_to(view, cell))] if closed_to(view, cell) else []),
        ("speed limit", _limits(view, cell)),
        ("weights", _weights(view, cell)),
        ("room for", [room + (", one each way" if capacity == 2 else "")]),
    ]


def _limits(view: View, cell: int) -> Parts:
    """The minimum duration of moves out of a cell, by direction; [] without a limit."""
    limits = view.floor_plan.min_move_ticks
    if not len(limits) or not limits[cell].any():
        return []
    ways = [
        f"{name} {count(int(ticks), 'tick')}"
        for name, ticks in zip(DIRECTIONS, limits[cell], strict=True)
        if ticks
    ]
    return ["a move takes at least: " + ", ".join(ways)]


def _weights(view: View, cell: int) -> Parts:
    """The weights of moves out of a cell and of waiting; [] without streets."""
    floor_plan = view.floor_plan
    if not len(floor_plan.move_weights):
        return []
    exits, closed = int(floor_plan.exits.flat[cell]), closed_moves(floor_plan, cell)
    said = [
        f"{name} {'closed' if direction in closed else f'{weight / WEIGHT_UNIT:g}'}"
        for direction, (name, weight) in enumerate(
            zip(DIRECTIONS, floor_plan.move_weights[cell].tolist(), strict=True)
        )
        if direction in closed or exits >> direction & 1
    ]
    return [", ".join([*said, f"waiting {floor_plan.wait_weights[cell] / WEIGHT_UNIT:g}"])]


def closed_moves(floor_plan: FloorPlan, cell: int) -> list[int]:
    """The directions in which robots come into a cell but do not leave it."""
    exits = floor_plan.exits.flat
    return [
        direction
        for direction, beside in enumerate(floor_plan.neighbours(cell))
        if exits[beside] >> (direction ^ 2) & 1 and not exits[cell] >> direction & 1
    ]


def _traffic(view: View, cell: int) -> Facts:
    """Robots in the cell, entering it and waiting for it; the layer's number."""
    fleet, snapshot = view.snapshot.robots, view.snapshot
    at = np.where(fleet.cell == NIL, fleet.bay, fleet.cell)
    layer = layer_named(view.layer)
    counted: Parts = []
    if snapshot.heat is not None and layer.counted:
        counted = [f"{int(snapshot.heat[cell]):,} {layer.counted}"]
    elif snapshot.flow is not None:
        moves = [
            f"{name} {int(n):,}" for name, n in zip(DIRECTIONS, snapshot.flow[cell], strict=True)
        ]
        counted = ["moves " + ", ".join(moves)]
    return [
        ("here", _robots(np.flatnonzero(at == cell).tolist())),
        ("coming", _robots(np.flatnonzero(fleet.claim == cell).tolist())),
        ("wanted by", _robots(np.flatnonzero(fleet.wanted == cell).tolist())),
        (view.layer or "layer", counted),
    ]


def _robots(robots: list[int]) -> Parts:
    return several([robot_link(robot) for robot in robots])


def _stored(view: View, cell: int) -> Facts:
    """The content of a slot."""
    slots, orders = view.snapshot.slots, view.snapshot.orders
    kind = view.floor_plan.kind_of(cell)
    found = np.flatnonzero(slots.cell == cell)
    if not len(found):
        return []
    if has_pods(view):
        return storage_facts(view, cell) if kind.code == STORAGE else []
    slot = int(found[0])
    keeper: Parts = (
        [] if slots.reserved_by[slot] == NIL else [robot_link(int(slots.reserved_by[slot]))]
    )
    facts: Facts = []
    if kind.holds == ANY_LOADS and kind.gives:
        waiting = np.flatnonzero(
            (orders.current_slot == slot) & (orders.state == ORDER_WAITING)
        ).tolist()
        fetched = (orders.state == ORDER_CARRIED) | (orders.state == ORDER_DELIVERED)
        taken = int(np.count_nonzero((orders.source == slot) & fetched))
        facts += [
            ("waiting", [count(len(waiting), "load")]),
            ("fetched", [count(taken, "load")]),
            ("the next", several([order_link(order, "load") for order in waiting])),
        ]
    if kind.holds == ANY_LOADS and kind.takes:
        arrived = np.flatnonzero((orders.target == slot) & (orders.state == ORDER_DELIVERED))
        coming = (orders.state == ORDER_WAITING) | (orders.state == ORDER_CARRIED)
        expected = int(np.count_nonzero((orders.target == slot) & coming))
        newest = arrived[np.argsort(-orders.delivered[arrived], kind="stable")].tolist()
        facts += [
            ("received", [count(len(newest), "load")]),
            ("expected", [count(expected, "load")]),
            ("the last", several([order_link(order, "load") for order in newest])),
            ("reserved", keeper),
        ]
    if facts:
        left = [load for load in slots.content[found[1:]].tolist() if load != NIL]
        return [*facts, ("left here", several([order_link(load, "load") for load in left]))]
    load = int(slots.content[slot])
    held: Parts = ["nothing"] if load == NIL else [order_link(load, "load")]
    fetcher = NIL if load == NIL else int(orders.reserved_by[load])
    return [
        ("holds", held),
        ("for", [] if load == NIL else slot_place(view, int(orders.target[load]))),
        ("fetched by", [] if fetcher == NIL else [robot_link(fetcher)]),
        ("reserved", keeper),
    ]


# An order.


def order_lines(view: View, order: int, width: int) -> list[Line]:
    """Everything about one order and its load, or one trip of a pod."""
    if makes_trips(view):
        return trip_lines(view, order, width)
    orders = view.snapshot.orders
    state, reserved_by = int(orders.state[order]), int(orders.reserved_by[order])
    stops = int(orders.first_stop[order + 1] - orders.first_stop[order])
    no_load = int(orders.source[order]) == NIL
    lines = [line(title(f"order {order} "), state_word(view, order))]
    done = state == ORDER_DELIVERED
    facts: Facts = [
        ("pod", ordered_pod(view, order)),
        ("from", slot_place(view, int(orders.source[order]))),
        ("to", slot_place(view, int(orders.target[order]))),
        ("lies at", [] if done else slot_place(view, int(orders.current_slot[order]))),
        (
            "carried by" if state == ORDER_CARRIED else "taken by",
            [] if reserved_by == NIL else [robot_link(reserved_by)],
        ),
        ("stops", [f"{int(orders.stops_done[order])} of {stops} done"] if stops else []),
        ("picked up", [] if no_load else [count(int(orders.legs[order]), "time")]),
        ("known", ["from ", tick_link(int(orders.release_tick[order]))]),
        ("due", due_facts(view, order)),
        ("delivered", [tick_link(int(orders.delivered[order]))] if done else []),
        ("lead time", _lead_time(view, order)),
        *part_of_order(view, order),
        *order_zone(view, order),
    ]
    return [*lines, *fact_lines(facts, width)]


def _lead_time(view: View, order: int) -> Parts:
    """Ticks from release to delivery, or until now."""
    orders = view.snapshot.orders
    known, state = int(orders.release_tick[order]), int(orders.state[order])
    if state == ORDER_UNRELEASED:
        return []
    if state == ORDER_DELIVERED:
        return [count(int(orders.delivered[order]) - known, "tick")]
    return [f"{count(view.snapshot.tick - known, 'tick')} so far"]
