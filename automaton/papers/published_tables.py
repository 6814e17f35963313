"""Published tables and how to reproduce them, by name. A new one is a module and a line here."""

from __future__ import annotations

import importlib

from automaton.errors import InputError, alternatives, nearest
from automaton.papers.reproduction_study import Reproduction

REPRODUCTIONS = {  # name: (module with REPRODUCTION, what it holds)
    "tabletop": (
        "automaton.papers.tabletop_study",
        "table-top warehouse: independent and cooperative robots (Grzejszczak & Nocoń, Table 3)",
    ),
    "traffic": (
        "automaton.papers.traffic.traffic_study",
        "warehouse with slow zones: A* and traffic avoidance (Bhattathiri, Li & Kuhl, Table 5)",
    ),
    "traffic-fleet": (
        "automaton.papers.traffic.traffic_fleet",
        "the same warehouse, up to 100 robots, all by one policy: beyond the paper",
    ),
    "auctions": (
        "automaton.papers.auctions.auction_study",
        "sequential auctions with charging in the bids (De Ryck et al., sections 4 and 5)",
    ),
    "auctions-floor": (
        "automaton.papers.auctions.living_auctions",
        "auctions, batteries, lines and failures in the living world: beyond the paper",
    ),
    "fleets": (
        "automaton.papers.fleets.fleet_study",
        "hundreds of robots on grids, pibt and epibt (Yukhnevich & Andreychuk; Robot Runners)",
    ),
    "queues": (
        "automaton.papers.queues.queue_study",
        "one robot that serves lines one by one: an M/G/1 queue, beside its formula",
    ),
    "zoning": (
        "automaton.papers.zoning.zoning_study",
        "zones of a factory that are redesigned (Keith & La, Table 5 and Figure 5)",
    ),
}


def find(name: str) -> Reproduction:
    """The reproduction of a name. Raises InputError for an unknown one."""
    if name not in REPRODUCTIONS:
        raise InputError(
            f"nothing called '{name}' to reproduce{nearest(name, REPRODUCTIONS)}; "
            f"there is {alternatives(REPRODUCTIONS)}"
        )
    module = importlib.import_module(REPRODUCTIONS[name][0])
    found: Reproduction = module.REPRODUCTION
    return found
