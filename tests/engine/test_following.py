"""The rule of following by the naive rules, and what the kernel shares with them: A, B, C are robots."""

from __future__ import annotations

from collections import Counter
from itertools import product

import pytest
from moving_worlds import WORLDS, KernelWorld, MakeWorld, NaiveWorld, Want, drawn, picture_of
from reference_motion import Robot, splitmix64
from refinement_trials import drawn_case

from automaton.engine.state import NIL
from automaton.floor.floor_plan import DIRECTIONS, EAST
from automaton.runs.pictures.pictures import Following


class Story:
    """A picture with robots that move by the naive rules; each has its own ticks of a move."""

    def __init__(self, picture: str, following: Following = "convoy", **ticks: int) -> None:
        self.world, self.robots = drawn(NaiveWorld, picture, following)
        assert isinstance(self.world, NaiveWorld)
        self.floor, self.ticks, self.now = self.world.floor, ticks, 0

    def tick(self, **wants: str) -> str:
        """One tick; returns the picture after it."""
        self.now += 1
        moves = {
            self.robots[name]: Want(DIRECTIONS.index(way), self.ticks.get(name, 1))
            for name, way in wants.items()
        }
        self.world.tick(self.now, moves)
        return picture_of(self.world)

    def delay(self, **ticks: int) -> None:
        self.floor.delay({self.robots[name]: delay for name, delay in ticks.items()})

    def lost(self) -> dict[str, int]:
        """Ticks lost behind other robots."""
        return {name: self.floor.robots[k].lost for name, k in self.robots.items()}


# A saturated lane


LAWS: dict[Following, tuple[int, ...]] = {  # ticks between two robots, by ticks of a move
    "none": (2, 4, 6, 10),
    "handover": (1, 3, 5, 9),
    "convoy": (1, 2, 3, 5),
}
MOVES = (1, 2, 3, 5)


@pytest.mark.parametrize(("make", "following"), WORLDS)
@pytest.mark.parametrize("move", MOVES)
def test_a_saturated_lane_passes_a_robot_in_so_many_ticks(
    move: int, following: Following, make: MakeWorld
) -> None:
    """Robots of a queue arrive in the cell before it: every 2d, 2d - 1 or d ticks."""
    world, robots = drawn(make, "ABCDEF......", following)
    gate = world.states()[5][0] + 1
    passed: dict[int, int] = {}
    for number in range(1, 80):
        world.tick(number, {k: Want(EAST, move) for k in robots.values()})
        for k, (cell, _, _) in enumerate(world.states()):
            if cell == gate:
                passed.setdefault(k, number)
    assert [passed[k] - passed[k + 1] for k in range(5)] == [LAWS[following][MOVES.index(move)]] * 5


# Files and rings


def test_a_robot_commits_itself_behind_a_slow_one_at_once() -> None:
    story = Story("AB.", B=4)
    assert story.tick(B="east") == "AB*"
    assert story.tick(A="east") == "AB*", "its claim is where B still is"
    assert story.tick() == "AB*"
    assert story.tick() == ".AB"
    assert story.lost() == {"A": 2, "B": 0}


def test_under_handover_it_waits_for_the_last_tick() -> None:
    story = Story("AB.", "handover", B=4)
    assert [story.tick(**wants) for wants in ({"B": "east"}, {"A": "east"}, {"A": "east"})] == [
        "AB*"
    ] * 3
    assert story.world.states()[0][1] == NIL
    assert story.tick(A="east") == ".AB"


def test_who_follows_for_longer_takes_its_own_time() -> None:
    story = Story("AB.", A=5, B=2)
    assert story.tick(A="east", B="east") == "AB*"
    assert story.tick() == "A*B"
    assert [story.tick() for _ in range(3)] == ["A*B", "A*B", ".AB"]
    assert story.lost() == {"A": 0, "B": 0}


def test_a_file_arrives_together_behind_the_slowest_ahead() -> None:
    story = Story("ABCD.", A=1, B=2, C=4, D=3)
    assert story.tick(A="east", B="east", C="east", D="east") == "ABCD*"
    story.tick()
    assert story.tick() == "ABC*D"
    assert story.tick() == ".ABCD"
    assert story.lost() == {"A": 3, "B": 2, "C": 0, "D": 0}


