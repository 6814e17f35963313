"""Events and states, taken from a run while it goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from automaton.engine.observation import (
    CAUSE_NO_ORDER,
    CAUSE_NOT_WAITING,
    CAUSES,
    COUNT_EVENTS,
    EVENT_CHARGING,
    EVENT_DELIVERED,
    EVENT_DEPLETED,
    EVENT_DROPPED,
    EVENT_FAILED,
    EVENT_NAMES,
    EVENT_PICKED,
    EVENT_VISITED,
)
from automaton.engine.robot_states import BATTERY_FULL
from automaton.engine.state import ACTION_IDLE, ACTION_NAMES, NIL
from automaton.runs.simulation import Simulation
from automaton.tables.columns import NO_TEXT, Array, Form, Rows, form_of, texts_where, where
from automaton.tables.places import columns_and_rows
from automaton.world.resolve import Resolved

EVENTS_IN_CELLS: Final = (
    *(EVENT_PICKED, EVENT_DROPPED, EVENT_DELIVERED, EVENT_VISITED),
    *(EVENT_DEPLETED, EVENT_FAILED),
)
HEADINGS: Final = {1: (), 2: ("EW", "NS"), 4: ("E", "S", "W", "N")}  # by how many a type has

Append = Callable[[Rows], None]


def event_form(resolved: Resolved) -> Form:
    """The form of the events of a run."""
    return form_of("events", resolved, event=EVENT_NAMES)


class EventTaker:
    """Gives the events of a simulation on, and empties its buffers; `robots`: only theirs."""

    def __init__(self, append: Append | None, robots: Array | None) -> None:
        self._append, self._robots = append, robots

    def __call__(self, simulation: Simulation) -> None:
        """Take what the buffers hold."""
        observation = simulation.observation
        events = observation.events[: observation.count[COUNT_EVENTS]]
        if self._append is not None and len(events):
            if self._robots is not None:
                events = events[np.isin(events[:, 2], self._robots)]
            self._append(event_rows(simulation, events))
        simulation.empty_observation()


def event_rows(simulation: Simulation, events: Array) -> Rows:
    """Rows (tick, code, robot, subject, value) of an observation as those of a table."""
    tick, code, robot, subject, value = events.T
    in_cell = np.isin(code, EVENTS_IN_CELLS)
    x, y = columns_and_rows(simulation.resolved.floor_plan, np.where(in_cell, value, NIL))
    share = np.where(code == EVENT_CHARGING, value / BATTERY_FULL, value)
    return {
        "tick": tick,
        "event": code,
        "robot": where(robot != NIL, robot),
        "order": where(subject != NIL, subject),
        "value": np.where(in_cell | (value == NIL), np.nan, share),
        "x": x,
        "y": y,
    }


def state_form(resolved: Resolved) -> Form:
    """The form of the states of a run."""
    return form_of(
        "states",
        resolved,
        heading=[name for count in heading_counts(resolved) for name in HEADINGS[count]],
        action=ACTION_NAMES,
        cause=[cause.name for cause in CAUSES],
    )


def heading_counts(resolved: Resolved) -> list[int]:
    """How many headings the types of robots distinguish, the most first."""
    return sorted({one.headings for one in resolved.fleet.types}, reverse=True)


def heading_texts(simulation: Simulation, at: Array) -> Array:
    """(k,) the places of the headings of some robots among the texts of `state_form`."""
    robots, before, places = simulation.world.robots, 0, np.full(len(at), NO_TEXT)
    apart = simulation.world.grid.type_headings[robots.type[at]]
    for count in heading_counts(simulation.resolved):
        if count > 1:
            places = np.where(apart == count, before + robots.heading[at], places)
        before += len(HEADINGS[count])
    return places


def state_rows_of(simulation: Simulation, robots: Array | None) -> Rows:
    """What each robot, or each of these, is like after the current tick of an observed run."""
    world, observation = simulation.world, simulation.observation
    identities = np.arange(len(world.robots.cell)) if robots is None else robots
    at = world.robots.at_index[identities]
    fleet, cause = world.robots, observation.cause[at]
    x, y = columns_and_rows(simulation.resolved.floor_plan, fleet.cell[at])
    is_idle = (fleet.parked[at] != 0) | (cause == CAUSE_NO_ORDER)
    waits = cause != CAUSE_NOT_WAITING
    load, order, blocker = fleet.load[at], fleet.order[at], observation.blocker[at]
    charge = fleet.charge[at] / BATTERY_FULL if world.rules.battery else np.full(len(at), np.nan)
    return {
        "tick": np.full(len(at), simulation.tick),
        "robot": identities,
        "x": x,
        "y": y,
        "heading": heading_texts(simulation, at),
        "action": np.where(is_idle, ACTION_IDLE, fleet.action[at]),
        "load": where(load != NIL, load),
        "order": where(order != NIL, order),
        "charge": charge,
        "cause": texts_where(waits, cause),
        "blocker": where(waits & (blocker != NIL), blocker),
    }
