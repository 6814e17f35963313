"""On random floors the kernel moves robots exactly as the rules say, however they are stored.

Every case drives a fleet for some ticks with random wants, once with the contest of a crowded floor
and once with the hash table, and compares each tick with `reference_motion`.
"""

from __future__ import annotations

import inspect
from collections import Counter
from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures
from reference_motion import Floor, Robot, splitmix64, tie_break_hash

from automaton.engine import motion, random_numbers
from automaton.engine.motion import (
    CLAIM_BITS,
    ENTERED,
    INTENT_STATE,
    LIVE,
    MOVED,
    REFUSED,
    move_all,
    occupy,
    vacate,
)
from automaton.engine.state import NIL, World
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import DRIVABLE, EAST, WEST, FloorPlan
from automaton.runs.pictures.pictures import Following
from automaton.scenario.schema import Durations, Fleet, Scenario, WorldRules
from automaton.world import building as build
from automaton.world.resolved import Resolved

CROWDED, SPARSE = 10**9, 0  # values of build.CROWDED that choose the contest

ALL_ROOM = 32 | 64  # bits of traffic.occupancy: room for travel E or S, and W or N

# An exit in four, a capacity in three: crossings, one-way loops, aisles, walls.
SYMBOLS = ".......===~~><v^#"


FOLLOWING: Final[tuple[Following, ...]] = ("none", "handover", "convoy")


@dataclass(frozen=True)
class Case:
    """A floor, a fleet on it, and what robots want in every tick."""

    floor_plan: FloorPlan
    cells: tuple[int, ...]  # of robots, by identity
    following: Following
    storage: tuple[int, ...]
    first_tick: int
    ticks: tuple[tuple[int, ...], ...]  # per tick and robot one byte, read by `wish`


def wish(byte: int) -> tuple[int, int, int, bool] | None:
    """(direction, ticks, priority, came out of a parking bay) of a byte; None: it stands."""
    if byte % 8 == 7:
        return None
    spans = (1, 1, 1, 2, 1, 5, 1, 3)
    return byte & 3, spans[byte >> 3 & 7], (byte >> 6) - 1, byte % 61 == 60


@st.composite
def cases(draw: Any) -> Case:
    width = draw(st.sampled_from([5, 4, 3, 2, 1]))
    height = draw(st.sampled_from([4, 3, 2, 1]))
    picture = draw(pictures(SYMBOLS, width, height))
    if not set(picture) - set("#\n"):
        picture = picture.replace("#", ".")
    floor_plan = draw_floor(picture)
    drivable = np.flatnonzero(floor_plan.drivable).tolist()
    shuffled = draw(st.permutations(drivable))
    cells = shuffled[: draw(st.sampled_from(range(len(drivable), 0, -1)))]
    # Cells without limit may hold several robots from the start.
    crowd = [cell for cell in cells if floor_plan.capacity.flat[cell] == 0]
    cells += crowd[: draw(st.integers(0, 2))]
    n = len(cells)
    seed, ticks = draw(st.integers(0, 2**40)), draw(st.sampled_from([12, 6, 3]))
    return Case(
        floor_plan=floor_plan,
        cells=tuple(cells),
        following=draw(st.sampled_from(FOLLOWING)),
        storage=tuple(draw(st.permutations(range(n)))),
        first_tick=draw(st.integers(0, 2**31)),
        ticks=tuple(
            tuple(splitmix64(seed + n * number + robot) & 255 for robot in range(n))
            for number in range(ticks)
        ),
    )


def built(case: Case, storage: tuple[int, ...] | None) -> World:
    scenario = Scenario(
        name="case",
        layout={},
        fleet=Fleet(robots=len(case.cells), kinematics="omni"),
        durations=Durations(move=2),  # where all moves take one tick there are no convoys
        world=WorldRules(following=case.following),
    )
    resolved = Resolved(scenario, case.floor_plan, strategies={}, start=case.cells, source="")
    order = None if storage is None else np.array(storage, np.int32)
    return build.build_world(resolved, 1, order)[0]


