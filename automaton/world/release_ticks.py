"""When the orders of a scenario are released: at a mean rate, in bursts, or at the rates of a profile."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from automaton.engine import random_numbers
from automaton.engine.random_numbers import STREAM_PROFILE, draw_releases
from automaton.engine.state import NEVER, Array
from automaton.scenario.arrivals import (
    HOURS_OF_WEEK,
    MAX_BATCH,
    SECONDS_OF_HOUR,
    BatchSize,
    Bursts,
    Mean,
    MeanTime,
    second_of_week,
)
from automaton.scenario.orders import MAX_DRAWN_LINES
from automaton.scenario.schema import Scenario
from automaton.world.draws import (
    duration_quantile,
    geometric,
    logarithm,
    quantiles,
    uniform_draws,
    whole_ticks,
)

SIZES, GAPS, PARTS = 1, 2, 3  # draws of a burst; PARTS + k: gaps between parts of type k
DRAW_GAP, DRAW_THINNING, DRAW_BATCH = 0, 1, 2  # draws of a candidate of a profile
CANDIDATES_AT_ONCE: Final = 4096  # drawn at a time


def ticks_by_rank(scenario: Scenario, count: int, seed: int, in_system: int = 0) -> Array:
    """(count,) int64: the release ticks of the first order, the second, ...; those after the run are
    one tick after its end.

    With a mean_interarrival_time, the first order comes at once, then one in each tick with probability
    1/mean_interarrival_time.
    """
    orders, last = scenario.orders, scenario.stop.max_duration + 1
    ticks = np.zeros(count, np.int64)
    arrivals = orders.arrivals
    if orders.mean_interarrival_time:
        with np.errstate(over="ignore"):
            chance = round(2**32 / orders.mean_interarrival_time)
            draw_releases(ticks, chance, np.uint64(seed), last)
    elif arrivals is not None and arrivals.bursts is not None:
        ticks = np.minimum(burst_ticks(arrivals.bursts, count, seed), last)
    elif arrivals is not None and arrivals.profile is not None:
        arrived = profile_ticks(scenario, seed)[:count]
        ticks = np.full(count, last, np.int64)
        ticks[: len(arrived)] = arrived
    elif in_system:
        ticks[in_system:] = NEVER
    return ticks


# Arrivals at the rates of a profile: a Poisson process of batches, by thinning (Lewis & Shedler 1979).
#
# Candidates come at the greatest rate of the week, each with its own draws, and one in an hour of a
# lower rate is kept with the ratio of both rates. So a longer run begins with the same orders.


def profile_ticks(scenario: Scenario, seed: int) -> Array:
    """(m,) int64 ascending ticks before the end of a run in which the orders of its profile arrive.

    There are `orders.count` at most.
    """
    orders, scale, end = scenario.orders, scenario.units.scale, scenario.stop.max_duration
    arrivals, clock = orders.arrivals, scale.clock
    assert arrivals is not None and clock is not None, "checked: a profile needs a clock"
    tick = float(scale.tick_seconds) / SECONDS_OF_HOUR  # hours
    rates = np.array(arrivals.rates) / mean_batch(arrivals.batch)  # batches per hour
    peak, begin = float(rates.max()), second_of_week(clock) / SECONDS_OF_HOUR
    most = orders.count or MAX_DRAWN_LINES
    ticks, now, first, held = [np.zeros(0, np.int64)], 0.0, 0, 0
    while peak and now < end * tick and held < most:
        number = np.arange(first, first + CANDIDATES_AT_ONCE)
        after = hours_between(number, peak, seed)
        times = np.cumsum(np.concatenate([[now], after]))[1:]
        now, first = float(times[-1]), first + CANDIDATES_AT_ONCE
        hour = np.floor(begin + times).astype(np.int64) % HOURS_OF_WEEK
        chance = uniform_draws(seed, (STREAM_PROFILE, number, np.full(len(number), DRAW_THINNING)))
        when = np.floor(times / tick).astype(np.int64)
        comes = (chance * peak < rates[hour]) & (when < end)
        ticks.append(np.repeat(when[comes], batch_sizes(arrivals.batch, number[comes], seed)))
        held += len(ticks[-1])
    return np.concatenate(ticks)[:most]


def hours_between(number: Array, rate: float, seed: int) -> Any:
    """(k,) hours from the candidate before each to itself: exponential, at a rate per hour."""
    u = uniform_draws(seed, (STREAM_PROFILE, number, np.full(len(number), DRAW_GAP)))
    return -logarithm(u) / rate


def batch_sizes(batch: int | BatchSize, number: Array, seed: int) -> Array:
    """(k,) int64: orders of the batches of these candidates."""
    if isinstance(batch, int):
        return np.full(len(number), batch, np.int64)
    who = np.full(len(number), DRAW_BATCH)
    if batch.exponential is not None:
        return geometric(batch.exponential, seed, STREAM_PROFILE, number, who)
    sizes = duration_quantile(batch, uniform_draws(seed, (STREAM_PROFILE, number, who)))
    return whole_ticks(np.minimum(sizes, MAX_BATCH)).astype(np.int64)


def mean_batch(batch: int | BatchSize) -> float:
    """The mean number of orders of a batch, after rounding."""
    if isinstance(batch, int):
        return batch
    if batch.exponential is not None:
        return batch.exponential
    sizes = np.minimum(duration_quantile(batch, quantiles()), MAX_BATCH)
    return float(whole_ticks(sizes).mean())


def burst_ticks(bursts: Bursts, count: int, seed: int) -> Array:
    """(count,) int64: the tick of the burst to which each order belongs; the first one is at 0."""
    sizes = gaps(bursts.size, count, seed, SIZES)  # no burst is empty
    ticks = np.concatenate([[0], np.cumsum(gaps(bursts.every, count, seed, GAPS)[:-1])])
    by_order: Array = np.repeat(ticks, np.minimum(sizes, count))[:count]
    return by_order


def gaps(value: int | Mean | MeanTime, count: int, seed: int, what: int) -> Array:
    """(count,) int64: a given number, or a random number for each."""
    if isinstance(value, int):
        return np.full(count, value, np.int64)
    return geometric(value.mean, seed, random_numbers.STREAM_RELEASES, np.arange(count), what)
