"""The flow of pods: an estimate of the visits of robots, stations and chargers, and what bounds them."""

from __future__ import annotations

import math
from contextlib import suppress

import msgspec
import pytest
from pod_floors import drawn_pods
from pod_scenes import RING, pod_scene

from automaton.errors import InputError
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.bounds import PodFlow, bounds_in_words, pod_flow, pod_ways
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
    begun, long, assumptions, bound = bounds_in_words(resolved)
    assert begun == (
        "estimate without traffic, for a run of 43,200 ticks (6 h) that begins with the initial charge: "
        "477 visits an hour, limited by robots (30 robots: 477, 4 chargers: 1,045, 6 stations: 1,108)"
    )
    assert long == (
        "estimate without traffic, in the long run: 437 visits an hour, limited by robots "
        "(30 robots: 437, 4 chargers: 619, 6 stations: 1,108)"
    )
    assert assumptions.startswith("assumptions: uniform pod demand, ")
    assert bound == "upper bound for any strategy: 2,880 visits an hour, limited by stations"


def test_a_ring() -> None:
    """3 + 26 + 20 + 3 ticks of a robot, and 5 / 3 between two pods; 20 + 1 of the station."""
    flow = pod_flow(pod_scene([{"pod": 1}]))
    assert flow is not None
    assert (flow.trip - flow.to_pod, flow.to_pod) == pytest.approx((52, 5 / 3))
    assert flow.chargers == math.inf
    assert 3600 * flow.robots == pytest.approx(67.1, abs=0.05)
    assert 3600 * flow.stations == pytest.approx(171.4, abs=0.05)


def test_chargers_and_charging_are_part_of_the_estimate() -> None:
    """With a tenth of the power chargers limit the flow, and robots spend most of the time there."""
    weak = pod_flow(resolve("goods-60x40", ["battery.charge_rate=10 %/h"]))
    usual = pod_flow(resolve("goods-60x40"))
    assert weak is not None and usual is not None
    assert weak.chargers == pytest.approx(usual.chargers / 10, rel=1e-3)
    assert weak.robots < 0.6 * usual.robots and weak.most_robots == usual.most_robots
    said = bounds_in_words(resolve("goods-60x40", ["battery.charge_rate=10 %/h"]))[1]
    assert "in the long run: 62 visits an hour, limited by chargers (4 chargers: 62, " in said


def test_over_a_shift_the_charge_at_its_start_counts() -> None:
    def flow(hours: int, charge: int) -> PodFlow:
        keys = ("battery.charge_rate=10 %/h", f"battery.initial_charge={charge}")
        found = pod_flow(resolve("goods-60x40", [*keys, f"stop.max_duration={hours} h"]))
        assert found is not None
        return found

    empty, full, short = flow(3, 15), flow(3, 100), flow(1, 100)
    assert empty.robots_begin == pytest.approx(empty.robots)
    assert empty.chargers_begin == empty.chargers
    assert short.robots_begin == pytest.approx(30 / full.trip)  # no robot has to charge
    # 30 robots with 85 % each, beside 4 chargers that give 10 % an hour
    assert full.chargers_begin == pytest.approx(full.chargers * (1 + 30 * 85 / (4 * 10 * 3)))
    keys = ["battery.charge_rate=10 %/h", "battery.initial_charge=100"]
    (begun, long, *_), (only, assumptions, _) = (
        bounds_in_words(resolve("goods-60x40", [*keys, *more]))
        for more in ((), ("stop.at_limit=failure",))
    )
    assert "for a run of 43,200 ticks (6 h) that begins with the initial charge" in begun
    assert "long run: 62 visits" in long and "traffic: 62 visits" in only
    assert assumptions.startswith("assumptions")


def test_the_mean_way_between_pods_leaves_out_the_way_to_itself() -> None:
    flow = pod_flow(pod_scene([{"pod": 1}], picture=RING.replace("pppp", "p###")))
    assert flow is not None and flow.to_pod == 0  # there is no other pod


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