def tick(world: World, number: int, wishes: tuple[int, ...]) -> tuple[set[int], set[int]]:
    """One tick of the kernel; returns the identities of those who moved, and who were refused."""
    robots, traffic = world.robots, world.traffic
    traffic.intent[:] = 0
    for identity, byte in enumerate(wishes):
        i, wanted = robots.at_index[identity], wish(byte)
        if wanted is not None and robots.busy[i] == 0:
            direction, traffic.move_ticks[i], robots.priority[i], entered = wanted
            traffic.intent[i] = LIVE | direction | (ENTERED if entered else 0)
    with np.errstate(over="ignore"):
        move_all(world.grid, world.rules, robots, traffic, number)
    who = robots.identity
    done = traffic.intent & LIVE != 0
    moved, refused = (done & (traffic.intent & bit != 0) for bit in (MOVED, REFUSED))
    return set(who[moved].tolist()), set(who[refused].tolist())


def naive(case: Case) -> Floor:
    floor_plan = case.floor_plan
    floor = Floor(
        exits=floor_plan.exits.ravel().tolist(),
        capacity=floor_plan.capacity.ravel().tolist(),
        offset=(1, floor_plan.stride, -1, -floor_plan.stride),
        following=case.following,
    )
    floor.robots = {i: Robot(i, cell) for i, cell in enumerate(case.cells)}
    return floor


def naive_tick(floor: Floor, number: int, wishes: tuple[int, ...]) -> tuple[set[int], set[int]]:
    wants, entered = {}, []
    for identity, byte in enumerate(wishes):
        wanted = wish(byte)
        if wanted is not None and floor.robots[identity].busy == 0:
            direction, span, floor.robots[identity].priority, is_new = wanted
            wants[identity] = (direction, span)
            entered += [identity] if is_new else []
    return floor.tick(number, wants, entered)


def assert_equal_states(world: World, floor: Floor) -> None:
    """Positions, long moves, and the room that is left in every cell."""
    by_identity = world.robots.at_index
    for name in ("cell", "claim", "busy"):
        nothing = NIL if name == "claim" else 0
        mine = [getattr(r, name) for _, r in sorted(floor.robots.items())]
        expected = [nothing if value is None else value for value in mine]
        assert getattr(world.robots, name)[by_identity].tolist() == expected, name
    room = [ALL_ROOM for _ in floor.capacity]
    for cell, kind in enumerate(world.grid.kind.tolist()):
        room[cell] *= bool(DRIVABLE[kind])
    for robot in floor.robots.values():
        for cell, direction in floor.holds(robot):
            bit = {0: 0, 1: ALL_ROOM, 2: 32 << (direction >> 1)}[floor.capacity[cell]]
            assert room[cell] & bit == bit, "a cell is held twice"
            room[cell] -= bit
    assert (world.traffic.occupancy & ALL_ROOM).tolist() == room
    assert not (world.traffic.occupancy & CLAIM_BITS).any(), "claims are left from this tick"
    assert (world.traffic.contest == NIL).all(), "the contest is not cleared"


def test_the_kernel_finds_the_greatest_set_of_moves() -> None:
    """The contest of a crowded floor and the hash table, one of them with robots in another order."""
    reached: dict[bool, Counter[str]] = {True: Counter(), False: Counter()}
    met = 0

    @settings(max_examples=600)
    @given(cases())
    def check(case: Case) -> None:
        nonlocal met
        floor = naive(case)
        worlds = []
        for crowded in (True, False):
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(build, "CROWDED", CROWDED if crowded else SPARSE)
                storage = case.storage if crowded == bool(case.first_tick % 2) else None
                worlds.append((crowded, built(case, storage)))
        assert all((world.traffic.key.size == 0) == crowded for crowded, world in worlds)
        for number, wishes in enumerate(case.ticks, case.first_tick):
            moved, refused = expected = naive_tick(floor, number, wishes)
            for crowded, world in worlds:
                assert tick(world, number, wishes) == expected
                assert_equal_states(world, floor)
                # Rows of the contest are written only for intents that the two passes left open.
                open_rows = np.count_nonzero(world.traffic.pending[:, INTENT_STATE])
                world.traffic.pending[:] = 0
                reached[crowded].update(moved=len(moved), refused=len(refused), contested=open_rows)
        met += floor.met

    check()
    assert met > 10
    for counts in reached.values():
        assert len(counts) == 3 and min(counts.values()) > 1500, reached


