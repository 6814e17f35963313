"""Markets made ready for the kernels: arrays of the right shapes, from what a caller knows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from strategies.allocation.auction.market import (
    BATTERY_FULL,
    INF_COST,
    POLICY_NO_CHARGING,
    Array,
    Battery,
    ChargingPlan,
    Counts,
    Fleet,
    PathSearch,
    Scratch,
    TaskCosts,
)


def visits(ticks: ArrayLike, energy: ArrayLike, places: ArrayLike) -> TaskCosts:
    """Tasks that are done by being at these places."""
    at = np.asarray(places, np.int32)
    nothing = np.zeros(len(at), np.int32)
    return deliveries(ticks, energy, at, at, nothing, nothing)


def deliveries(
    ticks: ArrayLike,
    energy: ArrayLike,
    begin: ArrayLike,
    end: ArrayLike,
    inside: ArrayLike,
    use: ArrayLike,
) -> TaskCosts:
    """Tasks that begin and end at different places; ticks, energy: (P, P), or (K, P, P) by type."""

    def numbers(values: ArrayLike, by_type: int = 0, dtype: DTypeLike = np.int32) -> Array:
        found = np.array(values, dtype)
        return found if found.ndim >= by_type else found[None]

    return TaskCosts.sized(
        ticks=numbers(ticks, 3),
        energy=numbers(energy, 3, np.int64),
        begin=numbers(begin),
        end=numbers(end),
        inside=numbers(inside, 2),
        use=numbers(use, 2, np.int64),
    )


def battery_of(
    energy: ArrayLike,
    chargers: ArrayLike = (),
    curve: ArrayLike = ((0, 1),),
    reserve: ArrayLike = 0,
    end_reach: bool = False,
    policy: int = POLICY_NO_CHARGING,
    threshold: int = 0,
    target: int = BATTERY_FULL,
) -> Battery:
    """energy: (P, P) units, or (K, P, P); chargers: their places; curve: (from units, units per tick).

    `curve`: (pieces, 2), or (K, pieces, 2); `reserve`: one number, or (K,).
    """
    between = np.asarray(energy, np.int64)
    between = between if between.ndim == 3 else between[None]
    at, pieces = np.asarray(chargers, np.int32), np.asarray(curve, np.int32)
    to = between[:, :, at]
    none, shape = at.size == 0, between.shape[:2]
    return Battery.sized(
        charger=at,
        nearest=np.full(shape, -1, np.int32) if none else to.argmin(2).astype(np.int32),
        reach=np.full(shape, INF_COST, np.int64) if none else to.min(2),
        curve=np.broadcast_to(pieces, (len(between), *pieces.shape[-2:])).copy(),
        reserve=np.broadcast_to(np.asarray(reserve, np.int64), len(between)).copy(),
        end_reach=int(end_reach),
        policy=policy,
        threshold=threshold,
        target=target,
    )


def fleet_of(
    places: ArrayLike, tasks: int, charge: ArrayLike = BATTERY_FULL, longest: int | None = None
) -> Fleet:
    """Robots at these places with empty lists, at most `longest` tasks in each."""
    at = np.asarray(places, np.int32).copy()
    robots = len(at)
    most = tasks if longest is None else longest
    return Fleet.sized(
        {"L": most},
        place=at,
        charge=np.full(robots, charge, np.int32),
        capacity=np.full(robots, most, np.int32),
        may_bid=np.ones((robots, tasks), np.uint8),
    )


def scratch_for(robots: int, tasks: int, longest: int, chargers: int) -> Scratch:
    """Room for auctions of so many tasks among so many robots with lists of at most `longest`."""
    stops = (longest + 1) * max(chargers, 1) + longest + 2
    sizes = {"R": robots, "T": tasks, "L": longest, "C": chargers, "S": stops}
    return Scratch.sized(
        sizes, path=PathSearch.sized(), count=Counts.sized(), plan=ChargingPlan.sized(sizes)
    )
