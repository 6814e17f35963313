"""States of robots, orders and trips: a word for each, and a phrase if the word is too short.

Text pictures, explanations, tables, films and the viewer take their words from here, so that each state
has one name. The states are those of docs/explanation/robot-states.md. Words and phrases follow "the
robot is": "picking", "picking up load 7". The causes of `automaton.engine.observation` name the reasons
for which robots wait. Importing this needs neither Numba nor Textual.
"""

from __future__ import annotations

from enum import IntEnum
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.engine import observation
from automaton.engine import state as codes
from automaton.engine.robot_states import is_charging, is_queueing
from automaton.engine.state import Array
from automaton.floor.floor_plan import DIRECTIONS


class RobotState(IntEnum):
    """The state of a robot, in the sort order of a table of robots.

    Its task says what a robot drives for. Its motion says whether a waiting robot is stuck, halted or
    held back, and its cause says why.
    """

    IDLE = 0
    DRIVING = 1
    TURNING = 2
    PICKING = 3
    DROPPING = 4
    TRYING = 5
    AT_STOP = 6
    CHARGING = 7
    WAITING = 8
    QUEUEING = 9
    PARKED = 10
    DOWN = 11  # on the floor
    TOWED = 12
    GONE = 13


STATE_WORDS: Final = tuple(state.name.lower().replace("_", " ") for state in RobotState)
ROBOT_PHRASES: Final = {  # phrases for words that are too short in a sentence
    RobotState.PICKING: "picking up",
    RobotState.TRYING: "trying to drop",
    RobotState.AT_STOP: "at its stop",
}
# Conditions of a robot, by STATUS_*.
CONDITION_WORDS: Final = (
    *("running", "failing", "exhausted"),
    *(
        observation.CAUSES[code].name
        for code in (observation.CAUSE_NO_ENERGY, observation.CAUSE_FAULT)
    ),
    *(STATE_WORDS[state] for state in (RobotState.TOWED, RobotState.GONE)),
)
IN_WAIT_CYCLE: Final = "in a wait cycle"
IS_DOWN: Final = "down"
# Colours in which robots are drawn, by their names in the palette.
COLOUR_WORDS: Final = {
    "parked": "parked",
    "idle": "idle: without an order",
    "charging": "charging",
    "empty": "without a load",
    "loaded": "with a load",
    "low battery": "battery below 20 %",
    "waiting": "waiting",
    "fault": f"{IN_WAIT_CYCLE}, or {IS_DOWN}",
}


def phrase_of(state: RobotState) -> str:
    """Return the phrase of a state of a robot, or its word if it has none."""
    return ROBOT_PHRASES.get(state, STATE_WORDS[state])


class ActionPhrases(NamedTuple):
    """The words for an action, and the state of a robot with it if no other condition holds."""

    state: RobotState
    past: str  # when it is over
    longer: str = ""  # while it lasts, if more exact than the phrase of the state

    @property
    def present(self) -> str:
        """The phrase while the action lasts."""
        return self.longer or phrase_of(self.state)