@pytest.mark.parametrize("following", FOLLOWING)
@pytest.mark.parametrize("floor", ["".join(symbols) for symbols in product(".=~", repeat=3)])
def test_no_two_robots_are_on_an_edge_in_opposite_directions(
    floor: str, following: Following
) -> None:
    """A>.<B: each drives to the other end, in moves of 1 to 3 ticks; B sets out 0 to 3 ticks late.

    On which edge a robot is in a tick follows from where it was before and after.
    """
    floor_plan = draw_floor(floor)
    first, last = np.flatnonzero(floor_plan.drivable)[[0, -1]].tolist()
    passings = 0
    for span_a, span_b, late in product((1, 2, 3), (1, 2, 3), range(4)):
        world = built(Case(floor_plan, (first, last), following, (), 0, ()), None)
        robots, traffic = world.robots, world.traffic
        vacate(traffic.occupancy, last, 0)
        occupy(traffic.occupancy, last, WEST)
        robots.travel[1] = WEST
        for number in range(14):
            before = list(zip(robots.cell.tolist(), robots.claim.tolist(), strict=True))
            for i, (way, end) in enumerate(((EAST, last), (WEST, first))):
                goes = robots.busy[i] == 0 and robots.cell[i] != end and number >= late * i
                traffic.intent[i] = LIVE | way if goes else 0
            traffic.move_ticks[:] = span_a, span_b
            with np.errstate(over="ignore"):
                move_all(world.grid, world.rules, robots, traffic, number)
            a, b = (driven(*before[i], int(robots.cell[i]), int(robots.claim[i])) for i in (0, 1))
            if a is not None and b is not None and set(a) == set(b):
                assert "." not in floor[min(a) - first :][:2], (span_a, span_b, late, number)
                passings += 1
    assert bool(passings) == any(floor[k : k + 2].count(".") == 0 for k in (0, 1))


def driven(cell: int, claim: int, now: int, claims: int) -> tuple[int, int] | None:
    """The edge on which a robot was in a tick; `cell`, `claim`: before it, the others: after it."""
    if claim != NIL:
        return cell, claim
    if claims != NIL:
        return now, claims
    return (cell, now) if now != cell else None


def test_which_contest_a_floor_gets_depends_on_its_crowding() -> None:
    room = draw_floor("\n".join(["." * 20] * 20))
    cells = tuple(np.flatnonzero(room.drivable).tolist())
    keys = {
        robots: built(Case(room, cells[:robots], "convoy", (), 0, ()), None).traffic.key.size
        for robots in (10, 200)
    }
    assert keys[10] > 0 and keys[200] == 0


def test_the_hash_of_tick_and_identity_ranks_claimants_without_ties() -> None:
    for number in (1, 7, 2**31):
        with np.errstate(over="ignore"):
            ranks = [int(motion.tie_break_hash(number, i)) for i in range(200)]
        assert ranks == [tie_break_hash(number, i) for i in range(200)]
        assert len(set(ranks)) == 200


def test_the_mixer_is_the_published_one() -> None:
    with np.errstate(over="ignore"):
        for value in (0, 1, 2**32 + 5, 2**64 - 1):
            assert int(random_numbers.splitmix64(np.uint64(value))) == splitmix64(value)


def test_the_naive_rules_share_no_code_with_the_kernels() -> None:
    import reference_motion

    assert "automaton" not in inspect.getsource(reference_motion)
