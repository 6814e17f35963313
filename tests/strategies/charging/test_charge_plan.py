"""Charging of a list, against trying everything."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator

import numpy as np
import pytest
from auction_scenes import TAPER, between_with, market_of, random_situation, stops_of
from reference_charging import Situation, best_single, best_ticks, charging_time, ticks_of

from automaton.engine.energy import charging_ticks, level_after
from automaton.engine.state import BATTERY_FULL
from layouts.depots import OPTIONAL_LANES
from strategies.allocation.auction import quotes
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_FILL_UP,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
    ChargingPlan,
)


def short_of_energy(count: int, seed: int, **options: object) -> list[Situation]:
    """Situations in which the list cannot be driven without charging."""
    rng = random.Random(seed)
    drawn = (random_situation(rng, **options) for _ in itertools.count())  # type: ignore[arg-type]
    return list(itertools.islice((case for case in drawn if ticks_of(case, ()) is None), count))


def test_one_stop_is_the_best_of_all_positions_and_chargers() -> None:
    """200 states in which at most one stop is needed; ties by the rule too."""
    seen = 0
    for case in short_of_energy(800, seed=1):
        *_, fleet, scratch = market_of(case)
        if scratch.plan.stops != 1 or fleet.cost[0] >= INF_COST:
            continue
        best = best_single(case)
        assert best is not None
        done = ticks_of(case, best)
        assert done is not None and done[0] == fleet.cost[0]
        assert stops_of(scratch) == best
        seen += 1
    assert seen >= 200


def test_several_stops_are_the_best_of_all_sequences_of_three() -> None:
    several = infeasible = 0
    for case in short_of_energy(150, seed=2, chargers=2):
        *_, fleet, scratch = market_of(case)
        if scratch.plan.stops > 3:
            continue
        best = best_ticks(case, 3)
        if best is None:
            assert fleet.cost[0] >= INF_COST
            infeasible += 1
            continue
        assert best == fleet.cost[0]
        several += scratch.plan.stops > 1
    assert several >= 15
    assert infeasible >= 10


def test_no_charging_where_none_is_needed() -> None:
    rng = random.Random(3)
    for _ in range(100):
        case = random_situation(rng)
        direct = ticks_of(case, ())
        if direct is not None:
            *_, fleet, scratch = market_of(case)
            assert (fleet.cost[0], scratch.plan.stops) == (direct[0], 0)


def check_figures(case: Situation, plan: ChargingPlan, target: int | None = None) -> None:
    """What the plan says of itself adds up."""
    path = [case.start, *case.stops]
    direct = sum(case.between[a][b] for a, b in itertools.pairwise(path))
    assert plan.cost == direct + plan.net
    assert plan.lowest_charge >= case.reserve
    assert plan.end_charge >= case.reserve
    assert plan.gross >= plan.net >= plan.charging + plan.charger_wait


@pytest.mark.parametrize("policy", [POLICY_HIERARCHICAL, POLICY_FILL_UP])
def test_a_plan_says_what_it_costs_and_never_goes_below_the_reserve(policy: int) -> None:
    feasible = 0
    for case in short_of_energy(200, seed=4):
        *_, fleet, scratch = market_of(case, policy)
        if fleet.cost[0] < INF_COST:
            check_figures(case, scratch.plan)
            feasible += 1
    assert feasible > 100


def test_with_a_taper_one_stop_is_the_best_by_the_curve() -> None:
    seen = 0
    for case in short_of_energy(300, seed=5, curve=TAPER):
        *_, fleet, scratch = market_of(case)
        best = best_single(case)
        if best is None:
            assert scratch.plan.stops != 1
            continue
        done = ticks_of(case, best)
        assert done is not None and done[0] == fleet.cost[0]
        assert stops_of(scratch) == best
        seen += 1
    assert seen >= 100


@pytest.mark.parametrize("curve", [None, TAPER])
@pytest.mark.parametrize("target", [BATTERY_FULL, 800_000_000])
def test_filling_up_credits_what_is_left(curve: object, target: int) -> None:
    seen = 0
    for case in short_of_energy(150, seed=6, curve=curve):
        *_, fleet, scratch = market_of(case, POLICY_FILL_UP, target=target)
        best = best_single(case, target)
        if best is None:
            continue
        assert stops_of(scratch) == best
        done = ticks_of(case, best, target)
        assert done is not None and done[0] == fleet.cost[0]
        assert scratch.plan.level[0] >= target
        seen += 1
    assert seen >= 40


@pytest.mark.parametrize("curve", [((0, 7_300_000),), TAPER])
def test_charging_time_is_that_of_charging_tick_by_tick(curve: tuple[tuple[int, int], ...]) -> None:
    rng = random.Random(7)
    pieces = np.array(curve, np.int32)
    for _ in range(200):
        low, high = sorted((rng.randrange(BATTERY_FULL + 1), rng.randrange(BATTERY_FULL + 1)))
        ticks = charging_ticks(pieces, low, high)
        assert (ticks, level_after(pieces, low, ticks, BATTERY_FULL)) == charging_time(
            curve, low, high
        )
        fewer = level_after(pieces, low, max(ticks - 1, 0), BATTERY_FULL)
        assert fewer < high or low == high


def threshold_by_hand(case: Situation, threshold: int, safe: bool) -> tuple[int, int, list[int]]:
    """(ticks, lowest level, positions of stops) by the rule, step by step."""
    here, level, ticks, lowest, stops = case.start, case.charge, 0, case.charge, []
    reach = [min(row[at] for at in case.chargers) * case.drain for row in case.between]
    for i, place in enumerate(case.stops):
        then = level - case.between[here][place] * case.drain
        if then < threshold or (safe and then < reach[place]):
            charger = min(
                range(len(case.chargers)), key=lambda c: case.between[here][case.chargers[c]]
            )
            at = case.chargers[charger]
            level -= case.between[here][at] * case.drain
            lowest = min(lowest, level)
            used, level = charging_time(case.curve, level, BATTERY_FULL)
            ticks = max(ticks + case.between[here][at], case.wait[charger]) + used
            here = at
            stops.append(i)
        ticks += case.between[here][place]
        level -= case.between[here][place] * case.drain
        lowest = min(lowest, level)
        here = place
    return ticks, lowest, stops


@pytest.mark.parametrize("policy", [POLICY_THRESHOLD, POLICY_THRESHOLD_REACHABLE])
def test_threshold_charges_fully_at_the_nearest_charger(policy: int) -> None:
    rng = random.Random(8)
    stopped = stranded = 0
    for _ in range(300):
        case = random_situation(rng)
        *_, fleet, scratch = market_of(case, policy, threshold=200_000_000)
        ticks, lowest, stops = threshold_by_hand(
            case, 200_000_000, policy == POLICY_THRESHOLD_REACHABLE
        )
        assert scratch.plan.lowest_charge == lowest
        assert [position for position, _ in stops_of(scratch)] == stops
        assert fleet.cost[0] == (INF_COST if lowest < 0 else ticks)
        stopped += bool(stops)
        stranded += lowest < 0
    assert stopped > 100
    assert stranded > 10 if policy == POLICY_THRESHOLD else True


def test_inserting_with_charging_in_mind_is_never_worse() -> None:
    """And in some cases it is better: the two modes are two."""
    cheaper = 0
    for case in short_of_energy(250, seed=9):
        if len(case.stops) < 4:
            continue
        costs = {}
        for policy in (POLICY_HIERARCHICAL, POLICY_JOINT):
            task_costs, battery, fleet, scratch = market_of(case, policy)
            fleet.length[0] -= 1
            quotes.settle_all(task_costs, battery, fleet, scratch)
            task = len(case.stops) - 1
            _, costs[policy] = quotes.insertion_quote(task_costs, battery, fleet, scratch, 0, task)
        assert costs[POLICY_JOINT] <= costs[POLICY_HIERARCHICAL]
        cheaper += costs[POLICY_JOINT] < costs[POLICY_HIERARCHICAL]
    assert cheaper > 0


def test_joint_insertion_is_the_best_of_all_positions() -> None:
    checked = 0
    for case in short_of_energy(60, seed=10, chargers=2):
        if not 2 <= len(case.stops) <= 6:
            continue
        task_costs, battery, fleet, scratch = market_of(case, POLICY_JOINT)
        fleet.length[0] -= 1
        quotes.settle_all(task_costs, battery, fleet, scratch)
        if fleet.cost[0] >= INF_COST:
            continue
        *others, task = case.stops
        _, cost = quotes.insertion_quote(
            task_costs, battery, fleet, scratch, 0, len(case.stops) - 1
        )
        lists = [(*others[:i], task, *others[i:]) for i in range(len(others) + 1)]
        found = [best_ticks(Situation(**vars(case) | {"stops": one}), 2) for one in lists]
        best = min((ticks for ticks in found if ticks is not None), default=INF_COST)
        assert cost <= best
        checked += 1
    assert checked >= 10


def all_variants() -> Iterator[list[list[int]]]:
    """Ticks between positions for all 256 sets of optional lanes."""
    for chosen in itertools.product((False, True), repeat=len(OPTIONAL_LANES)):
        yield between_with(
            lane for lane, there in zip(sorted(OPTIONAL_LANES), chosen, strict=True) if there
        )


def test_every_variant_of_the_floor_gives_the_plan_of_the_worked_example() -> None:
    """The list of the paper's robot 2, short by 5 %."""
    for between in all_variants():
        case = Situation(
            between=between,
            drain=5_000_000,
            curve=((0, 50_000_000),),
            chargers=(1,),
            wait=(0,),
            reserve=0,
            end_reach=False,
            start=0,
            charge=450_000_000,
            stops=(4, 3, 8, 13),
        )
        *_, fleet, scratch = market_of(case)
        assert best_single(case) == stops_of(scratch) == ((1, 0),)
        assert best_ticks(case, 1) == fleet.cost[0] == 189


