"""How long operations take, from messages that see them only now and then.

    message    a        b        c        d       At work in the messages b to c, and not at a and d: the
    at work    -        x        x        -       operation began between a and b, ended between c and d.

With F the distribution function of the duration and G its integral from 0, and a beginning that is
uniform between a and b, the likelihood of such an observation is

    G(d - a) - G(d - b) - G(c - a) + G(c - b).

Operations that no message sees are missing, so the sum is divided by the mean of g - G(g) over the gaps g
between messages: the share of operations that messages show.

Source: De Gruttola & Lagakos (1989), doubly-censored data; the truncation as in Sun (1995).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

Array = np.ndarray[Any, Any]

HALF_CHI_SQUARE: Final = 1.9207  # half of the 95 % quantile with one degree of freedom
MAX_GAPS: Final = 64  # quantiles that stand for all gaps between messages
MIN_SPREAD: Final = 0.005
MAX_CV: Final = 5.0
SHORTEST_S: Final = 0.01
LEAST_LIKELIHOOD: Final = 1e-300  # likelihood of an operation that a family cannot explain
QUANTILES: Final = 100  # durations of an empirical distribution
EM_STEPS: Final = 200
REJECTED: Final = 0.001  # p below which no family describes the durations
EVENT_ERROR_S: Final = 0.05
MAX_IRREGULAR: Final = 0.2  # share of gaps that differ by half; stamps that err cause fewer
REPEATS: Final = 20  # simulated durations for each observed one


class Censored(NamedTuple):
    """Operations of one kind, and the gaps between messages, in seconds."""

    free_before: Array  # (k,) last message before each operation, counted from the next column
    observed: Array  # (k,) from its first to its last message
    free_after: Array  # (k,) from its last message to the next one
    gaps: Array  # (m,) quantiles of the gaps between messages; empty: every operation has messages
    error: float  # standard deviation of a duration through errors of the stamps

    @property
    def n(self) -> int:
        """Number of operations."""
        return len(self.observed)

    @property
    def middles(self) -> Array:
        """(k,) the durations if each begins and ends midway between two messages."""
        return self.observed + (self.free_before + self.free_after) / 2


class Family(NamedTuple):
    """A distribution with a mean and at most one further parameter, a relative spread."""

    name: str
    integral: Callable[[Array, float, float, float], Array]  # G at x for mean, spread, error
    spreads: tuple[float, float] | None  # the range of the spread; None: it has none
    draw: Callable[[np.random.Generator, int, float, float], Array]


class DurationFit(NamedTuple):
    """A family with its parameters, and the interval of its mean."""

    family: str
    mean: float
    low: float
    high: float
    spread: float  # lognormal: sd / mean; uniform: half of the width / mean; else 0
    aic: float
    n: int
    p: float = math.nan  # that durations of this family differ as much from the observed ones
    empirical: tuple[float, ...] = ()  # of handling: quantiles, each equally likely


def _constant(x: Array, mean: float, spread: float, error: float) -> Array:
    from scipy.special import ndtr

    z = (x - mean) / error
    out: Array = (x - mean) * ndtr(z) + error * np.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)
    return out


def _uniform(x: Array, mean: float, spread: float, error: float) -> Array:
    half = spread * mean
    inside = np.clip(x - (mean - half), 0, 2 * half)
    out: Array = inside * inside / (4 * half) + np.maximum(x - (mean + half), 0)
    return out


def _lognormal(x: Array, mean: float, spread: float, error: float) -> Array:
    from scipy.special import ndtr

    sigma = math.sqrt(math.log1p(spread * spread))
    z = (np.log(np.maximum(x, 1e-300)) - math.log(mean)) / sigma + sigma / 2
    out: Array = x * ndtr(z) - mean * ndtr(z - sigma)
    return out


def _exponential(x: Array, mean: float, spread: float, error: float) -> Array:
    out: Array = x + mean * np.expm1(-x / mean)
    return out


def _draw_lognormal(rng: np.random.Generator, n: int, mean: float, spread: float) -> Array:
    sigma = math.sqrt(math.log1p(spread * spread))
    return rng.lognormal(math.log(mean) - sigma * sigma / 2, sigma, n)


FAMILIES: Final = {
    family.name: family
    for family in (
        Family("constant", _constant, None, lambda rng, n, mean, spread: np.full(n, mean)),
        Family(
            "uniform",
            _uniform,
            (MIN_SPREAD, 1.0),
            lambda rng, n, mean, spread: rng.uniform(mean * (1 - spread), mean * (1 + spread), n),
        ),
        Family("lognormal", _lognormal, (MIN_SPREAD, MAX_CV), _draw_lognormal),
        Family(
            "exponential", _exponential, None, lambda rng, n, mean, spread: rng.exponential(mean, n)
        ),
    )
}


class Likelihood:
    """The likelihood of operations; equal ones are counted once."""

    def __init__(self, data: Censored) -> None:
        rows = np.round((data.free_before, data.observed, data.free_after), 6)
        (before, observed, after), self.counts = np.unique(rows, axis=1, return_counts=True)
        parts = before + observed + after, observed + after, before + observed, observed
        self.x, self.gaps = np.concatenate((*parts, data.gaps)), data.gaps
        self.error = data.error

    def loss(self, family: Family, mean: float, spread: float) -> float:
        """Minus the logarithm of the likelihood."""
        values, kinds = family.integral(self.x, mean, spread, self.error), len(self.counts)
        outer, begin, end, inner = values[: 4 * kinds].reshape(4, kinds)
        joint = np.maximum(outer - begin - end + inner, LEAST_LIKELIHOOD)
        out = -float(self.counts @ np.log(joint))
        if len(self.gaps):
            detected = float((self.gaps - values[4 * kinds :]).mean())
            out += int(self.counts.sum()) * math.log(max(detected, LEAST_LIKELIHOOD))
        return out


def fit_family(data: Censored, family: Family) -> DurationFit:
    """The most likely parameters of a family, and the profile likelihood interval of its mean."""
    from scipy.optimize import brentq, minimize, minimize_scalar

    likelihood, middles = Likelihood(data), np.maximum(data.middles, SHORTEST_S)
    longest = 100 * float(middles.max())

    def loss(log_mean: float, log_spread: float = 0.0) -> float:
        mean, spread = math.exp(log_mean), math.exp(log_spread)
        low, high = family.spreads or (spread, spread)
        if not (low <= spread <= high and SHORTEST_S <= mean <= longest):
            return math.inf
        return likelihood.loss(family, mean, spread)

    start = [math.log(middles.mean())]
    if family.name == "uniform":  # all durations lie within the first guess
        middle = (middles.min() + middles.max()) / 2
        start = [math.log(middle), math.log(max(min(middles.max() / middle - 1, 1.0), MIN_SPREAD))]
    elif family.spreads is not None:
        cv = np.clip(middles.std() / middles.mean(), 2 * MIN_SPREAD, 0.9)
        start.append(math.log(cv))
    simplex = np.vstack((start, np.array(start) - 0.1 * np.eye(len(start))))
    options = {"xatol": 1e-4, "fatol": 1e-4, "initial_simplex": simplex}
    best = minimize(lambda at: loss(*at), start, method="Nelder-Mead", options=options)
    log_mean, spread = best.x[0], best.x[1] if family.spreads else -math.inf

    def beyond(one: float) -> float:
        """The profile likelihood at a mean, beyond the end of the interval."""
        if family.spreads is None:
            profile = loss(one)
        else:
            low, high = map(math.log, family.spreads)
            ends = max(low, spread - 1.0), min(high, spread + 1.0)
            search = minimize_scalar(
                lambda other: loss(one, other),
                bounds=ends,
                method="bounded",
                options={"xatol": 2e-3},
            )
            profile = float(search.fun)
        return min(profile - float(best.fun), 1e9) - HALF_CHI_SQUARE

    def end(sign: int) -> float:
        step = 0.02
        if beyond(log_mean) >= 0:
            return sign * math.inf
        while beyond(log_mean + sign * step) < 0:
            step *= 2
            if step > 3:
                return sign * math.inf
        return float(brentq(beyond, log_mean, log_mean + sign * step, xtol=1e-4))

    aic = 2 * (float(best.fun) + len(start))
    mean, low, high = (math.exp(one) for one in (log_mean, end(-1), end(1)))
    return DurationFit(family.name, mean, low, high, math.exp(spread), aic, data.n)


# Operations in a log.


def operations_of(seconds: Array, usable: Array, identity: Array, chosen: Array) -> Censored:
    """The operations of messages that are `chosen`: (n,) bool, such as all picks.

    `usable`: (n,) bool, of a message and the next; `identity`: (n,) differs between two operations. In a
    log with messages on events, an operation begins at its first message and ends with the first message
    without it. An operation is left out if a gap lies before, in or after it.
    """
    gaps = np.diff(seconds)[usable[:-1]]
    same = np.append(False, (identity[1:] == identity[:-1]) & usable[:-1])
    first = np.flatnonzero(chosen & ~(same & np.append(False, chosen[:-1])))
    last = np.flatnonzero(chosen & ~np.append((same & chosen)[1:], False))
    inside = (first > 0) & (last < len(seconds) - 1)
    first, last = first[inside], last[inside]
    linked = usable[first - 1] & usable[last]
    first, last = first[linked], last[linked]
    before, observed = seconds[first] - seconds[first - 1], seconds[last] - seconds[first]
    after = seconds[last + 1] - seconds[last]
    if len(gaps) and has_event_messages(gaps, after):
        fine = np.full(len(observed), EVENT_ERROR_S)
        return Censored(fine, observed + after - EVENT_ERROR_S, fine, np.zeros(0), EVENT_ERROR_S)
    return Censored(before, observed, after, gap_quantiles(gaps), stamp_error(gaps))


def has_event_messages(gaps: Array, after: Array) -> bool:
    """Whether messages come on events: gaps differ, above all those at the end of operations."""
    usual = float(np.median(gaps))
    irregular = float((abs(gaps - usual) > usual / 2).mean())
    return irregular > MAX_IRREGULAR or (len(after) > 0 and float(np.median(after)) > 1.5 * usual)


def gap_quantiles(gaps: Array) -> Array:
    """Gaps that stand for all: those at evenly spaced ranks."""
    if not len(gaps):
        return np.zeros(0)
    out: Array = np.quantile(gaps, (np.arange(MAX_GAPS) + 0.5) / MAX_GAPS)
    return out


def stamp_error(gaps: Array) -> float:
    """The standard deviation of a duration through errors of stamps, from the spread of regular gaps."""
    if not len(gaps):
        return EVENT_ERROR_S
    return max(1.4826 * float(np.median(abs(gaps - np.median(gaps)))), EVENT_ERROR_S)


def fit_durations(data: Censored, seed: int = 0) -> DurationFit:
    """The family with the least AIC, and how well it describes the durations."""
    fits = [fit_family(data, family) for family in FAMILIES.values()]
    best = min(fits, key=lambda fit: fit.aic)
    if best.spread and best.spread * best.mean < 2 * data.error:
        best = fits[0]  # the stamps err as much as such durations differ
    p = math.nan if best.family == "constant" else family_p(data, best, seed)
    return best._replace(p=p)


def family_p(data: Censored, fit: DurationFit, seed: int) -> float:
    """The p value of a Kolmogorov-Smirnov test of observed and simulated operations.

    Both are compared by their middles, which are blurred by the gap between messages.
    """
    from scipy.special import kolmogorov

    rng = np.random.default_rng(seed)
    n = REPEATS * data.n
    durations = FAMILIES[fit.family].draw(rng, n, fit.mean, fit.spread)
    durations = np.maximum(durations + data.error * rng.normal(size=n), SHORTEST_S)
    gap = float((data.free_before + data.free_after).mean()) / 2
    messages = np.floor((rng.uniform(0, gap, n) + durations) / gap)
    simulated = messages[messages > 0] * gap
    first, second = (
        middles + rng.uniform(-gap / 2, gap / 2, len(middles))
        for middles in (data.middles, simulated)
    )
    both = np.sort(np.concatenate((first, second)))
    shares = (
        np.searchsorted(np.sort(one), both, side="right") / len(one) for one in (first, second)
    )
    distance = float(abs(next(shares) - next(shares)).max())
    return float(kolmogorov(distance * math.sqrt(len(first) * len(second) / len(both))))


def empirical_quantiles(data: Censored) -> tuple[float, ...]:
    """The most likely distribution without a family, as durations of equal probability (EM).

    Source: Turnbull (1976), with the likelihood above for each duration of a grid.
    """
    if not len(data.gaps):  # each duration is seen to both ends
        shares = (np.arange(QUANTILES) + 0.5) / QUANTILES
        durations = np.maximum(np.quantile(data.middles, shares), SHORTEST_S)
        return tuple(np.round(durations, 2).tolist())
    top = float((data.free_before + data.observed + data.free_after).max())
    bottom = float(data.observed.min())
    grid = np.linspace(max(bottom, SHORTEST_S), top, 2 * QUANTILES)[None, :]

    def area(x: Array) -> Array:
        out: Array = np.maximum(x[:, None] - grid, 0.0)
        return out

    before, observed, after = data.free_before, data.observed, data.free_after
    likely = (
        area(before + observed + after)
        - area(observed + after)
        - area(before + observed)
        + area(observed)
    )
    likely = np.maximum(likely, 0.0)
    known = likely.sum(axis=1) > 0
    likely = likely[known]
    detected = np.ones(grid.shape[1])
    if len(data.gaps):
        detected = np.minimum(1.0, grid[0] / data.gaps.mean())
    mass = np.full(grid.shape[1], 1 / grid.shape[1])
    for _ in range(EM_STEPS):
        share = likely * mass
        mass = (share / share.sum(axis=1, keepdims=True)).mean(axis=0)
    mass = mass / detected
    ranks = (np.arange(QUANTILES) + 0.5) / QUANTILES
    at = np.searchsorted(np.cumsum(mass) / mass.sum(), ranks)
    return tuple(np.round(grid[0][np.minimum(at, grid.shape[1] - 1)], 2).tolist())
