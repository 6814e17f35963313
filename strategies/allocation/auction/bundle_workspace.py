"""Scratch of the methods that look at whole allotments: bundles of tasks, and populations."""

from __future__ import annotations

from typing import Any, Final

from numpy.typing import NDArray

from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.errors import InputError

Array = NDArray[Any]

MAX_BUNDLE_TASKS: Final = 12  # 2^12 bundles for each robot, 3^12 ways to split them between two
MAX_BUNDLE_ROBOTS: Final = 16
MAX_GENERATIONS: Final = 1000


class Bundles(Struct, role=SCRATCH):
    """Every subset S of n tasks, as a number with bit k for item k, and every one of R robots."""

    cost: Array = field("(R, 2^n) int64", "ticks of the bundle; INF: not feasible")
    best: Array = field("(R, 2^n) int64", "the best that robots 0..r make of S, by the objective")
    part: Array = field("(R, 2^n) int32", "what robot r takes of S then")
    ends: Array = field(
        "(2^n, n) int32", "ticks of the shortest way through S that ends with item k"
    )
    chosen: Array = field("(R,) int32", "the bundle that each robot gets")
    trying: Array = field("(R,) int32", "scratch of the search")
    rest: Array = field("(R + 1,) int32", "scratch")
    total: Array = field("(R + 1,) int64", "scratch")
    most: Array = field("(R + 1,) int64", "scratch")


class Population(Struct, role=SCRATCH):
    """N individuals: which of R robots does each of n items; and the lists to begin with."""

    genes: Array = field("(N, n) int32")
    children: Array = field("(N, n) int32")
    fitness: Array = field("(N,) int64", "the objective; smaller is better")
    rank: Array = field("(N,) int32", "individuals from the best to the worst")
    order: Array = field("(R, L) int32", "the robots' lists before the auction")
    length: Array = field("(R,) int32")


def bundles_for(robots: int, tasks: int) -> Bundles:
    """Raises InputError for sizes that cannot be done."""
    if tasks > MAX_BUNDLE_TASKS or robots > MAX_BUNDLE_ROBOTS:
        raise InputError(
            f"bundles of {tasks} tasks for {robots} robots are too many: "
            f"at most {MAX_BUNDLE_TASKS} tasks and {MAX_BUNDLE_ROBOTS} robots can be done exactly"
        )
    return Bundles.sized({"R": robots, "n": tasks, "2^n": 1 << tasks})


def population_for(robots: int, tasks: int, longest: int) -> Population:
    """Ten individuals for each robot."""
    return Population.sized({"N": 10 * robots, "n": tasks, "R": robots, "L": longest})


def generations(robots: int, tasks: int) -> int:
    """Ten times the number of allotments, at most 1,000 (De Ryck et al.)."""
    allotments: int = robots**tasks
    return min(MAX_GENERATIONS, 10 * allotments)
