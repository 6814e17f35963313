"""The speed of this machine: what `automaton bench` measures, and how.

A part is a function that lists measurements; each prepares a world and then takes samples.
"""

from __future__ import annotations

from typing import Final, NamedTuple


class BenchPart(NamedTuple):
    """Measurements that are asked for together."""

    place: str  # a module with `measurements()`, or module:function
    usual: bool  # measured when nothing else is asked for
    summary: str


BENCH_PARTS: Final[dict[str, BenchPart]] = {
    "step": BenchPart("automaton.bench.step_speed", True, "the bare step: occupancy rules alone"),
    "tabletop": BenchPart(
        "automaton.bench.run_speed:tabletop_measurements",
        True,
        "whole runs of the table-top warehouse",
    ),
    "routes": BenchPart(
        "automaton.bench.route_speed", True, "the loop, driving routes without decisions"
    ),
    "crowd": BenchPart(
        "automaton.bench.crowd_speed", True, "robots looked up by cell; giving way in a crowd"
    ),
    "observing": BenchPart(
        "automaton.bench.route_speed:observing_measurements", True, "what watching adds to a tick"
    ),
    "steering": BenchPart(
        "automaton.bench.steering_speed",
        False,
        "a tick of 400 and 10,000 robots under each right of way; some minutes",
    ),
    "pods": BenchPart(
        "automaton.bench.run_speed:pod_measurements",
        False,
        "a tick of 30 robots that carry pods to six stations",
    ),
    "recording": BenchPart(
        "automaton.bench.run_speed:recording_measurements",
        False,
        "a run with pods recorded, and its recording verified, in times of the run",
    ),
    "tables": BenchPart(
        "automaton.bench.table_speed", True, "distance tables: computed and looked up"
    ),
    "plans": BenchPart(
        "automaton.bench.warehouse_speed", True, "A* and traffic avoidance on three warehouses"
    ),
    "congestion": BenchPart(
        "automaton.bench.warehouse_speed:congestion_measurements",
        True,
        "routes searched in time, three warehouses",
    ),
    "zones": BenchPart(
        "automaton.bench.warehouse_speed:zone_measurements",
        True,
        "slow zones, and the network that predicts",
    ),
    "auctions": BenchPart(
        "automaton.bench.auction_speed", True, "auctions with and without charging, the optimum"
    ),
    "zoning": BenchPart(
        "automaton.bench.zoning_speed",
        False,
        "days of a factory in zones, zones redesigned; a minute",
    ),
    "layers": BenchPart(
        "automaton.bench.loop_speed:layer_measurements", True, "a layer that is asked every tick"
    ),
    "loop": BenchPart(
        "automaton.bench.loop_speed", True, "the loop with an idle fleet; the digest"
    ),
    "sweep": BenchPart(
        "automaton.bench.sweep_speed", False, "what a sweep adds to its runs; two workers"
    ),
    "viewer": BenchPart(
        "tui.bench.viewer_speed", False, "the viewer in a pseudo-terminal; some minutes"
    ),
    "watching": BenchPart(
        "tui.bench.viewer_speed:planning_measurements",
        False,
        "the viewer on 10,000 robots that plan, which is a part of viewer; a minute or two",
    ),
    "compile": BenchPart(
        "automaton.bench.startup_speed:first_run_measurements",
        False,
        "first runs, which compile, in processes of their own; some minutes",
    ),
    "startup": BenchPart(
        "automaton.bench.startup_speed", False, "commands, in processes of their own"
    ),
}
