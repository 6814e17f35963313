"""Which of the moves of a tick happen, told as stories: A, B, C are robots, the rest is floor."""

from __future__ import annotations

from itertools import permutations

import pytest

import automaton.world.building
from automaton.errors import InputError
from automaton.runs.pictures import Story, moved


@pytest.fixture(autouse=True, params=["crowded", "sparse"])
def contest(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every story is told twice: contests are kept per cell on crowded floors, else in a table."""
    if request.param == "sparse":
        monkeypatch.setattr(automaton.world.building, "CROWDED", 0)


def rows(*lines: str) -> str:
    return "\n".join(lines)


def test_a_robot_moves_to_a_free_cell() -> None:
    assert moved("A.", A="east") == ".A"


def test_a_robot_that_wants_nothing_stands_and_is_not_run_over() -> None:
    assert moved("AB.", A="east") == "AB."


def test_nobody_drives_into_a_wall_or_against_a_one_way_cell() -> None:
    assert moved("A#", A="east") == "A#"
    assert moved("A<.", A="east") == "A<."


# Queues and rings


def test_a_queue_moves_as_a_whole() -> None:
    assert moved("ABC.", A="east", B="east", C="east") == ".ABC"


def test_a_queue_stands_when_its_head_stands() -> None:
    assert moved("ABC.", A="east", B="east") == "ABC."


def test_a_queue_bends_round_corners() -> None:
    assert moved("AB\n.C\n..", A="east", B="south", C="south") == rows(".A", ".B", ".C")


def test_a_ring_rotates() -> None:
    story = Story("AB\nDC")
    ring = {"A": "east", "B": "south", "C": "west", "D": "north"}
    assert story.tick(**ring) == rows("DA", "CB")


def test_a_ring_with_one_robot_standing_stands() -> None:
    assert moved("AB\nDC", A="east", B="south", C="west") == rows("AB", "DC")


def test_who_wants_a_cell_of_a_ring_breaks_it_only_if_it_goes_first() -> None:
    ring = {"A": "east", "B": "south", "C": "west", "D": "north"}
    late = Story("EAB\n.DC", priority={"D": 1})
    assert late.tick(**ring, E="east") == rows("EDA", ".CB")
    first = Story("EAB\n.DC", priority={"E": 1})
    assert first.tick(**ring, E="east") == rows("EAB", ".DC"), "A has nowhere to go, so E neither"


def test_two_robots_may_not_close_a_ring_of_two() -> None:
    assert moved("AB", A="east", B="west") == "AB"


# Swaps


def test_a_swap_is_refused() -> None:
    story = Story(".AB.")
    assert story.tick(A="east", B="west") == ".AB."
    assert story.refused == "AB"


def test_a_queue_behind_a_refused_swap_stands() -> None:
    story = Story("CABD", priority={"A": 9, "B": 9})
    assert story.tick(A="east", B="west", C="east", D="west") == "CABD"
    assert story.refused == "ABCD"


def test_a_refused_swap_competes_for_nothing() -> None:
    # B and C want the same free lane of the aisle. B goes first, but may not swap with A.
    story = Story(rows("A=B", "#.#", "#C#"), priority={"B": 9})
    assert story.tick(A="east", C="north") == rows(".AB", "#C#", "#.#")
    assert story.tick(A="east", B="west", C="north") == rows(".@B", "#.#", "#.#")
    assert story.refused == "AB"


def test_robots_pass_each_other_in_an_aisle_for_two() -> None:
    story = Story("A==B")
    assert story.tick(A="east", B="west") == ".AB."
    assert story.tick(A="east", B="west") == ".BA."
    assert story.tick(A="east", B="west") == "B==A"


def test_a_swap_needs_both_cells_to_let_robots_pass() -> None:
    story = Story("A=B")
    assert story.tick(A="east") == ".AB"
    assert story.tick(A="east", B="west") == ".AB"
    assert story.refused == "AB"


def test_who_starts_may_not_meet_a_long_move_on_its_edge_even_as_that_arrives() -> None:
    # A drives for two ticks into the cell that B is about to leave; in the second its own is free.
    story = Story("A~B", move=2)
    assert story.tick(B="west") == "A*B"
    assert story.tick() == "AB."
    assert story.tick(A="east") == "AB."
    assert story.tick(B="west") == ".@."
    assert story.refused == "B"
    assert story.tick(A="east", B="west") == "*@*", "the edge is free again"


def test_a_third_robot_may_enter_what_a_refused_swap_leaves_free() -> None:
    story = Story(rows("A~B", ".##", "C##"), move=2, priority={"B": 9})
    assert story.tick(B="west", C="north") == rows("A*B", "*##", "C##")
    assert story.tick() == rows("AB.", "C##", ".##")
    assert story.tick(A="east") == rows("AB.", "C##", ".##")
    assert story.tick(B="west", C="north") == rows("*@.", "C##", ".##")
    assert story.refused == "B"


# Capacities


def test_a_passing_aisle_holds_one_robot_each_way() -> None:
    story = Story("A=B")
    assert story.tick(A="east", B="west") == ".@."
    assert story.tick(A="east", B="west") == "B=A"


def test_a_passing_aisle_holds_no_two_robots_going_the_same_way() -> None:
    story = Story("BA=.")
    assert story.tick(A="east", B="east") == ".BA."
    assert story.tick(B="east") == ".BA."
    assert story.refused == "B"
    assert story.tick(A="east", B="east") == "..BA", "but one follows the other"


def test_an_unlimited_cell_takes_everybody_at_once() -> None:
    story = Story(rows("#A#", "B~C", "#D#"))
    everybody = story.tick(A="south", B="east", C="west", D="north")
    assert everybody == rows("#.#", ".@.", "#.#")
    assert story.tick(A="south", B="east", C="west", D="north") == rows("#D#", "C~B", "#A#")


# Claimants


@pytest.mark.parametrize("storage", list(permutations(range(2))))
def test_the_higher_priority_wins(storage: tuple[int, ...]) -> None:
    for tick in range(8):
        story = Story("A.B", priority={"B": 1}, storage=storage, tick=tick)
        assert story.tick(A="east", B="west") == "AB."
        assert story.refused == "A"


def test_among_equals_a_hash_of_tick_and_robot_decides() -> None:
    results = [Story("A.B", tick=tick).tick(A="east", B="west") for tick in range(64)]
    assert set(results) == {".AB", "AB."}
    assert 16 < results.count(".AB") < 48, "neither robot is favoured"


@pytest.mark.parametrize("storage", list(permutations(range(3))))
def test_how_robots_are_stored_does_not_matter(storage: tuple[int, ...]) -> None:
    picture = rows("#A#", "B.C")
    wants = {"A": "south", "B": "east", "C": "west"}
    for tick in range(16):
        expected = Story(picture, tick=tick).tick(**wants)
        assert Story(picture, tick=tick, storage=storage).tick(**wants) == expected


def test_who_cannot_enter_its_cell_frees_none_for_others() -> None:
    # B loses against C, so A may not follow B.
    story = Story(rows("AB.", "##C"), priority={"C": 1})
    assert story.tick(A="east", B="east", C="north") == rows("ABC", "##.")


# following: false


def test_without_following_a_cell_must_be_empty_when_the_tick_starts() -> None:
    story = Story("AB.", following="none")
    assert story.tick(A="east", B="east") == "A.B"
    assert story.tick(A="east") == ".AB"


def test_without_following_no_ring_rotates() -> None:
    story = Story("AB\nDC", following="none")
    assert story.tick(A="east", B="south", C="west", D="north") == rows("AB", "DC")


# Long moves


def test_a_long_move_holds_both_cells_until_it_arrives() -> None:
    story = Story("A..", move=3)
    assert story.tick(A="east") == "A*."
    assert story.tick() == "A*."
    assert story.tick() == ".A."


def test_with_handover_nobody_enters_a_cell_that_a_long_move_claims_or_still_holds() -> None:
    story = Story(rows("#B#", "A..", "C##"), move=3, following="handover")
    assert story.tick(A="east") == rows("#B#", "A*.", "C##")
    assert story.tick(B="south", C="north") == rows("#B#", "A*.", "C##")
    assert story.refused == "BC"


def test_with_handover_a_follower_enters_in_the_tick_in_which_a_long_move_arrives() -> None:
    story = Story("BA..", move=3, following="handover")
    assert story.tick(A="east", B="east") == "BA*."
    assert story.tick(B="east") == "BA*."
    assert story.refused == "B"
    assert story.tick(B="east") == "B*A.", "A arrives, B claims the cell it has left"
    assert story.tick(A="east") == "B*A*"
    assert story.tick() == ".BA*"


def test_without_following_a_long_move_frees_its_cell_for_the_next_tick() -> None:
    story = Story("BA.", move=2, following="none")
    assert story.tick(A="east") == "BA*"
    assert story.tick(B="east") == "B.A"
    assert story.refused == "B"
    assert story.tick(B="east") == "B*A"


def test_with_handover_a_ring_of_long_moves_does_not_rotate() -> None:
    story = Story("AB\nDC", move=2, following="handover")
    assert story.tick(A="east", B="south", C="west", D="north") == rows("AB", "DC")
    assert story.refused == "ABCD"


# Convoys


def test_in_a_convoy_robots_set_out_and_arrive_together() -> None:
    story = Story("BA..", move=3)
    assert story.tick(A="east", B="east") == "BA*."
    assert story.refused == ""
    assert story.tick() == "BA*."
    assert story.tick() == ".BA."


def test_a_robot_that_follows_late_arrives_after_its_own_ticks() -> None:
    story = Story("BA..", move=3)
    assert story.tick(A="east") == "BA*."
    assert story.tick(B="east") == "BA*."
    assert story.tick() == "B*A."
    assert story.tick() == ".BA."


def test_a_cell_that_is_being_left_takes_one_follower() -> None:
    story = Story(rows("BA.", "#C#"), move=2, priority={"B": 1})
    assert story.tick(A="east", B="east", C="north") == rows("BA*", "#C#")
    assert story.refused == "C"
    assert story.tick(C="north") == rows(".BA", "#C#")
    assert story.refused == "C", "B is in the cell from now on, and stands"


def test_nobody_follows_into_a_cell_whose_robot_stands() -> None:
    story = Story("CBA", move=2)
    assert story.tick(B="east", C="east") == "CBA"
    assert story.refused == "BC"


def test_in_a_convoy_a_ring_of_long_moves_rotates() -> None:
    story = Story("AB\nDC", move=2)
    assert story.tick(A="east", B="south", C="west", D="north") == rows("AB", "DC")
    assert story.tick() == rows("DA", "CB")


def test_in_a_convoy_nobody_enters_an_edge_while_another_robot_is_on_it() -> None:
    story = Story("A~B", move=3)
    story.tick(B="west")
    story.tick()
    assert story.tick() == "AB."
    assert story.tick(A="east") == "AB."
    assert story.tick(B="west") == "AB." and story.refused == "B"
    assert story.tick(B="west") == ".@." and story.refused == "B"
    assert story.tick(B="west") == "*@."


def test_a_long_move_through_an_aisle_leaves_the_other_lane_free() -> None:
    story = Story("A==B", move=2)
    assert story.tick(A="east", B="west") == "A**B"
    assert story.tick() == ".AB."
    assert story.tick(A="east", B="west") == ".AB.", "both are on their way past each other"
    assert story.tick() == ".BA."


# The teller


def test_a_story_says_what_it_does_not_understand() -> None:
    with pytest.raises(InputError, match="no robot B"):
        moved("A.", B="east")
    with pytest.raises(InputError, match="'up' is not a direction; try east, south, west or north"):
        moved("A.", A="up")
    with pytest.raises(InputError, match="has no robots"):
        Story("...")
    story = Story("A..", move=2)
    story.tick(A="east")
    with pytest.raises(InputError, match="robot A is still on its way"):
        story.tick(A="east")
