"""How long a visit at a station takes: something for the visit, for each line, and for each unit."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, field

from automaton.scenario.field_types import ConfigSection, NonEmptyText
from automaton.scenario.quantities import TIME, quantity

LONGEST = 65_535  # ticks

Duration = Annotated[float, quantity(TIME, ge=0, le=LONGEST, description="In ticks, not rounded.")]
Mean = Annotated[float, quantity(TIME, gt=0, le=LONGEST, description="Mean ticks.")]


class Uniform(ConfigSection, frozen=True, kw_only=True):
    """Any duration between two, all alike probable."""

    least: Annotated[Duration, Meta(description="The shortest.")] = field(name="from")
    most: Annotated[Duration, Meta(description="The longest.")] = field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least:g}) must not be above to ({self.most:g})")


class Lognormal(ConfigSection, frozen=True, kw_only=True):
    """A duration whose logarithm is normally distributed."""

    mean: Mean
    sd: Annotated[
        float, quantity(TIME, ge=0, le=LONGEST, description="Standard deviation, in ticks.")
    ]


class Distribution(ConfigSection, frozen=True, kw_only=True):
    """A duration that is drawn for each line: of one distribution."""

    uniform: Uniform | None = None
    lognormal: Lognormal | None = None
    empirical: Annotated[
        Annotated[tuple[Duration, ...], Meta(min_length=1, max_length=1_000_000)]
        | NonEmptyText
        | None,
        Meta(
            description="One of these durations, all alike probable; or of a CSV file, relative to "
            "the scenario."
        ),
    ] = None
    column: Annotated[NonEmptyText | None, Meta(description="The column of that file.")] = None
    exponential: Annotated[
        Mean | None,
        Meta(
            description="With this mean, memoryless, in whole ticks from 1 on: the geometric "
            "distribution."
        ),
    ] = None

    def __post_init__(self) -> None:
        stated = (self.uniform, self.lognormal, self.empirical, self.exponential)
        if sum(form is not None for form in stated) != 1:
            raise ValueError(
                "a distribution is one of uniform, lognormal, empirical and exponential"
            )
        if isinstance(self.empirical, str) != (self.column is not None):
            raise ValueError("a file of durations and its column belong together")
        if self.exponential is not None and self.exponential < 1:
            raise ValueError(f"exponential must be at least a tick, found {self.exponential:g}")


class Handling(ConfigSection, frozen=True, kw_only=True):
    """What a robot's visit at a station takes, while it holds its pod: the sum of three parts."""

    visit: Annotated[Duration, Meta(description="Once for the visit.")] = 0.0
    line: Annotated[Duration | Distribution, Meta(description="For each line.")] = 0.0
    unit: Annotated[Duration, Meta(description="For each unit of a line.")] = 0.0
