"""Traffic avoidance by every robot of the warehouse: beyond Bhattathiri, Li & Kuhl.

The paper dispatches one robot among five that do not react. Here the whole fleet follows one policy
under the dynamic rule of slow zones, one task after another; the paper prints no such results. All
policies face the same orders: dock and rack of order k depend only on the seed and on k.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from automaton.papers.claims import OUR_BOUND, Figure, MeanQuantity, above, claim, mean_of
from automaton.papers.reproduction_study import Headline, PublishedTable, Reproduction, ScenarioCase

WAREHOUSE_SCENARIO: Final = "warehouse-100"
FLEET_SIZES: Final = (6, 20, 50, 100)
LARGEST_FLEET: Final = FLEET_SIZES[-1]
TICKS_BY_ROBOTS: Final = {6: 6900}  # long enough for small fleets to finish enough tasks
USUAL_TICKS: Final = 2300
CHANCE: Final = "10 %"  # of a tick more for a move

A_STAR: Final = "A*"
AVOIDANCE: Final = "avoidance"
TIME_AVERAGE: Final = "time average"
UNDELAYED: Final = "undelayed"
SHARED_PLANS: Final = "shared plans"
CONGESTION: Final = "congestion"

ROUTING_POLICIES: Final = {  # what strategy.routing is set to; any other strategy stands for itself
    A_STAR: "{name: astar, tie_break: random}",
    AVOIDANCE: "{name: traffic-avoidance, tie_break: random}",
    TIME_AVERAGE: "{name: congestion, forecast: task-averages, beta: 1, replan_period: 0}",
    UNDELAYED: "{name: congestion, forecast: tasks, beta: 1, replan_period: 0}",
    SHARED_PLANS: "{name: congestion, beta: 1, replan_period: 0}",
    CONGESTION: "{name: congestion, beta: 2, replan_period: 20}",
}
FLEET_METRICS: Final = ("task_time", "delay", "completions")


def scenario_of(policy: str, robots: int) -> tuple[str, ...]:
    """The settings of warehouse-100 for a fleet with a policy."""
    routing = ROUTING_POLICIES.get(policy, policy)
    ticks = TICKS_BY_ROBOTS.get(robots, USUAL_TICKS)
    return f"strategy.routing={routing}", f"fleet.robots={robots}", f"stop.max_duration={ticks}"


def fleets(policies: Sequence[str]) -> list[ScenarioCase]:
    """Each policy with each size of the fleet."""
    return [
        ScenarioCase(
            {"policy": policy, "robots": robots}, WAREHOUSE_SCENARIO, scenario_of(policy, robots)
        )
        for policy in policies
        for robots in FLEET_SIZES
    ]


def delayed_fleets(policies: Sequence[str]) -> list[ScenarioCase]:
    """The largest fleet with each policy, with moves that randomly take longer."""
    return [
        ScenarioCase(
            {"policy": policy, "extra tick": CHANCE},
            WAREHOUSE_SCENARIO,
            (*scenario_of(policy, LARGEST_FLEET), "world.extra_tick_probability=0.1"),
        )
        for policy in policies
    ]


def delay(policy: str, of: int | str = LARGEST_FLEET) -> MeanQuantity:
    """The mean delay with a policy; `of`: number of robots, or CHANCE."""
    return mean_of("delay", policy, of)


def beyond_a_star(policy: str, robots: int, **bounds: Any) -> Figure:
    """A figure: the additional delay with a policy."""
    more = delay(policy, robots) - delay(A_STAR, robots)
    return Figure(f"delay beyond A*, N = {robots}", more, digits=1, **bounds)


TRAFFIC_FLEET_CLAIMS: Final = (
    claim(
        "Avoidance by static counts harms a fleet in which everybody uses it",
        *(beyond_a_star(AVOIDANCE, robots, at_least=0, strict=True) for robots in FLEET_SIZES),
    ),
    claim(
        "What helps is to know the plans of the others: their tasks alone are not enough",
        *(
            above(
                f"delay by {policy} beyond {SHARED_PLANS}",
                delay(policy) - delay(SHARED_PLANS),
                digits=1,
            )
            for policy in (TIME_AVERAGE, UNDELAYED)
        ),
    ),
    claim(
        "Search in time through shared plans leaves 100 robots at most 7 ticks of delay",
        Figure("delay", delay(CONGESTION), at_most=7, digits=1, why=OUR_BOUND),
    ),
    claim(
        "It gives at least a fifth more throughput than A*",
        Figure(
            "more completions",
            mean_of("completions", CONGESTION, LARGEST_FLEET)
            / mean_of("completions", A_STAR, LARGEST_FLEET)
            - 1,
            at_least=0.2,
            unit="%",
            why=OUR_BOUND,
        ),
    ),
    claim("Six robots lose nothing by it", beyond_a_star(CONGESTION, 6, at_most=0)),
    claim(
        "It bears that plans are not kept: at most 27 ticks of delay, extra ticks included",
        Figure("delay", delay(CONGESTION, CHANCE), at_most=27, digits=1, why=OUR_BOUND),
    ),
)

TRAFFIC_FLEET_REMARKS: Final = (
    "The paper studies one robot that avoids five others with plain A*, and leaves mutual avoidance to "
    "further work.",
    "Counts of all future users of a zone make all robots avoid the same busy zones at the same time, so "
    "that they meet elsewhere; it helps to know when robots will be in a zone, from their real plans.",
    "time average: a zone costs the share of their tasks that other robots spend there on their A* "
    "paths; undelayed: the same paths, searched in time as if no robot delayed another; shared plans: "
    "the routes of all robots, replayed with the slow zones.",
    "Extra ticks count as delay, although no robot is in the way.",
)

FLEET_HEADLINES: Final = (
    *(
        Headline(f"100 robots, delay: {policy}", cell=("delay", (policy, LARGEST_FLEET)), digits=1)
        for policy in ROUTING_POLICIES
    ),
    Headline("avoidance beyond A*, 6 robots", "Avoidance by static counts harms"),
    Headline("time average beyond plans", "What helps is to know"),
    Headline("congestion, delay", "Search in time through shared plans"),
    Headline("congestion, throughput gained", "It gives at least a fifth"),
    Headline("congestion, extra ticks: delay", "It bears that plans"),
)

REPRODUCTION: Final = Reproduction(
    name="traffic-fleet",
    title="Warehouse with slow zones, the whole fleet by one policy",
    source="beyond Shaji Bhattathiri, Li & Kuhl, A traffic avoidance path planning method for "
    "autonomous vehicles in a warehouse environment: no printed figures",
    strategies=tuple(ROUTING_POLICIES),
    tables=(
        PublishedTable(
            title="All moves take what their zones say",
            cases=fleets,
            panels=(FLEET_METRICS,),
            digits=2,
            grouped=1,
        ),
        PublishedTable(
            title=f"{LARGEST_FLEET} robots, a tick more for {CHANCE} of the moves",
            cases=delayed_fleets,
            panels=(FLEET_METRICS,),
            digits=2,
            grouped=0,
        ),
    ),
    claims=TRAFFIC_FLEET_CLAIMS,
    remarks=TRAFFIC_FLEET_REMARKS,
    headlines=FLEET_HEADLINES,
    seeds=3,
    claims_title="Claims",
    remarks_title="Remarks",
)
