"""Robots that only move, without strategies, by the kernel and by the naive rules alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
from reference_motion import Floor, Robot

from automaton.engine.faults import hand_delays_on
from automaton.engine.motion import ENTERED, LIVE, MOVED, move_all
from automaton.engine.state import ACTION_FOLLOWING, FOLLOWING_CONVOY, NIL
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.pictures.pictures import Following
from automaton.scenario.fleet import Delays, DelayTicks
from automaton.scenario.schema import Durations, Faults, Fleet, Scenario, WorldRules
from automaton.world.building import build_world
from automaton.world.resolved import Resolved


class Want(NamedTuple):
    """What a robot tries in a tick: a move of so many ticks. `entered`: it came out of its bay."""

    direction: int
    ticks: int
    priority: int = 0
    entered: bool = False


Wants = Mapping[int, Want]  # by identity
States = list[tuple[int, int, int]]  # of each robot: cell, claim, ticks still to go


class MovingWorld(Protocol):
    """A floor with robots in cells; robot k is the k-th of them."""

    floor_plan: FloorPlan

    def tick(self, number: int, wants: Wants) -> None:
        """Move the robots; what busy robots want counts for nothing."""

    def delay(self, number: int, delays: Mapping[int, int]) -> None:
        """Let delays begin in the tick to come; what stands is not concerned."""

    def states(self) -> States:
        """Where the robots are."""

    def lost(self) -> list[int]:
        """Ticks that each robot has lost behind others."""


class MakeWorld(Protocol):
    """How a world is made."""

    def __call__(
        self, floor_plan: FloorPlan, cells: tuple[int, ...], following: Following
    ) -> MovingWorld: ...


class NaiveWorld:
    """The rules as `reference_motion` has them."""

    def __init__(self, floor_plan: FloorPlan, cells: tuple[int, ...], following: Following) -> None:
        self.floor_plan = floor_plan
        self.floor = Floor(
            exits=floor_plan.exits.ravel().tolist(),
            capacity=floor_plan.capacity.ravel().tolist(),
            offset=floor_plan.offsets,
            following=following,
            robots={k: Robot(k, cell) for k, cell in enumerate(cells)},
        )

    def tick(self, number: int, wants: Wants) -> None:
        for identity, want in wants.items():
            self.floor.robots[identity].priority = want.priority
        entered = [identity for identity, want in wants.items() if want.entered]
        moves = {identity: (want.direction, want.ticks) for identity, want in wants.items()}
        self.floor.tick(number, moves, entered)

    def delay(self, number: int, delays: Mapping[int, int]) -> None:
        self.floor.delay(delays)

    def states(self) -> States:
        robots = (self.floor.robots[k] for k in range(len(self.floor.robots)))
        return [(r.cell, NIL if r.claim is None else r.claim, r.busy) for r in robots]

    def lost(self) -> list[int]:
        return [self.floor.robots[k].lost for k in range(len(self.floor.robots))]


class KernelWorld:
    """The world of runs, of which motion alone is called."""

    def __init__(self, floor_plan: FloorPlan, cells: tuple[int, ...], following: Following) -> None:
        self.floor_plan = floor_plan
        scenario = Scenario(
            name="moving",
            layout={},
            fleet=Fleet(robots=len(cells), kinematics="omni"),
            durations=Durations(move=2),  # where all moves take one tick there are no convoys
            world=WorldRules(following=following),
            faults=Faults(delays=Delays(probability=0.5, ticks=DelayTicks(least=1, most=9))),
        )
        resolved = Resolved(scenario, floor_plan, strategies={}, start=cells, source="")
        self.world = build_world(resolved, 1)[0]
        self._begun_behind = np.zeros(len(cells), np.int64)  # ticks lost as moves began

    def tick(self, number: int, wants: Wants) -> None:
        world = self.world
        robots, traffic = world.robots, world.traffic
        traffic.intent[:] = 0
        for identity, want in wants.items():
            i = robots.at_index[identity]
            robots.priority[i] = want.priority
            if robots.busy[i] == 0:
                traffic.intent[i] = LIVE | want.direction | (ENTERED if want.entered else 0)
                traffic.move_ticks[i] = want.ticks
        with np.errstate(over="ignore"):
            move_all(world.grid, world.rules, robots, traffic, number)
        if world.rules.following == FOLLOWING_CONVOY:
            lost = traffic.move_ticks.astype(np.int64) - traffic.own_ticks
            self._begun_behind += np.where(traffic.intent & MOVED, lost, 0)

    def delay(self, number: int, delays: Mapping[int, int]) -> None:
        world = self.world
        world.clock.tick = number
        for identity, ticks in delays.items():
            i = world.robots.at_index[identity]
            if world.robots.busy[i]:
                world.robots.busy[i] += ticks
                world.delays.until[identity] = number
        if world.rules.following == FOLLOWING_CONVOY:
            hand_delays_on(world)

    def states(self) -> States:
        robots = self.world.robots
        columns = (robots.cell, robots.claim, robots.busy)
        return list(zip(*(c[robots.at_index].tolist() for c in columns), strict=True))

    def lost(self) -> list[int]:
        handed_on = self.world.tally.ticks[:, ACTION_FOLLOWING].sum(axis=1)
        lost: list[int] = (self._begun_behind + handed_on)[self.world.robots.at_index].tolist()
        return lost


# Each world with the rules of following that it has.
WORLDS: tuple[tuple[MakeWorld, Following], ...] = (
    *((NaiveWorld, following) for following in ("none", "handover", "convoy")),
    *((KernelWorld, following) for following in ("none", "handover", "convoy")),
)


def drawn(
    make: MakeWorld, picture: str, following: Following = "convoy"
) -> tuple[MovingWorld, dict[str, int]]:
    """The world of a picture with robots A, B, ..., and their identities."""
    floor_plan = draw_floor(picture)
    names = sorted(symbol for symbol in picture if "A" <= symbol <= "Z")
    identities = {name: k for k, name in enumerate(names)}
    return make(floor_plan, floor_plan.starts, following), identities


def picture_of(world: MovingWorld) -> str:
    """Robots where they are, '*' where they claim a cell, '.' elsewhere."""
    plan = world.floor_plan
    symbols = ["#" if not drivable else "." for drivable in plan.drivable.ravel().tolist()]
    for _, claim, _ in world.states():
        if claim != NIL:
            symbols[claim] = "*"
    for k, (cell, _, _) in enumerate(world.states()):
        symbols[cell] = chr(ord("A") + k)
    rows = [symbols[y * plan.stride + 1 :][: plan.width] for y in range(1, plan.height + 1)]
    return "\n".join("".join(row) for row in rows)
