"""What happened in a run, as far as it is known: its events, and a few figures of every tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.simulation import Simulation
from automaton.world.state import NIL, TICK, Array
from automaton.world.waiting import CURVE_COLUMNS, EVENT_NAMES, EVENTS, ROWS

EVENT_COLUMNS = 5


class Event(NamedTuple):
    """One event; `subject` is an order or NIL, `value` depends on the kind (world.waiting)."""

    tick: int
    code: int
    robot: int
    subject: int
    value: int

    @property
    def name(self) -> str:
        return EVENT_NAMES[self.code]


class Growing:
    """An array that rows are appended to; readers in other threads see whole rows only."""

    def __init__(self, columns: int) -> None:
        self._rows = np.zeros((1024, columns), np.int32)
        self._count = 0

    def append(self, rows: Array) -> None:
        """Add rows at the end."""
        count = self._count + len(rows)
        if count > len(self._rows):
            grown = np.zeros((2 * count, self._rows.shape[1]), np.int32)
            grown[: self._count] = self._rows[: self._count]
            self._rows = grown
        self._rows[self._count : count] = rows
        self._count = count

    @property
    def rows(self) -> Array:
        """(N, columns) int32, not to be written to."""
        count = self._count
        found: Array = self._rows[:count]
        return found


class Chronicle:
    """Give it to a simulation as `on_observe`: it takes each tick once, however often it is played."""

    def __init__(self) -> None:
        self._events = Growing(EVENT_COLUMNS)
        self._curve = Growing(CURVE_COLUMNS)

    def __call__(self, simulation: Simulation) -> None:
        """Take what the buffers of an observation hold, and empty them."""
        watch, last = simulation.watch, int(simulation.world.clock[TICK])
        rows = int(watch.count[ROWS])
        fresh = min(rows, last - self.known)
        if fresh > 0:
            self._curve.append(watch.curve[rows - fresh : rows])
            events = watch.events[: watch.count[EVENTS]]
            self._events.append(events[events[:, 0] > last - fresh])
        simulation.empty_observation()

    @property
    def known(self) -> int:
        """The last tick of which it tells."""
        return len(self._curve.rows)

    @property
    def events(self) -> Array:
        """(N, 5) int32, ascending ticks: tick, code, robot, subject, value."""
        return self._events.rows

    @property
    def curve(self) -> Array:
        """(known, CURVE_COLUMNS) int32: row t - 1 tells of tick t; columns in world.waiting."""
        return self._curve.rows

    def event(self, index: int) -> Event:
        """One event of the list."""
        return Event(*(int(value) for value in self.events[index]))

    def index_at(self, tick: int) -> int:
        """How many events there are up to and with a tick."""
        return int(np.searchsorted(self.events[:, 0], tick, side="right"))


def event_text(event: Event) -> str:
    """An event in words."""
    texts = {
        "took": f"takes order {event.subject}",
        "picked up": f"picks up load {event.subject}",
        "set down": f"sets load {event.subject} down on the way",
        "delivered": f"delivers load {event.subject}",
        "left bay": "leaves its bay",
        "parked": "is parked",
        "withdrew": f"withdraws {event.value} step{'s' if event.value != 1 else ''}",
        "gave back": f"gives order {event.subject} back",
        "charges": f"charges for {event.value} ticks",
        "illegal answer": "loses a tick to an illegal answer",
        "circular wait": f"closes a circle of {event.value} waiting robots",
        "deadlock": f"has been in a circle of {event.value} waiting robots for too long",
    }
    who = "" if event.robot == NIL else f"robot {event.robot} "
    return who + texts[event.name]
