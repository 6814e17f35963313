"""What a viewer sees of a run after a tick: copies, by identity, that do not change any more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from automaton.engine.facilities import Stations
from automaton.engine.observation import LOST_EVER, congestion_of, visits_of
from automaton.engine.service_zones import ServiceZones
from automaton.engine.state import CLOCK_TICK, NIL, Array
from automaton.runs.simulation import Simulation

FLEET: Final = (  # fields of world.robots
    *("cell", "claim", "heading", "travel", "action", "busy", "priority", "load", "order", "slot"),
    *(
        "goal_type",
        "goal_cell",
        "home",
        "bay",
        "parked",
        "service_zone",
        "failed_retries",
        "retreat_moves",
    ),
    *("charge", "charge_target", "status", "status_until", "ticket", "order_queue_length"),
)
WATCHED: Final = (  # fields of the observation
    *(
        "cause",
        "blocker",
        "wanted",
        "since",
        "slow_zone",
        "slow_zone_occupancy",
        "wait_cycle_ticks",
        "lost",
    ),
)
AT_STATIONS: Final = (
    "in_service",
    "queue_tail",
    "job_done_tick",
    "next_in_queue",
    "arrival_tick",
    "completion_tick",
)  # what changes there
OVERLAYS: Final = ("explored", "predicted")  # tui.playback.route_overlays brings their numbers


@dataclass(frozen=True)
class Fleet:
    """The robots, indexed by identity; meanings as in automaton.engine.state and .waiting."""

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
    goal_type: Array
    goal_cell: Array
    home: Array
    bay: Array
    parked: Array
    service_zone: Array
    failed_retries: Array
    retreat_moves: Array
    charge: Array
    charge_target: Array
    status: Array
    status_until: Array
    ticket: Array
    order_queue_length: Array
    route_length: Array  # (n,) int32: steps left
    cause: Array
    blocker: Array
    wanted: Array
    since: Array
    slow_zone: Array
    slow_zone_occupancy: Array
    wait_cycle_ticks: Array
    lost: Array

    def __len__(self) -> int:
        return len(self.cell)


@dataclass(frozen=True)
class OrderBook:
    """The orders."""

    state: Array
    current_slot: Array
    source: Array
    target: Array
    reserved_by: Array
    release_tick: Array
    weight: Array
    release_sequence: Array
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
    unbounded: Array
    content: Array
    reserved_by: Array


@dataclass(frozen=True)
class Snapshot:
    """The state after a tick."""

    tick: int
    finished: bool
    robots: Fleet
    orders: OrderBook
    slots: SlotStates
    stations: Stations  # that work on parts; which works there are is of the world itself
    service_zones: ServiceZones  # that robots serve; its roads are those of the world
    redesigns: int  # ticks so far in which stations changed their zones
    selected: int  # the robot whose route and plan are given, or NIL
    route: Array  # (k,) int32: cells that the selected robot has still to drive through
    order_queue: Array  # (k,) int32: orders that the selected robot is to do, one after another
    curve: Array  # (K, 2) int32: from this charge on, units that a tick at a charger gives
    layer: str  # the one that was asked for, whose numbers follow
    heat: Array | None  # (C,) int32, or None
    flow: Array | None  # (C, 4) int32
    lost_in_zone: Array  # (Z,) int64: ticks that moves took longer because of each slow zone


def take_snapshot(simulation: Simulation, selected: int = NIL, layer: str = "") -> Snapshot:
    """Copy what a viewer needs from an observed simulation."""
    world, observation = simulation.world, simulation.observation
    by_identity = world.robots.at_index
    fields = {name: getattr(world.robots, name)[by_identity] for name in FLEET}
    fields |= {name: getattr(observation, name)[by_identity] for name in WATCHED}
    fields["route_length"] = (world.robots.route_length - world.robots.route_index)[by_identity]
    return Snapshot(
        tick=int(world.clock[CLOCK_TICK]),
        finished=simulation.finished,
        robots=Fleet(**fields),
        orders=OrderBook(
            **{name: getattr(world.orders, name).copy() for name in world.orders._fields}
        ),
        slots=SlotStates(
            cell=world.slots.cell.copy(),
            unbounded=world.slots.unbounded.copy(),
            content=world.slots.content.copy(),
            reserved_by=world.slots.reserved_by.copy(),
        ),
        stations=world.stations.replaced(
            **{name: getattr(world.stations, name).copy() for name in AT_STATIONS}
        ),
        service_zones=world.service_zones.copied().replaced(
            design=world.service_zones.design.copied()
        ),
        redesigns=int(observation.redesigns[0]),
        selected=selected,
        route=_route(simulation, selected),
        layer=layer,
        order_queue=_plan(simulation, selected),
        curve=world.rules.curve,  # it is never written to
        heat=_heat(simulation, layer),
        flow=observation.flow.copy() if layer == "flow" else None,
        lost_in_zone=observation.lost_in_zone.copy(),
    )


def _route(simulation: Simulation, selected: int) -> Array:
    """(k,) int32: the cells of a robot's remaining route."""
    robots, grid = simulation.world.robots, simulation.world.grid
    if not 0 <= selected < len(robots.cell):  # in a comparison the other fleet may be larger
        return np.zeros(0, np.int32)
    i = robots.at_index[selected]
    start = robots.home[i] if robots.cell[i] == NIL else robots.cell[i]
    start = start if robots.claim[i] == NIL else robots.claim[i]
    steps = robots.route[i, robots.route_index[i] : robots.route_length[i]]
    cells: Array = (start + np.cumsum(grid.offset[steps])).astype(np.int32)
    return cells


def _plan(simulation: Simulation, selected: int) -> Array:
    """(k,) int32: the orders ahead of a robot."""
    robots = simulation.world.robots
    if not 0 <= selected < len(robots.cell):
        return np.zeros(0, np.int32)
    i = robots.at_index[selected]
    orders: Array = robots.order_queue[i, : robots.order_queue_length[i]].copy()
    return orders


def _heat(simulation: Simulation, layer: str) -> Array | None:
    observation = simulation.observation
    if layer == "visits":
        return visits_of(observation.flow, simulation.world.grid.offset)
    if layer == "waiting":
        return observation.lost_ticks_by_cell[:, LOST_EVER].copy()
    if layer == "congestion":
        return congestion_of(observation.lost_ticks_by_cell, simulation.tick)
    return None
