"""Claims of a publication, judged by runs: each claim is one or more figures with required ranges.

A figure is a smooth function of the means of metrics. Its 95 % interval is Student's, with the jackknife
standard error over the seeds: leaving out one seed in all cases at once preserves the correlation
between cases (the same seed gives the same demand), so a difference of means has exactly the paired
interval. A share of runs has the interval of Clopper and Pearson.

If all n runs agree, the variance is 0, and an interval without width would exclude any exception. Such a
claim is "not contradicted" if the value is inside the range and does not hold if it is outside: with 95 %
confidence, at most a share 1 - 0.025^(1 / n) of runs are exceptions. Only results without random draws
hold from agreement alone.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final, Literal

from automaton.studies.inference.intervals import ROUNDING, student
from automaton.studies.inference.proportions import exact_share

Verdict = Literal["holds", "not contradicted", "undecided", "does not hold"]
WORST_FIRST: Final[tuple[Verdict, ...]] = ("does not hold", "undecided", "not contradicted")
OUR_BOUND: Final = "a bound of ours"  # reason for a range that does not follow from the paper
Sample = tuple[str, tuple[Any, ...]]  # metric and key of a case
Mean = Callable[..., float]  # mean(metric, *labels of the case)


class MeanQuantity:
    """A function of the means of metrics; arithmetic operations give further such functions."""

    def __init__(self, of: Callable[[Mean], float]) -> None:
        self._of = of

    def __call__(self, mean: Mean) -> float:
        return self._of(mean)

    def _with(
        self, apply: Callable[[float, float], float], other: MeanQuantity | float
    ) -> MeanQuantity:
        if isinstance(other, MeanQuantity):
            return MeanQuantity(lambda mean: apply(self(mean), other(mean)))
        return MeanQuantity(lambda mean: apply(self(mean), other))

    def __add__(self, other: MeanQuantity | float) -> MeanQuantity:
        return self._with(operator.add, other)

    def __sub__(self, other: MeanQuantity | float) -> MeanQuantity:
        return self._with(operator.sub, other)

    def __rsub__(self, other: float) -> MeanQuantity:
        return MeanQuantity(lambda mean: other - self(mean))

    def __mul__(self, other: MeanQuantity | float) -> MeanQuantity:
        return self._with(operator.mul, other)

    def __truediv__(self, other: MeanQuantity | float) -> MeanQuantity:
        return self._with(operator.truediv, other)

    def __rtruediv__(self, other: float) -> MeanQuantity:
        return MeanQuantity(lambda mean: other / self(mean))

    __radd__ = __add__
    __rmul__ = __mul__


def mean_of(name: str, *key: Any) -> MeanQuantity:
    """The mean of a metric in the case with these labels."""
    return MeanQuantity(lambda mean: mean(name, *key))


def least(quantities: Iterable[MeanQuantity]) -> MeanQuantity:
    """The smallest of several quantities."""
    several = tuple(quantities)
    return MeanQuantity(lambda mean: min(one(mean) for one in several))


def exponent(large: MeanQuantity, small: MeanQuantity, high: float, low: float) -> MeanQuantity:
    """The growth exponent of a quantity from size `low` to size `high`."""
    return MeanQuantity(lambda mean: math.log(large(mean) / small(mean)) / math.log(high / low))


@dataclass(frozen=True)
class Figure:
    """A number on which a claim is based, and the range that it must lie in."""

    label: str
    of: Callable[[Mean], float]
    at_least: float = -math.inf
    at_most: float = math.inf
    strict: bool = False  # whether the range excludes its ends ("more" is not "as many")
    unit: str = ""  # "%" and "points" show shares times 100
    digits: int = 0  # decimals, except for shares
    certain: bool = False  # without random draws, so that one run is enough
    why: str = ""  # reason for the range, unless it means "more" or "the same"

    def holds(self, low: float, high: float) -> bool:
        """Whether the interval from low to high lies in the range."""
        if self.strict:
            return low > self.at_least and high < self.at_most
        return low >= self.at_least and high <= self.at_most

    def fails(self, low: float, high: float) -> bool:
        """Whether the interval from low to high lies outside the range."""
        if self.strict:
            return high <= self.at_least or low >= self.at_most
        return high < self.at_least or low > self.at_most


@dataclass(frozen=True)
class Claim:
    """A statement of the publication in our words, and its interpretation as figures."""

    text: str
    figures: tuple[Figure, ...]
    source: str = ""  # the publication's own sentence, if our words differ much from it


def above(label: str, of: Callable[[Mean], float], bound: float = 0, **shown: Any) -> Figure:
    """A figure that must be greater than a bound; `shown`: its other fields."""
    return Figure(label, of, at_least=bound, strict=True, **shown)


def below(label: str, of: Callable[[Mean], float], bound: float = 0, **shown: Any) -> Figure:
    """A figure that must be less than a bound."""
    return Figure(label, of, at_most=bound, strict=True, **shown)


def claim(text: str, *figures: Figure, source: str = "") -> Claim:
    """A claim based on these figures."""
    return Claim(text, figures, source)


@dataclass(frozen=True)
class Judged:
    """A figure with its interval; low and high are None if the runs give no interval."""

    figure: Figure
    value: float
    low: float | None
    high: float | None
    printed: float | None  # the same figure from the publication's own table
    runs: int = 1
    alike: bool = False  # whether all runs agree although they involve random draws
    what: str = "run"  # the kind of repetition: run, tour, training

    @property
    def verdict(self) -> Verdict:
        """`holds` if the interval lies inside the range, `does not hold` if it lies outside."""
        if self.low is not None and self.high is not None:
            if self.figure.holds(self.low, self.high):
                return "holds"
            if self.figure.fails(self.low, self.high):
                return "does not hold"
        return self._of_alike() if self.alike else "undecided"

    def _of_alike(self) -> Verdict:
        """The verdict if all runs agree: no run contradicts the claim, or none supports it.

        A share that must be 0 or 1 is a claim of never or always, which no number of runs can prove;
        for any other share the interval decides.
        """
        never_or_always = self.value in (self.figure.at_least, self.figure.at_most)
        if self.low is not None and not never_or_always:
            return "undecided"
        inside = self.figure.holds(self.value, self.value)
        return "not contradicted" if inside else "does not hold"

    @property
    def otherwise(self) -> float | None:
        """The upper 95 % bound on the share of exceptions if all runs agree; else None."""
        return exact_share(0, self.runs).high if self.alike else None

    @property
    def in_print(self) -> bool | None:
        """Whether the publication's own table confirms the figure; None if it prints no value."""
        if self.printed is None:
            return None
        return self.figure.holds(self.printed, self.printed)

    @property
    def margin(self) -> float:
        """The distance of the value from the ends of the range; negative outside."""
        return min(self.value - self.figure.at_least, self.figure.at_most - self.value)


