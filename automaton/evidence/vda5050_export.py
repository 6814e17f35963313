"""A recorded run as a trace of VDA 5050: a `state` message a line for each robot and period.

    {"headerId":0,"timestamp":"2026-03-02T06:00:00.000Z","version":"3.0.0", ...}

Nodes are cells, x_y as a user counts them; an edge leads from one to the next. x and y are metres to
the right of and above the lower left corner of the floor, theta is counter-clockwise. A robot's order is
a number of `orders`, or of trips. Numbers of a sequence count 2 for each move of an order: nodes have
even ones, edges odd ones.

Source: VDA 5050, versions 2.1.0 and 3.0.0, topic `state`.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, BinaryIO, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.robot_states import (
    BATTERY_PERCENT,
    STATUS_DEPLETED,
    STATUS_NAMES,
    is_charging,
)
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_PICK,
    ACTION_SERVE,
    NIL,
    World,
)
from automaton.errors import InputError
from automaton.evidence.recording.frames import Recording
from automaton.evidence.recording.header import floor_plan_of
from automaton.evidence.state_trace import Sample, StateTrace
from automaton.evidence.vda5050_routes import NodeNames, RouteAhead, RouteState, route_columns
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.quantities import Scale
from automaton.scenario.refinement import refined_data
from automaton.scenario.schema import Scenario

MANUFACTURER: Final = "automaton"
ACTIONS: Final = {ACTION_PICK: "pick", ACTION_DROP: "drop", ACTION_SERVE: "serve"}
# Headings count clockwise from east as seen on the screen, theta counter-clockwise.
THETAS: Final = {
    1: (0.0,),
    2: (0.0, math.pi / 2),
    4: (0.0, -math.pi / 2, math.pi, math.pi / 2),
}
EPOCH: Final = datetime.datetime(1970, 1, 1)


class Version(NamedTuple):
    """What a version of the standard calls the same things."""

    name: str
    position: str
    localized: str  # of the position
    power: str
    charge: str  # of the power
    emergency_stop: str
    always: dict[str, Any]  # keys that it wants besides


VERSIONS: Final = {
    "3.0.0": Version(
        "3.0.0",
        *(
            "mobileRobotPosition",
            "localized",
            "powerSupply",
            "stateOfCharge",
            "activeEmergencyStop",
        ),
        {"instantActionStates": []},
    ),
    "2.1.0": Version(
        "2.1.0",
        *("agvPosition", "positionInitialized", "batteryState", "batteryCharge", "eStop"),
        {},
    ),
}
LATEST: Final = "3.0.0"


class TraceSize(NamedTuple):
    """What a trace holds."""

    robots: int
    messages: int


def write_trace(
    recording: Recording, file: BinaryIO, every: Fraction | None = None, version: str = LATEST
) -> TraceSize:
    """Write a trace, `every` so many seconds; None: the least whole number of ticks from 1 s on.

    Raises InputError where a tick is not a time or a cell has no size, and for a recording that was
    altered.
    """
    scenario = refined_data(recording.header["scenario"])
    scale = scenario.units.scale
    period = _period(every, scale.tick_seconds)
    messages = Messages(recording, scenario, VERSIONS[version])
    encoder = msgspec.json.Encoder()
    lines = 0
    for number, sample in enumerate(StateTrace(recording, period)):
        states = [encoder.encode(message) for message in messages.of(number, sample)]
        file.write(b"\n".join([*states, b""]))
        lines += len(states)
    return TraceSize(len(recording.header["robots"]["cell"]), lines)


def _period(every: Fraction | None, tick: Fraction) -> int:
    """Ticks between two messages of a robot. Raises InputError for a time that is not whole ticks."""
    if every is None:
        return max(1, math.ceil(1 / tick))
    if every % tick:
        lower = every // tick * tick
        near = " or ".join(f"{float(one):g} s" for one in (lower, lower + tick) if one)
        raise InputError(
            f"--every {float(every):g} s is not a whole number of ticks of {float(tick):g} s: take {near}"
        )
    return int(every / tick)


class Messages:
    """The messages of a recording's robots, sample after sample."""

    def __init__(self, recording: Recording, scenario: Scenario, version: Version) -> None:
        self.version = version
        self.floor_plan = floor_plan_of(recording.header["floor"])
        self.time = TickTimes(scenario.units.scale)
        self.position = Positions(self.floor_plan, scenario.units.scale.cell_metres)
        self.has_pods = bool(recording.header.get("pods"))
        self.has_battery = scenario.battery is not None
        self.map = scenario.name
        robots = len(recording.header["robots"]["cell"])
        self.names = NodeNames(self.floor_plan)
        self.routes = [RouteAhead(self.names, self.floor_plan.offsets) for _ in range(robots)]

    def of(self, number: int, sample: Sample) -> Iterator[dict[str, Any]]:
        """Yield the message of each robot, by identity; `number`: samples before this one."""
        world: Any = sample.world
        robots, index = world.robots, sample.stored
        version, timestamp = self.version, self.time.text(sample.tick)
        busy = robots.busy[index] > 0
        columns = zip(
            index.tolist(),
            robots.order[index].tolist(),
            robots.load[index].tolist(),
            robots.status[index].tolist(),
            robots.action[index].tolist(),
            busy.tolist(),
            sample.begun.tolist(),
            sample.moves.tolist(),
            self.position.cells(world, index).tolist(),
            sample.driving.tolist(),
            route_columns(robots, index),
            self.position.of(world, sample),
            self._charges(world, index),
            is_charging(robots)[index].tolist(),
            strict=True,
        )
        for identity, column in enumerate(columns):
            i, order, load, status, action, is_busy, begun, moves, cell, *others = column
            driving, columns_of_route, place, *power = others
            route = self.routes[identity]
            route_state = RouteState(i, cell, moves if order != NIL else None, *columns_of_route)
            last, nodes, edges = route.ahead(robots, route_state)
            on_map = {} if place is None else {version.position: self._place(place)}
            yield {
                "headerId": number,
                "timestamp": timestamp,
                "version": version.name,
                "manufacturer": MANUFACTURER,
                "serialNumber": str(identity),
                "orderId": "" if order == NIL else str(order),
                "orderUpdateId": 0,
                "lastNodeId": "" if cell == NIL else self.names[cell],
                "lastNodeSequenceId": last,
                "nodeStates": nodes,
                "edgeStates": edges,
                **on_map,
                "driving": driving,
                "actionStates": _actions(action, begun) if is_busy and action in ACTIONS else [],
                **version.always,
                "loads": [] if load == NIL else [self._load(world, load)],
                version.power: {version.charge: power[0], "charging": power[1]},
                "operatingMode": "AUTOMATIC",
                "errors": _errors(status) if status >= STATUS_DEPLETED else [],
                "safetyState": {version.emergency_stop: "NONE", "fieldViolation": False},
            }

    def _place(self, place: tuple[float, float, float]) -> dict[str, Any]:
        x, y, theta = place
        return {"x": x, "y": y, "theta": theta, "mapId": self.map, self.version.localized: True}

    def _load(self, world: Any, order: int) -> dict[str, str]:
        if self.has_pods:
            return {"loadId": str(int(world.trips.pod[order]) + 1), "loadType": "pod"}
        return {"loadId": str(order)}

    def _charges(self, world: Any, index: Any) -> list[float]:
        """Percent left in each battery; 100 without batteries."""
        if not self.has_battery:
            return [100.0] * len(index)
        percent: list[float] = np.round(world.robots.charge[index] / BATTERY_PERCENT, 4).tolist()
        return percent


