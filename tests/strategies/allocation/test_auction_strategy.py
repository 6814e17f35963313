"""The options of `auction` in the world: each changes the run, and does what it says."""

from __future__ import annotations

from itertools import chain
from typing import Any

import pytest
from drawn_scenes import scene

from automaton.engine.state import BATTERY_FULL, LAYER_ALLOCATION, NIL, ORDER_DELIVERED
from automaton.errors import InputError
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve
from strategies.allocation.auction.market import INF_COST
from strategies.allocation.auction.metaheuristics import genetic, objective

EIGHT = "orders={generator: stations, count: 8}"
FIFTY = "orders={generator: stations, count: 50, mean_interarrival_time: 30}"
NO_BATTERY = ("battery=null", "strategy.charging=none")


def auction(options: str, *settings: str, name: str = "depots", seed: int = 1) -> Simulation:
    """A run, not begun yet, with these options of the auction."""
    chosen = f"strategy.allocation={{name: auction{', ' if options else ''}{options}}}"
    return Simulation(resolve(name, [chosen, *settings]), seed)


def lists(run: Simulation) -> list[list[int]]:
    """What each robot has taken and plans to do."""
    robots = run.world.robots
    return [
        [int(robots.order[i])] * int(robots.order[i] != NIL)
        + robots.order_queue[i, : robots.order_queue_length[i]].tolist()
        for i in robots.at_index
    ]


def sold_at_once(options: str, *settings: str, seed: int = 1) -> Simulation:
    """A run after its first tick, in which eight orders were sold to full batteries."""
    run = auction(options, EIGHT, *settings, seed=seed)
    run.run(until=1)
    return run


def value(run: Simulation) -> int:
    """What the last auction made of the lists: the objective for epsilon = 0.5."""
    return int(objective(run.states[LAYER_ALLOCATION].market.fleet, 500))


# Kinds of auctions, and what they count.


def test_bids_and_messages_of_the_kinds_are_counted() -> None:
    counted = {kind: sold_at_once(f"mechanism: {kind}").counted for kind in COUNTS}
    assert {kind: (c["bids"], c["messages"]) for kind, c in counted.items()} == COUNTS
    assert all(c["auctions"] == 1 for c in counted.values())


COUNTS = {  # 4 robots hear of 8 orders; a message for each, for each bid, and for each sale
    "sequential": (32 + 28, 32 + 60 + 8),  # after each sale the winner bids for what is left
    "arrival": (32, 32 + 32 + 8),
    "parallel": (32, 32 + 32 + 8),
    "assignment": (32, 32 + 32 + 4),
    "combinatorial": (4 * 255, 32 + 1020 + 4),
}


def test_one_shot_assignment_gives_each_robot_one_order_at_a_time() -> None:
    assert [len(one) for one in lists(sold_at_once("mechanism: assignment"))] == [1, 1, 1, 1]


@pytest.mark.parametrize("seed", range(1, 6))
def test_nothing_beats_the_exact_allotment_and_search_never_worsens_one(seed: int) -> None:
    kinds = ("sequential", "arrival", "parallel", "combinatorial", "genetic", "exact")
    found = {
        kind: value(sold_at_once(f"mechanism: {kind}", *NO_BATTERY, seed=seed)) for kind in kinds
    }
    assert found["exact"] == min(found.values())
    for kind in kinds:
        searched = value(
            sold_at_once(f"mechanism: {kind}, local_search: true", *NO_BATTERY, seed=seed)
        )
        assert found["exact"] <= searched <= found[kind]


def test_search_after_the_auction_makes_shorter_lists() -> None:
    plain = [value(sold_at_once("", seed=seed)) for seed in range(1, 11)]
    searched = [value(sold_at_once("local_search: true", seed=seed)) for seed in range(1, 11)]
    assert all(after <= before for after, before in zip(searched, plain, strict=True))
    assert sum(searched) < 0.97 * sum(plain)


