"""Snapshots of a run after a tick for viewers: immutable copies, indexed by identity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from automaton.engine.facilities import (
    Gates,
    Lines,
    Pods,
    PodStations,
    ServiceZones,
    Slots,
    Stations,
    Stops,
    Trips,
)
from automaton.engine.jit.structs import CARRIED, Struct
from automaton.engine.observation import CAUSE_ILLEGAL_DECISION, Observation
from automaton.engine.state import GATE_CLOSING, GATE_DOOR, NIL, Array, Orders, Robots

if TYPE_CHECKING:  # this needs Numba
    from automaton.runs.simulation import Simulation

AnyStruct = TypeVar("AnyStruct", bound=Struct)


def by_robot(struct: type[Struct]) -> list[str]:
    """The arrays by robot that belong to the state of a struct, without rows of different lengths."""
    return [
        name
        for name, declared in struct._declared.items()
        if declared.role in CARRIED and declared.extents[:1] == ("n",) and not declared.used
    ]


_FIELDS: Final = by_robot(Robots)
_OBSERVED: Final = by_robot(Observation)


@dataclass(frozen=True)
class FleetSnapshot:
    """The robots, indexed by identity: the fields of world.robots and of the observation.

    `route_length`: (n,) int32, remaining steps.
    """

    __annotations__ = dict.fromkeys([*_FIELDS, *_OBSERVED], "Array")

    if TYPE_CHECKING:

        def __init__(self, **arrays: Array) -> None: ...

        def __getattr__(self, name: str) -> Array: ...

    def __len__(self) -> int:
        return len(self.cell)


@dataclass(frozen=True)
class Snapshot:
    """The state after a tick."""

    tick: int
    finished: bool
    robots: FleetSnapshot
    orders: Orders
    slots: Slots
    stations: Stations  # stations that work on parts
    pods: Pods
    lines: Lines
    trips: Trips
    stops: Stops
    pod_stations: PodStations
    gates: Gates
    station_names: tuple[str, ...]  # of pod_stations
    pod_names: tuple[str, ...]
    stride: int  # flat index difference of a cell and the cell below
    service_zones: ServiceZones  # shares its roads with the world
    redesigns: int  # number of ticks so far in which stations changed their zones
    selected: int  # the robot whose route and plan are included, or NIL
    route: Array  # (k,) int32: remaining cells of the selected robot's route
    order_queue: Array  # (k,) int32: planned orders of the selected robot
    repairs_in_place: bool  # whether broken robots are repaired in place, not towed
    illegal: dict[int, str]  # by robot that waits for an illegal decision: the decision in words
    delayed_until: Array  # (n,) int64: last tick of a robot's delay; (0,) without delays
    curve: Array  # (K, pieces, 2) int32: rows of a charge, and units per charging tick above it
    lost_in_zone: Array  # (Z,) int64: extra ticks of moves because of each slow zone
    layer: str  # requested map layer; the viewer adds its numbers
    heat: Array | None = None  # (C,) int32, or None
    flow: Array | None = None  # (C, 4) int32
    observed: bool = False  # what real robots did
    detour: int = 0  # ticks by which streets make the selected robot's way longer than the shortest


def take_snapshot(simulation: Simulation, selected: int = NIL, layer: str = "") -> Snapshot:
    """Copy the state of an observed simulation for a viewer."""
    world, observation = simulation.world, simulation.observation
    by_identity = world.robots.at_index
    fields = {name: getattr(world.robots, name)[by_identity] for name in _FIELDS}
    fields |= {name: getattr(observation, name)[by_identity] for name in _OBSERVED}
    fields["route_length"] = (world.robots.route_length - world.robots.route_index)[by_identity]
    return Snapshot(
        tick=int(world.clock.tick),
        finished=simulation.finished,
        robots=FleetSnapshot(**fields),
        orders=_copied(world.orders),
        slots=_copied(world.slots),
        stations=_copied(world.stations),
        pods=_copied(world.pods),
        lines=_copied(world.lines),
        trips=_copied(world.trips),
        stops=_copied(world.stops),
        pod_stations=_copied(world.pod_stations),
        gates=_copied(world.gates),
        station_names=simulation.resolved.station_names,
        pod_names=simulation.resolved.pod_names,
        stride=simulation.resolved.floor_plan.stride,
        service_zones=_copied(world.service_zones).replaced(
            design=world.service_zones.design.copied()
        ),
        redesigns=int(observation.redesigns),
        selected=selected,
        route=_route(simulation, selected),
        order_queue=_plan(simulation, selected),
        repairs_in_place=len(world.rules.repair_in_place) > 0,
        illegal=_illegal(simulation),
        delayed_until=world.delays.until.copy(),
        curve=world.rules.curve,  # constant
        lost_in_zone=observation.lost_in_zone.copy(),
        layer=layer,
        observed=simulation.resolved.observed,
        detour=_detour(simulation, selected),
    )


def _copied(struct: AnyStruct) -> AnyStruct:
    """A copy of a struct that shares the arrays that never change."""
    changing = [
        name for name, one in struct._declared.items() if one.role in CARRIED and one.is_array
    ]
    return struct.replaced(**{name: struct.array(name).copy() for name in changing})


def _route(simulation: Simulation, selected: int) -> Array:
    """(k,) int32: the cells of a robot's remaining route."""
    robots, grid = simulation.world.robots, simulation.world.grid
    if not 0 <= selected < len(robots.cell):  # in comparisons the other fleet may be larger
        return np.zeros(0, np.int32)
    i = robots.at_index[selected]
    start = robots.home[i] if robots.cell[i] == NIL else robots.cell[i]
    start = start if robots.claim[i] == NIL else robots.claim[i]
    steps = robots.route[i, robots.route_index[i] : robots.route_length[i]]
    cells: Array = (start + np.cumsum(grid.offset[steps])).astype(np.int32)
    return cells


