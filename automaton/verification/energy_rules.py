"""The rules of batteries, faults and delays, checked on committed actions with recomputed charges.

An operation uses its charge when it begins; waiting and standing use charge while there is some
left. A robot that is down does nothing until it is towed, exactly when the scenario says, and
returns with the charge that the scenario says.
"""

from __future__ import annotations

from typing import Any, Final, Protocol

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DURATION,
    CHANGE_LOAD_LEFT,
    CHANGE_STATUS,
    ENTERED_PARKING_BAY,
    EXECUTED_BLOCKED,
    EXECUTED_CHARGE,
    EXECUTED_DROP,
    EXECUTED_ILLEGAL,
    EXECUTED_PICK,
    EXECUTED_RETREAT,
    EXECUTED_SERVE,
    EXECUTED_TRY_DROP,
    EXECUTED_WAIT,
    MOVE_EAST,
    MOVE_NORTH,
    TURN_LEFT,
    TURN_RIGHT,
)
from automaton.floor.floor_plan import CHARGER
from automaton.verification.motion_rules import Acts, Complaint, ReplayedMotion, Rows
from automaton.verification.move_time_rules import (
    DRAWS,
    NIL,
    CoarseTicks,
    drawn_from,
    durations_of,
    kinds_of,
    poisson_number,
    random_bits,
    repairs_of,
)
from automaton.verification.pod_rules import ReplayedTrips

BATTERY_FULL: Final = 1_000_000_000
# recorded statuses
STATUS_UP, STATUS_DEPLETED, STATUS_FAILED, STATUS_TOWED, STATUS_REMOVED = 0, 3, 4, 5, 6
REPAIR: Final = 25  # random stream of repairs in place
OPERATION_BY_CODE: Final = {
    **dict.fromkeys(range(MOVE_EAST, MOVE_NORTH + 1), "move"),
    TURN_LEFT: "turn",
    TURN_RIGHT: "turn",
    EXECUTED_PICK: "pick",
    EXECUTED_DROP: "drop",
    EXECUTED_TRY_DROP: "try_drop",
}
WAIT_CODES: Final = (
    EXECUTED_WAIT,
    EXECUTED_SERVE,
    EXECUTED_BLOCKED,
    EXECUTED_RETREAT,
    EXECUTED_ILLEGAL,
)


class TowedPods(Protocol):
    """The pods of towed robots."""

    trips: ReplayedTrips
    load: list[int]
    put_aside: set[int]


def units(percent: float) -> int:
    """Percent of a battery in units of charge."""
    return round(percent * BATTERY_FULL / 100)


class BatteryOfType:
    """Charge used and gained by the batteries of a robot type, in units of charge."""

    def __init__(self, usual: dict[str, Any], own: dict[str, Any]) -> None:
        said = {name: value for name, value in own.items() if value is not None}
        battery = {**usual, **said}
        drains = {name: rate for name, rate in said.get("drain", {}).items() if rate is not None}
        drain = {**usual["drain"], **drains}
        self.rates = {
            name: (units(rate), units(rate * drain["loaded_factor"]))
            for name, rate in drain.items()
            if name != "loaded_factor"
        }
        given = battery["charge_rate"]
        curve = given if isinstance(given, list | tuple) else ((0, given),)
        self.curve = [(units(since), units(rate)) for since, rate in curve]
        self.reserve = units(battery["reserve"])


