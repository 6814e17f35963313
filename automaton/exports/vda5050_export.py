"""A recorded run as a trace of VDA 5050: a line with a `state` message for each robot and period, or for
each change of its state.

    {"headerId":0,"timestamp":"2026-03-02T06:00:00.000Z","version":"3.0.0", ...}

Nodes are cells, x_y as a user counts them; an edge leads from one to the next. x and y are metres in
the coordinates of the site (units.origin, units.rotation), by default to the right of and above the
lower left corner of the floor; theta is counter-clockwise. A robot's order is a number of `orders`, or
of trips. Sequence numbers grow by 2 with each move of an order: nodes have even numbers, edges odd ones.

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

from automaton.engine.observation import EVENT_ORDER_TAKEN
from automaton.engine.record_codes import (
    ACTION_MASK,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_SERVE,
    MOVE_EAST,
    MOVE_NORTH,
)
from automaton.engine.robot_states import is_charging
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_PICK,
    ACTION_SERVE,
    BATTERY_PERCENT,
    NIL,
    STATUS_DEPLETED,
    Array,
    World,
)
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.history.playback import Playback
from automaton.recording.contents import Content
from automaton.recording.frames import Recording, floor_plan_of
from automaton.runs.simulation import Simulation
from automaton.scenario.quantities import Scale
from automaton.scenario.refinement import refined_data
from automaton.scenario.schema import Scenario, Units
from automaton.vocabulary import CONDITION_WORDS

MANUFACTURER: Final = "automaton"
ACTION_TYPES: Final = {ACTION_PICK: "pick", ACTION_DROP: "drop", ACTION_SERVE: "serve"}
# Headings count clockwise from east as seen on the screen, theta counter-clockwise.
THETAS: Final = {
    1: (0.0,),
    2: (0.0, math.pi / 2),
    4: (0.0, -math.pi / 2, math.pi, math.pi / 2),
}
LONGEST_PAUSE: Final = Fraction(30)  # seconds between two messages of a robot
EPOCH: Final = datetime.datetime(1970, 1, 1)


class Version(NamedTuple):
    """The names that a version of the standard uses."""

    name: str
    position: str
    localized: str  # key of the position
    power: str
    charge: str  # key of the power supply
    emergency_stop: str
    always: dict[str, Any]  # further required keys


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
    """The contents of a trace."""

    robots: int
    messages: int


def write_trace(
    recording: Recording,
    file: BinaryIO,
    every: Fraction | None = None,
    version: str = LATEST,
    on_events: bool = False,
) -> TraceSize:
    """Write a trace with a period of `every` seconds; None: at least 1 s in whole ticks.

    `on_events`: a robot also sends a message when its state changes, and the period, of 30 s if None, is
    the longest pause between two. Raises InputError if a tick is not a time, a cell has no size, or the
    recording was altered.
    """
    scenario = refined_data(recording.header["scenario"])
    tick = scenario.units.scale.tick_seconds
    period = _period(every, tick, LONGEST_PAUSE if on_events else Fraction(1))
    messages = Messages(recording, scenario, VERSIONS[version])
    robots = len(recording.header["robots"]["cell"])
    encoder = msgspec.json.Encoder()
    changes = StateChanges(robots, period)
    for sample in StateTrace(recording, 1 if on_events else period):
        sends = changes.sends(sample, messages.position) if on_events else changes.all_robots
        states = [encoder.encode(message) for message in messages.of(changes.sent, sample, sends)]
        file.write(b"\n".join([*states, b""]) if states else b"")
        changes.sent += sends
    return TraceSize(robots, int(changes.sent.sum()))


class StateChanges:
    """Which robots send a message, as the standard demands: those whose state has changed, and those
    that have been silent for a period."""

    def __init__(self, robots: int, period: int) -> None:
        self.sent = np.zeros(robots, np.int64)  # number of messages of each robot so far
        self.all_robots = np.ones(robots, np.bool_)
        self._last = np.full(robots, -period, np.int64)  # tick of the last message
        self._period = period
        self._before: Array = np.zeros((0, robots), np.int64)

    def sends(self, sample: Sample, position: Positions) -> Array:
        """(n,) bool: which robots send a message after this tick."""
        robots, index = sample.world.robots, sample.stored
        acts = np.isin(sample.acting, list(ACTION_TYPES))
        state = np.array(
            (
                *(position.cells(sample.world, index), robots.order[index], robots.load[index]),
                *(
                    sample.moves - (robots.claim[index] != NIL),
                    sample.driving,
                    robots.status[index],
                ),
                *(np.where(acts, sample.acting, 0), np.where(acts, sample.begun, 0)),
                *(is_charging(robots)[index], robots.route_hash[index]),
            ),
            np.int64,
        )
        silent = sample.tick - self._last >= self._period
        changes = silent if not len(self._before) else silent | (state != self._before).any(axis=0)
        self._before, self._last = state, np.where(changes, sample.tick, self._last)
        return changes


def _period(every: Fraction | None, tick: Fraction, usual: Fraction) -> int:
    """Ticks between two messages of a robot; `usual` seconds if `every` is None, at least a tick.

    Raises InputError if `every` is not a whole number of ticks.
    """
    if every is None:
        ticks = usual / tick
        return max(1, math.floor(ticks) if usual == LONGEST_PAUSE else math.ceil(ticks))
    if every % tick:
        lower = every // tick * tick
        near = " or ".join(f"{float(one):g} s" for one in (lower, lower + tick) if one)
        raise InputError(
            f"--every {float(every):g} s is not a whole number of ticks of {float(tick):g} s: use "
            f"{near}"
        )
    return int(every / tick)


class Messages:
    """The messages of the robots of a recording, sample by sample."""

    def __init__(self, recording: Recording, scenario: Scenario, version: Version) -> None:
        self.version = version
        self.floor_plan = floor_plan_of(recording.header["floor"])
        self.time = TickTimes(scenario.units.scale)
        self.position = Positions(self.floor_plan, scenario.units)
        self.has_pods = bool(recording.header.get("pods"))
        self.has_battery = scenario.battery is not None
        self.map = scenario.name
        robots = len(recording.header["robots"]["cell"])
        self.names = NodeNames(self.floor_plan)
        self.routes = [RouteAhead(self.names, self.floor_plan.offsets) for _ in range(robots)]

    def of(self, numbers: Array, sample: Sample, sends: Array) -> Iterator[dict[str, Any]]:
        """Yield the messages of the robots that send one, by identity.

        `numbers`: (n,) earlier messages of each robot; `sends`: (n,) bool.
        """
        world: Any = sample.world
        robots, index = world.robots, sample.stored
        version, timestamp = self.version, self.time.text(sample.tick)
        columns = zip(
            index.tolist(),
            robots.order[index].tolist(),
            robots.load[index].tolist(),
            robots.status[index].tolist(),
            sample.acting.tolist(),
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
            if not sends[identity]:
                continue
            i, order, load, status, action, begun, moves, cell, *others = column
            driving, columns_of_route, place, *power = others
            route = self.routes[identity]
            route_state = RouteState(i, cell, moves if order != NIL else None, *columns_of_route)
            last, nodes, edges = route.ahead(robots, route_state)
            on_map = {} if place is None else {version.position: self._place(place)}
            yield {
                "headerId": int(numbers[identity]),
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
                "actionStates": _actions(action, begun) if action in ACTION_TYPES else [],
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
    name = ACTION_TYPES[action]
    return [{"actionId": f"{name}-{begun}", "actionType": name, "actionStatus": "RUNNING"}]


def _errors(status: int) -> list[dict[str, str]]:
    return [{"errorType": CONDITION_WORDS[status], "errorLevel": "FATAL"}]


class TickTimes:
    """The ends of ticks, in UTC if the clock has an offset."""

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
    """The positions of robots, in metres and in the coordinates of the site."""

    def __init__(self, floor_plan: FloorPlan, units: Units) -> None:
        self._floor_plan = floor_plan
        self._cell = float(units.scale.cell_metres)
        self._origin = np.array(units.origin)
        self._turned = math.radians(units.rotation)
        sine, cosine = math.sin(self._turned), math.cos(self._turned)
        self._turn = np.array([[cosine, sine], [-sine, cosine]])  # of rows (x, y)

    def cells(self, world: World, index: Any) -> Any:
        """(n,) the cell of each robot or of its parking bay; NIL: towed."""
        robots: Any = world.robots
        cell, bay = robots.cell[index], robots.bay[index]
        parked = (cell == NIL) & (robots.status[index] < STATUS_DEPLETED) & (bay != NIL)
        return np.where(parked, bay, cell)

    def of(self, world: Any, sample: Sample) -> list[tuple[float, float, float] | None]:
        """x, y, theta of each robot; None: not on the floor."""
        robots, index = world.robots, sample.stored
        cell, claim = self.cells(world, index), robots.claim[index]
        x, y = self._centres(cell)
        to_x, to_y = self._centres(np.where(claim == NIL, cell, claim))
        share = sample.moved
        places = np.stack((x + share * (to_x - x), y + share * (to_y - y)), axis=1)
        places = places * self._cell
        if self._turned:
            places = places @ self._turn
        rounded = np.round(places + self._origin, 6).tolist()
        known = world.grid.type_headings[robots.type[index]].tolist()
        faces = zip(known, robots.heading[index].tolist(), strict=True)
        thetas = [self._theta(THETAS[headings][heading]) for headings, heading in faces]
        return [
            None if one == NIL else (*place, theta)
            for one, place, theta in zip(cell.tolist(), rounded, thetas, strict=True)
        ]

    def _theta(self, theta: float) -> float:
        return math.remainder(theta + self._turned, math.tau) if self._turned else theta

    def _centres(self, cell: Any) -> tuple[Any, Any]:
        """Centres of cells, in cells from the lower left corner."""
        row, column = np.divmod(cell, self._floor_plan.stride)
        return column - 0.5, self._floor_plan.height - row + 0.5


# The reports of robots while the run is replayed. Each sample has the state after a tick, by identity,
# and values that a state does not hold: the moves that a robot has begun for its order, and the ticks
# in which its move and its operation began.


EXECUTED_OPERATIONS: Final = (EXECUTED_PICK, EXECUTED_DROP, EXECUTED_SERVE)


class Sample(NamedTuple):
    """The state after a tick; arrays are by identity."""

    tick: int
    world: World
    stored: Array  # (n,) index of each robot
    moves: Array  # (n,) moves begun for the current order, current move included
    moved: Array  # (n,) completed share of the current move; 0 without one
    driving: Array  # (n,) bool: in a move, or at its end in this tick
    acting: Array  # (n,) operation under way, or at its end in this tick; NIL: none
    begun: Array  # (n,) tick in which the last pick, drop or stop began


class StateTrace:
    """A recording that is replayed, with a sample every `period` ticks."""

    def __init__(self, recording: Recording, period: int) -> None:
        self.recording = recording
        self.period = period
        robots = len(recording.header["robots"]["cell"])
        self._frame = 0  # first tick of the counted frame
        # Moves begun up to each tick of the frame, and before it.
        self._moves = np.zeros((1, robots), np.int64)
        self._begun = np.zeros((1, robots), np.int64)  # likewise the last begin of an operation
        self._set_out = np.zeros((1, robots), np.int64)  # likewise the last begin of a move
        self._before_order = np.zeros(robots, np.int64)  # moves begun when the order was taken
        self._playback = Playback(recording.header, recording.stored(), on_observe=self._observe)

    def __iter__(self) -> Iterator[Sample]:
        """Yield a sample at tick 0 and after each period. Raises InputError for an altered file."""
        for tick in range(0, self.recording.ticks + 1, self.period):
            self._playback.go_to(max(tick - 1, 0))
            before = self._in_move(), self._operation()
            self._playback.go_to(tick)
            yield self._sample(tick, *before)

    def _observe(self, simulation: Simulation) -> None:
        """Note the orders that were taken; each call is within one frame."""
        content = self._playback.frames.ticks_with(simulation.tick)
        if content is not None and content["first"] != self._frame:
            self._count(content)
        observation = simulation.observation
        events = observation.events[: observation.count.events]
        for tick, _, robot, *_ in events[events[:, 1] == EVENT_ORDER_TAKEN].tolist():
            self._before_order[robot] = self._moves[tick - self._frame, robot]
        simulation.empty_observation()

    def _count(self, content: Content) -> None:
        """Count moves and note their begins in the ticks of a frame; row 0 is the tick before it."""
        executed = content["executed"] & ACTION_MASK
        ticks = content["first"] + np.arange(len(executed))[:, None]
        is_move = (executed >= MOVE_EAST) & (executed <= MOVE_NORTH)
        self._frame = content["first"]
        self._moves = np.cumsum(np.concatenate((self._moves[-1:], is_move)), axis=0)
        self._set_out = _latest(self._set_out, is_move, ticks)
        self._begun = _latest(self._begun, np.isin(executed, EXECUTED_OPERATIONS), ticks)

    def _in_move(self) -> Array:
        """(n,) bool: whether robots are in a move after the current tick."""
        robots = self._playback.simulation.world.robots
        in_move: Array = robots.claim[robots.at_index] != NIL
        return in_move

    def _operation(self) -> Array:
        """(n,) the operation of each robot that goes on after the current tick, or NIL."""
        robots = self._playback.simulation.world.robots
        index = robots.at_index
        action = robots.action[index].astype(np.int64)
        operation: Array = np.where(robots.busy[index] > 0, action, NIL)
        return operation

    def _sample(self, tick: int, moved: Array, acted: Array) -> Sample:
        """The sample of a tick; (n,) a tick earlier, `moved`: in a move, `acted`: in an operation."""
        world: Any = self._playback.simulation.world
        index = world.robots.at_index
        row = tick - self._frame + 1 if tick else 0
        robots, set_out = world.robots, self._set_out[row]
        busy, driven = robots.busy[index].astype(np.int64), tick - set_out + 1
        in_move = self._in_move()
        begins = (set_out > 0) & (set_out == tick)
        return Sample(
            tick=tick,
            world=world,
            stored=index,
            moves=self._moves[row] - self._before_order,
            moved=np.where(in_move, driven / (driven + busy), 0.0),
            driving=in_move | moved | begins,
            acting=np.select(
                [acted != NIL, (busy > 0) | ((tick > 0) & (self._begun[row] == tick))],
                [acted, robots.action[index].astype(np.int64)],
                NIL,
            ),
            begun=self._begun[row],
        )


def _latest(before: Array, happens: Array, ticks: Array) -> Array:
    """(T + 1, n) the last tick of an event up to each tick; row 0 is the last row of `before`."""
    rows = np.concatenate((before[-1:], np.where(happens, ticks, 0)))
    latest: Array = np.maximum.accumulate(rows, axis=0)
    return latest


# The nodes and edges ahead of a robot, as JSON. Most of a route is the same from message to message: a
# node keeps its number as the robot approaches. So the text of a route is made once, and messages take
# its rest.


EMPTY: Final = msgspec.Raw(b"[]")


class RouteState(NamedTuple):
    """The state that determines a robot's route ahead."""

    i: int  # index of the robot
    cell: int  # its cell, or the cell that it leaves
    moves: int | None  # moves begun for its order; None without one
    claim: int  # the cell that it enters, or NIL
    driven: int  # driven steps of the route
    length: int  # steps of the route
    route_hash: int


