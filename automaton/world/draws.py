"""Random durations: handling, delays, repairs, and the gaps between random events.

Draws depend only on the seed and a number, so all fleets and strategies face the same work. They are
quantiles of numbers between 0 and 1. All arithmetic rounds alike on every machine: it uses the four
operations and the square root, and no function of a mathematics library.
"""

from __future__ import annotations

import decimal
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.engine import random_numbers
from automaton.engine.facilities import MICRO, Delays
from automaton.engine.state import ACTION_COUNT, ACTION_NAMES, MAX_BUSY, Array
from automaton.scenario.arrivals import BatchSize
from automaton.scenario.durations import Distribution, Handling
from automaton.scenario.fleet import Delays as DelayRules
from automaton.scenario.fleet import Faults

Floats = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

Address = tuple[int, Whole, Whole]  # address of draws: a stream, (count,) ticks and (count,) robots

PLACES: Final = 65_536  # quantiles in a table: probabilities are accurate to 0.00002
DRAWS: Final = 2**32  # unit of probabilities
EXPONENTIAL_DIGITS: Final = 40  # so that it rounds alike on every machine
LEAST_POWER: Final = 2.0**-60  # no u is below 2^-54
LN2_HIGH: Final = 6.93147180369123816490e-01  # the sum of both is log 2
LN2_LOW: Final = 1.90821492927058770002e-10

# Wichura, Algorithm AS 241 (1988), routine PPND16: numerators and denominators, lowest power first.
CENTRE: Final = (
    (
        *(3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3),
        *(1.3731693765509461125e4, 4.5921953931549871457e4, 6.7265770927008700853e4),
        *(3.3430575583588128105e4, 2.5090809287301226727e3),
    ),
    (
        *(1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3),
        *(2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4),
        5.2264952788528545610e3,
    ),
)
TAIL: Final = (
    (
        *(1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0),
        *(3.64784832476320460504e0, 1.27045825245236838258e0, 2.41780725177450611770e-1),
        *(2.27238449892691845833e-2, 7.74545014278341407640e-4),
    ),
    (
        *(1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1),
        *(1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4),
        1.05075007164441684324e-9,
    ),
)
FAR_TAIL: Final = (
    (
        *(6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0),
        *(2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3),
        *(2.71155556874348757815e-5, 2.01033439929228813265e-7),
    ),
    (
        *(1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2),
        *(7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7),
        2.04426310338993978564e-15,
    ),
)


# The handling times of lines at stations, drawn by line number.


def handling_of_lines(handling: Handling, units: Whole, seed: int) -> Whole:
    """(lines,) handling time of each line in millionths of a tick, from its number and its units."""
    line = np.zeros(len(units))
    if isinstance(handling.line, Distribution):
        line = drawn_durations(handling.line, len(units), seed)
    else:
        line += handling.line
    result: Whole = whole_micro(line) + units * whole_micro(np.array([handling.unit]))
    return np.minimum(result, MAX_BUSY * MICRO)  # so that sums do not overflow


def whole_micro(ticks: Floats) -> Whole:
    """Millionths of a tick, half up."""
    rounded: Whole = np.floor(ticks * MICRO + 0.5).astype(np.int64)
    return rounded


def drawn_durations(
    distribution: Distribution, count: int, seed: int, address: Address | None = None
) -> Floats:
    """(count,) ticks, addressed by line unless an address is given."""
    if address is None:
        address = random_numbers.STREAM_LINES, np.arange(count), np.zeros(count, np.int64)
    if distribution.exponential is not None:
        return geometric(distribution.exponential, seed, *address).astype(np.float64)
    return duration_quantile(distribution, uniform_draws(seed, address))


# Delays and repairs, as tables to draw from: all entries of a table are equally likely.


def build_delays(rules: DelayRules | None, robots: int) -> Delays:
    """The delays of a scenario; tiny without them."""
    lengthens = np.zeros(ACTION_COUNT, np.uint8)
    if rules is None:
        return Delays.sized({"d": 0, "h": 0, "t": 1, "c": 0}, lengthens=lengthens)
    lengthens[[ACTION_NAMES.index(name) for name in rules.of]] = 1
    is_poisson = rules.events == "poisson"
    return Delays.sized(
        {"d": robots, "h": robots if is_poisson else 0},
        probability=round(rules.probability * DRAWS),
        poisson=int(is_poisson),
        ticks=delay_ticks(rules),
        counts=poisson_counts(rules.probability) if is_poisson else np.zeros(0, np.int64),
        lengthens=lengthens,
    )


def delay_ticks(rules: DelayRules) -> Array:
    """(t,) int32: ticks of delays."""
    least, most = rules.ticks.least, rules.ticks.most
    if isinstance(rules.distribution, str):
        return np.arange(least, most + 1, dtype=np.int32)
    bell = rules.distribution.gaussian
    share = bell.mean_ratio + bell.sd_ratio * normal_quantile(quantiles())
    return whole_ticks(np.clip(least + (most - least) * share, least, most))


def repair_ticks(faults: Faults) -> Array:
    """(r,) int32: ticks of repairs in place; (0,): robots are towed."""
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
    """(PLACES,) numbers between 0 and 1, evenly spread."""
    return (np.arange(PLACES) + 0.5) / PLACES


def whole_ticks(ticks: Floats) -> Array:
    """Whole ticks, half up, at least 1."""
    rounded: Array = np.maximum(np.floor(ticks + 0.5), 1).astype(np.int32)
    return rounded


