"""What each robot looks like in a drawing: the state that gives it its colour, its shape, its front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.engine.robot_states import (
    BATTERY_PERCENT,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_TOWED,
    is_charging,
)
from automaton.engine.state import NIL

# States of a robot, the worse the higher.
DRAW_PARKED: Final = 0
DRAW_CHARGING: Final = 1
DRAW_EMPTY: Final = 2
DRAW_LOADED: Final = 3
DRAW_LOW_BATTERY: Final = 4
DRAW_WAITING: Final = 5
DRAW_FAULT: Final = 6  # in a wait cycle, or down
STATE_COLOURS: Final = (
    *("parked", "charging", "empty", "loaded", "low battery", "waiting", "fault"),
)
STATE_WORDS: Final = (
    *("parked", "charging", "without a load", "with a load", "battery low"),
    *("waiting", "in a wait cycle, or down"),
)

# Shapes of a robot.
SHAPE_HOLLOW: Final = 0
SHAPE_FILLED: Final = 1  # with a load
SHAPE_SQUARE: Final = 2  # parked
SHAPE_PLUG: Final = 3  # charges
SHAPE_VOID: Final = 4  # its battery is empty
SHAPE_CROSS: Final = 5  # broken
SHAPE_THIN: Final = 6  # its battery is low
SHAPE_BOXED: Final = 7  # its battery is low, with a load
WITH_LOAD: Final = (SHAPE_FILLED, SHAPE_BOXED)
LOW_CHARGE: Final = 20 * BATTERY_PERCENT


class RobotLooks(NamedTuple):
    """All (n,) uint8."""

    state: NDArray[np.uint8]
    shape: NDArray[np.uint8]
    direction: NDArray[np.uint8]  # 0 to 3: the way it faces or drives


def robot_looks(
    robots: Any, headings: Sequence[int], battery: bool, may_be_down: bool
) -> RobotLooks:
    """Read them off the fields of the robots, and `cause` and `wait_cycle_ticks` of the observation.

    `robots`: an object with these arrays, (n,) each; `headings`: that robots of each type distinguish;
    `battery`: robots run on batteries; `may_be_down`: they may stand on the floor for good.
    """
    loaded, parked = robots.load != NIL, robots.parked != 0
    state = np.where(loaded, np.uint8(DRAW_LOADED), np.uint8(DRAW_EMPTY))
    state[robots.cause != 0] = DRAW_WAITING
    state[parked] = DRAW_PARKED
    state[robots.wait_cycle_ticks != 0] = DRAW_FAULT
    shape = loaded.astype(np.uint8)
    shape[parked] = SHAPE_SQUARE
    if battery:
        plugged = is_charging(robots)
        state[plugged], shape[plugged] = DRAW_CHARGING, SHAPE_PLUG
        low = (robots.charge < LOW_CHARGE) & ~plugged
        state[low] = np.maximum(state[low], DRAW_LOW_BATTERY)
        shape[low] = np.where(loaded[low], SHAPE_BOXED, SHAPE_THIN)
    if battery or may_be_down:
        for code, sign in ((STATUS_DEPLETED, SHAPE_VOID), (STATUS_FAILED, SHAPE_CROSS)):
            state[robots.status == code], shape[robots.status == code] = DRAW_FAULT, sign
        towed = robots.status >= STATUS_TOWED  # it shows in a parking bay alone
        state[towed], shape[towed] = DRAW_PARKED, SHAPE_CROSS
    return RobotLooks(state, shape, directions(robots, headings))


def cell_of(robots: Any) -> NDArray[np.int32]:
    """(n,) the cell in which each robot is drawn, that of its parking bay if it is there; or NIL."""
    return np.asarray(np.where(robots.cell == NIL, robots.bay, robots.cell), np.int32)


def directions(robots: Any, headings: Sequence[int]) -> NDArray[np.uint8]:
    """(n,) 0 to 3: the way each robot faces or, if its heading does not say, drives.

    `headings`: that robots of each type distinguish.
    """
    own = np.array(headings)[robots.type % len(headings)]  # types with a load come behind
    # On rails: the way it came, or its new axis once it has turned. An omni robot: the way it came.
    came = (own == 1) | ((own == 2) & (robots.travel & 1 == robots.heading))
    return np.asarray(np.where(came, robots.travel & 3, robots.heading & 3), np.uint8)