KINDS = (
    "bid_rule: average",
    "bid_rule: average-paper",
    "epsilon: 0",
    "epsilon: 1",
    "epsilon: load",
    "epsilon: {from: 1, to: 0, until: 1000}",
    "winner_rule: difference",
    "winner_rule: regret",
    "local_search: true",
    "max_orders_per_robot: 1",
    "max_items: 1",
    "mechanism: arrival",
    "mechanism: parallel",
    "mechanism: combinatorial",
    "mechanism: genetic",
    "mechanism: assignment",
    "auctioneer: fixed",
    "auctioneer: token, announcement_radius: 3",
    "auctioneer: time, announcement_radius: 3",
    "region: order, announcement_radius: 3",
    "reauction_after: 0",
    "while_charging: keep",
)


def test_every_option_makes_another_run_and_all_deliver_everything() -> None:
    digests = {}
    for options in ("", *KINDS):
        resolved = auction(options, FIFTY.replace("30", "25")).resolved  # somebody is idle at times
        recorder = MemoryRecorder(resolved)
        run = Simulation(resolved, on_record=recorder)
        run.run()
        figures = metrics_of(run)
        assert run.finished and (figures["battery_depletions"], figures["illegal_answers"]) == (
            0,
            0,
        ), options
        assert validate_stored(recorder.recording()).valid
        digests.setdefault(run.digest, []).append(options)
    assert [same for same in digests.values() if len(same) > 1] == []


def test_fewest_bidders_first_makes_a_difference_where_not_all_bid() -> None:
    many = "orders={generator: stations, count: 40}"
    for heard, same in (("", True), (", region: order, announcement_radius: 4", False)):
        runs = [auction(f"winner_rule: {winner}{heard}", many) for winner in ("lowest", "fewest")]
        for run in runs:
            run.run(until=1)
        assert (lists(runs[0]) == lists(runs[1])) == same


# Lists, and how many are sold.


@pytest.mark.parametrize("limit", [1, 3])
def test_no_list_is_longer_than_the_limit(limit: int) -> None:
    run = auction(f"max_orders_per_robot: {limit}", name="depots-full")
    longest = 0
    while run.tick < 1500:
        run.run(until=run.tick + 1)
        longest = max(longest, int(run.world.robots.order_queue_length.max()))
    assert longest == limit


@pytest.mark.parametrize("horizon", [1, 5])
def test_an_auction_sells_no_more_orders_than_its_horizon(horizon: int) -> None:
    sold = sorted(chain.from_iterable(lists(sold_at_once(f"max_items: {horizon}"))))
    assert sold == list(range(horizon))


# Epsilon.


def same_run(one: str, other: str, *settings: str) -> bool:
    digests = set()
    for options in (one, other):
        run = auction(options, *settings)
        run.run()
        digests.add(run.digest)
    return len(digests) == 1


def test_a_schedule_goes_evenly_from_one_epsilon_to_another() -> None:
    assert same_run("epsilon: {from: 0, to: 1, until: 1}", "epsilon: 1", FIFTY)
    assert same_run("epsilon: {from: 0.3, to: 0.3, until: 700}", "epsilon: 0.3", FIFTY)
    run = auction("epsilon: {from: 0.2, to: 0.6, until: 1000}", FIFTY)
    strategy: Any = run.strategies[LAYER_ALLOCATION]
    found = []
    for tick in (0, 500, 1000, 9000):
        run.world.clock.tick = tick
        found.append(strategy._epsilon(run.view, 1, 1))
    assert found == [200, 400, 600, 600]


def test_load_makes_epsilon_grow_with_the_orders_for_each_robot() -> None:
    lines = (f"{{from: [0, 2], to: [8, 8], release: {at}}}" for at in range(0, 3000, 300))
    one_by_one = f"orders={{list: [{', '.join(lines)}]}}"
    assert same_run("epsilon: load", "epsilon: 0.083", one_by_one), "1 of 3 x 4"
    at_once = "orders={generator: stations, count: 12}"
    assert same_run("epsilon: load", "epsilon: 1", at_once), "12 of 3 x 4"


# Auctioneers and who hears them.


def test_whoever_the_auctioneer_is_the_result_is_the_same_if_all_hear_it() -> None:
    assert same_run("", "auctioneer: token", FIFTY)
    assert same_run("", "auctioneer: time", FIFTY)
    assert same_run("", "auctioneer: fixed, auctioneers: 1", FIFTY)