def poisson_counts(mean: float) -> Array:
    """(c,) int64: cumulative Poisson distribution for 0, 1, ..., in units of 2**-32."""
    with decimal.localcontext(decimal.Context(prec=EXPONENTIAL_DIGITS)):
        wanted = decimal.Decimal(mean)
        term = total = (-wanted).exp()
        counts: list[int] = []
        while not counts or counts[-1] < DRAWS:
            counts.append(round(total * DRAWS))
            term = term * wanted / len(counts)
            total += term
    return np.array(counts[:-1], np.int64)


# Distributions by quantiles, the functions that they need, and the draws.


def duration_quantile(distribution: Distribution | BatchSize, u: Floats) -> Floats:
    """(k,) values, not rounded, for numbers between 0 and 1; not of an exponential distribution."""
    if distribution.uniform is not None:
        least, most = distribution.uniform.least, distribution.uniform.most
        spread: Floats = least + (most - least) * u
        return spread
    if distribution.lognormal is not None:
        mean, sd = distribution.lognormal.mean, distribution.lognormal.sd
        variance = logarithm(np.array([1 + (sd / mean) * (sd / mean)]))
        centre = logarithm(np.array([mean])) - variance / 2
        return exponential(centre + np.sqrt(variance) * normal_quantile(u))
    assert isinstance(distribution.empirical, tuple), "its file has been read"
    values = np.array(distribution.empirical, np.float64)
    result: Floats = values[np.minimum((u * len(values)).astype(np.int64), len(values) - 1)]
    return result


def geometric(
    mean: float, seed: int, stream: int, ticks: npt.ArrayLike, robots: npt.ArrayLike
) -> Whole:
    """(k,) int64 from 1 on, geometric with this mean, addressed by (stream, ticks[i], robots[i]).

    P(X > k) = q^k with q = 1 - 1/mean. A draw is 1 plus the greatest k with q^k > u, u uniform in
    (0, 1).
    """
    where, who = np.broadcast_arrays(np.asarray(ticks, np.int64), np.asarray(robots, np.int64))
    return geometric_quantile(mean, uniform_draws(seed, (stream, where.copy(), who.copy())))


def geometric_quantile(mean: float, u: Floats) -> Whole:
    """(k,) int64: for u between 0 and 1, 1 plus the greatest k with q^k > u, where q = 1 - 1/mean.

    k is found bit by bit from q, q^2, q^4, ... by multiplications, which round alike everywhere;
    logarithms do not.
    """
    powers = [1.0 - 1.0 / mean]  # q^(2^i)
    while powers[-1] > LEAST_POWER:
        powers.append(powers[-1] * powers[-1])
    numbers = np.ones(len(u), np.int64)
    left = np.ones(len(u))
    for i in range(len(powers) - 1, -1, -1):
        further = left * powers[i]
        more = further > u
        left[more] = further[more]
        numbers[more] += 1 << i
    return numbers


def uniform_draws(seed: int, address: Address) -> Floats:
    """(count,) numbers between 0 and 1, both excluded."""
    bits = np.zeros(len(address[1]), np.uint64)
    with np.errstate(over="ignore"):
        random_numbers.random_bits_of_each(bits, np.uint64(seed), *address)
    u: Floats = ((bits >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
    return u


def integers(count: int, below: int, seed: int, stream: int, what: int = 0) -> Whole:
    """(count,) whole numbers from 0, below a limit; addresses (stream, what, 0), (stream, what, 1) ..."""
    numbers = np.zeros(count, np.int64)
    with np.errstate(over="ignore"):
        random_numbers.random_integers(numbers, below, np.uint64(seed), stream, what)
    return numbers


def normal_quantile(u: Floats) -> Floats:
    """The standard normal quantile (AS 241)."""
    q = u - 0.5
    r = 0.180625 - q * q
    near = np.abs(q) <= 0.425
    centre = q * _ratio(CENTRE, np.where(near, r, 0.0))
    root = np.sqrt(-logarithm(np.where(near, 0.5, np.minimum(u, 1 - u))))
    tail = np.where(root <= 5, _ratio(TAIL, root - 1.6), _ratio(FAR_TAIL, root - 5))
    result: Floats = np.where(near, centre, np.where(q < 0, -tail, tail))
    return result


def _ratio(polynomials: tuple[tuple[float, ...], tuple[float, ...]], x: Floats) -> Floats:
    above, below = (_horner(coefficients, x) for coefficients in polynomials)
    return above / below


def _horner(coefficients: tuple[float, ...], x: Floats) -> Floats:
    total = np.full(np.shape(x), coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total


def exponential(x: Floats) -> Floats:
    """The exponential function, by its series around multiples of log 2."""
    power = np.floor(x / (LN2_HIGH + LN2_LOW) + 0.5)
    rest = (x - power * LN2_HIGH) - power * LN2_LOW
    total = np.ones_like(rest)
    for k in range(17, 0, -1):
        total = 1 + total * rest / k
    result: Floats = np.ldexp(total, power.astype(np.int64))
    return result


def logarithm(x: Floats) -> Floats:
    """The natural logarithm of positive numbers, by the series of its inverse hyperbolic tangent."""
    mantissa, power = np.frexp(x)
    small = mantissa < 0.7071067811865476
    mantissa, power = np.where(small, 2 * mantissa, mantissa), power - small
    s = (mantissa - 1) / (mantissa + 1)
    total = np.zeros_like(s)
    for k in range(41, 0, -2):
        total = total * (s * s) + 1.0 / k
    result: Floats = power * LN2_HIGH + (2 * s * total + power * LN2_LOW)
    return result
