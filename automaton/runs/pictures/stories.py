"""Stories: a few robots on a tiny floor, moved tick by tick, to test the rules of occupancy.

    >>> moved("AB.", A="east", B="east")
    '.AB'

Robots are drawn on free floor and drive in any direction without turning; the other symbols of
floors work as always, so an aisle for two is 'A==B'. A Story goes on from tick to tick.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from automaton.engine.drive import count_robots, set_move_ticks
from automaton.engine.motion import LIVE, REFUSED, move_all
from automaton.engine.state import ACTION_MOVE, CLOCK_TICK
from automaton.errors import InputError, alternatives
from automaton.floor.cells import DIRECTIONS
from automaton.floor.drawn_floors import Legend, draw_floor
from automaton.runs.pictures.picture_writing import map_rows
from automaton.runs.pictures.robot_lines import identity_of, name_of
from automaton.scenario.schema import Durations, Fleet, Orders, Scenario, WorldRules
from automaton.world.building import build_world
from automaton.world.resolve import Resolved

Following = Literal["convoy", "handover", "none"]


class Story:
    """Robots drawn in a picture, and what becomes of their wishes.

    `following`, `move` (ticks of a move), `slow` (the mode of zones that slow moves down; "" for
    none), `priority` by robot, and `storage` (the order in which robots are stored, which must not
    matter) set the rules; `tick` decides ties.
    """

    def __init__(
        self,
        picture: str,
        *,
        following: Following = "convoy",
        move: int = 1,
        slow: str = "",
        priority: Mapping[str, int] | None = None,
        storage: Sequence[int] | None = None,
        legend: Legend = (),
        tick: int = 0,
    ) -> None:
        self.floor_plan = draw_floor(picture.strip("\n"), legend)
        if not self.floor_plan.starts:
            raise InputError("the picture of a story has no robots; draw them as A, B, C ...")
        order = None if storage is None else np.array(storage, np.int32)
        self.world, _ = build_world(_scenario(self, following, move, slow), 1, order)
        self.world.clock[CLOCK_TICK] = tick
        for name, value in (priority or {}).items():
            self.world.robots.priority[self._index(name)] = value

    def tick(self, **wants: str) -> str:
        """One tick in which robots want to move so (A="east"); returns the picture after it.

        Robots in a long move go on by themselves and want nothing.
        """
        traffic, robots = self.world.traffic, self.world.robots
        traffic.intent[:] = 0
        for name, direction in wants.items():
            if direction not in DIRECTIONS:
                raise InputError(
                    f"'{direction}' is not a direction; try {alternatives(DIRECTIONS)}"
                )
            i = self._index(name)
            if robots.busy[i]:
                raise InputError(f"robot {name} is still on its way")
            traffic.intent[i] = LIVE | DIRECTIONS.index(direction)
        traffic.move_ticks[:] = self.world.rules.duration[0, ACTION_MOVE]
        self.world.clock[CLOCK_TICK] += 1
        with np.errstate(over="ignore"):
            count_robots(self.world.grid, robots, traffic.zone_occupancy)
            set_move_ticks(self.world)
            move_all(
                self.world.grid, self.world.rules, robots, traffic, self.world.clock[CLOCK_TICK]
            )
        return self.picture

    @property
    def picture(self) -> str:
        """The floor and the robots now; '*' is claimed by a long move, '@' holds several robots."""
        return "\n".join(map_rows(self.world, self.floor_plan))

    @property
    def refused(self) -> str:
        """The robots whose wish was refused in the last tick, such as "BC"."""
        who = self.world.robots.identity[self.world.traffic.intent & REFUSED != 0]
        return "".join(name_of(identity) for identity in sorted(who.tolist()))

    def _index(self, name: str) -> int:
        if len(name) != 1 or not 0 <= identity_of(name) < len(self.floor_plan.starts):
            raise InputError(f"there is no robot {name} in this story")
        return int(self.world.robots.at_index[identity_of(name)])


def moved(picture: str, **wants: str) -> str:
    """The picture after one tick in which robots want to move so."""
    return Story(picture).tick(**wants)


def _scenario(story: Story, following: Following, move: int, slow: str) -> Resolved:
    floor_plan = story.floor_plan
    scenario = Scenario(
        name="story",
        layout={},
        fleet=Fleet(robots=len(floor_plan.starts), kinematics="omni"),
        durations=Durations(move=move),
        orders=Orders(generator="full-shelves"),
        world=WorldRules(
            following=following,
            traffic_zones=slow or "undirected",  # type: ignore[arg-type]
            slowdown="zones" if slow else "none",
        ),
    )
    return Resolved(scenario, floor_plan, strategies={}, start=floor_plan.starts, source="")