class Energy:
    """The charge and the status of each robot."""

    def __init__(
        self, header: dict[str, Any], motion: ReplayedMotion, report_violation: Complaint
    ) -> None:
        self.motion = motion
        self.seed: int = header["seed"]
        self.report_violation = report_violation
        self.charge: list[int] = header["robots"]["charge"].tolist()
        self.status = [STATUS_UP] * len(self.charge)
        self.since = [0] * len(self.charge)  # tick in which a robot got its status
        self.ticks_of = CoarseTicks(header["scenario"])
        self.apply_rules(header["scenario"])

    def apply_rules(self, scenario: dict[str, Any]) -> None:
        """Apply the rules of a scenario for batteries and faults."""
        self.battery = scenario.get("battery")
        self.faults = scenario["faults"]
        in_place = self.faults.get("repair_in_place")
        self.repairs = [] if in_place is None else repairs_of(in_place)
        self.jitter: int = scenario["durations"]["handling_jitter"]
        if self.battery is None:
            return
        self.own = [
            battery
            for kind, robots in kinds_of(scenario)
            for battery in [BatteryOfType(self.battery, kind.get("battery") or {})] * robots
        ]

    def spend(self, tick: int, acts: Acts, rows: Rows, load: list[int], placed: set[int]) -> None:
        """Subtract the charge of operations that begin in a tick, with the loads before it.

        `placed`: robots that leave their parking bays in this tick.
        """
        for r, did in acts:
            if self.status[r] != STATUS_UP and did & ACTION_MASK:
                text = "acts although it is down"
                self.report_violation("energy", [r], self.motion.cell[r], text)
        if self.battery is None:
            return
        lengths = {row[2]: row[3] for row in rows if row[1] == CHANGE_DURATION}
        stride = self.ticks_of.stride  # ticks of a lost tick
        for r, did in acts:
            code, loaded = did & ACTION_MASK, int(load[r] != NIL)
            if code in OPERATION_BY_CODE:
                name = OPERATION_BY_CODE[code]
                ticks = lengths.get(r, max(1, self.motion.types.ticks_of(r, name)))
                behind = self._ticks_behind(tick, r, code, ticks, r in placed)
                self._operate(r, name, (ticks - behind) * self.own[r].rates[name][loaded])
                self._stand(r, behind * self.own[r].rates["wait"][loaded])
            elif code in WAIT_CODES:
                self._stand(r, lengths.get(r, stride) * self.own[r].rates["wait"][loaded])
            elif code == EXECUTED_CHARGE:
                self._take_in(r)
        stands = any(any(one.rates["wait"]) for one in set(self.own))
        if stands and self.ticks_of.decides(tick):
            busy = {r for r, did in acts if did & (ACTION_MASK | ENTERED_PARKING_BAY)}
            for r, cell in enumerate(self.motion.cell):
                free = self.motion.free[r] <= tick and self.status[r] == STATUS_UP
                if cell != NIL and free and r not in busy:
                    self._stand(r, stride * self.own[r].rates["wait"][int(load[r] != NIL)])

    def _ticks_behind(self, tick: int, r: int, code: int, ticks: int, is_new: bool) -> int:
        """The ticks of a move lost behind the robot ahead, which use charge like waits."""
        if self.motion.following != "convoy" or code > MOVE_NORTH or self.motion.cell[r] == NIL:
            return 0
        return max(0, ticks - self.motion.own_ticks(tick, r, code - MOVE_EAST, is_new))

    def _operate(self, r: int, name: str, price: int) -> None:
        if price > self.charge[r]:
            text = f"begins a {name} that takes {price} units of charge, but has {self.charge[r]}"
            self.report_violation("energy", [r], self.motion.cell[r], text)
        self.charge[r] -= min(price, self.charge[r])

    def _stand(self, r: int, price: int) -> None:
        self.charge[r] -= min(price, self.charge[r])

    def _take_in(self, r: int) -> None:
        cell = self.motion.cell[r]
        if cell == NIL or self.motion.kind[cell] != CHARGER:
            self.report_violation("energy", [r], cell, "charges in a cell without a charger")
        rate = max(step for step in self.own[r].curve if step[0] <= self.charge[r])[1]
        self.charge[r] += min(self.ticks_of.stride * rate, BATTERY_FULL - self.charge[r])

    def stand_for(self, r: int, ticks: int) -> None:
        """Subtract the charge for standing for a number of ticks."""
        if self.battery is not None:
            loaded = int(self.motion.types.load[r] != NIL)
            self._stand(r, ticks * self.own[r].rates["wait"][loaded])

    def is_down(self, r: int) -> bool:
        """Whether a robot is down, on the floor or off it."""
        return self.status[r] >= STATUS_DEPLETED

    def become(self, tick: int, r: int, status: int, pods: TowedPods) -> None:
        """A robot goes down, is towed, or returns; it is towed when there is room for its pod."""
        before, since = self.status[r], self.since[r]
        cell = self.motion.cell[r]
        if status in (STATUS_DEPLETED, STATUS_FAILED):
            self._check_fault(tick, r, status, before)
            if status == STATUS_DEPLETED or not self.repairs:
                self.motion.parked[r] = cell == NIL
                self.motion.unsure.discard(r)
        elif status in (STATUS_TOWED, STATUS_REMOVED):
            wait = self.faults["tow_after"]
            in_time = cell == NIL or tick - since == wait
            in_time |= r in pods.put_aside and wait is not None and tick - since > wait
            if before not in (STATUS_DEPLETED, STATUS_FAILED) or not in_time:
                self.report_violation("energy", [r], cell, "is towed at the wrong time")
            if (status == STATUS_REMOVED) != (self.faults["repair_time"] is None):
                self.report_violation(
                    "energy", [r], cell, "is removed, or towed to return, against the rules"
                )
            if status == STATUS_TOWED and self.battery is not None:
                self._mend(r, before == STATUS_DEPLETED, self.own[r].reserve)
            if pods.trips.there and pods.load[r] != NIL:
                self.report_violation("pod", [r], cell, "is towed with its pod")
            pods.put_aside.discard(r)
            self.motion.tow(r)
        elif before == STATUS_FAILED and self.repairs:
            wanted = drawn_from(
                self.repairs, random_bits(self.seed, REPAIR, self.ticks_of.of(since), r)
            )
            if tick - since != wanted:
                text = f"resumes after {tick - since} ticks, but its repair takes {wanted}"
                self.report_violation("energy", [r], cell, text)
        elif before != STATUS_TOWED or tick - since != self.faults["repair_time"]:
            self.report_violation("energy", [r], cell, "returns at the wrong time")
        self.status[r], self.since[r] = status, tick

    def _mend(self, r: int, ran_empty: bool, reserve: int) -> None:
        """Set the charge with which a towed robot returns."""
        given = self.faults["charge"]
        if given != "kept":
            self.charge[r] = units(given)
        elif ran_empty:
            self.charge[r] = max(self.charge[r], reserve)

    def _check_fault(self, tick: int, r: int, status: int, before: int) -> None:
        cell = self.motion.cell[r]
        if self.motion.is_under_way(r):
            self.report_violation("energy", [r], cell, "goes down before its move ends")
        if before != STATUS_UP:
            self.report_violation("energy", [r], cell, "goes down although it is already down")
        if status == STATUS_DEPLETED:
            if self.charge[r] and self.charge[r] >= self._dearest():
                text = f"is out of energy with {self.charge[r]} units of charge"
                self.report_violation("energy", [r], cell, text)
        elif not (self.faults["failure_probability"] or self.faults.get("mtbf")):
            due = [f["at"] for f in self.faults["list"] if f["robot"] == r and f["at"] <= tick]
            if not due:
                self.report_violation(
                    "energy", [r], cell, "breaks down without a cause in the scenario"
                )

    def _dearest(self) -> int:
        """Charge of the most expensive operation; moves in slow zones or lifts last longer."""
        if self.battery is None:
            return 0
        pace = self.motion.pace
        limits = max(
            max(pace.limits.values(), default=0), max(pace.cabin_ticks.values(), default=0)
        )
        around = 1 if pace.usual else len(self.charge) + 1
        slowest = self.motion.types.slowest
        prices = [
            max(rates) * (max(1, slowest(name), limits) + self.jitter)
            for one in set(self.own)
            for name, rates in one.rates.items()
        ]
        dearest: int = max(prices) * around
        return dearest


