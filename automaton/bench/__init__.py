"""The speed of this machine: what `automaton bench` measures, and how.

A part is a function that lists measurements; each prepares a world and then takes samples.
"""

from __future__ import annotations

from typing import Final, NamedTuple


class BenchPart(NamedTuple):
    """A group of measurements."""

    place: str  # a module with `measurements()`, or module:function
    usual: bool  # measured by default
    summary: str


BENCH_PARTS: Final[dict[str, BenchPart]] = {
    "step": BenchPart("automaton.bench.step_speed", True, "the bare step: only occupancy rules"),
    "tabletop": BenchPart(
        "automaton.bench.run_speed:tabletop_measurements",
        True,
        "whole runs of the table-top warehouse",
    ),
    "routes": BenchPart(
        "automaton.bench.route_speed", True, "the loop: driving routes without decisions"
    ),
    "crowd": BenchPart(
        "automaton.bench.crowd_speed", True, "look-ups of robots by cell; giving way in a crowd"
    ),
    "observing": BenchPart(
        "automaton.bench.route_speed:observing_measurements",
        True,
        "overhead of observation per tick",
    ),
    "steering": BenchPart(
        "automaton.bench.steering_speed",
        False,
        "a tick of 400 and 10,000 robots under each right of way; takes minutes",
    ),
    "pods": BenchPart(
        "automaton.bench.run_speed:pod_measurements",
        False,
        "a tick of 30 robots that carry pods to six stations",
    ),
    "recording": BenchPart(
        "automaton.bench.run_speed:recording_measurements",
        False,
        "recording a run with pods and verifying it, as multiples of the run's time",
    ),
    "tables": BenchPart(
        "automaton.bench.table_speed", True, "distance tables: computation and look-ups"
    ),
    "plans": BenchPart(
        "automaton.bench.warehouse_speed", True, "A* and traffic avoidance on three warehouses"
    ),
    "congestion": BenchPart(
        "automaton.bench.warehouse_speed:congestion_measurements",
        True,
        "route searches over time, three warehouses",
    ),
    "zones": BenchPart(
        "automaton.bench.warehouse_speed:zone_measurements",
        True,
        "slow zones, and the network that predicts congestion",
    ),
    "auctions": BenchPart(
        "automaton.bench.auction_speed", True, "auctions with and without charging, and the optimum"
    ),
    "zoning": BenchPart(
        "automaton.bench.zoning_speed",
        False,
        "days of a factory with zones, redesigns of zones; takes a minute",
    ),
    "layers": BenchPart(
        "automaton.bench.loop_speed:layer_measurements", True, "a layer asked every tick"
    ),
    "loop": BenchPart(
        "automaton.bench.loop_speed", True, "the loop with an idle fleet; the digest"
    ),
    "sweep": BenchPart("automaton.bench.sweep_speed", False, "overhead of a sweep; two workers"),
    "viewer": BenchPart(
        "tui.bench.viewer_speed", False, "the viewer in a pseudo-terminal; takes minutes"
    ),
    "watching": BenchPart(
        "tui.bench.viewer_speed:planning_measurements",
        False,
        "the viewer on 10,000 robots that plan (part of viewer); takes 1 to 2 minutes",
    ),
    "compile": BenchPart(
        "automaton.bench.startup_speed:first_run_measurements",
        False,
        "first runs, which compile, in separate processes; takes minutes",
    ),
    "startup": BenchPart(
        "automaton.bench.startup_speed", False, "start-up of commands in separate processes"
    ),
}
