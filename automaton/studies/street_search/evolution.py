"""The search for weights: an evolution strategy on their logarithms, coarse to fine.

    rows       a number for each row east and west and each column south and north, one for waiting
    stretches  a number for each stretch and direction, one for waiting

Separable CMA-ES (Ros & Hansen 2008) samples numbers of a generation, all candidates run with the same
seed, and the better half moves the mean. Each stage begins at the mean of the stage before, the first at
the best of the scenario as it is and the four crisscross patterns. Weights are exp(number). Candidates
are written to a file before they run, so that a search that was cut off continues with them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.floor.floor_plan import WEIGHT_UNIT, FloorPlan
from automaton.scenario.streets import StreetWeights, crisscross_on
from automaton.studies.street_search.candidates import CandidateLog
from automaton.studies.street_search.designs import Row, StreetDesign, StreetRuns, stretches
from automaton.studies.sweeps.run_keys import seed_of

Numbers = NDArray[np.float64]

ROWS, STRETCHES = DETAILS = ("rows", "stretches")
LARGEST_NUMBER: Final = 4.0  # number: a weight of e^4, about 55
FIRST_POPULATION: Final = 24
POPULATION: Final = 32
FIRST_SHARE: Final = 0.6  # of the runs, for the first of two stages
STEP_FROM_ONES: Final = 0.5  # of the first stage if it begins without weights
FIRST_STEP: Final = 0.3
LATER_STEP: Final = 0.15
RESAMPLING: Final = 10  # tries to draw numbers within their limits, before they are cut
START_RUNS: Final = 8
FULL_SEARCH: Final = 2000  # runs; after a shorter search the later parts have fewer runs, too
LEAST_SHARE: Final = 0.2  # of their runs
FINALIST_EVERY: Final = 10  # generations
UNCHANGED: Final = "as it is"
INSTALL: Final = "pip install 'fleet-automaton[optimize]'"


class SearchQuestion(NamedTuple):
    """What is searched for, and with how many runs."""

    metric: str
    is_higher_better: bool
    robots: tuple[int | None, ...]  # fleets; None: that of the scenario
    seed: int
    runs: int
    detail: str

    @property
    def generations(self) -> tuple[int, int]:
        """The generations of each stage. Raises InputError if the runs are too few."""
        fleets = len(self.robots)
        starts = fleets * START_RUNS * len(start_phases())
        left = (self.runs - starts) // fleets
        if self.detail == ROWS:
            first, later, least = left // FIRST_POPULATION, 0, 2 * FIRST_POPULATION
        else:
            first = max(1, int(FIRST_SHARE * left) // FIRST_POPULATION)
            later = (left - FIRST_POPULATION * first) // POPULATION
            least = FIRST_POPULATION + POPULATION
        if left < least:
            raise InputError(
                f"the {starts:,} runs of the start designs and two generations take "
                f"{starts + fleets * least:,} runs",
                f"--runs {self.runs}",
            )
        return first, later

    def scaled(self, number: int) -> int:
        """The runs of a later part that has `number` runs after a full search; at least two."""
        share = min(1.0, max(LEAST_SHARE, self.runs / FULL_SEARCH))
        return max(2, math.ceil(share * number))

    def seeds(self, purpose: str, number: int) -> list[int]:
        """Seeds that serve one purpose only."""
        return [seed_of(f"{self.seed} {purpose} {r}") for r in range(number)]

    def value(self, row: Row) -> float:
        """The metric of a run such that more is better; -inf without one, or if it did not finish."""
        value = row.get(self.metric)
        if row["error"] is not None or not row["finished"] or value is None:
            return -math.inf
        return float(value) if self.is_higher_better else -float(value)


class NamedDesign(NamedTuple):
    """A design that may be chosen."""

    name: str
    design: StreetDesign


class Generation(NamedTuple):
    """The results of a generation, in units of the metric of the first fleet."""

    number: int  # from 1
    stage: str
    mean: float  # of the candidates that finished
    best: float


class SearchResult(NamedTuple):
    """What a search found."""

    finalists: list[NamedDesign]  # the first is the scenario as it is
    generations: list[Generation]


# Numbers and designs.


def start_phases() -> tuple[tuple[int, int] | None, ...]:
    """The phases of the crisscross patterns that a search may begin with; None: the scenario as it is."""
    return None, (0, 0), (0, 1), (1, 0), (1, 1)


def design_of(floor_plan: FloorPlan) -> StreetDesign:
    """The weights of a floor."""
    cells = floor_plan.kind.size
    moves, waits = floor_plan.move_weights, floor_plan.wait_weights
    if not len(moves):
        moves, waits = (np.full(shape, WEIGHT_UNIT, np.int32) for shape in ((cells, 4), cells))
    return StreetDesign(moves, waits, np.zeros((cells, 4), np.bool_))


def crisscross(
    floor_plan: FloorPlan, phase: tuple[int, int], as_it_is: StreetDesign
) -> StreetDesign:
    """Rows run east and west in turn, columns south and north; closed moves stay closed."""
    weights = crisscross_on(floor_plan, phase)
    return StreetDesign(weights.moves, weights.waits, as_it_is.closed)


class Stage:
    """The numbers of a level of detail: which moves each of them gives a weight."""

    def __init__(self, detail: str, floor_plan: FloorPlan, as_it_is: StreetDesign) -> None:
        self.name, self.as_it_is = detail, as_it_is
        weights = StreetWeights(floor_plan)
        is_open = weights.open_moves() & ~as_it_is.closed
        find = moves_of_rows if detail == ROWS else moves_of_stretches
        groups = (moves[is_open.flat[moves]] for moves in find(floor_plan))
        self.groups = [moves for moves in groups if len(moves)]
        self.of_move = np.full(is_open.size, -1)  # the number of each move
        for number, moves in enumerate(self.groups):
            self.of_move[moves] = number

    def design(self, numbers: Numbers) -> StreetDesign:
        """The design of some numbers; the last one is that of waiting."""
        weights = np.floor(WEIGHT_UNIT * np.exp(numbers) + 0.5).astype(np.int32)
        moves = np.where(self.of_move >= 0, weights[self.of_move], WEIGHT_UNIT).astype(np.int32)
        waits = np.full(len(self.as_it_is.waits), weights[-1], np.int32)
        return StreetDesign(moves.reshape(-1, 4), waits, self.as_it_is.closed)

    def numbers(self, design: StreetDesign) -> Numbers:
        """The mean number of the moves of each group, within the limits."""
        logs = np.log(np.maximum(design.moves.reshape(-1), 1) / WEIGHT_UNIT)
        wait = np.log(np.maximum(design.waits, 1) / WEIGHT_UNIT).mean()
        means = np.array([*(logs[moves].mean() for moves in self.groups), wait])
        numbers: Numbers = np.clip(means, -LARGEST_NUMBER, LARGEST_NUMBER)
        return numbers


def moves_of_rows(floor_plan: FloorPlan) -> Iterator[NDArray[np.int64]]:
    """The moves (cell * 4 + direction) of each row and column in each direction."""
    cells = np.arange(floor_plan.kind.size).reshape(floor_plan.kind.shape)
    for direction in range(4):
        for line in cells if direction % 2 == 0 else cells.T:
            yield 4 * line + direction


def moves_of_stretches(floor_plan: FloorPlan) -> Iterator[NDArray[np.int64]]:
    """The moves (cell * 4 + direction) of each stretch in each direction."""
    for stretch in stretches(floor_plan):
        cells = np.array(stretch.cells, np.int64)
        yield 4 * cells[:-1] + stretch.along
        yield 4 * cells[1:] + (stretch.along ^ 2)


# The search.


def optimizer_type() -> Any:
    """Separable CMA-ES. Raises InputError if it is not installed."""
    try:
        from cmaes import SepCMA
    except ImportError:
        raise InputError(f"the search needs the package cmaes: {INSTALL}") from None
    return SepCMA


class Search:
    """A search on a floor without streets; `runs` judges designs."""

    def __init__(
        self,
        question: SearchQuestion,
        floor_plan: FloorPlan,
        as_it_is: StreetDesign,
        runs: StreetRuns,
        log: CandidateLog,
        on_generation: Callable[[Generation], None] = lambda generation: None,
    ) -> None:
        self.question, self.floor_plan, self.as_it_is = question, floor_plan, as_it_is
        self.runs, self.log, self.on_generation = runs, log, on_generation
        self.finalists: list[NamedDesign] = []
        self.generations: list[Generation] = []
        self.usual: list[float] = []  # the metric of each fleet in the scenario as it is

    def run(self) -> SearchResult:
        """Search. Raises InputError if no run of a start design finished."""
        first, later = self.question.generations
        design, is_plain = self._start()
        step = STEP_FROM_ONES if is_plain else FIRST_STEP
        design = self._climb(ROWS, design, step, first, FIRST_POPULATION)
        if later:
            self._climb(STRETCHES, design, LATER_STEP, later, POPULATION)
        return SearchResult(self.finalists, self.generations)

    def _start(self) -> tuple[StreetDesign, bool]:
        """The best of the start designs, and whether it is without weights."""
        for phase in start_phases():
            name, design = UNCHANGED, self.as_it_is
            if phase is not None:
                name = f"crisscross, phase {list(phase)}"
                design = crisscross(self.floor_plan, phase, self.as_it_is)
            self.finalists.append(NamedDesign(name, design))
        designs = [one.design for one in self.finalists]
        values = self._values(designs, self.question.seeds("start", START_RUNS))
        self.usual = [abs(float(value)) for value in values[:, 0]]
        if not np.isfinite(values).all(axis=0).any():
            raise InputError(
                "no start design finishes all its runs: give them more time or fewer robots"
            )
        best = self.finalists[int(np.argmax(self._over_fleets(values)))].design
        return best, bool((best.moves == WEIGHT_UNIT).all() and (best.waits == WEIGHT_UNIT).all())

    def _values(self, designs: Sequence[StreetDesign], seeds: Sequence[int]) -> Numbers:
        """(fleets, designs) the mean value of the runs."""
        of_fleets = (self.runs(designs, seeds, robots) for robots in self.question.robots)
        value = self.question.value
        return np.array(
            [[np.mean([value(row) for row in rows]) for rows in fleet] for fleet in of_fleets]
        )

    def _over_fleets(self, values: Numbers) -> Numbers:
        """(designs,) the mean over fleets of the value relative to the scenario as it is."""
        usual = [one if 0 < one < math.inf else 1.0 for one in self.usual]
        relative: Numbers = (values / np.array(usual)[:, None]).mean(axis=0)
        return relative

    def _climb(
        self, detail: str, start: StreetDesign, step: float, generations: int, population: int
    ) -> StreetDesign:
        """The mean design after some generations of a stage."""
        stage = Stage(detail, self.floor_plan, self.as_it_is)
        begin = stage.numbers(start)
        limits = np.tile([-LARGEST_NUMBER, LARGEST_NUMBER], (len(begin), 1))
        optimizer = optimizer_type()(
            mean=begin,
            sigma=step,
            bounds=limits,
            n_max_resampling=RESAMPLING,
            population_size=population,
        )
        for last in range(1, generations + 1):
            self._advance(stage, optimizer, population)
            if last == generations or len(self.generations) % FINALIST_EVERY == 0:
                name = f"mean after generation {len(self.generations)}, {detail}"
                self.finalists.append(NamedDesign(name, stage.design(optimizer.mean.copy())))
        return self.finalists[-1].design

    def _advance(self, stage: Stage, optimizer: Any, population: int) -> None:
        """Run one generation, all candidates with the same seed, and move the mean."""
        number, seed = len(self.generations) + 1, self.question.seed

        def sample() -> Numbers:
            optimizer.reseed_rng(seed_of(f"{seed} sample {number}") % 2**32)
            return np.array([optimizer.ask() for _ in range(population)])

        numbers = self.log.candidates(number, sample)
        designs = [stage.design(one) for one in numbers]
        values = self._values(designs, [seed_of(f"{seed} search {number}")])
        overall = self._over_fleets(values)
        optimizer.tell(list(zip(numbers, (-overall).tolist(), strict=True)))
        ended = np.abs(values[0][np.isfinite(values[0])])
        mean, best = (float(ended.mean()), float(ended.max())) if len(ended) else (math.nan,) * 2
        if len(ended) and not self.question.is_higher_better:
            best = float(ended.min())
        self.generations.append(Generation(number, stage.name, mean, best))
        self.on_generation(self.generations[-1])
