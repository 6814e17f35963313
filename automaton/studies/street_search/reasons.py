"""What each street of a design is worth, for whom, and which streets can be left out.

street   a stretch with a cheaper direction, or all stretches of a row or column if they agree in it
worth    of a street: the metric with it against without it, where both directions cost their
         geometric mean; pairs of runs with equal seeds
screened many streets are compared in few pairs first; those with the clearest effects are then
         confirmed with fresh seeds, so that the choice does not bias what they are worth
groups   orders by where they begin and end: pairs of stations, else of the nine parts of the floor
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import DIRECTIONS, EAST, WEIGHT_UNIT, FloorPlan
from automaton.studies.inference.intervals import Effect, Interval, Values, bonferroni, effect
from automaton.studies.reports.comparison_tables import relative_text
from automaton.studies.street_search.designs import (
    Row,
    StreetDesign,
    StreetRuns,
    Stretch,
    stretches,
)

ERROR: Final = 0.05  # of all intervals of a family together
MOST_CONFIRMED: Final = 40  # streets; if there are more, all are screened first
SMALL_EFFECT: Final = 0.002  # of the metric: streets below it may be left out
MOST_CHANGE: Final = 0.005  # of the metric, if such streets are left out together
MOST_EXPLAINED: Final = 10  # streets for which groups of orders are compared
LEAST_PAIRS: Final = 5  # of runs that have orders of a group
PARTS: Final = (
    *("north-west", "north", "north-east"),
    *("west", "centre", "east"),
    *("south-west", "south", "south-east"),
)
Cells = NDArray[np.int64]
Change: TypeAlias = Effect  # of a metric between two designs
LeadTimes = Mapping[str, float]  # of a run: ticks and numbers of its orders by group


class ComparedRuns(NamedTuple):
    """A comparison of designs by a metric of runs with equal seeds.

    With several fleets a value is the mean over fleets of the metric in shares of the mean with the
    design that is compared with.
    """

    runs: StreetRuns
    metric: str
    is_higher_better: bool
    fleets: tuple[int | None, ...] = (None,)  # robots; None: as in the scenario

    def pairs(
        self, designs: Sequence[StreetDesign], base: StreetDesign, seeds: Sequence[int]
    ) -> list[tuple[Values, Values]]:
        """Values of each design and of the base, of runs that have the metric with both."""
        values = np.zeros((1 + len(designs), len(seeds)))
        for robots in self.fleets:
            rows = self.runs([base, *designs], seeds, robots)
            known = [[self.value(row) for row in each] for each in rows]
            table = np.array(known, np.float64)  # None becomes nan
            if len(self.fleets) > 1:
                table /= len(self.fleets) * np.nanmean(table[0])
            values += table
        both = np.isfinite(values[1:]) & np.isfinite(values[0])
        return [(one[b], values[0][b]) for one, b in zip(values[1:], both, strict=True)]

    def value(self, row: Row) -> float | None:
        """The metric of a run that finished."""
        value: float | None = row.get(self.metric) if row.get("finished", True) else None
        return value

    def effects(
        self,
        designs: Sequence[StreetDesign],
        base: StreetDesign,
        seeds: Sequence[int],
        level: float = 1 - ERROR,
    ) -> list[Effect | None]:
        """The effect of each design against the base; None for fewer than two pairs."""
        return [
            effect(x, y, True, level) if len(x) > 1 else None
            for x, y in self.pairs(designs, base, seeds)
        ]

    def gain(self, change: Effect | None) -> float:
        """What a change gains, in shares of the metric; 0 if it is not known."""
        share = 0.0 if change is None else share_of(change).value
        return share if self.is_higher_better else -share

    def least_gain(self, change: Effect) -> float:
        """The lower end of what a change gains, in shares of the metric; -inf without an interval."""
        interval = share_of(change)
        low, high = interval.low, interval.high
        if low is None or high is None:
            return -math.inf
        return low if self.is_higher_better else -high


def share_of(change: Effect) -> Interval:
    """A change in shares of the metric; as a difference if its mean is not above 0."""
    return change.difference if change.relative is None else change.relative


def change_text(change: Effect | Interval | None) -> str:
    """A change in percent, with its interval."""
    return relative_text(share_of(change) if isinstance(change, Effect) else change)


# The streets of a design.


class GuidedStreet(NamedTuple):
    """Stretches of a row or column with the same cheaper direction."""

    stretches: tuple[Stretch, ...]
    cheap: int  # the cheaper direction
    ratios: tuple[float, float]  # least and largest cost of the other direction, as multiples
    is_one_way: bool  # moves in the other direction are closed

    def edges(self, floor_plan: FloorPlan) -> tuple[Cells, Cells]:
        """Where moves east or south begin, and where they end, of edges with moves both ways."""
        each = [edges_of(stretch, floor_plan) for stretch in self.stretches]
        begin, end = (np.concatenate(cells) for cells in zip(*each, strict=True))
        return begin, end

    def name(self, floor_plan: FloorPlan) -> str:
        """Such as "row 12, columns 2 to 33"; only the row if it is all of it."""
        places = [floor_plan.xy(cell) for one in self.stretches for cell in one.cells]
        is_row = self.stretches[0].along == EAST
        across, along = (1, 0) if is_row else (0, 1)
        line = places[0][across]
        first, last = min(at[along] for at in places), max(at[along] for at in places)
        name = f"row {line}" if is_row else f"column {line}"
        length = floor_plan.width if is_row else floor_plan.height
        if last - first == length - 1:
            return name
        return f"{name}, {'columns' if is_row else 'rows'} {first} to {last}"

    @property
    def preference(self) -> str:
        """Such as "west 2.1 times as cheap" or "one-way west"."""
        way = DIRECTIONS[self.cheap]
        if self.is_one_way:
            return f"one-way {way}"
        least, most = (f"{ratio:.3g}" for ratio in self.ratios)
        return f"{way} {least if least == most else f'{least} to {most}'} times as cheap"


def edges_of(stretch: Stretch, floor_plan: FloorPlan) -> tuple[Cells, Cells]:
    """Where the moves along a stretch begin, and where they end, of edges with moves both ways."""
    exits, cells = floor_plan.exits.reshape(-1), np.array(stretch.cells)
    begin, end = cells[:-1], cells[1:]
    both = (exits[begin] >> stretch.along & 1 != 0) & (exits[end] >> (stretch.along ^ 2) & 1 != 0)
    return begin[both], end[both]


def move_ratio(design: StreetDesign, begin: Cells, end: Cells, along: int) -> float:
    """The cost of moves against a stretch as a multiple of that along it, the geometric mean."""
    logs = np.log(design.moves[end, along ^ 2]) - np.log(design.moves[begin, along])
    return float(np.exp(logs.mean()))


def preference_of(
    design: StreetDesign, stretch: Stretch, floor_plan: FloorPlan
) -> GuidedStreet | None:
    """A stretch as a street; None if no move both ways is cheaper in one of the directions."""
    begin, end = edges_of(stretch, floor_plan)
    if not len(begin):
        return None
    ratio = move_ratio(design, begin, end, stretch.along)
    along = design.closed[begin, stretch.along].any()
    against = design.closed[end, stretch.along ^ 2].any()
    if along != against:
        cheap, is_one_way = stretch.along ^ (2 if along else 0), True
    elif abs(ratio - 1) < 1 / WEIGHT_UNIT**2:
        return None
    else:
        cheap, is_one_way = stretch.along ^ (0 if ratio > 1 else 2), False
    ratio = ratio if cheap == stretch.along else 1 / ratio
    return GuidedStreet((stretch,), cheap, (ratio, ratio), is_one_way)


def streets_of(design: StreetDesign, floor_plan: FloorPlan) -> list[GuidedStreet]:
    """The streets of a design: rows and columns whose stretches agree, and single stretches."""
    lines: dict[tuple[int, int], list[GuidedStreet | None]] = {}
    for stretch in stretches(floor_plan):
        line = floor_plan.xy(stretch.cells[0])[1 - stretch.along]
        street = preference_of(design, stretch, floor_plan)
        lines.setdefault((stretch.along, line), []).append(street)
    streets: list[GuidedStreet] = []
    for members in lines.values():
        guided = [one for one in members if one is not None]
        if (
            len(guided) == len(members)
            and len({(one.cheap, one.is_one_way) for one in guided}) == 1
        ):
            parts = tuple(one.stretches[0] for one in guided)
            ratios = sorted(one.ratios[0] for one in guided)
            guided = [guided[0]._replace(stretches=parts, ratios=(ratios[0], ratios[-1]))]
        streets += guided
    return streets


def without_street(
    design: StreetDesign, street: GuidedStreet, floor_plan: FloorPlan
) -> StreetDesign:
    """The design where both directions of a street cost their geometric mean, and are open."""
    (begin, end), along = street.edges(floor_plan), street.stretches[0].along
    means = np.sqrt(design.moves[begin, along].astype(float) * design.moves[end, along ^ 2])
    return with_weight(design, street, floor_plan, np.floor(means + 0.5))


def with_weight(
    design: StreetDesign, street: GuidedStreet, floor_plan: FloorPlan, weights: Any
) -> StreetDesign:
    """The design with some weights of a street in both directions, which are open."""
    (begin, end), along = street.edges(floor_plan), street.stretches[0].along
    moves, closed = design.moves.copy(), design.closed.copy()
    for cells, direction in ((begin, along), (end, along ^ 2)):
        moves[cells, direction] = weights
        closed[cells, direction] = False
    return design._replace(moves=moves, closed=closed)


# What streets are worth.


class GroupChange(NamedTuple):
    """How a street changes the mean lead time of some orders."""

    name: str  # such as "from the west to the centre"
    change: Interval  # in shares


class Reason(NamedTuple):
    """What a street is worth."""

    street: GuidedStreet
    worth: Effect | None  # the metric with the street against without it; None: too few runs
    gain: float  # in shares of the metric; above 0 if the street makes it better
    is_confirmed: bool = True  # False: screened only
    saves: GroupChange | None = None  # the orders that gain most, if any do
    costs: GroupChange | None = None  # the orders that lose most

    @property
    def certainty(self) -> float:
        """The distance of the interval from 0, in shares of the metric; below 0 if it holds 0."""
        share = None if self.worth is None else share_of(self.worth)
        if share is None or share.low is None or share.high is None:
            return -math.inf
        return max(share.low, -share.high)

    @property
    def has_effect(self) -> bool:
        """Whether the worth is distinguishable from 0, by seeds that did not choose the street."""
        return self.is_confirmed and self.certainty > 0

    @property
    def changes_nothing(self) -> bool:
        """Whether all runs have the same value without the street."""
        return self.certainty == self.gain == 0

    @property
    def may_go(self) -> bool:
        """Whether the worth is small and not distinguishable from 0."""
        return abs(self.gain) < SMALL_EFFECT and -math.inf < self.certainty <= 0


def reasons(
    design: StreetDesign,
    floor_plan: FloorPlan,
    compared: ComparedRuns,
    screening: Sequence[int],
    seeds: Sequence[int],
) -> list[Reason]:
    """What each street of a design is worth: confirmed ones by gain, then screened ones by gain.

    `screening`, `seeds`: fresh seeds. Intervals of confirmed streets hold together, those of screened
    streets one by one.
    """
    streets, screened = streets_of(design, floor_plan), []
    if len(streets) > MOST_CONFIRMED:
        ranked = worths(streets, design, floor_plan, compared, screening, 1 - ERROR)
        ranked.sort(key=lambda one: (one.changes_nothing, -one.certainty))
        clear = sum(one.certainty > 0 for one in ranked)
        number = min(max(clear, MOST_EXPLAINED), MOST_CONFIRMED)
        streets = [one.street for one in ranked[:number]]
        screened = [one._replace(is_confirmed=False) for one in ranked[number:]]
    level = bonferroni(1 - ERROR, len(streets) or 1)
    confirmed = worths(streets, design, floor_plan, compared, seeds, level)
    return [
        one for each in (confirmed, screened) for one in sorted(each, key=lambda one: -one.gain)
    ]


def worths(
    streets: Sequence[GuidedStreet],
    design: StreetDesign,
    floor_plan: FloorPlan,
    compared: ComparedRuns,
    seeds: Sequence[int],
    level: float,
) -> list[Reason]:
    """What some streets are worth, with intervals of a level."""
    others = [without_street(design, street, floor_plan) for street in streets]
    pairs = compared.pairs(others, design, seeds) if streets else []
    effects = [
        effect(with_it, without, True, level) if len(without) > 1 else None
        for without, with_it in pairs
    ]
    return [Reason(*one, compared.gain(one[1])) for one in zip(streets, effects, strict=True)]


def sum_of_largest(ranked: Sequence[Reason], most: int = MOST_EXPLAINED) -> float:
    """The sum of the largest gains of single confirmed streets, in shares of the metric."""
    return sum(sorted((one.gain for one in ranked if one.is_confirmed), reverse=True)[:most])


class FewerStreets(NamedTuple):
    """A design without the streets that may go."""

    design: StreetDesign  # without them if that changes little, else as it was
    removed: tuple[GuidedStreet, ...]  # that may go
    change: Effect | None  # of the metric without them; None: none may go, or too few runs
    is_kept: bool  # whether the design is without them


def fewer(
    design: StreetDesign,
    floor_plan: FloorPlan,
    ranked: Sequence[Reason],
    compared: ComparedRuns,
    seeds: Sequence[int],
) -> FewerStreets:
    """Set the weights of all streets that may go to 1, if the mean metric gets little worse."""
    removed = tuple(one.street for one in ranked if one.may_go)
    trial = design
    for street in removed:
        trial = with_weight(trial, street, floor_plan, WEIGHT_UNIT)
    change = compared.effects([trial], design, seeds)[0] if removed else None
    if change is None:
        return FewerStreets(design, removed, None, False)
    is_kept = compared.gain(change) >= -MOST_CHANGE
    return FewerStreets(trial if is_kept else design, removed, change, is_kept)


# Whom a street serves: orders by where they begin and end.


def lead_times_by_group(simulation: Any) -> dict[str, float]:
    """Run to the end; the ticks and the numbers of delivered orders: "from A to B ticks", "... orders".

    An order begins where its load was, or where its robot took it, and ends at its target or its last
    stop. A lead time lasts from the release of an order to its delivery.
    """
    from automaton.runs.headless import run_to_end

    run_to_end(simulation)
    world, floor_plan = simulation.world, simulation.resolved.floor_plan
    orders, slot_cell, stop_cell = world.orders, world.slots.cell, world.stops.cell
    done = np.flatnonzero(orders.delivered >= 0)
    begin = orders.dispatched_from[done].astype(np.int64)
    loaded = orders.source[done] >= 0
    begin[loaded] = slot_cell[orders.source[done][loaded]]
    end = np.full(len(done), -1, np.int64)
    has_stops = orders.stops_done[done] > 0
    last = orders.first_stop[done] + orders.stops_done[done] - 1
    end[has_stops] = stop_cell[last[has_stops]]
    carried = orders.target[done] >= 0
    end[carried] = slot_cell[orders.target[done][carried]]
    known = (begin >= 0) & (end >= 0)
    times = (orders.delivered[done] - orders.release_tick[done])[known]
    return dict(summed_by_group(floor_plan, begin[known], end[known], times))


def summed_by_group(
    floor_plan: FloorPlan, begin: Cells, end: Cells, times: Cells
) -> Iterator[tuple[str, float]]:
    """The sum and the number of the times of orders with these ends, by group."""
    numbers = np.zeros(floor_plan.kind.size, np.int64)
    numbers[floor_plan.stations] = 1 + np.arange(len(floor_plan.stations))
    parts = parts_of(floor_plan)
    both = (numbers[begin] > 0) & (numbers[end] > 0)
    codes = (
        np.where(both, numbers[begin], -1 - parts[begin]),
        np.where(both, numbers[end], -1 - parts[end]),
    )
    pairs, group = np.unique(np.stack(codes, axis=1), axis=0, return_inverse=True)
    ticks, orders = np.bincount(group.reshape(-1), times), np.bincount(group.reshape(-1))
    for (first, last), each, many in zip(pairs.tolist(), ticks, orders, strict=True):
        name = f"from {place_name(first)} to {place_name(last)}"
        if first == last < 0:
            name = f"within {place_name(first)}"
        yield f"{name} ticks", float(each)
        yield f"{name} orders", float(many)


def parts_of(floor_plan: FloorPlan) -> Cells:
    """(cells,) the number of the part of the floor, of three by three, in which a cell is."""
    rows, columns = np.divmod(np.arange(floor_plan.kind.size), floor_plan.stride)
    down = np.clip(3 * (rows - 1) // floor_plan.height, 0, 2)
    right = np.clip(3 * (columns - 1) // floor_plan.width, 0, 2)
    parts: Cells = 3 * down + right
    return parts


def place_name(code: int) -> str:
    """A station by its number from 1, or a part of the floor from -1 down."""
    return f"station {code}" if code > 0 else f"the {PARTS[-1 - code]}"


def with_groups(
    ranked: Sequence[Reason],
    design: StreetDesign,
    floor_plan: FloorPlan,
    lead_times: Callable[[Sequence[StreetDesign], Sequence[int]], Sequence[Sequence[LeadTimes]]],
    seeds: Sequence[int],
) -> list[Reason]:
    """The reasons, those with the largest effects with the orders that gain and lose most.

    `lead_times`: by design and seed what `lead_times_by_group` counts.
    """
    largest = [one for one in ranked if one.has_effect]
    largest = sorted(largest, key=lambda one: -abs(one.gain))[:MOST_EXPLAINED]
    if not largest:
        return list(ranked)
    others = [without_street(design, one.street, floor_plan) for one in largest]
    base, *runs = lead_times([design, *others], seeds)
    names = {key.removesuffix(" orders") for run in base for key in run if key.endswith("orders")}
    level = bonferroni(1 - ERROR, len(largest) * len(names) or 1)
    explained = {}
    for one, without in zip(largest, runs, strict=True):
        changes = list(group_changes(sorted(names), base, without, level))
        lower = [each for each in changes if each.change.high is not None and each.change.high < 0]
        higher = [each for each in changes if each.change.low is not None and each.change.low > 0]
        explained[one.street] = one._replace(
            saves=min(lower, key=lambda each: each.change.value, default=None),
            costs=max(higher, key=lambda each: each.change.value, default=None),
        )
    return [explained.get(one.street, one) for one in ranked]


def group_changes(
    names: Sequence[str],
    with_it: Sequence[LeadTimes],
    without: Sequence[LeadTimes],
    level: float,
) -> Iterator[GroupChange]:
    """How the mean lead time of each group changes, by runs in which it has orders both times."""
    for name in names:
        pairs = [
            (a[f"{name} ticks"] / a[f"{name} orders"], b[f"{name} ticks"] / b[f"{name} orders"])
            for a, b in zip(with_it, without, strict=True)
            if a.get(f"{name} orders") and b.get(f"{name} orders")
        ]
        if len(pairs) >= LEAST_PAIRS:
            a, b = np.array(pairs).T
            change = effect(a, b, True, level).relative
            if change is not None:
                yield GroupChange(name, change)
