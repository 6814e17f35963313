"""How many visits robots and stations can make at most."""

from __future__ import annotations

import pytest
from pod_scenes import pod_scene

from automaton.world.bounds import bounds_in_words, round_trips, visit_bounds
from automaton.world.resolve import resolve


def test_least_drives_on_a_large_floor() -> None:
    """As a program that shares no code with this one computed them, over all 864 x 6 pairs."""
    resolved = resolve("goods-60x40")
    drives = round_trips(resolved)
    assert drives.shape == (864, 6)
    assert (drives.min(), drives.max()) == (106, 592)
    assert drives.mean() == pytest.approx(341.49, abs=0.005)
    assert bounds_in_words(resolved) == [
        "563 visits an hour by 30 robots and 1,108 by 6 stations at most, assuming uniform pod "
        "demand, one line per trip and fixed storage; drives without a pod are not "
        "counted"
    ]


def test_a_ring() -> None:
    """3 + 26 + 20 + 3 ticks of a robot; 20 + 1 of the station, without a turn."""
    bounds = visit_bounds(pod_scene([{"pod": 1}]))
    assert bounds is not None
    assert (bounds.trip, bounds.visit) == (52, 21)
    assert bounds.visits(3600) == pytest.approx((69.2, 171.4), abs=0.05)


def test_other_orders_have_none() -> None:
    assert visit_bounds(resolve("tabletop-mini")) is None
