"""Auctions, batteries, lines and failures in the living world: beyond De Ryck et al.

Robots drive cell by cell on the floor of the paper, batteries drain, orders come in, chargers have
lines, robots fail. Nothing of this is printed in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from automaton.papers.auctions.living_claims import CLAIMS, REMARKS
from automaton.papers.reproduction_study import Key, Reproduction, ScenarioCase, Table
from automaton.papers.scenario_runs import beside_infinite, conduct_all, to_the_end, with_lines

SATURATED: Final = "orders={generator: stations, count: 100}"  # all known at the start
COMING: Final = "orders={generator: stations, count: 100, mean_interarrival_time: 45}"
FAILING: Final = "orders={generator: stations, count: 60, mean_interarrival_time: 20}"
WAITS: Final = (0.01, 0.05, 0.1)  # percent in a tick
RESERVES: Final = (0, 5, 10, 20)  # percent

CHARGING: Final = {  # what strategy.charging is set to, and whether batteries are infinite
    "infinite batteries": ("strategy.charging=none", "battery=null", "faults.charge=kept"),
    "insertion": ("strategy.charging=insertion",),
    "insertion, joint": ("strategy.charging={name: insertion, mode: joint}",),
    "fill-up": ("strategy.charging=fill-up",),
    "opportunity": ("strategy.charging=opportunity",),
    "threshold, safe": ("strategy.charging=threshold",),
    "threshold, look": ("strategy.charging={name: threshold, mode: threshold-only}",),
    "insertion, may strand": ("strategy.charging={name: insertion, never_strand: false}",),
}
KEEP: Final = "while_charging: keep"  # lists stay with robots that charge, as the figures were made
KEPT: Final = f"strategy.allocation={{name: auction, {KEEP}}}"
FULLY: Final = "faults.charge=100"  # who was towed comes back full, likewise
QUEUES: Final = {"in the bids": "true", "left out": "false"}
REPAIRS: Final = {"gone for good": "null", "back after 600 ticks": "600"}
KINDS: Final = {  # parameters of strategy.allocation
    "sequential, lowest bid": "",
    "sequential, biggest difference": "winner_rule: difference",
    "sequential, regret": "winner_rule: regret",
    "sequential, local search": "local_search: true",
    "in the order of arrival": "mechanism: arrival",
    "parallel": "mechanism: parallel",
    "combinatorial": "mechanism: combinatorial",
    "assignment": "mechanism: assignment",
    "two fixed auctioneers": "auctioneer: fixed",
    "two fixed auctioneers, radius 4": "auctioneer: fixed, announcement_radius: 4",
    "token, radius 4": "auctioneer: token, announcement_radius: 4",
    "around the order, radius 4": "region: order, announcement_radius: 4",
}


def stranding_cases(_: Sequence[str]) -> list[ScenarioCase]:
    """Each charging strategy with more orders than robots can do."""
    return [
        ScenarioCase({"charging": name}, "depots-full", (KEPT, FULLY, SATURATED, *settings))
        for name, settings in CHARGING.items()
    ]


def waiting_cases(_: Sequence[str]) -> list[ScenarioCase]:
    """Waits that take energy, by what plans keep in reserve."""
    return [
        ScenarioCase(
            {"wait, % per tick": str(wait), "reserve, %": reserve},
            "depots-full",
            (
                KEPT,
                FULLY,
                COMING,
                "strategy.charging=insertion",
                f"battery.drain.wait={wait}",
                f"battery.reserve={reserve}",
            ),
        )
        for wait in WAITS
        for reserve in RESERVES
    ]


def line_cases(_: Sequence[str]) -> list[ScenarioCase]:
    """Five robots around one charger, that count its line or do not."""
    return [
        ScenarioCase(
            {"lines": name},
            "depots-line",
            (KEPT, f"strategy.charging={{name: insertion, count_queues: {queues}}}"),
        )
        for name, queues in QUEUES.items()
    ]


def failure_cases(_: Sequence[str]) -> list[ScenarioCase]:
    """A robot fails, and is back or not."""
    return [
        ScenarioCase(
            {"robot": name}, "depots", (KEPT, FULLY, FAILING, f"faults.repair_time={repair}")
        )
        for name, repair in REPAIRS.items()
    ]


def kind_cases(_: Sequence[str]) -> list[ScenarioCase]:
    """Each kind of auction on the same stream of orders."""
    return [
        ScenarioCase(
            {"auction": name},
            "depots",
            (f"strategy.allocation={{name: auction, {KEEP}{', ' if more else ''}{more}}}",),
        )
        for name, more in KINDS.items()
    ]


def unpublished(key: Key, metric: str) -> None:
    """The paper has no figures of a living world."""


REPRODUCTION: Final = Reproduction(
    name="auctions-floor",
    title="Auctions and batteries in the living world",
    source="beyond De Ryck et al. (sequential auctions with charging): no printed figures",
    strategies=(),
    tables=(
        Table(
            name="stranding",
            title="More orders than four robots can do, a charger in every depot (depots-full)",
            cases=stranding_cases,
            panels=(("ran_empty", "all_delivered", "share", "T_total"),),
            shares=("all_delivered", "share"),
            published=unpublished,
            run=beside_infinite,
            digits=1,
        ),
        Table(
            name="waiting",
            title="Waits take energy (depots-full, orders come in, insertion)",
            cases=waiting_cases,
            panels=(("stranded", "ran_empty", "lead_time"),),
            shares=("stranded",),
            published=unpublished,
            run=conduct_all(to_the_end),
            digits=1,
            grouped=1,
        ),
        Table(
            name="lines",
            title="Five robots around one charger (depots-line)",
            cases=line_cases,
            panels=(("in_line", "wait", "stays", "lead_time"),),
            shares=("in_line",),
            published=unpublished,
            run=conduct_all(with_lines),
            digits=1,
        ),
        Table(
            name="failures",
            title="A robot fails at a tick drawn by the seed (depots)",
            cases=failure_cases,
            panels=(("breakdowns", "all_delivered", "recovered", "lead_time", "T_total"),),
            shares=("all_delivered",),
            published=unpublished,
            run=conduct_all(to_the_end, failing=True),
            digits=1,
        ),
        Table(
            name="kinds",
            title="Kinds of auctions, central and decentral (depots)",
            cases=kind_cases,
            panels=(("T_total", "lead_time", "E_U_moves", "auctions", "bids", "messages"),),
            shares=("E_U_moves",),
            published=unpublished,
            run=conduct_all(to_the_end),
        ),
    ),
    averaged=(),
    claims=CLAIMS,
    remarks=REMARKS,
    seeds=40,
    claims_title="Claims",
    remarks_title="Remarks",
)
