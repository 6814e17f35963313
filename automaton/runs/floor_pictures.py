"""The picture of a run as it stands: its floor and robots, and a line below."""

from __future__ import annotations

from typing import Any

from automaton.drawings.floor_picture import FloorPicture
from automaton.drawings.moment import drawn_floor, moment_of
from automaton.drawings.palette import THEMES, Theme
from automaton.engine.state import NIL
from automaton.errors import InputError, alternatives
from automaton.runs.asked_orders import asked_count, done_count
from automaton.units import count
from automaton.world.resolve import Resolved


def floor_picture(
    resolved: Resolved, world: Any, observation: Any, theme: Theme, follow: int
) -> FloorPicture:
    """The picture of a world; `follow`: the robot that is marked, or NIL. Raises InputError."""
    robots = resolved.scenario.fleet.robots
    if theme not in THEMES:
        raise InputError(f"unknown theme {theme!r}: allowed are {alternatives(THEMES)}")
    if not NIL <= follow < robots:
        raise InputError(f"there is no robot {follow}: the last one is robot {robots - 1}")
    floor = drawn_floor(resolved)
    moment = moment_of(floor, world, observation)
    done, asked = done_count(world.orders, world.lines), asked_count(world)
    caption = (
        f"{resolved.scenario.name}, {count(robots, 'robot')}: tick {moment.tick:,}, "
        f"{done:,} of {count(asked, 'order')} done"
    )
    return FloorPicture(floor, moment, caption, theme, follow)
