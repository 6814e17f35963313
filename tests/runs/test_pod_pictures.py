"""Pictures of runs in which pods are carried."""

from __future__ import annotations

import pytest

from automaton.errors import InputError
from automaton.runs.pictures import picture_of, world_from
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve


def goods(tick: int) -> Simulation:
    run = Simulation(resolve("goods-mini"))
    run.run(tick)
    return run


def test_pods_are_drawn_where_they_are() -> None:
    """Both robots carry theirs; where they stood, storage is free."""
    rows = picture_of(goods(30)).split("\n")[2:6]
    assert rows == [
        ">>>>>>>>>v",
        "^#qqpp#q#v",
        "^########v",
        "^<<<<BA<<<",
    ]


def test_the_last_picture_counts_orders_and_tells_of_trips() -> None:
    text = picture_of(goods(122), brief=True)
    assert text.endswith("\n3 orders delivered")
    assert "trip 0 done at (2, 1) in tick 70" in picture_of(goods(122))


def test_a_picture_of_pods_is_not_read_back() -> None:
    with pytest.raises(InputError, match="does not show where each pod is"):
        world_from(picture_of(goods(30)), resolve("goods-mini"))
