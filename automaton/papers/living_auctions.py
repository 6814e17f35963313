"""Auctions, batteries, queues and failures in full simulation: beyond De Ryck et al.

Robots drive cell by cell on the floor of the paper, batteries drain, orders arrive over time, chargers
have queues, and robots fail. The paper has no such results. Every strategy faces the same orders and
failures, which depend on the seed only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import msgspec
import numpy as np

from automaton.engine.random_numbers import STREAM_BREAKDOWNS, random_between
from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_QUEUE,
    FAILURE_DEPLETED,
    ORDER_DELIVERED,
    World,
)
from automaton.papers.claims import OUR_BOUND, Figure, above, claim, mean_of
from automaton.papers.reproduction_study import (
    Headline,
    PublishedTable,
    Reproduction,
    ScenarioCase,
    fixed,
    scenario_runs,
)
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Fault
from automaton.studies.process_pool import OnDone, RunResult, run_and_measure
from automaton.world.resolved import Resolved

SATURATED: Final = "orders={generator: stations, count: 100}"  # all orders known at the start
COMING: Final = "orders={generator: stations, count: 100, mean_interarrival_time: 45}"
FAILING: Final = "orders={generator: stations, count: 60, mean_interarrival_time: 20}"
WAITS: Final = ("0.01", "0.05", "0.1")  # percent per tick
RESERVES: Final = (0, 5, 10, 20)  # percent

CHARGING_STRATEGIES: Final = {  # settings of strategy.charging and of infinite batteries
    "infinite batteries": ("strategy.charging=none", "battery=null", "faults.charge=kept"),
    "insertion": ("strategy.charging=insertion",),
    "insertion, joint": ("strategy.charging={name: insertion, mode: joint}",),
    "fill-up": ("strategy.charging=fill-up",),
    "opportunity": ("strategy.charging=opportunity",),
    "threshold, safe": ("strategy.charging=threshold",),
    "threshold, look": ("strategy.charging={name: threshold, mode: threshold-only}",),
    "insertion, may strand": ("strategy.charging={name: insertion, never_strand: false}",),
}
KEEP_LISTS: Final = (
    "while_charging: keep"  # charging robots keep their lists, as in the recorded results
)
KEPT: Final = f"strategy.allocation={{name: auction, {KEEP_LISTS}}}"
FULLY: Final = "faults.charge=100"  # towed robots return fully charged, as in the recorded results
QUEUES_IN_BIDS: Final = {"in the bids": "true", "left out": "false"}
REPAIRS: Final = {"gone for good": "null", "back after 600 ticks": "600"}
AUCTION_KINDS: Final = {  # further parameters of strategy.allocation
    "sequential, lowest bid": "",
    "sequential, biggest difference": ", winner_rule: difference",
    "sequential, regret": ", winner_rule: regret",
    "sequential, local search": ", local_search: true",
    "in the order of arrival": ", mechanism: arrival",
    "parallel": ", mechanism: parallel",
    "combinatorial": ", mechanism: combinatorial",
    "assignment": ", mechanism: assignment",
    "two fixed auctioneers": ", auctioneer: fixed",
    "two fixed auctioneers, radius 4": ", auctioneer: fixed, announcement_radius: 4",
    "token, radius 4": ", auctioneer: token, announcement_radius: 4",
    "around the order, radius 4": ", region: order, announcement_radius: 4",
}

# The energy balance limits throughput to kr / (kc + kr) of infinite batteries, with the percent that a
# tick of charging adds (kr = 1) and a tick of driving takes (kc = 0.3). The claim requires 80 % of this.
LEAST_SHARE: Final = 0.8 * 1 / (0.3 + 1)
LEAST: Final = "0.8 kr / (kc + kr)"
SAFE: Final = ("insertion", "insertion, joint", "fill-up", "opportunity")  # never strand
FIXED_AUCTIONEERS: Final = "two fixed auctioneers"
NEAR_AUCTIONEERS: Final = "two fixed auctioneers, radius 4"
LOOK_EVERY: Final = 5  # ticks between two counts of the charger queue; a move takes 10 ticks
LAST_FAILURE: Final = 2500  # latest tick of a failure
TOW_AFTER: Final = 200  # ticks

Figures = dict[str, float | int]


def to_the_end(simulation: Simulation) -> Figures:
    """The metrics of a run, with its outcome: stranding, complete delivery, recovered loads."""
    return run_and_measure(simulation) | outcome_of(simulation.world)


def outcome_of(world: World) -> Figures:
    """Shares of runs (0 or 1 for one run), and the number of loads picked up more than once."""
    return {
        "stranded": float(world.tally.failures[:, FAILURE_DEPLETED].any()),
        "all_delivered": float((world.orders.state == ORDER_DELIVERED).all()),
        "recovered": int((world.orders.legs > 1).sum()),
    }


def with_lines(simulation: Simulation) -> Figures:
    """The metrics of a run in which the charger queue is counted every LOOK_EVERY ticks.

    `in_line`: share of counts with two or more robots in the queue; `wait`: ticks in the queue per
    charge.
    """
    limit, looks, lines = simulation.resolved.scenario.stop.max_duration, 0, 0
    while not simulation.finished and simulation.tick < limit:
        simulation.run(until=simulation.tick + LOOK_EVERY)
        looks += 1
        lines += int((simulation.world.robots.action == ACTION_QUEUE).sum()) >= 2
    tally = simulation.world.tally
    stays = int(tally.operations[:, ACTION_CHARGE].sum())
    return {
        **metrics_of(simulation),
        **outcome_of(simulation.world),
        "in_line": lines / looks,
        "wait": float(tally.ticks[:, ACTION_QUEUE].sum()) / max(1, stays),
        "stays": stays,
    }


def with_failure(resolved: Resolved, seed: int) -> Resolved:
    """The scenario with one failure, of a random robot at a random tick that depend on the seed."""
    with np.errstate(over="ignore"):
        address = np.uint64(seed), STREAM_BREAKDOWNS, 0
        robot = random_between(0, resolved.scenario.fleet.robots - 1, *address, 0)
        at = random_between(1, LAST_FAILURE, *address, 1)
    faults = msgspec.structs.replace(
        resolved.scenario.faults, listed=(Fault(robot=int(robot), at=int(at)),), tow_after=TOW_AFTER
    )
    scenario = msgspec.structs.replace(resolved.scenario, faults=faults)
    return replace(resolved, scenario=scenario)


def beside_infinite(
    cases: Sequence[ScenarioCase],
    seeds: Sequence[int],
    workers: int | None = None,
    on_done: OnDone | None = None,
) -> list[list[RunResult]]:
    """Runs with `share`: throughput relative to the first case with the same seed."""
    results = scenario_runs(to_the_end)(cases, seeds, workers, on_done)
    most = [result.metrics["throughput"] for result in results[0]]
    return [
        [
            result._replace(
                metrics=result.metrics | {"share": result.metrics["throughput"] / reference}
            )
            for result, reference in zip(batch, most, strict=True)
        ]
        for batch in results
    ]


LIVING_TABLES: Final = (
    PublishedTable(
        name="stranding",
        title="More orders than four robots can do, a charger in every depot (depots-full)",
        cases=fixed(
            [
                ScenarioCase({"charging": name}, "depots-full", (KEPT, FULLY, SATURATED, *settings))
                for name, settings in CHARGING_STRATEGIES.items()
            ]
        ),
        panels=(("ran_empty", "all_delivered", "share", "T_total"),),
        shares=("all_delivered", "share"),
        run=beside_infinite,
        digits=1,
    ),
    PublishedTable(
        name="waiting",
        title="Waits take energy (depots-full, orders come in, insertion)",
        cases=fixed(
            [
                ScenarioCase(
                    {"wait, % per tick": wait, "reserve, %": reserve},
                    "depots-full",
                    (
                        *(KEPT, FULLY, COMING, "strategy.charging=insertion"),
                        f"battery.drain.wait={wait}",
                        f"battery.reserve={reserve}",
                    ),
                )
                for wait in WAITS
                for reserve in RESERVES
            ]
        ),
        panels=(("stranded", "ran_empty", "lead_time"),),
        shares=("stranded",),
        run=scenario_runs(to_the_end),
        digits=1,
        grouped=1,
    ),
    PublishedTable(
        name="lines",
        title="Five robots around one charger (depots-line)",
        cases=fixed(
            [
                ScenarioCase(
                    {"lines": name},
                    "depots-line",
                    (KEPT, f"strategy.charging={{name: insertion, count_queues: {queues}}}"),
                )
                for name, queues in QUEUES_IN_BIDS.items()
            ]
        ),
        panels=(("in_line", "wait", "stays", "lead_time"),),
        shares=("in_line",),
        run=scenario_runs(with_lines),
        digits=1,
    ),
    PublishedTable(
        name="failures",
        title="A robot fails at a tick drawn by the seed (depots)",
        cases=fixed(
            [
                ScenarioCase(
                    {"robot": name},
                    "depots",
                    (KEPT, FULLY, FAILING, f"faults.repair_time={repair}"),
                )
                for name, repair in REPAIRS.items()
            ]
        ),
        panels=(("breakdowns", "all_delivered", "recovered", "lead_time", "T_total"),),
        shares=("all_delivered",),
        run=scenario_runs(to_the_end, with_failure),
        digits=1,
    ),
    PublishedTable(
        name="kinds",
        title="Kinds of auctions, central and decentral (depots)",
        cases=fixed(
            [
                ScenarioCase(
                    {"auction": name},
                    "depots",
                    (f"strategy.allocation={{name: auction, {KEEP_LISTS}{more}}}",),
                )
                for name, more in AUCTION_KINDS.items()
            ]
        ),
        panels=(("T_total", "lead_time", "E_U_moves", "auctions", "bids", "messages"),),
        shares=("E_U_moves",),
        run=scenario_runs(to_the_end),
    ),
)


def empty(wait: str, reserve: int, **bounds: Any) -> Figure:
    """A figure: the share of runs with an empty robot, by energy of waits and reserve of plans."""
    label = f"runs with an empty robot, {wait} % a tick, reserve {reserve} %"
    return Figure(label, mean_of("stranded", wait, reserve), unit="%", **bounds)


def slower(one: str, other: str) -> Figure:
    """A figure: the lead time of one kind of auction is longer than that of another."""
    longer = mean_of("lead_time", one) - mean_of("lead_time", other)
    return above(f"ticks of lead time, {one} beyond {other}", longer)


def all_delivered(name: str) -> Figure:
    """A figure: the share of runs in which everything is delivered, which must be 100 %."""
    return Figure(f"runs, {name}", mean_of("all_delivered", name), at_least=1, unit="%")


LIVING_CLAIMS: Final = (
    claim(
        "With never-strand no robot runs empty",
        *(
            Figure(
                f"runs with an empty robot, {name}", mean_of("stranded", name), at_most=0, unit="%"
            )
            for name in SAFE
        ),
    ),
    claim("and every order is delivered", *map(all_delivered, SAFE)),
    claim(
        "at 0.8 kr / (kc + kr) of the throughput of infinite batteries at least",
        *(Figure(name, mean_of("share", name), LEAST_SHARE, unit="%", why=LEAST) for name in SAFE),
    ),
    claim(
        "Without it robots run empty",
        above("robots in a run", mean_of("ran_empty", "insertion, may strand")),
    ),
    claim(
        "Where waits take energy, robots run empty in most runs if plans keep no reserve",
        *(empty(wait, 0, at_least=0.5, why=OUR_BOUND) for wait in WAITS),
    ),
    claim(
        "and in one run of twenty at most if they keep 20 %",
        *(empty(wait, 20, at_most=0.05, why=OUR_BOUND) for wait in WAITS),
    ),
    claim(
        "With one charger and five robots, two or more stand in line in a tenth of all ticks",
        Figure("ticks", mean_of("in_line", "in the bids"), at_least=0.1, unit="%", why=OUR_BOUND),
    ),
    claim(
        "Robots wait longer for the charger if bids leave its line out",
        above(
            "ticks more per stay",
            mean_of("wait", "left out") - mean_of("wait", "in the bids"),
            digits=1,
        ),
    ),
    claim(
        "Local search after the auction shortens lead times, parallel sale lengthens them",
        slower("sequential, lowest bid", "sequential, local search"),
        slower("parallel", "sequential, lowest bid"),
    ),
    claim(
        "Regions of announcement, widened until somebody bids, save no messages, and orders wait longer",
        above(
            "messages more",
            mean_of("messages", NEAR_AUCTIONEERS) - mean_of("messages", FIXED_AUCTIONEERS),
        ),
        slower(NEAR_AUCTIONEERS, FIXED_AUCTIONEERS),
    ),
    claim("If a robot fails, all orders are delivered", *map(all_delivered, REPAIRS)),
)

LIVING_REMARKS: Final = (
    "Here opportunity charging equals insertion because no robot is ever idle. Every station is within "
    "20 % of a charger, so both readings of the threshold agree, too.",
    "Plans keep the reserve, but they do not foresee the energy that a robot uses in queues or behind "
    "other robots.",
)

LIVING_HEADLINES: Final = (
    Headline("insertion: runs that run empty", "With never-strand"),
    Headline("insertion: all delivered", "and every order"),
    Headline("insertion: throughput", "at 0.8 kr"),
    Headline("may strand: empty robots", "Without it robots"),
    Headline("wait 0.01 %, reserve 0: empty", "Where waits take energy"),
    Headline("wait 0.01 %, reserve 20: empty", "and in one run of twenty"),
    Headline("two or more in line", "With one charger"),
    Headline("line left out: wait, ticks", "Robots wait longer"),
    Headline("local search: lead time saved", "Local search"),
    Headline("radius 4: messages more", "Regions of announcement"),
    Headline("a failure: all delivered", "If a robot fails"),
)

REPRODUCTION: Final = Reproduction(
    name="auctions-floor",
    title="Auctions and batteries in full simulation",
    source="beyond De Ryck et al. (sequential auctions with charging): no printed figures",
    tables=LIVING_TABLES,
    claims=LIVING_CLAIMS,
    remarks=LIVING_REMARKS,
    headlines=LIVING_HEADLINES,
    seeds=40,
    claims_title="Claims",
    remarks_title="Remarks",
)
