"""What a viewer sees of a run after a tick: copies, by identity, that do not change any more."""

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
from automaton.engine.observation import Observation
from automaton.engine.state import GATE_CLOSING, GATE_DOOR, NIL, Array, Orders, Robots

if TYPE_CHECKING:  # it needs Numba
    from automaton.runs.simulation import Simulation

AnyStruct = TypeVar("AnyStruct", bound=Struct)


def by_robot(struct: type[Struct]) -> list[str]:
    """The arrays of a struct that go with its state, by robot; rows of different lengths aside."""
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

    `route_length`: (n,) int32, steps left.
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
    stations: Stations  # that work on parts
    pods: Pods
    lines: Lines
    trips: Trips
    stops: Stops
    pod_stations: PodStations  # to which pods are carried
    gates: Gates
    station_names: tuple[str, ...]  # of these
    pod_names: tuple[str, ...]
    stride: int  # from a cell to the one below it
    service_zones: ServiceZones  # that robots serve; its roads are those of the world
    redesigns: int  # ticks so far in which stations changed their zones
    selected: int  # the robot whose route and plan are given, or NIL
    route: Array  # (k,) int32: cells that the selected robot has still to drive through
    order_queue: Array  # (k,) int32: orders that the selected robot is to do, one after another
    repairs_in_place: bool  # broken robots are not towed
    delayed_until: Array  # (n,) int64: the last tick of a robot's delay; (0,): there are no delays
    curve: Array  # (K, pieces, 2) int32: from this charge on, units that a tick at a charger gives
    lost_in_zone: Array  # (Z,) int64: ticks that moves took longer because of each slow zone
    layer: str  # of the map, that was asked for; whoever shows it brings its numbers
    heat: Array | None = None  # (C,) int32, or None
    flow: Array | None = None  # (C, 4) int32


def take_snapshot(simulation: Simulation, selected: int = NIL, layer: str = "") -> Snapshot:
    """Copy what a viewer needs from an observed simulation."""
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
        delayed_until=world.delays.until.copy(),
        curve=world.rules.curve,  # it is never written to
        lost_in_zone=observation.lost_in_zone.copy(),
        layer=layer,
    )


def _copied(struct: AnyStruct) -> AnyStruct:
    """The same struct over copies of what may change."""
    changing = [
        name for name, one in struct._declared.items() if one.role in CARRIED and one.is_array
    ]
    return struct.replaced(**{name: struct.array(name).copy() for name in changing})


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


# Gates at that tick.


def closed_until(snapshot: Snapshot, gate: int) -> int:
    """The tick from which a closing is over that lasts; NIL if it is open."""
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
    """(k,) int32 flat cells that are closed now, and (d,) of doors that are not open."""
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