def test_on_every_variant_of_the_floor_plans_are_those_of_trying_everything() -> None:
    rng = random.Random(13)
    stopped = 0
    for between in all_variants():
        for _ in range(3):
            drawn = random_situation(rng)
            case = Situation(**vars(drawn) | {"between": between})
            *_, fleet, scratch = market_of(case)
            if fleet.cost[0] < INF_COST and scratch.plan.stops <= 1:
                done = ticks_of(case, best_single(case) or ())
                assert done is not None and done[0] == fleet.cost[0]
                assert stops_of(scratch) == best_single(case)
                stopped += scratch.plan.stops
            elif fleet.cost[0] >= INF_COST:
                assert best_single(case) is None
    assert stopped > 100


def test_waiting_at_a_busy_charger_counts() -> None:
    moved = 0
    for case in short_of_energy(100, seed=12):
        free = Situation(**vars(case) | {"wait": (0,) * len(case.chargers)})
        busy = Situation(**vars(case) | {"wait": (300, *(0,) * (len(case.chargers) - 1))})
        costs = []
        for one in (free, busy):
            *_, fleet, scratch = market_of(one)
            costs.append((int(fleet.cost[0]), stops_of(scratch)))
        assert costs[0][0] <= costs[1][0]
        moved += costs[0][0] < costs[1][0] < INF_COST and all(c != 0 for _, c in costs[1][1])
    assert moved > 0
