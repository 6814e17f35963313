"""The rules of delays: who begins one and how long it lasts, drawn once more; what it does."""

from __future__ import annotations

from typing import Any, Final

from automaton.engine.record_codes import MOVE_EAST, MOVE_NORTH, TURN_RIGHT
from automaton.evidence.verification.coarse_ticks import CoarseTicks
from automaton.evidence.verification.drawn_durations import (
    WHOLE,
    drawn_from,
    durations_of,
    poisson_number,
)
from automaton.evidence.verification.energy_rules import Energy
from automaton.evidence.verification.motion_rules import Complaint, Motion
from automaton.evidence.verification.move_time_rules import random_bits
from automaton.evidence.verification.type_rules import NIL

MAX_BUSY: Final = 65_535  # ticks for which a robot may be busy
BEGIN, TICKS, COUNT = 22, 23, 24  # streams of draws


class Delays:
    """Which robots are delayed, and until when."""

    def __init__(
        self, header: dict[str, Any], motion: Motion, energy: Energy, report_violation: Complaint
    ) -> None:
        self.motion, self.energy = motion, energy
        self.report_violation = report_violation
        self.seed: int = header["seed"]
        self.rules = header["scenario"]["faults"].get("delays")
        self.until = [0] * len(motion.home)
        self.ticks_of = CoarseTicks(header["scenario"])
        self.table = self.rules.get("table") or durations_of(self.rules) if self.rules else []

    def begin(self, tick: int, rows: list[list[int]]) -> None:
        """Begin the delays of a tick as they are recorded, and say which are others than drawn."""
        if not self.rules and not rows:
            return
        due = self._due(tick) if self.rules else {}
        recorded = {row[2]: row[3] for row in rows}
        for r in sorted({*due, *recorded}):
            if due.get(r) != recorded.get(r):
                words = [f"{recorded[r]} ticks" if r in recorded else "none"]
                words += [f"{due[r]} ticks" if r in due else "none"]
                text = f"a delay of {words[0]} is recorded, and {words[1]} is due"
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
        """How long the delays last that begin in a tick, by robot."""
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
            chosen = [r for r in able if hashes[r] >> 32 < round(probability * WHOLE)]
        return {r: min(self._length(drawn_in, r), self._room(tick, r)) for r in chosen}

    def _length(self, tick: int, r: int) -> int:
        return drawn_from(self.table, random_bits(self.seed, TICKS, tick, r))

    def _room(self, tick: int, r: int) -> int:
        return MAX_BUSY - max(0, self.motion.free[r] - tick)
