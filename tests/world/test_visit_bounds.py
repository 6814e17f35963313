"""The flow of pods: an estimate of the visits of robots, stations and chargers, and what bounds them."""

from __future__ import annotations

import math
from contextlib import suppress

import msgspec
import pytest
from pod_floors import drawn_pods
from pod_scenes import pod_scene

from automaton.errors import InputError
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.bounds import bounds_in_words, pod_flow, pod_ways
from automaton.world.resolve import resolve
from automaton.world.resolved import Resolved


def test_least_drives_on_a_large_floor() -> None:
    """As a program that shares no code with this one computed them, over all 864 x 6 pairs."""
    resolved = resolve("goods-60x40")
    ways = pod_ways(resolved, resolved.fleet.types[0])
    assert ways.loaded.shape == (864, 6)
    assert (ways.loaded.min(), ways.loaded.max()) == (106, 592)
    assert ways.loaded.mean() == pytest.approx(341.49, abs=0.005)
    assert ways.least <= 106
    estimate, bound = bounds_in_words(resolved)
    assert estimate.startswith(
        "estimate without traffic: 437 visits an hour, limited by robots (437 by 30 robots, 619 by 4 "
        "chargers, 1,108 by 6 stations), assuming uniform pod demand"
    )
    assert bound == (
        "bound for any strategies: at most 2,880 visits an hour, because of the stations"
    )


def test_a_ring() -> None:
    """3 + 26 + 20 + 3 ticks of a robot, and 1.25 between two pods; 20 + 1 of the station."""
    flow = pod_flow(pod_scene([{"pod": 1}]))
    assert flow is not None
    assert (flow.trip - flow.to_pod, flow.to_pod, flow.chargers) == (52, 1.25, math.inf)
    assert 3600 * flow.robots == pytest.approx(67.6, abs=0.05)
    assert 3600 * flow.stations == pytest.approx(171.4, abs=0.05)


def test_chargers_and_charging_are_part_of_the_estimate() -> None:
    """With a tenth of the power chargers limit the flow, and robots spend most of the time there."""
    weak = pod_flow(resolve("goods-60x40", ["battery.charge_rate=10 %/h"]))
    usual = pod_flow(resolve("goods-60x40"))
    assert weak is not None and usual is not None
    assert weak.chargers == pytest.approx(usual.chargers / 10, rel=1e-3)
    assert weak.robots < 0.6 * usual.robots and weak.most_robots == usual.most_robots
    said = bounds_in_words(resolve("goods-60x40", ["battery.charge_rate=10 %/h"]))[0]
    assert "limited by chargers (62 by 4 chargers" in said


def test_a_station_with_handling_of_its_own_raises_the_bound() -> None:
    usual = pod_flow(resolve("goods-mini"))
    faster = pod_flow(resolve("goods-mini", ["stations.P1.handling={line: 1}"]))
    assert usual is not None and faster is not None
    assert faster.most_stations > usual.most_stations and faster.most_robots > usual.most_robots


def test_a_battery_without_a_range_to_charge_has_no_charging_time() -> None:
    assert bounds_in_words(resolve("goods-60x40", ["battery.reserve=100"]))


def drawn(number: int) -> Resolved:
    """The scenario of a number, or of one of the next ones that is not refused and has lines."""
    for other in range(number, number + 20):
        with suppress(InputError, msgspec.ValidationError):
            resolved = drawn_pods(other)
            if pod_flow(resolved) is not None:
                return resolved
    raise AssertionError("no scenario could be drawn")


@pytest.mark.parametrize("number", range(0, 400, 20))
def test_no_run_on_a_drawn_floor_exceeds_the_bounds(number: int) -> None:
    """Besides the visits under way: one at each station, and those of one trip of each robot."""
    resolved = drawn(number)
    run, flow = Simulation(resolved), pod_flow(resolved)
    assert flow is not None
    run.run(resolved.scenario.stop.max_duration)
    visits = metrics_of(run)["visits"]
    robots, stops = resolved.scenario.fleet.robots, resolved.scenario.pods.max_stops
    assert visits <= flow.most_robots * run.tick + robots * stops
    assert visits <= flow.most_stations * run.tick + len(resolved.floor_plan.stations)


def test_other_orders_have_none() -> None:
    assert pod_flow(resolve("tabletop-mini")) is None
