"""How often robots are delayed and for how long, and how long repairs take, as tables to draw from.

All entries of a table of ticks are alike probable. A distribution that is not a list of whole numbers
becomes its quantiles at 65,536 places: a probability is right to 0.00002.
"""

from __future__ import annotations

import decimal
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.engine.facilities import Delays
from automaton.engine.state import ACTION_COUNT, ACTION_NAMES, Array
from automaton.scenario.durations import Distribution
from automaton.scenario.energy_and_faults import Delays as DelayRules
from automaton.scenario.energy_and_faults import Faults
from automaton.world.geometric_draws import geometric_quantile
from automaton.world.handling_times import duration_quantile, normal_quantile

QUANTILES: Final = 65_536
ONE: Final = 2**32  # draws
DIGITS: Final = 40  # of the exponential function, so that it rounds alike on every machine

Floats = npt.NDArray[np.float64]


def build_delays(rules: DelayRules | None, robots: int) -> Delays:
    """The delays of a scenario; tiny without them."""
    lengthens = np.zeros(ACTION_COUNT, np.uint8)
    if rules is None:
        return Delays.sized({"d": 0, "h": 0, "t": 1, "c": 0}, lengthens=lengthens)
    lengthens[[ACTION_NAMES.index(name) for name in rules.of]] = 1
    is_poisson = rules.events == "poisson"
    return Delays.sized(
        {"d": robots, "h": robots if is_poisson else 0},
        probability=round(rules.probability * ONE),
        poisson=int(is_poisson),
        ticks=delay_ticks(rules),
        counts=poisson_counts(rules.probability) if is_poisson else np.zeros(0, np.int64),
        lengthens=lengthens,
    )


def delay_ticks(rules: DelayRules) -> Array:
    """(t,) int32: how long delays last."""
    least, most = rules.ticks.least, rules.ticks.most
    if isinstance(rules.distribution, str):
        return np.arange(least, most + 1, dtype=np.int32)
    bell = rules.distribution.gaussian
    share = bell.mean_ratio + bell.sd_ratio * normal_quantile(quantiles())
    return whole_ticks(np.clip(least + (most - least) * share, least, most))


def repair_ticks(faults: Faults) -> Array:
    """(r,) int32: how long repairs in place take; (0,): robots are towed."""
    duration = faults.repair_in_place
    if duration is None:
        return np.zeros(0, np.int32)
    if isinstance(duration, int):
        return np.array([duration], np.int32)
    if isinstance(duration.empirical, tuple):
        return whole_ticks(np.array(duration.empirical))
    if duration.exponential is not None:
        numbers: Array = geometric_quantile(duration.exponential, 1 - quantiles())
        return numbers.astype(np.int32)
    assert isinstance(duration, Distribution)
    return whole_ticks(duration_quantile(duration, quantiles()))


def quantiles() -> Floats:
    """(QUANTILES,) numbers between 0 and 1, evenly spread."""
    return (np.arange(QUANTILES) + 0.5) / QUANTILES


def whole_ticks(ticks: Floats) -> Array:
    """Whole ticks, half up, 1 at least."""
    rounded: Array = np.maximum(np.floor(ticks + 0.5), 1).astype(np.int32)
    return rounded


def poisson_counts(mean: float) -> Array:
    """(c,) int64: of 2**32 draws of a Poisson number, how many are at most 0, 1, ..."""
    with decimal.localcontext(decimal.Context(prec=DIGITS)):
        wanted = decimal.Decimal(mean)
        term = total = (-wanted).exp()
        counts: list[int] = []
        while not counts or counts[-1] < ONE:
            counts.append(round(total * ONE))
            term = term * wanted / len(counts)
            total += term
    return np.array(counts[:-1], np.int64)