def route_columns(robots: Any, index: Any) -> Iterator[tuple[int, ...]]:
    """Return the last four entries of RouteState of each robot, stored at `index`."""
    arrays = (robots.claim, robots.route_index, robots.route_length, robots.route_hash)
    return zip(*(array[index].tolist() for array in arrays), strict=True)


class NodeNames(dict[int, str]):
    """The node of each cell, x_y; created on access."""

    def __init__(self, floor_plan: FloorPlan) -> None:
        self._floor_plan = floor_plan

    def __missing__(self, cell: int) -> str:
        x, y = self._floor_plan.xy(cell)
        name = self[cell] = f"{x}_{y}"
        return name


class RouteAhead:
    """One robot's route ahead."""

    def __init__(self, names: NodeNames, offsets: tuple[int, int, int, int]) -> None:
        self._names = names
        self._offsets = offsets  # from a cell to its neighbours
        self._key: tuple[int, ...] = ()
        self._cells: list[int] = []  # before each step of the route
        self._nodes: list[bytes] = []  # behind each step
        self._edges: list[bytes] = []
        self._shown: RouteState | None = None  # state of the last two texts,
        self._texts = EMPTY, EMPTY  # nodes and edges

    def ahead(self, robots: Any, state: RouteState) -> tuple[int, msgspec.Raw, msgspec.Raw]:
        """The number of the last node, and the nodes and edges ahead; `robots`: holds the routes."""
        is_between = state.claim != NIL
        begun = int(is_between) if state.moves is None else state.moves
        last = 2 * (begun - is_between)
        if not is_between and state.driven >= state.length:
            return last, EMPTY, EMPTY
        if state != self._shown:
            self._shown = state
            self._renew(robots, state, begun - state.driven)
            nodes = self._nodes[state.driven : state.length]
            edges = self._edges[state.driven : state.length]
            if is_between:
                nodes.insert(0, self._node(state.claim, 2 * begun))
                edges.insert(0, self._edge(state.cell, state.claim, 2 * begun - 1))
            self._texts = _listed(nodes), _listed(edges)
        return last, *self._texts

    def _renew(self, robots: Any, state: RouteState, offset: int) -> None:
        """Make the texts of a route again if it changed; `offset`: moves before its first step."""
        i, index, length = state.i, state.driven, state.length
        key = (state.route_hash, length, offset)
        start = int(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
        start = start if state.claim == NIL else state.claim
        if key == self._key and self._cells[index : index + 1] == [start]:
            return
        self._key = key
        self._cells = [NIL] * index + [start]
        self._nodes, self._edges = [b""] * index, [b""] * index  # those behind the robot
        for step, direction in enumerate(robots.route[i, index:length].tolist(), index + 1):
            to = start + self._offsets[direction]
            self._cells.append(to)
            self._nodes.append(self._node(to, 2 * (offset + step)))
            self._edges.append(self._edge(start, to, 2 * (offset + step) - 1))
            start = to

    def _node(self, cell: int, number: int) -> bytes:
        return b'{"nodeId":"%b","sequenceId":%d,"released":true}' % (
            self._names[cell].encode(),
            number,
        )

    def _edge(self, one: int, other: int, number: int) -> bytes:
        return b'{"edgeId":"%b-%b","sequenceId":%d,"released":true}' % (
            self._names[one].encode(),
            self._names[other].encode(),
            number,
        )


def _listed(entries: list[bytes]) -> msgspec.Raw:
    return msgspec.Raw(b"[%b]" % b",".join(entries))