def test_a_token_is_passed_on_after_each_auction_and_a_term_after_its_ticks() -> None:
    run = auction("auctioneer: token", FIFTY)
    state = run.states[LAYER_ALLOCATION]
    held = set()
    for until in range(1, 900, 10):
        run.run(until=until)
        assert state.auctioneer == state.rounds % 4
        held.add(int(state.auctioneer))
    assert held == {0, 1, 2, 3}
    run = auction("auctioneer: time, auctioneer_term: 250", FIFTY)
    state = run.states[LAYER_ALLOCATION]
    for tick in range(1, 1200):
        rounds = int(state.rounds)
        run.run(until=tick)
        assert state.rounds == rounds or state.auctioneer == tick // 250 % 4


def test_fixed_auctioneers_sell_the_orders_nearest_to_them() -> None:
    """Two hold an auction each where one would hold one."""
    assert sold_at_once("auctioneer: fixed, auctioneers: 1").counted["auctions"] == 1
    two = sold_at_once("auctioneer: fixed, auctioneers: 2")
    assert two.counted["auctions"] == 2
    assert two.counted["bids"] < 60, "two short auctions take fewer bids than a long one"


ROAD = "t..........."


def road(options: dict[str, Any], *robots: int) -> Simulation:
    """One order at the left end, robots at these columns."""
    resolved = scene(
        ROAD,
        [(x, 0) for x in robots],
        orders={"list": [{"from": [0, 0], "to": [0, 0]}]},
        strategy={"allocation": {"name": "auction", **options}, "right_of_way": "wait"},
    )
    run = Simulation(resolved)
    run.run(until=1)
    return run


@pytest.mark.parametrize(("column", "rounds"), [(1, 1), (2, 2), (3, 3), (4, 3), (5, 4), (8, 4)])
def test_a_region_is_doubled_until_somebody_bids(column: int, rounds: int) -> None:
    """Radius 1, 2, 4, 8: each round is an auction; only those who hear cost messages."""
    run = road({"region": "order", "announcement_radius": 1}, column)
    assert run.counted == {"auctions": rounds, "bids": 1, "messages": 3}
    assert run.world.orders.reserved_by[0] == 0


def test_a_region_leaves_out_robots_that_are_far_away() -> None:
    everybody = road({}, 2, 9, 10)
    near = road({"region": "order", "announcement_radius": 3}, 2, 9, 10)
    assert everybody.counted == {"auctions": 1, "bids": 3, "messages": 3 + 3 + 1}
    assert near.counted == {"auctions": 1, "bids": 1, "messages": 1 + 1 + 1}


def test_around_an_auctioneer_those_hear_it_who_are_near_to_it() -> None:
    """The second of two robots has the token first: around it there is nobody else."""
    run = road({"auctioneer": "token", "announcement_radius": 2}, 2, 9)
    assert run.counted == {"auctions": 1, "bids": 1, "messages": 3}
    assert run.world.orders.reserved_by[0] == 1, "though the other one is nearer"


# Late robots.


def test_a_late_robot_gives_its_list_back() -> None:
    late = ("world.extra_tick_probability=1.0", "durations.move=2", EIGHT, *NO_BATTERY)
    runs = [auction(f"reauction_after: {after}", *late) for after in ("null", "100000", "0")]
    for run in runs:
        run.run()
        assert run.finished
    assert runs[0].digest == runs[1].digest, "so late is nobody"
    assert runs[0].counted["auctions"] == 1
    assert runs[2].counted["auctions"] > 2


def test_who_is_on_time_keeps_its_list() -> None:
    assert same_run("reauction_after: 0", "", EIGHT, *NO_BATTERY)


# Robots that charge.


def test_orders_do_not_wait_in_the_lists_of_robots_that_charge() -> None:
    """Five robots and one charger: the slowest twentieth of the orders, over three seeds."""
    slowest = {}
    for option in ("keep", "release"):
        runs = [auction(f"while_charging: {option}", name="depots-line", seed=s) for s in (1, 2, 3)]
        for run in runs:
            run.run()
            assert run.finished
        slowest[option] = sum(metrics_of(run)["lead_time_p95"] for run in runs)
    assert slowest["release"] < 0.9 * slowest["keep"]