@dataclass(frozen=True)
class JudgedClaim:
    """A claim with its figures; it holds if all of them do."""

    claim: Claim
    figures: Sequence[Judged] = field(default_factory=tuple)

    @property
    def verdict(self) -> Verdict:
        verdicts = [figure.verdict for figure in self.figures]
        for worst in WORST_FIRST:
            if worst in verdicts:
                return worst
        return "holds"

    @property
    def in_print(self) -> bool | None:
        known = [figure.in_print for figure in self.figures]
        if any(value is None for value in known):
            return None
        return all(known)


def judge(
    claim: Claim,
    samples: Mapping[Sample, Sequence[float]],
    printed: Mapping[Sample, float],
    repeated: Mapping[Sample, str] = MappingProxyType({}),
) -> JudgedClaim | None:
    """Judge a claim by the values of each case over the seeds; None if a case was not run.

    Also None after a division by zero: with changed scenarios a metric may be zero.

    `repeated`: the kind of repetition of a sample, by default a run.
    """
    try:
        found = [_judged(figure, samples, printed, repeated) for figure in claim.figures]
        return JudgedClaim(claim, found)
    except (KeyError, ZeroDivisionError):
        return None


def _judged(
    figure: Figure,
    samples: Mapping[Sample, Sequence[float]],
    printed: Mapping[Sample, float],
    repeated: Mapping[Sample, str],
) -> Judged:
    used: list[Sample] = []

    def overall(metric: str, *key: Any) -> float:
        used.append((metric, key))
        values = samples[metric, key]
        return math.fsum(values) / len(values)

    value = figure.of(overall)
    own = {sample: samples[sample] for sample in used}
    try:
        in_print = figure.of(lambda metric, *key: printed[metric, key])
    except KeyError:
        in_print = None
    low, high, alike = _interval(figure, value, own)
    fewest = min(own, key=lambda sample: len(own[sample]))
    runs, what = len(own[fewest]), repeated.get(fewest, "run")
    return Judged(figure, value, low, high, in_print, runs, alike, what)


def _interval(
    figure: Figure, value: float, samples: Mapping[Sample, Sequence[float]]
) -> tuple[float | None, float | None, bool]:
    """The ends of the 95 % interval, and whether all runs agree although they involve random draws."""
    if _is_share(figure, samples):
        [values] = samples.values()
        share = exact_share(round(math.fsum(values)), len(values))
        return share.low, share.high, value in (0, 1)
    margin = _half_width(figure, samples)
    if figure.certain:
        return value - (margin or 0.0), value + (margin or 0.0), False
    if margin is None:
        return None, None, False
    largest = max(abs(one) for values in samples.values() for one in values)
    if margin <= ROUNDING * max(largest, abs(value)):
        return None, None, True
    return value - margin, value + margin, False


def _is_share(figure: Figure, samples: Mapping[Sample, Sequence[float]]) -> bool:
    """Whether a figure is simply the share of runs with some property."""
    if figure.unit != "%" or len(samples) != 1:
        return False
    [values] = samples.values()
    return set(values) <= {0, 1} and figure.of(lambda metric, *key: 0.25) == 0.25


def _half_width(figure: Figure, samples: Mapping[Sample, Sequence[float]]) -> float | None:
    """The half-width of the 95 % interval; None for a single seed."""
    n = min(map(len, samples.values()))
    if n < 2:
        return None
    sums = {sample: math.fsum(values) for sample, values in samples.items()}

    def without(seed: int) -> Mean:
        def mean(metric: str, *key: Any) -> float:
            return (sums[metric, key] - samples[metric, key][seed]) / (n - 1)

        return mean

    left_out = [figure.of(without(seed)) for seed in range(n)]
    centre = math.fsum(left_out) / n
    spread = math.fsum((value - centre) ** 2 for value in left_out)
    return student(n - 1) * math.sqrt(spread * (n - 1) / n)
