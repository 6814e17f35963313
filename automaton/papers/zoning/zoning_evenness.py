"""Who drives more evenly? The probability that one method's sigma of travel is the smaller one.

Of all pairs of a run of one method and a run of the other: in what share has the first the smaller
sigma (ties count half)? The interval is the bootstrap's, over seeds; claims are judged by the
jackknife's, of placements: for each seed, the share of the other's runs that it beats, and the share
of the first's that beat it. Both take a seed for both runs that have it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.papers.reproduction_study import Key, Measured, Reproduced
from automaton.papers.zoning.zoning_cases import DDZ, FREE, MANY, NEAR, NEAR_STOPS, NO_SHARING, SA

SIGMA: Final = "sigma_ft"
SMALLER: Final = "P(sigma smaller)"
SAMPLES: Final = 2000
WIDEST: Final = 0.05  # of half an interval that is called decided

PAIRS: Final = (  # is the first one's sigma the smaller?
    (FREE, NO_SHARING),  # neither shares load, nobody stands still
    (DDZ, SA),  # as published
    (FREE, SA),
    (NEAR, NO_SHARING),
    (NEAR, SA),
    (NEAR, FREE),
    (NEAR_STOPS, SA),
    (NEAR_STOPS, DDZ),
)


Pair = tuple[str, str, tuple[Sequence[float], Sequence[float]]]


class Evenness(NamedTuple):
    """An estimate of P(sigma of one < sigma of the other), and its 95 % interval."""

    one: str
    other: str
    share: float
    low: float
    high: float
    seeds: int

    @property
    def half_width(self) -> float:
        return (self.high - self.low) / 2


def wins(one: Sequence[float], other: Sequence[float]) -> NDArray[np.float64]:
    """(n, m): 1 where a value of `one` is below one of `other`, 1/2 where they are equal."""
    a, b = np.array(one)[:, None], np.array(other)[None]
    found: NDArray[np.float64] = (a < b) + 0.5 * (a == b)
    return found


def placements(one: Sequence[float], other: Sequence[float]) -> list[float]:
    """One value for each seed, with the share of all pairs as their mean."""
    beats = wins(one, other)
    found: list[float] = (beats.mean(1) + beats.mean(0) - beats.mean()).tolist()
    return found


def pairs_run(sigmas: Mapping[str, Sequence[float]]) -> Iterator[Pair]:
    """Both names and the sigmas of both, of each pair of which both were run."""
    for one, other in PAIRS:
        if one in sigmas and other in sigmas:
            yield one, other, (sigmas[one], sigmas[other])


def together(found: Mapping[Key, Sequence[Measured]]) -> Iterator[tuple[tuple[str, Key], Any]]:
    """The placements of all pairs, as samples that claims rest on."""
    sigmas = {
        str(key[0]): [run.metrics[SIGMA] for run in batch]
        for key, batch in found.items()
        if key[1:] == (MANY,)
    }
    for one, other, values in pairs_run(sigmas):
        yield (SMALLER, (one, other)), placements(*values)


def evenness(one: str, other: str, values: Sequence[Sequence[float]]) -> Evenness:
    """The share of all pairs of runs, with the bootstrap's interval over seeds."""
    beats = wins(*values)
    n = len(beats)
    rng = np.random.default_rng(1)
    # How often each seed is drawn, so that sums are of whole and half numbers: exact anywhere.
    drawn = rng.multinomial(n, np.full(n, 1 / n), size=SAMPLES).astype(np.float64)
    shares = ((drawn @ beats) * drawn).sum(1) / n**2
    low, high = np.percentile(shares, (2.5, 97.5)).tolist()
    return Evenness(one, other, float(beats.mean()), low, high, n)


def all_evenness(made: Reproduced) -> list[Evenness]:
    """All pairs of which both were run."""
    sigmas = {
        str(key[0]): values
        for (metric, key), values in made.samples().items()
        if metric == SIGMA and key[1:] == (MANY,)
    }
    return [evenness(*pair) for pair in pairs_run(sigmas)]


def evenness_text(found: Sequence[Evenness]) -> str:
    """A line for each pair."""
    lines = [f"{'sigma of':<28}{'is below that of':<22}{'in pairs':>8}   95 % interval"]
    for pair in found:
        wide = "" if pair.half_width <= WIDEST else " (too wide)"
        lines.append(
            f"{pair.one:<28}{pair.other:<22}{100 * pair.share:>6.1f} %   "
            f"{100 * pair.low:.1f} to {100 * pair.high:.1f} %{wide}"
        )
    if found:
        seeds = found[0].seeds
        lines.append(
            f"All {seeds * seeds:,} pairs of {seeds} runs each; bootstrap over seeds, {SAMPLES:,} draws. "
            "Intervals beyond +-5 % are too wide."
        )
    return "\n".join(lines)
