"""How long delays and repairs in place last, and how many robots are delayed, computed once more.

Quantiles and exponentials come from the standard library.
"""

from __future__ import annotations

import math
from decimal import Context, Decimal
from statistics import NormalDist
from typing import Any, Final

PLACES: Final = 65_536  # of the quantiles from which durations are drawn
WHOLE: Final = 2**32
DIGITS: Final = Context(prec=50)


def drawn_from(table: list[int], bits: int) -> int:
    """An entry of a table, all alike probable."""
    return table[(bits >> 32) * len(table) >> 32]


def durations_of(rules: dict[str, Any]) -> list[int]:
    """How long delays last, each duration as often as it is probable."""
    least, most = rules["ticks"]["from"], rules["ticks"]["to"]
    if rules["distribution"] == "uniform":
        return list(range(least, most + 1))
    bell = rules["distribution"]["gaussian"]
    shares = (
        bell["mean_ratio"] + bell["sd_ratio"] * NormalDist().inv_cdf(u) for u in quantile_places()
    )
    return [half_up(min(max(least + (most - least) * one, least), most)) for one in shares]


def repairs_of(duration: Any) -> list[int]:
    """How long repairs in place last, each duration as often as it is probable."""
    if isinstance(duration, int):
        return [duration]
    if duration.get("empirical"):
        return [max(1, half_up(one)) for one in duration["empirical"]]
    places = quantile_places()
    if duration.get("uniform"):
        least, most = duration["uniform"]["from"], duration["uniform"]["to"]
        return [max(1, half_up(least + (most - least) * u)) for u in places]
    if duration.get("exponential"):
        stays = 1 - 1 / duration["exponential"]
        return [1 + greatest_power(stays, 1 - u) for u in places]
    mean, sd = duration["lognormal"]["mean"], duration["lognormal"]["sd"]
    variance = math.log(1 + (sd / mean) ** 2)
    normal = NormalDist(math.log(mean) - variance / 2, math.sqrt(variance)) if sd else None
    if normal is None:
        return [max(1, half_up(mean))]
    return [max(1, half_up(math.exp(normal.inv_cdf(u)))) for u in places]


def quantile_places() -> list[float]:
    """Numbers between 0 and 1, evenly spread."""
    return [(k + 0.5) / PLACES for k in range(PLACES)]


def half_up(value: float) -> int:
    """The nearest whole number; halves go up."""
    return math.floor(value + 0.5)


def greatest_power(base: float, value: float) -> int:
    """The greatest k with base ** k > value."""
    if base == 0:
        return 0
    k = max(0, math.floor(math.log(value) / math.log(base)) - 1)
    while base ** (k + 1) > value:
        k += 1
    return k


def poisson_number(mean: float, draw: int) -> int:
    """The Poisson number of a draw from 0 to 2**32 - 1."""
    term = total = DIGITS.exp(-Decimal(mean))
    number = 0
    while draw >= round(total * WHOLE):
        number += 1
        term = DIGITS.divide(DIGITS.multiply(term, Decimal(mean)), Decimal(number))
        total = DIGITS.add(total, term)
    return number
