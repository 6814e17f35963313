"""What a viewer sees of a run after a tick: copies, by identity, that nobody changes any more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from automaton.simulation import Simulation
from automaton.world.partition import Partition
from automaton.world.places import Stations
from automaton.world.state import NIL, TICK, Array
from automaton.world.waiting import LOST_EVER, congestion_of, visits_of

FLEET: Final = (  # fields of world.robots
    *("cell", "claim", "heading", "travel", "action", "busy", "priority", "load", "order", "slot"),
    *("goal", "stand", "home", "bay", "parked", "zone", "blocked", "withdrawing"),
    *("charge", "level", "status", "until", "ticket", "planned"),
)
WATCHED: Final = (  # fields of the observation
    *("cause", "blocker", "wanted", "since", "slow_zone", "crowd", "ring", "lost"),
)
AT_STATIONS: Final = ("first", "last", "until", "behind", "came", "done")  # what changes there
OVERLAYS: Final = ("explored", "predicted")  # automaton.history.overlays brings their numbers


@dataclass(frozen=True)
class Fleet:
    """The robots, indexed by identity; meanings as in automaton.world.state and .waiting."""

    cell: Array
    claim: Array
    heading: Array
    travel: Array
    action: Array
    busy: Array
    priority: Array
    load: Array
    order: Array
    slot: Array
    goal: Array
    stand: Array
    home: Array
    bay: Array
    parked: Array
    zone: Array
    blocked: Array
    withdrawing: Array
    charge: Array
    level: Array
    status: Array
    until: Array
    ticket: Array
    planned: Array
    route_length: Array  # (n,) int32: steps left
    cause: Array
    blocker: Array
    wanted: Array
    since: Array
    slow_zone: Array
    crowd: Array
    ring: Array
    lost: Array

    def __len__(self) -> int:
        return len(self.cell)


@dataclass(frozen=True)
class OrderBook:
    """The orders."""

    state: Array
    place: Array
    source: Array
    target: Array
    by: Array
    released: Array
    weight: Array
    coming: Array
    dispatched: Array
    dispatched_from: Array
    dispatched_heading: Array
    dispatched_type: Array
    delivered: Array
    legs: Array


@dataclass(frozen=True)
class SlotStates:
    """The cells that hold loads."""

    cell: Array
    endless: Array
    content: Array
    by: Array


@dataclass(frozen=True)
class Snapshot:
    """The state after a tick."""

    tick: int
    finished: bool
    robots: Fleet
    orders: OrderBook
    slots: SlotStates
    stations: Stations  # that work on parts; which works there are is of the world itself
    zoning: Partition  # that robots serve; its roads are those of the world
    redesigns: int  # ticks so far in which stations changed their zones
    selected: int  # the robot whose route and plan are given, or NIL
    route: Array  # (k,) int32: cells that the selected robot has still to drive through
    plan: Array  # (k,) int32: orders that the selected robot is to do, one after another
    curve: Array  # (K, 2) int32: from this charge on, units that a tick at a charger gives
    layer: str  # the one that was asked for, whose numbers follow
    heat: Array | None  # (C,) int32, or None
    flow: Array | None  # (C, 4) int32
    lost_in_zone: Array  # (Z,) int64: ticks that moves took longer because of each slow zone


def take_snapshot(simulation: Simulation, selected: int = NIL, layer: str = "") -> Snapshot:
    """Copy what a viewer needs from an observed simulation."""
    world, watch = simulation.world, simulation.watch
    by_identity = world.robots.at_index
    fields = {name: getattr(world.robots, name)[by_identity] for name in FLEET}
    fields |= {name: getattr(watch, name)[by_identity] for name in WATCHED}
    fields["route_length"] = (world.robots.length - world.robots.at)[by_identity]
    return Snapshot(
        tick=int(world.clock[TICK]),
        finished=simulation.finished,
        robots=Fleet(**fields),
        orders=OrderBook(
            **{name: getattr(world.orders, name).copy() for name in world.orders._fields}
        ),
        slots=SlotStates(
            cell=world.slots.cell.copy(),
            endless=world.slots.endless.copy(),
            content=world.slots.content.copy(),
            by=world.slots.by.copy(),
        ),
        stations=world.stations.replaced(
            **{name: getattr(world.stations, name).copy() for name in AT_STATIONS}
        ),
        zoning=world.zoning.copied().replaced(design=world.zoning.design.copied()),
        redesigns=int(watch.redesigns[0]),
        selected=selected,
        route=_route(simulation, selected),
        layer=layer,
        plan=_plan(simulation, selected),
        curve=world.rules.curve,  # nobody writes to it
        heat=_heat(simulation, layer),
        flow=watch.flow.copy() if layer == "flow" else None,
        lost_in_zone=watch.lost_in_zone.copy(),
    )


def _route(simulation: Simulation, selected: int) -> Array:
    """(k,) int32: the cells of a robot's remaining route."""
    robots, grid = simulation.world.robots, simulation.world.grid
    if not 0 <= selected < len(robots.cell):  # in a comparison the other fleet may be larger
        return np.zeros(0, np.int32)
    i = robots.at_index[selected]
    start = robots.home[i] if robots.cell[i] == NIL else robots.cell[i]
    start = start if robots.claim[i] == NIL else robots.claim[i]
    steps = robots.route[i, robots.at[i] : robots.length[i]]
    cells: Array = (start + np.cumsum(grid.offset[steps])).astype(np.int32)
    return cells


def _plan(simulation: Simulation, selected: int) -> Array:
    """(k,) int32: the orders ahead of a robot."""
    robots = simulation.world.robots
    if not 0 <= selected < len(robots.cell):
        return np.zeros(0, np.int32)
    i = robots.at_index[selected]
    orders: Array = robots.plan[i, : robots.planned[i]].copy()
    return orders


def _heat(simulation: Simulation, layer: str) -> Array | None:
    watch = simulation.watch
    if layer == "visits":
        return visits_of(watch.flow, simulation.world.grid.offset)
    if layer == "waiting":
        return watch.delay[:, LOST_EVER].copy()
    if layer == "congestion":
        return congestion_of(watch.delay, simulation.tick)
    return None
