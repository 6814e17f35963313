"""Slow zones: how long a move takes depends on who is in the zone when it starts, and on nothing else."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures
from random_strategies import Mood

from automaton.engine.observation import CAUSE_REDUCED_SPEED
from automaton.engine.record_codes import ACTION_MASK, LEFT_PARKING_BAY, MOVE_NORTH
from automaton.engine.state import ACTION_MOVE, NIL
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.traffic_zones import ZONE_MODES, TrafficZones, traffic_zones_of
from automaton.history.event_history import EventHistory
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import metrics_of
from automaton.runs.pictures import Story
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Durations, Fleet, Scenario, Stop, WorldRules
from automaton.strategy.lookup import NoParameters
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve
from automaton.world.resolved import Resolved, StrategyChoice


def rows(*lines: str) -> str:
    return "\n".join(lines)


# C stands on the only intersection; the rest of its row is one zone on either side of it.
CORNER = rows("#.########", ".C..A..B..")


def test_a_robot_alone_in_its_zone_moves_as_always() -> None:
    assert Story("A..", slow="undirected").tick(A="east") == ".A."


def test_two_robots_in_a_zone_take_two_ticks_a_third_three_and_the_others_keep_theirs() -> None:
    story = Story(CORNER, slow="undirected")
    assert story.tick(A="east", B="east", C="east") == rows("#.########", "..C.A*.B*.")
    assert story.tick(C="east") == rows("#.########", "..C*.A..B."), "C found three robots there"
    assert story.tick() == rows("#.########", "..C*.A..B.")
    assert story.tick() == rows("#.########", "...C.A..B.")


def test_who_leaves_a_zone_counts_until_it_has_arrived() -> None:
    story = Story(rows("#.#####", "..A.B.C"), slow="undirected")
    assert story.tick(A="west") == rows("#.#####", ".*A.B.C"), "three robots"
    assert story.tick(B="west") == rows("#.#####", ".*A*B.C"), "and still three"
    assert story.tick() == rows("#.#####", ".A.*B.C")
    assert story.tick() == rows("#.#####", ".A.B..C")
    assert story.tick(B="west") == rows("#.#####", ".A*B..C"), "two: A is on the intersection"
    assert story.tick() == rows("#.#####", ".AB...C")


def test_intersections_slow_nobody_down() -> None:
    """A and B share the intersection; the arms around it hold one robot each."""
    story = Story(rows("#A###", "B~..C"), slow="undirected")
    assert story.tick(A="south", B="east") == rows("#.###", ".@..C")
    assert story.tick(A="north") == rows("#A###", ".B..C")
    assert story.tick(B="east") == rows("#A###", ".~B.C")
    assert story.tick(B="west") == rows("#A###", ".*B.C"), "C is in its zone, too"


def test_lanes_count_the_robots_that_travel_their_way() -> None:
    """All of a row came from the west or stand so at the start."""
    both = Story("A..B..C", slow="undirected")
    assert both.tick(B="west") == "A.*B..C", "three ticks"
    lanes = Story("A..B..C", slow="directed")
    assert lanes.tick(B="west") == "A.B...C", "nobody else goes west"
    assert lanes.tick(A="east") == "A*B...C", "C looks east, too"
    assert lanes.tick(B="west", C="west") == ".AB..*C", "B has turned round; A went east"


def test_an_intersection_can_be_a_zone_of_its_own() -> None:
    story = Story(rows("#A###", "B~..C"), slow="with-intersections")
    assert story.tick(A="south", B="east") == rows("#.###", ".@..C")
    assert story.tick(A="north") == rows("#*###", ".@..C"), "two ticks: B is there, too"
    assert story.tick() == rows("#A###", ".B..C")


def test_the_length_of_a_move_cannot_be_stored_beyond_its_limit() -> None:
    story = Story("A.B", slow="undirected", move=10_000)
    story.tick(A="east")
    assert story.world.robots.busy[0] == 19_999
    crowd = Story("ABCDEFGHIJ.", slow="undirected", move=10_000)
    crowd.tick(J="east")
    assert crowd.world.robots.busy[9] == 65_534


# Whole runs: robots that step about at random, counted a second time here.


@dataclass(frozen=True)
class Case:
    """A world whose robots do anything."""

    resolved: Resolved
    traffic_zones: TrafficZones


TICKS = 24
SYMBOLS = "....~~~===><v^-|+#"
FLOORS = (
    "~~==..~~",
    "#~##~#\n~~~~~~",
    ".=~.\n#.#.\n~==~",
    "....\n.##.\n....",
    "~~~~~~~",
    "b...\nb.#.\n ~==",
    "#~#\n~~~\n#~#",
)
PICKS = {"right_of_way": "RandomRightOfWay", "allocation": "RandomAllocation"}


@st.composite
def cases(draw: Any) -> Case:
    if draw(st.booleans()):
        picture = draw(st.sampled_from(FLOORS))
    else:
        picture = draw(pictures(SYMBOLS, draw(st.integers(3, 6)), draw(st.integers(1, 3))))
    width = picture.index("\n") if "\n" in picture else len(picture)
    floor_plan = draw_floor(f"{picture}\n{('sd' * width)[:width]}\n{'.' * width}")
    cells = draw(st.permutations(np.flatnonzero(floor_plan.drivable).tolist()))
    bays = len(floor_plan.bays)
    n = bays or min(len(cells), draw(st.integers(2, 9)))
    rules = WorldRules(
        following=draw(st.sampled_from(["convoy", "handover", "none"])),
        traffic_zones=draw(st.sampled_from(ZONE_MODES)),
        slowdown="zones",
        extra_tick_probability=draw(st.sampled_from([0.0, 0.0, 0.25, 1.0])),
    )
    scenario = Scenario(
        name="case",
        layout={},
        fleet=Fleet(robots=n, kinematics=draw(st.sampled_from(["rail", "differential", "omni"]))),
        durations=Durations(move=draw(st.integers(1, 2)), pick=draw(st.integers(0, 1)), drop=0),
        world=rules,
        stop=Stop(when="never", max_duration=TICKS),
        seed=draw(st.integers(0, 2**32)),
    )
    picks = {layer: StrategyChoice("none", NoParameters()) for layer in ("zoning", "charging")}
    picks["routing"] = StrategyChoice("shortest", NoParameters())
    for layer, name in PICKS.items():
        mood = Mood(draw(st.integers(0, 2**32)), active=draw(st.sampled_from([128, 230])))
        picks[layer] = StrategyChoice(f"random_strategies:{name}", mood)
    start: Any = "parking-bays" if bays else tuple(cells[:n])
    return Case(
        Resolved(scenario, floor_plan, picks, start, ""),
        traffic_zones_of(floor_plan, rules.traffic_zones),
    )


@dataclass
class Move:
    """A move under way, as it must go on."""

    start: int
    to: int
    ends: int
    zone: int  # that slows it, or NIL


class Watcher:
    """Looks at a run after every tick: each move takes what its zone held when it began."""

    def __init__(self, case: Case) -> None:
        self.traffic_zones, self.world_rules = case.traffic_zones, case.resolved.scenario.world
        self.move = case.resolved.scenario.durations.move
        self.recorder = MemoryRecorder(case.resolved)
        self.run = Simulation(case.resolved, on_record=self.recorder, on_observe=EventHistory())
        self.moves: dict[int, Move] = {}
        self.held: set[int] = set()  # robots in the zones that moves began in
        self.lost: Counter[int] = Counter()  # ticks beyond the duration, by robot
        self.lost_in: Counter[int] = Counter()  # and by the zone that slows
        self.free = 0  # moves off an intersection with others on it

    def tick(self) -> None:
        robots = self.run.world.robots
        before = robots.cell.copy(), robots.travel.copy()
        self.run.run(self.run.tick + 1)
        for i, did in enumerate(robots.executed.tolist()):
            if 0 < did & ACTION_MASK <= MOVE_NORTH:
                assert i not in self.moves, "it was still on its way"
                self.begin(i, did, *before)
        for i, move in self.moves.items():
            if self.run.tick <= move.ends - self.move:
                self.lost[i] += 1
                self.lost_in[move.zone] += 1
        observation = self.run.observation
        assert observation.lost[:, CAUSE_REDUCED_SPEED].tolist() == [
            self.lost[i] for i in range(len(robots.executed))
        ]
        assert observation.lost_in_zone.tolist() == [
            self.lost_in[z] for z in range(self.traffic_zones.count)
        ]
        for i, move in list(self.moves.items()):
            if self.run.tick < move.ends:
                assert (robots.cell[i], robots.claim[i]) == (move.start, move.to)
            else:
                assert robots.claim[i] == self.run.observation.slow_zone[i] == NIL
                assert robots.cell[i] in (move.to, NIL if robots.parked[i] else move.to)
                del self.moves[i]

    def begin(self, i: int, did: int, cell: Any, travel: Any) -> None:
        direction, world = (did & ACTION_MASK) - 1, self.run.world
        start = int(world.robots.home[i] if did & LEFT_PARKING_BAY else cell[i])
        zone = self.traffic_zones.of[start, direction >> 1]
        held = np.where(cell == NIL, NIL, self.traffic_zones.of[cell, travel >> 1])
        others = int((np.delete(held, i) == zone).sum()) if zone != NIL else 0
        span = int(world.robots.busy[i]) + 1
        extra = span - (1 + others) * self.move
        assert extra in {0.0: (0,), 1.0: (1,)}.get(self.world_rules.extra_tick_probability, (0, 1))
        to = start + int(world.grid.offset[direction])
        slows = zone if others > 0 else NIL
        self.moves[i] = Move(start, to, self.run.tick + span - 1, slows)
        self.held.add(1 + others)
        observation, slowed = self.run.observation, others > 0
        assert observation.slow_zone[i] == (zone if slowed else NIL)
        assert not slowed or observation.slow_zone_occupancy[i] == 1 + others
        self.free += zone == NIL and int((cell == start).sum()) > 1


def test_a_move_takes_what_its_zone_held_when_it_began() -> None:
    held: set[tuple[str, int]] = set()
    free = 0

    @settings(max_examples=examples(100))
    @given(cases())
    def check(case: Case) -> None:
        nonlocal free
        watcher = Watcher(case)
        for _ in range(TICKS):
            watcher.tick()
        held.update((case.traffic_zones.mode, robots) for robots in watcher.held)
        free += watcher.free
        violations = validate_stored(watcher.recorder.recording()).violations
        assert [str(violation) for violation in violations] == []

    check()
    assert held >= {(mode, robots) for mode in ZONE_MODES for robots in (1, 2, 3)}
    assert free, "nobody left an intersection that held others"


def test_extra_ticks_come_as_often_as_they_should() -> None:
    settings = ("world.extra_tick_probability=0.3", "stop.max_duration=4000")
    extra = moves = 0
    for seed in (1, 2, 3):
        run = Simulation(resolve("crossing", settings), seed)
        run.run()
        tally = run.world.tally
        moves += int(tally.operations[:, ACTION_MOVE].sum())
        extra += int(tally.slowdown_ticks.sum())
        assert int(tally.ticks[:, ACTION_MOVE].sum()) == int(
            tally.operations[:, ACTION_MOVE].sum() + tally.slowdown_ticks.sum()
        )
    deviation = (moves * 0.3 * 0.7) ** 0.5
    assert moves > 1000
    assert abs(extra - 0.3 * moves) < 4 * deviation


@pytest.mark.parametrize("name", ["tabletop-1", "crossing"])
def test_a_fleet_delivers_everything_in_slow_zones(name: str) -> None:
    slow = Simulation(resolve(name, ("world.slowdown=zones", "world.extra_tick_probability=0.1")))
    slow.run()
    quick = Simulation(resolve(name))
    quick.run()
    assert slow.finished and slow.tick > quick.tick
    assert metrics_of(slow)["slowdown_ticks"] > 0
    assert "slowdown_ticks" not in metrics_of(quick) and not quick.world.tally.slowdown_ticks.any()


def test_slow_zones_cost_nothing_where_nobody_meets() -> None:
    plain = resolve("crossing", ("fleet.robots=1",))
    slow = resolve("crossing", ("fleet.robots=1", "world.slowdown=zones"))
    ends = []
    for resolved in (plain, slow):
        run = Simulation(resolved)
        run.run()
        ends.append((run.tick, run.digest))
    assert ends[0] == ends[1]
