"""What a recording adds up to: positions, pods and charges, counted again from the recording alone.

An opinion of its own: it shares no code with the kernels nor with the validator, starts from the state
at tick 0 and follows what robots executed. Each step leads over an exit of the floor, no cell holds too
many robots, no two swap; a pod is in one slot or on one robot; charges fall by what begins and rise at
chargers. It compares itself with each recorded state.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from automaton.engine import record_codes as codes
from automaton.floor.floor_plan import CHARGER, STORAGE
from automaton.recording.contents import FRAME_KIND_KEYFRAME, FRAME_KIND_TICKS
from automaton.recording.frames import Recording

NIL: Final = -1
FULL: Final = 10**9  # units of charge
UP, DEPLETED, FAILED, TOWED, REMOVED = 0, 3, 4, 5, 6  # recorded statuses
MOVES: Final = range(codes.MOVE_EAST, codes.MOVE_NORTH + 1)
TURNS: Final = {codes.TURN_LEFT: -1, codes.TURN_RIGHT: 1}
NAMES: Final = {
    codes.EXECUTED_PICK: "pick",
    codes.EXECUTED_DROP: "drop",
    codes.EXECUTED_TRY_DROP: "try_drop",
    **dict.fromkeys(MOVES, "move"),
    **dict.fromkeys(TURNS, "turn"),
}
STANDING: Final = (
    codes.EXECUTED_WAIT,
    codes.EXECUTED_SERVE,
    codes.EXECUTED_BLOCKED,
    codes.EXECUTED_RETREAT,
    codes.EXECUTED_ILLEGAL,
)
SOUTH_NORTH_EAST_WEST: Final = (1, 3, 0, 2)
HEADINGS: Final = {"omni": 1, "rail": 2, "differential": 4}
MAX_FLAWS: Final = 20

Row = list[int]  # tick, code, subject, value
Plain = dict[str, Any]


class TooManyFlawsError(Exception):
    """Counting on would only repeat what is wrong."""


@dataclass
class Robot:
    """A robot as its actions leave it."""

    cell: int
    heading: int
    home: int
    bay: int
    least: int  # charge; a move behind another robot leaves a range
    most: int
    kind: Kind
    travel: int = 0  # direction in which it came into its cell
    to: int = NIL  # the cell that it is on its way to
    way: int = 0  # in this direction
    end: int = 0  # last tick of what it does
    code: int = 0  # of that
    delayed: int = 0  # last tick of its delay
    is_loaded: bool = False
    status: int = UP


@dataclass
class Kind:
    """What the type of a robot says, in the ticks of the run."""

    headings: int
    ticks: dict[str, tuple[int, int]]  # by operation: without a load, and with one
    drain: dict[str, tuple[int, int]] = field(default_factory=dict)  # units a tick, likewise
    curve: list[tuple[int, int]] = field(default_factory=list)  # (from, units a tick)
    reserve: int = 0


def flaws_of(recording: Recording) -> list[str]:
    """Count a recording again; return what is wrong with it."""
    count = CountedRecording(recording.header)
    try:
        for frame in recording.frames:
            if frame.kind == FRAME_KIND_TICKS:
                count.ticks(frame.content)
            elif frame.kind == FRAME_KIND_KEYFRAME:
                count.compare(frame.content)
    except TooManyFlawsError:
        pass
    return count.flaws


class CountedRecording:
    """One count: give it the frames of ticks and states in their order."""

    def __init__(self, header: Plain) -> None:
        scenario, floor, robots = header["scenario"], header["floor"], header["robots"]
        self.flaws: list[str] = []
        self.tick = 0
        self.fine = scenario.get("refine", 1)
        self.stride = self.fine if scenario.get("decide", "coarse") == "coarse" else 1
        self.following = scenario["world"]["following"]
        self.leaves = scenario["fleet"].get("when_idle") == "leave"
        self.faults = scenario["faults"]
        self.has_battery = scenario.get("battery") is not None
        stride = floor["width"] + 2
        self.step = (1, stride, -1, -stride)
        self.exits: list[int] = floor["exits"].ravel().tolist()
        self.capacity: list[int] = floor["capacity"].ravel().tolist()
        self.kind: list[int] = floor["kind"].ravel().tolist()
        names = ("cell", "heading", "home", "bay", "charge")
        columns = zip(*(robots[name].tolist() for name in names), strict=True)
        self.robots = [
            Robot(cell, heading, home, bay, charge, charge, kind, travel=heading)
            for (cell, heading, home, bay, charge), kind in zip(
                columns, kinds_of(scenario, self.fine), strict=True
            )
        ]
        self.loads = CountedLoads(header, self)

    def wrong(self, text: str) -> None:
        """Note what is wrong in this tick."""
        self.flaws.append(f"tick {self.tick}: {text}")
        if len(self.flaws) >= MAX_FLAWS:
            raise TooManyFlawsError

    # A tick

    def ticks(self, content: Plain) -> None:
        """Follow the ticks of a frame."""
        rows: dict[int, list[Row]] = defaultdict(list)
        for row in content["changes"].tolist():
            rows[row[0]].append(row)
        for tick, executed in enumerate(content["executed"].tolist(), content["first"]):
            if tick != self.tick + 1:
                self.wrong(f"tick {tick} follows")
            self.tick = tick
            self._follow(executed, rows.get(tick, []))

    def _follow(self, executed: list[int], rows: list[Row]) -> None:
        self._change_status(rows)
        self._delay(rows)
        for r, value in enumerate(executed):
            if value & codes.LEFT_PARKING_BAY:
                self._come_out(r)
        lengths = {row[2]: row[3] for row in rows if row[1] == codes.CHANGE_DURATION}
        if self.has_battery:
            self._pay(executed, lengths)
        held = self._held() if self.following == "none" else set()
        for r, value in enumerate(executed):
            if value & codes.ACTION_MASK:
                self._begin(r, value & codes.ACTION_MASK, lengths.get(r), held)
        self._check_swaps()
        for robot in self.robots:
            if robot.to != NIL and robot.end <= self.tick:
                robot.cell, robot.travel, robot.to = robot.to, robot.way, NIL
        self.loads.handle(rows)
        for r, value in enumerate(executed):
            if value & codes.ENTERED_PARKING_BAY:
                self._park(r)
        self._check_room()

    def _change_status(self, rows: list[Row]) -> None:
        """Robots go down, leave their loads, are towed, or come back."""
        for _, code, r, value in rows:
            if code == codes.CHANGE_LOAD_LEFT:
                self.loads.leave(r, value)
            if code != codes.CHANGE_STATUS:
                continue
            robot = self.robots[r]
            if value in (DEPLETED, FAILED) and robot.to != NIL:
                self.wrong(f"robot {r} goes down between two cells")
            if value in (TOWED, REMOVED):
                self._tow(robot, value)
            robot.status = value

    def _tow(self, robot: Robot, status: int) -> None:
        if robot.cell != NIL:
            robot.home = robot.cell if self.leaves else robot.home
            robot.heading = robot.travel = self._heading_out_of(robot)
        robot.cell = NIL
        if status == TOWED and self.has_battery:
            again = self.faults["charge"]
            if again != "kept":
                robot.least = robot.most = units(again)
            elif robot.status == DEPLETED:
                robot.least = max(robot.least, robot.kind.reserve)
                robot.most = max(robot.most, robot.kind.reserve)

    def _delay(self, rows: list[Row]) -> None:
        """Robots stand for a while: what they do takes longer, for those behind them, too."""
        rules = self.faults.get("delays")
        begun = [row for row in rows if row[1] == codes.CHANGE_DELAYED]
        for _, _, r, ticks in begun:
            robot = self.robots[r]
            robot.delayed = self.tick + ticks - 1
            name = NAMES.get(robot.code)
            if robot.end >= self.tick and name in rules["of"]:
                robot.end += ticks
        while begun and self._hand_on():
            pass
        for robot in self.robots if rules else ():
            if robot.cell == NIL or robot.status >= DEPLETED:
                robot.delayed = 0
            elif robot.delayed >= self.tick > robot.end:
                self._stand(robot, robot.delayed - self.tick + 1)
                robot.end, robot.code = robot.delayed, codes.EXECUTED_NOTHING

    def _hand_on(self) -> bool:
        """No move ends before that of the robot ahead; return whether one was lengthened."""
        longer = False
        under_way = [robot for robot in self.robots if robot.to != NIL]
        leaving = {self._place(robot.cell, robot.travel): robot for robot in under_way}
        leaving.pop(None, None)
        for robot in under_way:
            ahead = leaving.get(self._place(robot.to, robot.way))
            if ahead is not None and ahead.end > robot.end:
                self._stand(robot, ahead.end - robot.end)
                robot.end, longer = ahead.end, True
        return longer

    def _come_out(self, r: int) -> None:
        """A robot that is off the floor comes to its home cell."""
        robot = self.robots[r]
        if robot.cell != NIL:
            self.wrong(f"robot {r} comes out of its parking bay and is on the floor")
        robot.cell = robot.home
        robot.heading = robot.travel = self._heading_out_of(robot)

    def _heading_out_of(self, robot: Robot) -> int:
        ways = [d for d in SOUTH_NORTH_EAST_WEST if self.exits[robot.home] >> d & 1]
        return ways[0] & (robot.kind.headings - 1) if ways else 0

    def _park(self, r: int) -> None:
        robot = self.robots[r]
        if self.leaves:
            robot.home = robot.cell
        if robot.cell != robot.home or robot.to != NIL:
            self.wrong(f"robot {r} parks, and is not at home")
        if robot.bay != NIL or self.leaves:
            robot.heading = self._heading_out_of(robot)
            robot.cell = NIL

    def _begin(self, r: int, code: int, length: int | None, held: set[tuple[int, int]]) -> None:
        robot = self.robots[r]
        bay_blocked = code == codes.EXECUTED_BAY_BLOCKED
        if robot.cell == NIL and not bay_blocked and code != codes.EXECUTED_ILLEGAL:
            self.wrong(f"robot {r} acts, and is off the floor")
        if robot.end >= self.tick or robot.to != NIL:
            self.wrong(f"robot {r} begins something, and is busy until tick {robot.end}")
        if robot.status >= DEPLETED:
            self.wrong(f"robot {r} begins something, and is down")
        name = NAMES.get(code)
        usual = max(1, robot.kind.ticks[name][robot.is_loaded]) if name else 1
        robot.end, robot.code = self.tick + (length or usual) - 1, code
        if code in TURNS:
            robot.heading = (robot.heading + TURNS[code]) % robot.kind.headings
        elif code in MOVES:
            self._begin_move(r, code - codes.MOVE_EAST, held)

    def _begin_move(self, r: int, way: int, held: set[tuple[int, int]]) -> None:
        robot = self.robots[r]
        if not self.exits[robot.cell] >> way & 1:
            self.wrong(f"robot {r} leaves cell {robot.cell} where it has no exit")
            return
        if way % robot.kind.headings != robot.heading:
            self.wrong(f"robot {r} drives across its heading")
        robot.to, robot.way = robot.cell + self.step[way], way
        if self._place(robot.to, way) in held:
            self.wrong(f"robot {r} enters cell {robot.to}, which was held when the tick began")

    # Room

    def _place(self, cell: int, way: int) -> tuple[int, int] | None:
        """A cell for one robot, or a lane of a cell for two; None: there is room for all."""
        room = self.capacity[cell]
        return (cell, way >> 1 if room == 2 else 0) if room else None

    def _held(self) -> set[tuple[int, int]]:
        """The places that robots are in, or on their way to."""
        ends = [(robot.cell, robot.travel) for robot in self.robots if robot.cell != NIL]
        ends += [(robot.to, robot.way) for robot in self.robots if robot.to != NIL]
        return {place for end in ends if (place := self._place(*end)) is not None}

    def _check_swaps(self) -> None:
        drives = defaultdict(list)
        for r, robot in enumerate(self.robots):
            if robot.to != NIL:
                drives[robot.cell, robot.to].append(r)
        for (begin, end), drivers in drives.items():
            narrow = 1 in (self.capacity[begin], self.capacity[end])
            if begin < end and narrow and (end, begin) in drives:
                others = drives[end, begin]
                self.wrong(f"robots {drivers} and {others} swap between cells {begin} and {end}")

    def _check_room(self) -> None:
        """No place holds two robots; under convoy not two that stay or come, nor two that leave."""
        inside: dict[Any, list[int]] = defaultdict(list)
        leaving: dict[Any, list[int]] = defaultdict(list)
        for r, robot in enumerate(self.robots):
            if robot.cell == NIL:
                continue
            moves = robot.to != NIL
            here = leaving if moves and self.following == "convoy" else inside
            here[self._place(robot.cell, robot.travel)].append(r)
            if moves:
                inside[self._place(robot.to, robot.way)].append(r)
            elif robot.code in TURNS and robot.end > self.tick and self.capacity[robot.cell] == 2:
                inside[self._place(robot.cell, robot.travel ^ 2)].append(r)
        for places in (inside, leaving):
            places.pop(None, None)
            for place, robots in places.items():
                if len(robots) > 1:
                    self.wrong(f"robots {robots} are in {place}, with room for one")

    # Charges

    def _pay(self, executed: list[int], lengths: dict[int, int]) -> None:
        leaving = {
            self._place(robot.cell, robot.travel)
            for robot, value in zip(self.robots, executed, strict=True)
            if robot.to != NIL or value & codes.ACTION_MASK in MOVES
        }
        for r, (robot, value) in enumerate(zip(self.robots, executed, strict=True)):
            code, loaded = value & codes.ACTION_MASK, robot.is_loaded
            if code in NAMES:
                self._pay_operation(r, code, lengths.get(r), leaving)
            elif code in STANDING:
                self._stand(robot, lengths.get(r, self.stride))
            elif code == codes.EXECUTED_CHARGE:
                self._charge(r)
            elif self._is_idle(robot, value):
                self._stand(robot, self.stride)
            if not 0 <= robot.least <= robot.most <= FULL:
                self.wrong(f"robot {r} has {robot.least} to {robot.most} units, loaded: {loaded}")

    def _is_idle(self, robot: Robot, value: int) -> bool:
        """Whether a robot stands on the floor and does nothing, for which it pays as well."""
        acts = value & (codes.ACTION_MASK | codes.ENTERED_PARKING_BAY)
        decides = (self.tick - 1) % self.stride == 0
        is_free = robot.cell != NIL and robot.to == NIL and robot.end < self.tick
        return decides and not acts and is_free and robot.status == UP

    def _pay_operation(self, r: int, code: int, length: int | None, leaving: set[Any]) -> None:
        """Pay for what begins; `leaving`: the places that robots are on their way out of."""
        robot, name = self.robots[r], NAMES[code]
        usual = max(1, robot.kind.ticks[name][robot.is_loaded])
        ticks = least_own = length or usual
        rate, wait = (robot.kind.drain[key][robot.is_loaded] for key in (name, "wait"))
        if self.following == "convoy" and code in MOVES:
            # Behind another robot a move may take longer: then it waits for the rest.
            way = code - codes.MOVE_EAST
            ahead = self._place(robot.cell + self.step[way], way) if robot.cell != NIL else None
            least_own = min(usual, ticks) if ahead in leaving and ahead is not None else ticks
        if least_own * rate > robot.most:
            self.wrong(f"robot {r} begins a {name} for {ticks * rate} units, and has {robot.most}")
        prices = [own * rate + (ticks - own) * wait for own in (least_own, ticks)]
        robot.least = max(0, robot.least - max(prices))
        robot.most = max(0, robot.most - min(prices))

    def _stand(self, robot: Robot, ticks: int) -> None:
        if self.has_battery:
            price = ticks * robot.kind.drain["wait"][robot.is_loaded]
            robot.least, robot.most = max(0, robot.least - price), max(0, robot.most - price)

    def _charge(self, r: int) -> None:
        robot = self.robots[r]
        if robot.cell == NIL or self.kind[robot.cell] != CHARGER:
            self.wrong(f"robot {r} charges, and is not at a charger")
        steps = [rate for since, rate in robot.kind.curve if since <= robot.most]
        first = [rate for since, rate in robot.kind.curve if since <= robot.least][-1]
        rates = {first, *steps[steps.index(first) :]}
        robot.least = min(FULL, robot.least + self.stride * min(rates))
        robot.most = min(FULL, robot.most + self.stride * max(rates))

    # States

    def compare(self, state: Plain) -> None:
        """Compare with a recorded state, and take its charges over."""
        if state["tick"] != self.tick:
            self.wrong(f"a state of tick {state['tick']} is recorded here")
        robots = state["robots"]
        for name, values in (
            ("cell", [robot.cell for robot in self.robots]),
            ("heading", [robot.heading for robot in self.robots]),
        ):
            self.differ(f"robots.{name}", robots[name].tolist(), values)
        claims = robots["claim"].tolist()
        for r, (robot, charge) in enumerate(
            zip(self.robots, robots["charge"].tolist(), strict=True)
        ):
            if (robot.to != NIL or claims[r] not in (NIL, robot.cell)) and claims[r] != robot.to:
                self.wrong(f"robot {r} is on its way to {claims[r]}, counted {robot.to}")
            if not robot.least <= charge <= robot.most:
                self.wrong(f"robot {r} has {charge} units, counted {robot.least} to {robot.most}")
            robot.least = robot.most = charge
        self.loads.compare(state)

    def differ(self, name: str, recorded: list[int], values: list[int]) -> None:
        """Note the first value of an array that is another one than recorded."""
        for k, (theirs, ours) in enumerate(zip(recorded, values, strict=True)):
            if theirs != ours:
                self.wrong(f"{name}[{k}] is {theirs} in the recorded state, counted {ours}")
                return


class CountedLoads:
    """Where each pod is, or each load: in one slot, or on one robot."""

    def __init__(self, header: Plain, count: CountedRecording) -> None:
        self.count = count
        self.slot_cell: list[int] = header["slots"]["cell"].tolist()
        self.has_pods = "pods" in header
        loads = header["pods"]["slot"] if self.has_pods else header["orders"]["source"]
        self.slot: list[int] = loads.tolist()  # of each pod or load; NIL: on a robot
        self.carried: dict[int, int] = {}  # robot -> pod or load
        orders = header["orders"]
        self.is_visit: list[bool] = (orders["source"] == orders["target"]).tolist()  # no load

    def handle(self, rows: list[Row]) -> None:
        """Robots pick loads up and drop them."""
        for _, code, r, value in rows:
            if code == codes.CHANGE_PICKED:
                self._pick(r, value)
            elif code == codes.CHANGE_DROPPED:
                self._put(r, value)

    def _pick(self, r: int, order: int) -> None:
        cell = self.count.robots[r].cell
        if r in self.carried:
            self.count.wrong(f"robot {r} picks a load up, and carries {self.carried[r]}")
        load = order
        if self.has_pods:
            here = [pod for pod, slot in enumerate(self.slot) if self.cell_of(slot) == cell]
            if len(here) != 1:
                self.count.wrong(f"robot {r} picks a pod up in cell {cell}, which has {here}")
                return
            load = here[0]
        elif self.slot[load] == NIL or not self._is_beside(r, self.slot[load]):
            self.count.wrong(f"robot {r} picks up load {load}, which is not there")
        elif self.is_visit[load]:
            return
        self.slot[load], self.carried[r] = NIL, load
        self.count.robots[r].is_loaded = True

    def _put(self, r: int, slot: int) -> None:
        if not self._is_beside(r, slot):
            self.count.wrong(f"robot {r} drops its load in slot {slot}, which is not there")
        self._store(r, slot)

    def leave(self, r: int, slot: int) -> None:
        """A robot that goes down leaves its load in its cell, one that is towed its pod in storage."""
        if not self.has_pods:
            self.slot_cell[slot] = self.count.robots[r].cell
        self._store(r, slot)

    def _store(self, r: int, slot: int) -> None:
        if r not in self.carried:
            self.count.wrong(f"robot {r} drops a load, and carries none")
            return
        cell = self.cell_of(slot)
        if self.has_pods and (slot in self.slot or self.count.kind[cell] != STORAGE):
            self.count.wrong(f"robot {r} drops a pod in cell {cell}, where none may stand")
        self.slot[self.carried.pop(r)] = slot
        self.count.robots[r].is_loaded = False

    def cell_of(self, slot: int) -> int:
        """The cell of a slot; NIL for none."""
        return NIL if slot == NIL else self.slot_cell[slot]

    def _is_beside(self, r: int, slot: int) -> bool:
        """Whether a robot stands in the cell of a slot, or without pods in the next one."""
        apart = self.cell_of(slot) - self.count.robots[r].cell
        return apart == 0 or (not self.has_pods and apart in self.count.step)

    def compare(self, state: Plain) -> None:
        """Compare with a recorded state: loads on robots, pods or loads in slots."""
        theirs = [int(load != NIL) for load in state["robots"]["load"].tolist()]
        ours = [int(robot.is_loaded) for robot in self.count.robots]
        self.count.differ("robots.load", theirs, ours)
        if self.has_pods:
            self.count.differ("pods.slot", state["pods"]["slot"].tolist(), self.slot)
            trips = state["pods"]["trip"].tolist()
            for r, pod in self.carried.items():
                if trips[pod] != state["robots"]["load"][r]:
                    self.count.wrong(f"robot {r} carries pod {pod}, recorded is another one")
        else:
            slots = state["orders"]["current_slot"].tolist()
            self.count.differ("orders.current_slot", slots, self.slot)


# What the scenario says of types


def kinds_of(scenario: Plain, fine: int) -> Iterator[Kind]:
    """Yield the type of each robot, in ticks that are so many times finer."""
    fleet = scenario["fleet"]
    types = fleet.get("types") or [{}]
    rest = fleet["robots"] - sum(one.get("robots") or 0 for one in types)
    for one in types:
        kind = kind_of(scenario, one, fine)
        for _ in range(one.get("robots") or rest):
            yield kind


def kind_of(scenario: Plain, one: Plain, fine: int) -> Kind:
    """Return what a type has of its own, and what it has in common with others."""
    durations = scenario["durations"] | stated(one.get("durations"))
    factor = fine * (one.get("move_time_factor") or 1)
    ticks = {name: by_load(durations[name], fine) for name in ("turn", "pick", "drop", "try_drop")}
    ticks["move"] = by_load(durations["move"], factor)
    headings = HEADINGS[one.get("kinematics") or scenario["fleet"]["kinematics"]]
    usual = scenario.get("battery")
    if usual is None:
        return Kind(headings, ticks)
    own = stated(one.get("battery"))
    drain = usual["drain"] | stated(own.get("drain"))
    more = drain["loaded_factor"]
    rates = {name: finer(rate, fine) for name, rate in drain.items() if name != "loaded_factor"}
    curve = own.get("charge_rate", usual["charge_rate"])
    steps = curve if isinstance(curve, list | tuple) else [(0, curve)]
    return Kind(
        headings,
        ticks,
        {name: (units(rate), units(rate * more)) for name, rate in rates.items()},
        [(units(since), units(finer(rate, fine))) for since, rate in steps],
        units(own.get("reserve", usual["reserve"])),
    )


def stated(section: Plain | None) -> Plain:
    """Return what a section says."""
    return {name: value for name, value in (section or {}).items() if value is not None}


def by_load(value: Any, factor: int) -> tuple[int, int]:
    """Ticks without a load, and with one."""
    if isinstance(value, dict):
        return value["empty"] * factor, value["loaded"] * factor
    return value * factor, value * factor


def finer(rate: float, fine: int) -> float:
    """Percent in a finer tick: rounded up in ten-millionths, as a battery counts."""
    return rate if fine == 1 else -(-round(rate * 10**7) // fine) / 10**7


def units(percent: float) -> int:
    """Percent of a battery in units of charge."""
    return round(percent * FULL / 100)
