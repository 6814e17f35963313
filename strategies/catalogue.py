"""The table of built-in strategies: name, implementation, parameters.

Neither this module nor the `*_parameters` modules import Numba, so reading, checking and listing
scenarios starts fast. This is why parameters are not beside their strategies.
"""

from __future__ import annotations

from automaton.strategy.lookup import (
    DYNAMIC,
    IMPORTED,
    MANUFACTURING,
    METHOD_PROPERTIES,
    MULTIPLE,
    ROUTED,
    SLOW_STEERED,
    STEERED,
    WAREHOUSE,
    CatalogueEntry,
    NoParameters,
)
from strategies.allocation.allocation_parameters import (
    Alleys,
    Auctions,
    FirstComeParameters,
    GreedyParameters,
    IndependentParameters,
    ShortestJobParameters,
)
from strategies.charging.charging_parameters import FillUp, Insertion, Opportunity, Threshold
from strategies.right_of_way.right_of_way_parameters import (
    EpibtParameters,
    PibtParameters,
    RetreatParameters,
    Waits,
)
from strategies.routing.routing_parameters import (
    Avoidance,
    SharedPlans,
    ShortestRoutes,
    TieBreaking,
)
from strategies.zoning.zoning_parameters import Annealing, Decentralized, Genetic, Monitoring

# Reader of zone designs: (floor plan, roads, data, names of points) -> Design.
ZONE_DESIGNS = "strategies.zoning.design_files:read_design"

CATALOGUE: dict[str, dict[str, CatalogueEntry]] = {
    "zoning": {
        "static": CatalogueEntry(
            "strategies.zoning.monitored:StaticZones",
            Monitoring,
            "fixed zones; robots share orders while the zones are unbalanced",
            in_random_cases=True,
        ),
        "annealing": CatalogueEntry(
            "strategies.zoning.monitored:AnnealedZones",
            Annealing,
            "zones redesigned by simulated annealing (Ho & Liao; Keith & La)",
            (DYNAMIC, MANUFACTURING),
        ),
        "genetic": CatalogueEntry(
            "strategies.zoning.monitored:GeneticZones",
            Genetic,
            "zones redesigned by a genetic algorithm (Keith & La)",
            (MULTIPLE, DYNAMIC, MANUFACTURING, WAREHOUSE),
        ),
        "decentralized": CatalogueEntry(
            "strategies.zoning.decentralized:DecentralizedZones",
            Decentralized,
            "robots in range of each other negotiate their zones (DDZ; Keith & La)",
            METHOD_PROPERTIES,
        ),
    },
    "charging": {
        "insertion": CatalogueEntry(
            "strategies.charging.quoted:InsertCharging",
            Insertion,
            "optimal insertion: the cheapest charger, position in the list and charging time (De Ryck)",
            in_random_cases=True,
        ),
        "threshold": CatalogueEntry(
            "strategies.charging.quoted:ThresholdCharging",
            Threshold,
            "threshold-100: below 20 %, charge at the nearest charger until full (De Ryck)",
            in_random_cases=True,
        ),
        "fill-up": CatalogueEntry(
            "strategies.charging.quoted:FillUpCharging",
            FillUp,
            "as insertion, but robots charge up to a target whenever their list needs a charger",
        ),
        "opportunity": CatalogueEntry(
            "strategies.charging.quoted:OpportunityCharging",
            Opportunity,
            "idle robots charge at free chargers and leave for orders that they can finish",
        ),
    },
    "allocation": {
        "independent": CatalogueEntry(
            "strategies.allocation.independent:Independent",
            IndependentParameters,
            "nearest unreserved order, carried to its destination (Grzejszczak & Nocon, alg. 1)",
            in_random_cases=True,
        ),
        "cooperative": CatalogueEntry(
            "strategies.allocation.cooperative:Cooperative",
            Alleys,
            "bucket brigade: robots pass loads from table to table (Grzejszczak & Nocon, alg. 2)",
        ),
        "adaptive": CatalogueEntry(
            "strategies.allocation.cooperative:Adaptive",
            Alleys,
            "each robot carries a load or passes it on, whichever cost less in its own experience",
        ),
        "first-come": CatalogueEntry(
            "strategies.allocation.first_come:FirstCome",
            FirstComeParameters,
            "oldest unreserved order, or the one due first, carried to its destination",
            in_random_cases=True,
        ),
        "greedy": CatalogueEntry(
            "strategies.allocation.greedy:Greedy",
            GreedyParameters,
            "cheapest pair of robot and order first; orders not yet begun may be matched again",
            default_for=IMPORTED,
            in_random_cases=True,
        ),
        "shortest-job": CatalogueEntry(
            "strategies.allocation.shortest_job:ShortestJob",
            ShortestJobParameters,
            "shortest job first with aging, in the robot's zone if there are zones (Keith & La)",
            in_random_cases=True,
        ),
        "auction": CatalogueEntry(
            "strategies.allocation.auction.auction:Auction",
            Auctions,
            "auctions with charging in the bids: sequential, parallel, combinatorial, ... (De Ryck)",
            in_random_cases=True,
        ),
        "independent-python": CatalogueEntry(
            "strategies.allocation.independent:IndependentPython",
            NoParameters,
            "the strategy of the tutorial: 'independent' in plain Python, with equal digests",
        ),
    },
    "routing": {
        "shortest": CatalogueEntry(
            "strategies.routing.shortest:Shortest",
            ShortestRoutes,
            "the path that takes the fewest ticks, including turns",
            in_random_cases=True,
        ),
        "astar": CatalogueEntry(
            "strategies.routing.astar:AStar",
            TieBreaking,
            "A*: a path that takes the fewest ticks; a rule breaks ties",
            in_random_cases=True,
        ),
        "traffic-avoidance": CatalogueEntry(
            "strategies.routing.traffic_avoidance:TrafficAvoidance",
            Avoidance,
            "A* around zones where many robots are predicted (Shaji Bhattathiri, Li & Kuhl)",
        ),
        "congestion": CatalogueEntry(
            "strategies.routing.congestion:Congestion",
            SharedPlans,
            "routes around the traffic predicted from the plans of all robots, by zone and tick",
        ),
    },
    "right_of_way": {
        "pibt": CatalogueEntry(
            "strategies.right_of_way.pibt.pibt:Pibt",
            PibtParameters,
            "robots make way by inherited priority (PIBT); turns and moves may take any number of "
            "ticks",
            default_for=STEERED,
            in_random_cases=True,
        ),
        "epibt": CatalogueEntry(
            "strategies.right_of_way.epibt.epibt:Epibt",
            EpibtParameters,
            "robots plan a few actions ahead and push each other (EPIBT)",
            default_for=SLOW_STEERED,
        ),
        "retreat": CatalogueEntry(
            "strategies.right_of_way.retreat:Retreat",
            RetreatParameters,
            "wait, retry, then retreat by a random number of moves (Grzejszczak & Nocon)",
            default_for=ROUTED,
            in_random_cases=True,
        ),
        "wait": CatalogueEntry(
            "strategies.right_of_way.retreat:Wait",
            Waits,
            "wait and retry for ever; shows which deadlocks a floor has",
            in_random_cases=True,
        ),
    },
}