def _detour(simulation: Simulation, selected: int) -> int:
    """Ticks by which the way of a robot to its goal is longer than the shortest, alone on the floor."""
    world = simulation.world
    if not len(world.grid.move_weight) or not 0 <= selected < len(world.robots.cell):
        return 0
    from automaton.runs.task_lower_bounds import detour_ahead

    with np.errstate(over="ignore"):
        i = world.robots.at_index[selected]
        return int(detour_ahead(simulation.view, simulation.workspace, i))


def _illegal(simulation: Simulation) -> dict[int, str]:
    """The illegal decisions that cost robots this tick, in words."""
    from automaton.runs.illegal_decisions import latest_illegal_decision

    world, floor_plan = simulation.world, simulation.resolved.floor_plan
    illegal = np.flatnonzero(simulation.observation.cause == CAUSE_ILLEGAL_DECISION)
    robots = world.robots.identity[illegal].tolist()
    latest = {robot: latest_illegal_decision(world, floor_plan, robot) for robot in robots}
    return {robot: f"{one.layer}: {one.words}" for robot, one in latest.items() if one is not None}


def _plan(simulation: Simulation, selected: int) -> Array:
    """(k,) int32: the planned orders of a robot."""
    robots = simulation.world.robots
    if not 0 <= selected < len(robots.cell):
        return np.zeros(0, np.int32)
    i = robots.at_index[selected]
    orders: Array = robots.order_queue[i, : robots.order_queue_length[i]].copy()
    return orders


# Gates in a snapshot.


def closed_until(snapshot: Snapshot, gate: int) -> int:
    """The first tick after a present closing; NIL if the gate is open."""
    gates = snapshot.gates
    row = int(gates.first_closing[gate] + gates.closing[gate])
    if gates.kind[gate] != GATE_CLOSING or row >= gates.first_closing[gate + 1]:
        return NIL
    first, end = gates.closings[row].tolist()
    return end if first <= snapshot.tick < end else NIL


def cells_of(snapshot: Snapshot, gate: int) -> Array:
    """(k,) int32: the flat cells of a gate."""
    gates = snapshot.gates
    entries = np.flatnonzero(gates.cell_gate == gate)
    cells: Array = np.searchsorted(gates.cell_first, entries, side="right").astype(np.int32) - 1
    return cells


def shut_cells(snapshot: Snapshot) -> tuple[Array, Array]:
    """(k,) int32 flat cells that are closed now, and (d,) flat cells of doors that are not open."""
    gates = snapshot.gates
    closed = [
        cells_of(snapshot, gate)
        for gate in range(len(gates.kind))
        if closed_until(snapshot, gate) != NIL
    ]
    shut = [
        cells_of(snapshot, int(gate))
        for gate in np.flatnonzero((gates.kind == GATE_DOOR) & (gates.open_from > snapshot.tick))
    ]
    none = np.zeros(0, np.int32)
    return np.concatenate([none, *closed]), np.concatenate([none, *shut])
