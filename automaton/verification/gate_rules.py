"""Gates, recomputed from moves only: closed cells, doors, blocks and lifts.

A recording says that a robot was refused, but not at which cell. So each robot that was refused
next to a door or a lift, or began to wait there, may have requested it. An entry is a violation if
no such robot can have opened it in time.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final

from automaton.engine.record_codes import (
    ACTION_MASK,
    EXECUTED_BAY_BLOCKED,
    EXECUTED_BLOCKED,
    EXECUTED_WAIT,
    MOVE_NORTH,
)
from automaton.floor.floor_plan import CELL_KINDS
from automaton.verification.move_time_rules import CoarseTicks

NIL: Final = -1
Complaint = Callable[..., None]  # (rule, robots, cell, text)
Entry = tuple[int, int, int]  # robot, from (NIL: its parking bay), to
Asks = set[int]  # cells that robots may have requested in a tick


class Cells:
    """The cells of gates, from the floor of a header."""

    def __init__(self, floor: dict[str, Any]) -> None:
        self.stride = floor["width"] + 2
        self.exits: list[int] = floor["exits"].ravel().tolist()
        self.drivable = [CELL_KINDS[kind].drivable for kind in floor["kind"].ravel().tolist()]
        self.steps = (1, self.stride, -1, -self.stride)

    def at(self, place: Iterable[int]) -> int:
        x, y = place
        cell: int = (y + 1) * self.stride + x + 1
        return cell

    def of(self, cells: Any) -> list[int]:
        """The drivable cells of a rectangle, or of a path by its corners, in its order."""
        if isinstance(cells, dict):
            (x, y), (u, v) = cells["from"], cells["to"]
            columns, rows = sorted((x, u)), sorted((y, v))
            flat = [
                self.at((column, row))
                for row in range(rows[0], rows[1] + 1)
                for column in range(columns[0], columns[1] + 1)
            ]
        else:
            flat = [self.at(cells[0])]
            for corner in cells[1:]:
                end = self.at(corner)
                step = self.stride if (end - flat[-1]) % self.stride == 0 else 1
                while flat[-1] != end:
                    flat.append(flat[-1] + (step if end > flat[-1] else -step))
        return [cell for cell in dict.fromkeys(flat) if self.drivable[cell]]

    def ways_out(self, cell: int) -> Iterator[int]:
        """The cells into which robots drive from a cell."""
        for direction, step in enumerate(self.steps):
            if self.exits[cell] >> direction & 1:
                yield cell + step

    def mouths(self, shaft: list[int]) -> list[int]:
        """The cells of a shaft where robots enter or leave it."""
        joined = {
            (cell, to)
            for cell in range(len(self.exits))
            if self.exits[cell]
            for to in self.ways_out(cell)
        }
        outside = {cell for pair in joined for cell in pair if not set(pair) <= set(shaft)}
        return [cell for cell in shaft if cell in outside]


class CheckedGate:
    """Any gate: its cells, and the robots in it when the tick began.

    It is checked only in ticks in which a robot is in it, enters it or may request it.
    """

    rule = ""

    def __init__(self, cells: list[int]) -> None:
        self.cells = set(cells)
        self.inside: set[int] = set()

    def look(self, inside: set[int], cell: list[int]) -> None:
        """Record the robots in it when a tick begins."""
        self.inside = inside

    def check(self, tick: int, entered: list[Entry], asked: bool, complain: Complaint) -> None:
        """Check the robots that enter it in a tick; `asked`: whether a robot may have requested it."""


class Closed(CheckedGate):
    """Cells that are closed at times."""

    def __init__(self, cells: list[int], rows: list[list[int]]) -> None:
        super().__init__(cells)
        self.rows = rows
        self.row = 0  # the first row that is not over

    def check(self, tick: int, entered: list[Entry], asked: bool, complain: Complaint) -> None:
        while self.row < len(self.rows) and self.rows[self.row][1] <= tick:
            self.row += 1
        if self.row < len(self.rows) and self.rows[self.row][0] <= tick:
            first, end = self.rows[self.row]
            for r, _, to in entered:
                complain(
                    "closed", [r], to, f"enters a cell that is closed from {first} to {end - 1}"
                )


class CheckedDoor(CheckedGate):
    """A cell that is shut until a robot requests it.

    Any possible request may have been the first, so several opening ticks are possible.
    """

    def __init__(self, cells: list[int], section: dict[str, Any]) -> None:
        super().__init__(cells)
        self.opening, self.hold = section["opening_time"], section["hold_open"]
        self.open_from: int | None = None  # the latest tick in which it may have opened
        self.opening_at: list[int] = []  # later possible openings
        self.used = 0

    def check(self, tick: int, entered: list[Entry], asked: bool, complain: Complaint) -> None:
        if self.inside:
            self.used = tick
        while self.opening_at and self.opening_at[0] <= tick:
            self.open_from = self.opening_at.pop(0)
        if self.open_from is not None and tick > max(self.used, self.open_from) + self.hold:
            self.open_from = None
        if entered or asked:
            self.used = tick
            self.opening_at.append(tick + self.opening)
        for r, _, to in entered:
            if self.open_from is None:
                complain("door", [r], to, "drives through a door that is shut")


class CheckedBlock(CheckedGate):
    """Cells that together hold at most a number of robots."""

    def __init__(self, cells: list[int], most: int, same: bool) -> None:
        super().__init__(cells)
        self.most, self.same = most, same
        self.mouth = NIL

    def check(self, tick: int, entered: list[Entry], asked: bool, complain: Complaint) -> None:
        if not entered:
            return
        robots = [r for r, _, _ in entered]
        if len(self.inside) + len(entered) > self.most:
            text = f"enters a block with {len(self.inside)} robots and a limit of {self.most}"
            complain("block", robots, entered[0][2], text)
        mouths = {to for _, _, to in entered}
        if self.inside and self.mouth != NIL:
            mouths.add(self.mouth)
        if self.same and len(mouths) > 1:
            complain(
                "block",
                robots,
                entered[0][2],
                "enters a block against the direction of the robots in it",
            )
        self.mouth = entered[0][2]


class CheckedLift(CheckedGate):
    """A block of one robot, whose cabin stays where it was left until it is called."""

    def __init__(self, cells: list[int], mouths: list[int], section: dict[str, Any]) -> None:
        super().__init__(cells)
        # The last mouth up to each cell of the path: a towed robot may return between two mouths.
        last = itertools.accumulate(int(cell in mouths) for cell in cells)
        self.number = dict(zip(cells, last, strict=True))
        self.travel, self.doors = section["travel_time"], section["door_time"]
        self.cabin = mouths[0]
        # The first tick in which it was free and may have been called.
        self.asked: int | None = None

    def look(self, inside: set[int], cell: list[int]) -> None:
        super().look(inside, cell)
        for r in self.inside:
            if cell[r] in self.number:
                self.cabin = cell[r]
        if self.inside:
            self.asked = None

    def check(self, tick: int, entered: list[Entry], asked: bool, complain: Complaint) -> None:
        if not self.inside and self.asked is None and (entered or asked):
            self.asked = tick
        if not entered:
            return
        robots, to = [r for r, _, _ in entered], entered[0][2]
        if len(self.inside) + len(entered) > 1:
            complain("lift", robots, to, "enters an occupied lift, which holds one robot")
            return
        way = abs(self.number[to] - self.number[self.cabin])
        there = (self.asked or 0) + way * self.travel + self.doors
        if tick < there:
            complain(
                "lift", robots, to, f"enters a lift whose cabin is not there before tick {there}"
            )


class GateRules:
    """All gates of a recording."""

    def __init__(self, header: dict[str, Any], complain: Complaint) -> None:
        section = header["scenario"].get("floor") or {}
        self.ticks_of = CoarseTicks(header["scenario"])
        self.complain = complain
        self.cells = cells = Cells(header["floor"])
        self.gates: list[CheckedGate] = []
        recorded = header.get("gates") or {}
        for number, one in enumerate(section.get("closed", ())):
            self.gates.append(Closed(cells.of(one["cells"]), rows_of(recorded, number)))
            self._check_schedule(one, rows_of(recorded, number), number)
        self.gates += [CheckedDoor([cells.at(one["at"])], one) for one in section.get("doors", ())]
        self.gates += [
            CheckedBlock(cells.of(one["cells"]), one["max_robots"], one["direction"] == "same")
            for one in section.get("blocks", ())
        ]
        self.cabin_ticks: dict[tuple[int, int], int] = {}  # by cell and direction
        for one in section.get("lifts", ()):
            shaft = cells.of(one["shaft"])
            mouths = cells.mouths(shaft)
            self.gates.append(CheckedLift(shaft, mouths, one))
            for path in (shaft, shaft[::-1]):
                self._share_out(path, set(mouths), one["travel_time"])
        self.by_cell: dict[int, list[int]] = {}  # gates by cell
        for number, gate in enumerate(self.gates):
            for cell in gate.cells:
                self.by_cell.setdefault(cell, []).append(number)
        self.used: set[int] = set()  # gates with robots in them when the tick began

    def _check_schedule(self, one: dict[str, Any], rows: list[list[int]], number: int) -> None:
        """Check that closings last at least a tick, do not overlap, and follow their schedule, if
        any."""
        every, begin = one.get("every"), one.get("from")
        for k, (first, end) in enumerate(rows):
            wrong = end <= first or (k and first <= rows[k - 1][1])
            if isinstance(begin, int):
                due = begin + k * (every or 0)
                ticks = tuple(self.ticks_of.begin_of(tick) for tick in (due, due + one["for"]))
                wrong = (first, end) != ticks or (k > 0 and every is None)
            if wrong:
                text = f"closing {number + 1} has the invalid ticks {first} to {end - 1}"
                self.complain("closed", [], NIL, text)
                return

    def _share_out(self, path: list[int], mouths: set[int], travel: int) -> None:
        """Moves from mouth to mouth take equal shares of the travel time, the last move the rest."""
        fine = self.ticks_of.factor
        stretch: list[tuple[int, int]] = []
        for cell, to in itertools.pairwise(path):
            stretch.append((cell, self.cells.steps.index(to - cell)))
            if to in mouths:
                share = travel // fine // len(stretch) * fine
                self.cabin_ticks.update(dict.fromkeys(stretch, share))
                self.cabin_ticks[stretch[-1]] = travel - share * (len(stretch) - 1)
                stretch = []

    def look(self, tick: int, cell: list[int], claim: dict[int, tuple[int, int]]) -> None:
        """Record where robots are when a tick begins, before they leave their parking bays."""
        inside: dict[int, set[int]] = {}
        claimed = ((r, one) for r, (one, _) in claim.items())
        for r, one in itertools.chain(enumerate(cell), claimed):
            for number in self.by_cell.get(one, ()):
                inside.setdefault(number, set()).add(r)
        for number in self.used - inside.keys():
            self.gates[number].look(set(), cell)
        for number, robots in inside.items():
            self.gates[number].look(robots, cell)
        self.used = set(inside)

    def check(self, tick: int, acts: list[tuple[int, int]], placed: set[int], motion: Any) -> None:
        """Check the robots that enter gates in a tick; `placed`: robots that have left their
        parking bays."""
        entries = [(r, NIL, motion.cell[r]) for r in sorted(placed)]
        asks: Asks = set()
        for r, did in acts:
            code, cell = did & ACTION_MASK, motion.cell[r]
            if 0 < code <= MOVE_NORTH and cell != NIL:
                entries.append((r, cell, cell + self.cells.steps[code - 1]))
            elif code in (EXECUTED_BLOCKED, EXECUTED_WAIT) and cell != NIL:
                asks.update(self.cells.ways_out(cell))
            elif code == EXECUTED_BAY_BLOCKED:
                asks.add(motion.home[r])
        entered: dict[int, list[Entry]] = {}
        for entry in entries:
            left = self.by_cell.get(entry[1], ())
            for number in self.by_cell.get(entry[2], ()):
                if number not in left:
                    entered.setdefault(number, []).append(entry)
        asked = {number for cell in asks for number in self.by_cell.get(cell, ())}
        for number in sorted(self.used | entered.keys() | asked):
            self.gates[number].check(tick, entered.get(number, []), number in asked, self.complain)


def rows_of(recorded: dict[str, Any], number: int) -> list[list[int]]:
    """The closings of a gate: first tick, tick after the last."""
    if not recorded:
        return []
    first = recorded["first_closing"]
    if number + 1 >= len(first):
        return []
    rows: list[list[int]] = recorded["closings"][first[number] : first[number + 1]].tolist()
    return rows