def parted_faults(rows: Rows) -> tuple[Rows, Rows]:
    """The changes of a tick, in two parts: robots that go down, are towed or return; then the
    others."""
    told = [k for k, row in enumerate(rows) if row[1] in (CHANGE_STATUS, CHANGE_LOAD_LEFT)]
    if not told:
        return [], rows
    # The order of a load that was left is returned right after it.
    first = told[-1] + (2 if rows[told[-1]][1] == CHANGE_LOAD_LEFT else 1)
    return rows[:first], rows[first:]


# Delays: which robots begin one and for how long, drawn again; and their effects.


MAX_BUSY: Final = 65_535  # longest time for which a robot may be busy
BEGIN, TICKS, COUNT = 22, 23, 24  # random streams


class ReplayedDelays:
    """Which robots are delayed, and until when."""

    def __init__(
        self,
        header: dict[str, Any],
        motion: ReplayedMotion,
        energy: Energy,
        report_violation: Complaint,
    ) -> None:
        self.motion, self.energy = motion, energy
        self.report_violation = report_violation
        self.seed: int = header["seed"]
        self.rules = header["scenario"]["faults"].get("delays")
        self.until = [0] * len(motion.home)
        self.ticks_of = CoarseTicks(header["scenario"])
        self.table = self.rules.get("table") or durations_of(self.rules) if self.rules else []

    def begin(self, tick: int, rows: list[list[int]]) -> None:
        """Begin the recorded delays of a tick, and report those that differ from the draws."""
        if not self.rules and not rows:
            return
        due = self._due(tick) if self.rules else {}
        recorded = {row[2]: row[3] for row in rows}
        for r in sorted({*due, *recorded}):
            if due.get(r) != recorded.get(r):
                words = [f"{recorded[r]} ticks" if r in recorded else "none"]
                words += [f"{due[r]} ticks" if r in due else "none"]
                text = f"a delay of {words[0]} is recorded, but {words[1]} is due"
                self.report_violation("delay", [r], self.motion.cell[r], text)
        delayed = [r for r in recorded if 0 <= r < len(self.until)]
        for r in delayed:
            self._delay(tick, r, recorded[r])
        for r, ticks in self.motion.hand_on(delayed):
            self.energy.stand_for(r, ticks)
        for r, until in enumerate(self.until):
            if until >= tick and self.motion.free[r] <= tick:
                self.energy.stand_for(r, until - tick + 1)
                self.motion.free[r] = until + 1

    def _delay(self, tick: int, r: int, ticks: int) -> None:
        self.until[r] = tick + ticks - 1
        code = self.motion.begun[r]
        moves = MOVE_EAST <= code <= MOVE_NORTH and "move" in self.rules["of"]
        turns = MOVE_NORTH < code <= TURN_RIGHT and "turn" in self.rules["of"]
        if self.motion.free[r] > tick and (moves or turns):
            self.motion.lengthen(r, ticks)

    def _due(self, tick: int) -> dict[int, int]:
        """Durations of the delays that begin in a tick, by robot."""
        able = []
        for r, cell in enumerate(self.motion.cell):
            if cell == NIL or self.energy.is_down(r):
                self.until[r] = 0
            elif self.until[r] < tick:
                able.append(r)
        if not self.ticks_of.draws(tick):
            return {}
        drawn_in = self.ticks_of.of(tick)
        hashes = {r: random_bits(self.seed, BEGIN, drawn_in, r) for r in able}
        probability = self.rules["probability"]
        if self.rules["events"] == "poisson":
            counts = [
                poisson_number(probability, random_bits(self.seed, COUNT, drawn_in, r) >> 32)
                for r in able
            ]
            chosen = sorted(able, key=hashes.__getitem__)[: sum(counts)]
        else:
            chosen = [r for r in able if hashes[r] >> 32 < round(probability * DRAWS)]
        return {r: min(self._length(drawn_in, r), self._room(tick, r)) for r in chosen}

    def _length(self, tick: int, r: int) -> int:
        return drawn_from(self.table, random_bits(self.seed, TICKS, tick, r))

    def _room(self, tick: int, r: int) -> int:
        return MAX_BUSY - max(0, self.motion.free[r] - tick)