def _actions(action: int, begun: int) -> list[dict[str, str]]:
    name = ACTIONS[action]
    return [{"actionId": f"{name}-{begun}", "actionType": name, "actionStatus": "RUNNING"}]


def _errors(status: int) -> list[dict[str, str]]:
    return [{"errorType": STATUS_NAMES[status], "errorLevel": "FATAL"}]


class TickTimes:
    """When ticks end, in UTC if the clock has an offset."""

    def __init__(self, scale: Scale) -> None:
        clock = scale.clock
        self._tick = scale.tick_seconds
        self._begin = Fraction(0)
        self._day = EPOCH
        if clock is not None:
            self._begin = clock.seconds - (clock.offset or 0)
            if clock.day is not None:
                self._day = datetime.datetime.fromordinal(clock.day)

    def text(self, tick: int) -> str:
        """The end of a tick, such as 2026-03-02T06:00:00.500Z. Raises InputError beyond year 9999."""
        milliseconds = math.floor(1000 * (self._begin + tick * self._tick))
        try:
            moment = self._day + datetime.timedelta(milliseconds=milliseconds)
        except OverflowError:
            raise InputError(f"tick {tick:,} lies outside the years 1 to 9999") from None
        return f"{moment.isoformat(timespec='milliseconds')}Z"


class Positions:
    """Where robots are, in metres."""

    def __init__(self, floor_plan: FloorPlan, cell: Fraction) -> None:
        self._floor_plan = floor_plan
        self._cell = float(cell)

    def cells(self, world: World, index: Any) -> Any:
        """(n,) the cell of each robot, or its parking bay's; NIL: it was towed."""
        robots: Any = world.robots
        cell, bay = robots.cell[index], robots.bay[index]
        parked = (cell == NIL) & (robots.status[index] < STATUS_DEPLETED) & (bay != NIL)
        return np.where(parked, bay, cell)

    def of(self, world: Any, sample: Sample) -> list[tuple[float, float, float] | None]:
        """x, y, theta of each robot; None: it is nowhere on the floor."""
        robots, index = world.robots, sample.stored
        cell, claim = self.cells(world, index), robots.claim[index]
        x, y = self._centres(cell)
        to_x, to_y = self._centres(np.where(claim == NIL, cell, claim))
        share = sample.moved
        places = np.stack((x + share * (to_x - x), y + share * (to_y - y)), axis=1)
        rounded = np.round(places * self._cell, 6).tolist()
        known = world.grid.type_headings[robots.type[index]].tolist()
        faces = zip(known, robots.heading[index].tolist(), strict=True)
        thetas = [THETAS[headings][heading] for headings, heading in faces]
        return [
            None if one == NIL else (*place, theta)
            for one, place, theta in zip(cell.tolist(), rounded, thetas, strict=True)
        ]

    def _centres(self, cell: Any) -> tuple[Any, Any]:
        """Centres of cells, in cells from the lower left corner."""
        row, column = np.divmod(cell, self._floor_plan.stride)
        return column - 0.5, self._floor_plan.height - row + 0.5