# What cannot be done.

IMPOSSIBLE = (  # 16 to 14 and to a charger takes more than a battery holds above the reserve
    "orders={list: [{from: [8, 8], to: [0, 8]}, {from: [0, 2], to: [4, 5]}, "
    "{from: [8, 2], to: [4, 5]}, {from: [4, 5], to: [0, 5]}]}",
    "battery.reserve=25",
    "stop.max_duration=3000",
)


@pytest.mark.parametrize("kind", ["sequential", "combinatorial", "genetic", "assignment"])
def test_an_order_that_nobody_can_do_does_not_keep_the_others_from_being_done(kind: str) -> None:
    run = auction(f"mechanism: {kind}", *IMPOSSIBLE)
    run.run()
    state = run.world.orders.state
    assert (state[1:] == ORDER_DELIVERED).all() and state[0] != ORDER_DELIVERED
    assert (run.world.tally.failures == 0).all()


ISLAND = """
t....t#.
......#.
c.....#t
"""


def test_a_robot_whose_way_there_is_not_counts_as_empty_and_not_as_charged() -> None:
    """It would take more units than a battery counts; the other one gets what is sold next."""
    orders = [{"from": [0, 0], "to": [5, 0]}, {"from": [5, 0], "to": [0, 0], "release": 3}]
    battery = {"drain": {"move": 1.0}, "charge_rate": 10.0, "reserve": 10}
    strategy = {"allocation": "auction", "charging": "threshold", "right_of_way": "retreat"}
    rules = {"battery": battery, "strategy": strategy}
    run = Simulation(scene(ISLAND, [(1, 1), (4, 1)], orders={"list": orders}, **rules))
    run.run(2)
    assert run.world.robots.order.tolist() == [0, NIL]
    run.world.robots.goal_cell[0] = run.resolved.floor_plan.cell(7, 0)
    run.run(3)
    fleet = run.states[LAYER_ALLOCATION].market.fleet
    assert fleet.charge.tolist() == [-BATTERY_FULL, BATTERY_FULL]
    assert lists(run)[1] == [1]


def first_genes(seed: int, monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """What the genetic auctions of a run begin with, each with as many tasks."""
    tools, found = 4, []
    count, generations = tools + 2, tools + 4

    def first_generation(*given: Any) -> int:
        genetic(*given[:generations], 0, *given[generations + 1 :])
        found.append(tuple(given[tools].genes[:, : given[count]].flat))
        return INF_COST  # so that the orders are sold in sequence

    monkeypatch.setattr("strategies.allocation.auction.auction.genetic", first_generation)
    auction("mechanism: genetic", FIFTY, seed=seed).run(until=1000)
    return [genes for genes in found if len(genes) == len(found[0])]


def test_genetic_auctions_of_other_seeds_and_of_one_run_draw_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    genes = [one for seed in (1, 2, 3) for one in first_genes(seed, monkeypatch)]
    assert len(genes) > 30 and len(set(genes)) == len(genes)


def test_kinds_that_cannot_do_a_scenario_say_so() -> None:
    with pytest.raises(InputError, match="mechanism exact ignores charging"):
        auction("mechanism: exact")
    for kind in ("exact", "combinatorial"):
        with pytest.raises(InputError, match=r"at most 16 robots, and fleet\.robots is 17"):
            auction(f"mechanism: {kind}", *NO_BATTERY, "fleet.robots=17", "fleet.start=random")


def test_all_of_a_large_fleet_s_orders_are_sold() -> None:
    """Beyond the depots: the same auction in a warehouse of racks."""
    settings = ["strategy.allocation=auction", "fleet.robots=20", "stop.max_duration=400"]
    run = Simulation(resolve("warehouse-100", settings))
    run.run()
    assert metrics_of(run)["delivered"] > 15
    assert metrics_of(run)["illegal_answers"] == 0
