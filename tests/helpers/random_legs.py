"""Random floors, and a leg on each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st
from random_floors import pictures
from reference_paths import HEADINGS, Pose, Ways

from automaton.engine.state import ACTION_COUNT, ACTION_MOVE, ACTION_TURN, Array
from automaton.floor.drawn_floors import draw_floor
from automaton.scenario.robot_types import RobotType
from automaton.scenario.schema import Durations
from automaton.world.prepared_floor import PreparedFloor, floor_for
from strategies.routing.astar import RouteSpace, route_space

SYMBOLS = ".......++--||==~><v^##"


class Case(NamedTuple):
    """A floor and a leg on it."""

    ways: Ways
    start: Pose
    target: int
    mode: str = "undirected"
    beside: str | None = None  # kinematics of another type of robots on the floor

    def built(self) -> tuple[PreparedFloor, Array, RouteSpace]:
        ways = self.ways
        durations = Durations(move=ways.move, turn=ways.turn)
        types = tuple(RobotType(durations=durations, kinematics=one) for one in self.kinematics)  # type: ignore[arg-type]
        floor = floor_for(ways.floor_plan, self.mode, types)
        duration = np.ones(ACTION_COUNT, np.int32)
        duration[ACTION_MOVE], duration[ACTION_TURN] = ways.move, ways.turn
        return (
            floor,
            duration,
            route_space(floor.grid),
        )

    @property
    def kinematics(self) -> list[str]:
        """Of each type; the leg is one of the first."""
        return [self.ways.kinematics, *([self.beside] if self.beside else [])]

    def start_pose(self) -> int:
        return self.start[0] * max(HEADINGS[one] for one in self.kinematics) + self.start[1]


@st.composite
def cases(draw: Any) -> Case:
    width = draw(st.integers(1, 6))
    lines = draw(pictures(SYMBOLS, width, draw(st.integers(1, 6)))).split("\n")
    if all(set(line) == {"#"} for line in lines):
        lines.append("." * width)
    ways = Ways(
        floor_plan=draw_floor("\n".join(lines)),
        kinematics=draw(st.sampled_from(["rail", "differential", "omni"])),
        move=draw(st.integers(1, 3)),
        turn=draw(st.sampled_from([0, 1, 2, 5])),
    )
    cells = ways.cells()
    start = (draw(st.sampled_from(cells)), draw(st.integers(0, ways.headings - 1)))
    mode = draw(st.sampled_from(["undirected", "directed", "with-intersections"]))
    beside = draw(st.sampled_from([None, *HEADINGS]))
    return Case(ways, start, draw(st.sampled_from(cells)), mode, beside)