def test_a_full_ring_of_unlike_speeds_starts_and_arrives_together() -> None:
    story = Story("AB\nDC", A=1, B=3, C=2, D=4)
    story.tick(A="east", B="south", C="west", D="north")
    assert [busy for _, _, busy in story.world.states()] == [3, 3, 3, 3]
    assert [story.tick() for _ in range(3)] == ["AB\nDC", "AB\nDC", "DA\nCB"]
    assert story.lost() == {"A": 3, "B": 1, "C": 2, "D": 0}


def test_a_full_ring_of_long_moves_stands_without_convoy() -> None:
    for following in ("none", "handover"):
        story = Story("AB\nDC", following, A=2, B=2, C=2, D=2)
        story.tick(A="east", B="south", C="west", D="north")
        assert all(claim == NIL for _, claim, _ in story.world.states())


def test_a_cell_has_one_holder_and_one_follower() -> None:
    story = Story("AB..\n.C##", B=4)
    story.tick(B="east")
    story.tick(A="east", C="north")
    claims = [claim for _, claim, _ in story.world.states()]
    assert sorted(claim == NIL for claim in claims) == [False, False, True], "B, and A or C"


def test_nobody_follows_a_robot_that_stands_or_one_that_is_still_to_come() -> None:
    story = Story("AB.", B=3)
    assert story.tick(A="east") == "AB."
    story = Story("A.B\n.C.", B=3)
    assert story.tick(B="west") == "A*B\n.C."
    assert story.tick(C="north") == "A*B\n.C."
    assert story.world.states()[2][1] == NIL


# Edges


@pytest.mark.parametrize("late", range(1, 5))
def test_the_edge_stays_barred_although_its_first_cell_is_open(late: int) -> None:
    """A drives east into a cell without limit from which B would drive west into A's open cell."""
    story = Story("A~B", A=3)
    story.tick(B="west")
    for number in range(6):
        wants = {"A": "east"} if number == 0 else {}
        if number == late:
            wants["B"] = "west"
        story.tick(**wants)
    a, b = (cell for cell, _, _ in story.world.states())
    assert a - b == (0 if late < 3 else 1), "they meet, or B has got past"


# Delays


def test_a_delay_is_handed_on_to_the_end_of_the_file() -> None:
    story = Story("ABC.", A=3, B=3, C=3)
    story.tick(A="east", B="east", C="east")
    story.delay(C=2)
    assert [story.tick() for _ in range(4)] == ["ABC*"] * 3 + [".ABC"]
    assert story.lost() == {"A": 2, "B": 2, "C": 0}


def test_who_has_time_to_spare_is_not_put_off() -> None:
    story = Story("AB.", A=6, B=2)
    story.tick(A="east", B="east")
    story.delay(B=3)
    assert [busy for _, _, busy in story.world.states()] == [5, 4]
    assert story.lost() == {"A": 0, "B": 0}


def test_all_delays_of_a_tick_count_before_any_is_handed_on() -> None:
    story = Story("ABC.", A=2, B=2, C=2)
    story.tick(A="east", B="east", C="east")
    story.delay(A=1, B=4, C=2)
    assert [busy for _, _, busy in story.world.states()] == [5, 5, 3]
    assert story.lost() == {"A": 3, "B": 0, "C": 0}


def test_a_ring_takes_the_longest_of_its_delays() -> None:
    story = Story("AB\nDC", A=2, B=2, C=2, D=2)
    story.tick(A="east", B="south", C="west", D="north")
    story.delay(A=1, C=3)
    assert [busy for _, _, busy in story.world.states()] == [4, 4, 4, 4]


# Bays and turns need a place in which nobody is


def test_nobody_comes_out_of_its_bay_behind_one_that_leaves() -> None:
    story = Story("A.", A=3)
    newcomer = Robot(1, story.floor.robots[0].cell)
    assert not story.floor.come_out(newcomer)
    story.tick(A="east")
    assert not story.floor.come_out(newcomer), "the cell is open, and A is still in it"
    assert [story.tick() for _ in range(2)] == ["A*", ".A"]
    assert story.floor.come_out(newcomer)


