"""The parts of `automaton bench`, which measures the speed of this machine.

A part is a function that lists measurements; each prepares a world and then takes samples.
"""

from __future__ import annotations

from typing import Final, NamedTuple


class BenchPart(NamedTuple):
    """Measurements that are selected together."""

    place: str  # a module with `measurements()`, or module:function
    usual: bool  # measured by default
    summary: str


BENCH_PARTS: Final[dict[str, BenchPart]] = {
    "step": BenchPart(
        "automaton.bench.step_speed",
        True,
        "one step of random moves, with only the rules of occupancy",
    ),
    "tabletop": BenchPart(
        "automaton.bench.run_speed:tabletop_measurements",
        True,
        "whole runs of the table-top warehouse",
    ),
    "routes": BenchPart(
        "automaton.bench.route_speed", True, "the tick loop with given routes, without decisions"
    ),
    "crowd": BenchPart(
        "automaton.bench.crowd_speed", True, "looking robots up by cell, and giving way in a crowd"
    ),
    "observing": BenchPart(
        "automaton.bench.route_speed:observing_measurements",
        True,
        "the time that observing adds to a tick",
    ),
    "steering": BenchPart(
        "automaton.bench.steering_speed",
        False,
        "a tick with 400 and with 10,000 robots under each right of way (some minutes)",
    ),
    "pods": BenchPart(
        "automaton.bench.run_speed:pod_measurements",
        False,
        "a tick with 30 robots that carry pods to six stations",
    ),
    "recording": BenchPart(
        "automaton.bench.run_speed:recording_measurements",
        False,
        "recording and verifying a run with pods, relative to the run alone",
    ),
    "tables": BenchPart(
        "automaton.bench.table_speed", True, "computing distance tables, and looking distances up"
    ),
    "plans": BenchPart(
        "automaton.bench.warehouse_speed", True, "A* and traffic avoidance on three warehouses"
    ),
    "congestion": BenchPart(
        "automaton.bench.warehouse_speed:congestion_measurements",
        True,
        "time-expanded route searches on three warehouses",
    ),
    "zones": BenchPart(
        "automaton.bench.warehouse_speed:zone_measurements",
        True,
        "slow zones, and the network that predicts zones",
    ),
    "auctions": BenchPart(
        "automaton.bench.auction_speed",
        True,
        "auctions with and without charging, and optimal assignment",
    ),
    "zoning": BenchPart(
        "automaton.bench.zoning_speed",
        False,
        "days of a factory in zones, and their redesign (a minute)",
    ),
    "layers": BenchPart(
        "automaton.bench.loop_speed:layer_measurements", True, "a layer that is called every tick"
    ),
    "loop": BenchPart(
        "automaton.bench.loop_speed", True, "the tick loop with an idle fleet, and the digest"
    ),
    "environments": BenchPart(
        "automaton.bench.environment_speed",
        False,
        "a step of an environment, beside the loop alone and, with --peers, other simulators (a minute)",
    ),
    "sweep": BenchPart(
        "automaton.bench.sweep_speed", False, "the overhead of a sweep with two workers"
    ),
    "viewer": BenchPart(
        "tui.bench.viewer_speed", False, "the viewer in a pseudo-terminal (some minutes)"
    ),
    "watching": BenchPart(
        "tui.bench.viewer_speed:planning_measurements",
        False,
        "the viewer with 10,000 robots that plan, a part of viewer (a minute or two)",
    ),
    "compile": BenchPart(
        "automaton.bench.startup_speed:first_run_measurements",
        False,
        "first runs, which compile, in new processes (some minutes)",
    ),
    "startup": BenchPart(
        "automaton.bench.startup_speed", False, "the start of commands, in new processes"
    ),
}
