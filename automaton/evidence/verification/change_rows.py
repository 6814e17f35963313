"""The rows of changes of a tick: which belong together, and whether what they name is there."""

from __future__ import annotations

from automaton.engine.record_codes import (
    CHANGE_DELAYED,
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_LOAD_LEFT,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SLOT_RESERVED,
    CHANGE_STATUS,
    CHANGE_VISITED,
    CHANGE_ZONE,
    DROPPED_ON_ARRIVAL,
    PICKED_ON_ARRIVAL,
)
from automaton.evidence.verification.motion_rules import Acts
from automaton.evidence.verification.type_rules import NIL

Rows = list[list[int]]  # (tick, code, subject, value)

STATUS_REMOVED = 6  # the last status of a robot


def parted(rows: Rows, acts: Acts) -> tuple[Rows, Rows]:
    """The changes before the moves of a tick have ended, and those of robots that arrive."""
    arriving = {r for r, did in acts if did & (PICKED_ON_ARRIVAL | DROPPED_ON_ARRIVAL)}
    for at, (_, code, subject, _) in enumerate(rows if arriving else ()):
        if code in (CHANGE_PICKED, CHANGE_DROPPED) and subject in arriving:
            # How long moves and waits take stands in between.
            lengths = [row for row in rows[at:] if row[1] == CHANGE_DURATION]
            return rows[:at] + lengths, [row for row in rows[at:] if row[1] != CHANGE_DURATION]
    return rows, []


def parted_delays(rows: Rows) -> tuple[Rows, Rows]:
    """The delays that begin in a tick, which come first, and the other changes."""
    delays = [row for row in rows if row[1] == CHANGE_DELAYED]
    return delays, rows[len(delays) :] if rows[: len(delays)] == delays else rows


def parted_visits(rows: Rows) -> tuple[Rows, Rows]:
    """The changes of a tick before stops are done, at its very end, and those from then on."""
    for at, row in enumerate(rows):
        if row[1] == CHANGE_VISITED:
            return rows[:at], rows[at:]
    return rows, []


def names_what_is_there(
    code: int, subject: int, value: int, robots: int, orders: int, slots: int
) -> bool:
    """Whether a change names robots, orders and slots of which there are so many."""
    limits = {
        CHANGE_ORDER_RESERVED: (orders, robots),
        CHANGE_SLOT_RESERVED: (slots, robots),
        CHANGE_DURATION: (robots, 1 << 31),
        CHANGE_PICKED: (robots, orders),
        CHANGE_DROPPED: (robots, slots),
        CHANGE_LOAD_LEFT: (robots, slots),
        CHANGE_STATUS: (robots, STATUS_REMOVED + 1),
        CHANGE_ZONE: (robots, 1 << 31),
        CHANGE_VISITED: (robots, orders),
        CHANGE_DELAYED: (robots, 1 << 31),
    }
    subjects, values = limits.get(code, (0, 0))
    least = NIL if code in (CHANGE_ORDER_RESERVED, CHANGE_SLOT_RESERVED, CHANGE_ZONE) else 0
    return 0 <= subject < subjects and least <= value < values