def test_who_comes_out_of_its_bay_is_followed_from_the_next_tick_on() -> None:
    for following, last in (("convoy", 2), ("handover", 3)):
        world, _ = drawn(NaiveWorld, "AB.", following)  # type: ignore[arg-type]
        world.tick(1, {0: Want(EAST, 1), 1: Want(EAST, 3, entered=True)})
        assert world.states()[0][1] == NIL
        for number in range(2, last + 1):
            assert world.states()[0][1] == NIL
            world.tick(number, {0: Want(EAST, 3)})
        assert world.states()[0][1] != NIL


def test_a_turn_in_an_aisle_for_two_needs_a_lane_in_which_nobody_is() -> None:
    """A came east, B west into the aisle; B drives on for 4 ticks, and its lane opens at once."""
    story = Story(".=.\nA#B", A=1, B=1)
    story.tick(A="north", B="north")
    story.tick(A="east")
    story.tick(B="west")
    story.ticks["B"] = 4
    story.tick(B="west")
    assert not story.floor.turn(0, 3), "B is still in the other lane"
    for _ in range(3):
        assert not story.floor.turn(0, 3)
        story.tick()
    assert story.floor.turn(0, 3)
    story.tick()
    claim = next(claim for _, claim, _ in story.world.states())
    assert claim == story.floor.robots[0].cell, "it holds both lanes until the turn ends"


# The kernel


def test_the_kernel_moves_and_delays_robots_as_the_rules_say() -> None:
    """Drawn floors, crowded ones too, with robots of unlike speeds: state by state, and ticks lost."""
    lost: Counter[str] = Counter()
    for seed, following in product(range(1000, 1040), LAWS):
        case = drawn_case(seed)
        worlds = [
            make(case.floor_plan, case.cells, following) for make in (NaiveWorld, KernelWorld)
        ]
        for number in range(1, case.ticks + 1):
            for world in worlds:
                world.delay(number, case.delays(number))
                world.tick(number, case.wants(number, 1, bays=True))
            assert worlds[0].states() == worlds[1].states(), (seed, following, number)
        assert worlds[0].lost() == worlds[1].lost(), (seed, following)
        lost[following] += sum(worlds[0].lost())
    assert lost["convoy"] > 50 and lost["none"] == lost["handover"] == 0


# Where all moves take one tick


def test_convoy_is_handover_where_every_move_takes_one_tick() -> None:
    for seed in range(30):
        worlds = [drawn(NaiveWorld, "AB.=\nC~D.\nE.=F", rule)[0] for rule in ("handover", "convoy")]
        for number in range(12):
            bits = [splitmix64(seed << 16 | number << 8 | k) for k in range(6)]
            wants = {k: Want(b & 3, 1, b >> 2 & 1, b >> 8 & 15 == 0) for k, b in enumerate(bits)}
            for world in worlds:
                world.tick(number, wants)
            assert worlds[0].states() == worlds[1].states()


def test_nobody_is_ever_where_another_robot_is() -> None:
    """Under convoy, on random wants of unlike lengths: one robot in a cell, one on its way into it."""
    moves = followed = 0
    for seed in range(20):
        world, robots = drawn(NaiveWorld, "AB..\nCD..\nEF..")
        assert isinstance(world, NaiveWorld)
        for number in range(40):
            bits = [splitmix64(seed << 20 | number << 8 | k) for k in robots.values()]
            if number % 5 == 4:
                world.delay(
                    number, {k: b >> 20 & 3 for k, b in enumerate(bits) if b >> 30 & 3 == 0}
                )
            world.tick(number, {k: Want(b & 3, 1 + (b >> 2 & 3)) for k, b in enumerate(bits)})
            cells = [cell for cell, _, _ in world.states()]
            claims = [claim for _, claim, _ in world.states() if claim != NIL]
            assert len(set(cells)) == len(cells) and len(set(claims)) == len(claims)
            moves += len(claims)
            followed += len(set(cells) & set(claims))
    assert moves > 1000 and followed > 300
