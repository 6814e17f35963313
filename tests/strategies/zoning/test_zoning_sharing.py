"""Load sharing and reassignment: what a round does to the queues of zones."""

from __future__ import annotations

from queue_scenes import SINGLES, Queues

CART, CRANES = {"name": "cart", "robots": 1, "payload": 5}, {"name": "crane", "robots": 3}


def test_the_first_order_bound_for_the_idle_zone_changes_robots() -> None:
    queues = Queues([0, 0, 0], at=[1, 1, 1], to=[2, 3, 4], age=[9, 1, 5])
    assert queues.shared() == ([0, 0, 1], [0, 0, 1], 1)


def test_the_first_order_bound_for_the_busy_zone_goes_past_the_transfer_stations() -> None:
    queues = Queues([0, 0, 1], at=[2, 1, 3], to=[1, 2, 2], age=[1, 1, 1])
    assert queues.shared() == ([0, 0, 1], [0, 0, 1], 1)


def test_at_most_one_of_each_kind_in_a_round() -> None:
    queues = Queues([0, 0, 0, 0, 1, 1], at=[1, 1, 1, 1, 4, 4], to=[3, 3, 3, 3, 1, 1])
    assert queues.shared() == ([1, 0, 0, 0, 1, 1], [1, 0, 0, 0, 1, 0], 2)


def test_equal_queues_are_left_alone() -> None:
    queues = Queues([0, 1], at=[1, 4], to=[3, 1], age=[1, 1])
    assert queues.shared() == ([0, 1], [0, 0], 0)


def test_by_distance_the_nearest_order_comes_first() -> None:
    """The robot of zone 0 stands at station 1; to its order at 2, and on to 4, it is 6 moves."""
    queues = Queues([0, 0], at=[2, 1], to=[4, 3], age=[9, 1])
    assert queues.shared(age=0, job=1) == ([0, 1], [0, 1], 1)


def test_of_orders_with_the_same_score_the_lowest_comes_first() -> None:
    """Both have waited alike, and both are 4 moves: by station 2 or straight on."""
    queues = Queues([0, 0], at=[2, 1], to=[3, 3], age=[5, 5])
    assert queues.shared(age=1, job=1) == ([1, 0], [1, 0], 1)


def test_what_a_robot_cannot_carry_goes_to_the_shortest_queue() -> None:
    queues = Queues(
        [0, 1, 2], at=[1, 2, 3], to=[4, 4, 4],
        zones=SINGLES, types=(CART, CRANES), weights=[10, 1, 1],
    )  # fmt: skip
    assert queues.reassigned() == [3, 1, 2]


def test_of_equal_queues_the_lowest_zone_gets_what_another_robot_cannot_carry() -> None:
    queues = Queues(
        [0, 1], at=[1, 2], to=[4, 4], zones=SINGLES, types=(CART, CRANES), weights=[10, 1]
    )
    assert queues.reassigned() == [2, 1]