ACTION_PHRASES: Final = (  # by ACTION_*
    ActionPhrases(RobotState.IDLE, "was idle"),
    ActionPhrases(RobotState.DRIVING, "drove"),
    ActionPhrases(RobotState.TURNING, "turned"),
    ActionPhrases(RobotState.PICKING, "picked up"),
    ActionPhrases(RobotState.DROPPING, "dropped"),
    ActionPhrases(RobotState.TRYING, "tried to drop"),
    ActionPhrases(RobotState.WAITING, "waited"),
    ActionPhrases(RobotState.IDLE, "charged", STATE_WORDS[RobotState.CHARGING]),
    ActionPhrases(RobotState.WAITING, "was blocked", "blocked"),
    ActionPhrases(RobotState.WAITING, "decided to retreat", "deciding to retreat"),
    ActionPhrases(RobotState.WAITING, "waited in its parking bay", "waiting in its parking bay"),
    ActionPhrases(
        RobotState.WAITING,
        "lost a tick to an illegal decision",
        "losing ticks to an illegal decision",
    ),
    ActionPhrases(RobotState.QUEUEING, "queued before a charger", "queueing before a charger"),
    ActionPhrases(RobotState.DOWN, "was down"),
    ActionPhrases(RobotState.WAITING, "was held back", "held back"),
    ActionPhrases(RobotState.AT_STOP, "was at its stop"),
    ActionPhrases(RobotState.QUEUEING, "queued before a station", "queueing before a station"),
    ActionPhrases(RobotState.WAITING, "was delayed", "delayed"),
    ActionPhrases(RobotState.WAITING, "waited at a gate", "waiting at a gate"),
    ActionPhrases(RobotState.DRIVING, "followed", "following"),
)
STATE_OF_ACTION: Final = np.array([phrases.state for phrases in ACTION_PHRASES])
READ_FIELDS: Final = (
    *("status", "parked", "cause", "action", "goal_type", "goal_cell", "cell", "claim", "ticket"),
)


def robot_states(robots: Any) -> Array:
    """Return (n,) int64: the RobotState of each robot. The first condition that holds decides.

    `robots` has the fields of the world's robots, and `cause` of the observation.
    """
    conditions = (
        (robots.status == codes.STATUS_REMOVED, RobotState.GONE),
        (robots.status == codes.STATUS_TOWED, RobotState.TOWED),
        (robots.status >= codes.STATUS_DEPLETED, RobotState.DOWN),
        (is_charging(robots), RobotState.CHARGING),
        (
            is_queueing(robots) | (robots.cause == observation.CAUSE_STATION_QUEUE),
            RobotState.QUEUEING,
        ),
        (observation.is_waiting(robots.cause), RobotState.WAITING),
        (robots.parked != 0, RobotState.PARKED),
        (robots.cause == observation.CAUSE_NO_ORDER, RobotState.IDLE),
    )
    out: Array = np.select(
        [holds for holds, _ in conditions],
        [int(state) for _, state in conditions],
        STATE_OF_ACTION[robots.action],
    )
    return out


def robot_state(robots: Any, robot: int) -> RobotState:
    """Return the state of one robot of a snapshot."""
    one = {name: getattr(robots, name)[robot : robot + 1] for name in READ_FIELDS}
    return RobotState(int(robot_states(SimpleNamespace(**one))[0]))


def robot_word(robots: Any, robot: int) -> str:
    """Return the word for the action of a robot."""
    return STATE_WORDS[robot_state(robots, robot)]


def cause_name(robots: Any, robot: int) -> str:
    """Return the name of the cause for which a robot waits, or ""."""
    cause = int(robots.cause[robot])
    return "" if cause == observation.CAUSE_NOT_WAITING else observation.CAUSES[cause].name


def with_cause(words: str, robots: Any, robot: int) -> str:
    """Add the cause for which a robot waits to words about it."""
    cause = cause_name(robots, robot)
    circle = ", in a wait cycle" if robots.wait_cycle_ticks[robot] else ""
    return f"{words}: {cause}{circle}" if cause else words


# Orders and trips.


ORDER_WORDS: Final = {
    codes.ORDER_WAITING: "waiting",
    codes.ORDER_CARRIED: "carried",
    codes.ORDER_STARTED: "under way",  # no load to be carried
    codes.ORDER_DELIVERED: "delivered",
    codes.ORDER_UNRELEASED: "not released",
}
DONE_WORD: Final = "done"  # for an order without a load, and for a trip: its pod is stored again


def order_word(state: int, delivers: bool = True) -> str:
    """Return the word for the state of an order; `delivers`: it delivers a load and is not a trip."""
    return DONE_WORD if state == codes.ORDER_DELIVERED and not delivers else ORDER_WORDS[state]


# Headings, by the number that a type of robots distinguishes.
HEADING_WORDS: Final = {1: ("",), 2: ("east-west", "north-south"), 4: DIRECTIONS}
