"""Charging of a list by trying everything, in plain Python: what the planner is held against."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

FULL = 1_000_000_000


@dataclass(frozen=True)
class Situation:
    """A robot with a list of stops; times in ticks, energy in units."""

    between: list[list[int]]  # ticks from place to place
    drain: int  # units per tick of driving
    curve: tuple[tuple[int, int], ...]  # (from level, units per tick)
    chargers: tuple[int, ...]
    wait: tuple[int, ...]  # ticks until each charger is free of others
    reserve: int
    end_reach: bool
    start: int
    charge: int
    stops: tuple[int, ...]


Stops = tuple[tuple[int, int], ...]  # (before which task, number of the charger)


def charging_time(curve: Sequence[tuple[int, int]], low: int, high: int) -> tuple[int, int]:
    """(ticks, level), tick by tick."""
    ticks, level = 0, low
    while level < high:
        level += [rate for start, rate in curve if level >= start or start == 0][-1]
        ticks += 1
    return ticks, min(level, FULL)


def route(case: Situation, plan: Stops) -> list[tuple[int, int]]:
    """(place, charger or -1) in the order of driving."""
    way = []
    for i, place in enumerate(case.stops):
        way += [(case.chargers[c], c) for at, c in plan if at == i]
        way.append((place, -1))
    return way


def tail(case: Situation) -> int | None:
    """Units for the way from the end to a charger; None if there is none."""
    if not case.end_reach:
        return 0
    reaches = [case.between[case.stops[-1]][at] for at in case.chargers]
    return min(reaches) * case.drain if reaches else None


def ticks_of(case: Situation, plan: Stops, target: int | None = None) -> tuple[int, int] | None:
    """(ticks, level at the end) with these stops, each charging what the next stretch needs.

    With a target each charges at least up to it. None where the level would fall below the reserve.
    """
    spare = tail(case)
    if spare is None:
        return None
    way = route(case, plan)
    here, level, ticks = case.start, case.charge, 0
    for k, (place, charger) in enumerate(way):
        ticks += case.between[here][place]
        level -= case.between[here][place] * case.drain
        here = place
        if level < case.reserve:
            return None
        if charger >= 0:
            ahead, at = 0, here
            for next_place, next_charger in way[k + 1 :]:
                ahead += case.between[at][next_place] * case.drain
                at = next_place
                if next_charger >= 0:
                    break
            else:
                ahead += spare
            goal = max(level, ahead + case.reserve, target or 0)
            if ahead + case.reserve > FULL:
                return None
            used, level = charging_time(case.curve, level, goal)
            ticks = max(ticks, case.wait[charger]) + used
    return (ticks, level) if level >= case.reserve + spare else None


def plans(case: Situation, most: int) -> Iterator[Stops]:
    """All sequences of up to `most` stops."""
    places = list(itertools.product(range(len(case.stops)), range(len(case.chargers))))
    for stops in range(most + 1):
        for plan in itertools.product(places, repeat=stops):
            if all(a[0] <= b[0] for a, b in itertools.pairwise(plan)):
                yield plan


def into(case: Situation, stop: tuple[int, int]) -> int:
    """Ticks from the task before to the charger."""
    before = case.start if stop[0] == 0 else case.stops[stop[0] - 1]
    return case.between[before][case.chargers[stop[1]]]


def best_ticks(case: Situation, most: int) -> int | None:
    """The fewest ticks with at most so many stops; None where nothing is feasible."""
    found = [done[0] for plan in plans(case, most) if (done := ticks_of(case, plan)) is not None]
    return min(found, default=None)


def best_single(case: Situation, target: int | None = None) -> Stops | None:
    """The best of no stop or one by the rules for ties; with a target, by the score of fill-up."""
    direct = ticks_of(case, ())
    if direct is not None:
        return ()
    rate = case.curve[0][1]
    ranked = []
    for plan in plans(case, 1):
        done = ticks_of(case, plan, target)
        if done is not None:
            score = done[0] * rate - (done[1] if target else 0)
            ranked.append((score, into(case, plan[0]), -plan[0][0], plan[0][1], plan))
    return min(ranked)[-1] if ranked else None
