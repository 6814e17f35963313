"""Measurements: a warm-up, then the median of several samples.

Samples within the process are CPU time, which excludes time that other processes had the core.
Compiled kernels run on one core, so on an idle machine CPU time equals wall-clock time.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from automaton.floor.floor_plan import (
    ALL_EXITS,
    FLOOR,
    UNLIMITED,
    FloorPlan,
    bordered,
    make_floor_plan,
)
from automaton.scenario.schema import LAYER_NAMES, Durations, Fleet, Scenario, Stop, Strategies
from automaton.strategy import lookup
from automaton.world.resolved import Resolved, StrategyChoice

Sample = Callable[[], float]  # takes one sample, in the unit of the measurement

NS_PER_TICK = "ns per tick"
NS_PER_ROBOT_AND_TICK = "ns per robot and tick"
US = "us"
US_PER_TICK = "us per tick"
MS_PER_RUN = "ms CPU per run"
MS = "ms"
S = "s"
TIMES_THE_RUN = "times the run"
EXPONENT = "exponent"  # of a size in the time that it takes
NEVER_ENDS = Stop(when="never", max_duration=2_000_000_000)
IDLE = "automaton.bench.idle_strategies:Idle"


class NotMeasuredError(Exception):
    """The measured event did not happen in time, or the process ended; the text says which."""


class Measurement(NamedTuple):
    """A measurement."""

    name: str
    unit: str
    prepare: Callable[[], Sample]  # sets up, outside the measured time
    warm_up: bool = True  # False: the first sample counts
    at_most: int = 1_000_000  # most samples, for slow measurements
    at_least: int = 1  # least samples, if a target needs them


class MeasuredFigure(NamedTuple):
    """A measured figure; low and high are the extremes of the samples."""

    name: str
    unit: str
    median: float
    low: float
    high: float
    load: float | None = None  # load average of the last minute; None: unknown


def take(measurement: Measurement, repeat: int) -> MeasuredFigure:
    """Prepare, warm up, and take `repeat` samples."""
    sample = measurement.prepare()
    if measurement.warm_up:
        sample()
    samples = max(min(repeat, measurement.at_most), measurement.at_least)
    values = [sample() for _ in range(samples)]
    median, low, high = (rounded(f(values)) for f in (statistics.median, min, max))
    return MeasuredFigure(measurement.name, measurement.unit, median, low, high, load())


def load() -> float | None:
    """The load average of the last minute; None if the system has none."""
    return round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None


def rounded(value: float) -> float:
    """Round to four digits: further ones are noise."""
    return float(f"{value:.4g}")


def slope(sizes: Sequence[float], values: Sequence[float]) -> float:
    """The exponent of growth: the slope of log value over log size, by least squares."""
    x, y = np.log(sizes), np.log(values)
    return float(np.polyfit(x, y, 1)[0])


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU seconds of this process that `work` takes."""
    begun = time.process_time_ns()
    work()
    return (time.process_time_ns() - begun) * 1e-9


def wall_seconds(work: Callable[[], object]) -> float:
    """Wall-clock seconds of `work`, for work in other processes."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


# Floors without shelves and scenes without orders, to measure only driving.


def open_floor(width: int, height: int) -> FloorPlan:
    """Free floor with capacity 1 in each cell."""
    kind, leave = bordered(height, width), bordered(height, width)
    kind[1:-1, 1:-1], leave[1:-1, 1:-1] = FLOOR, ALL_EXITS
    return make_floor_plan(kind, leave)


def mixed_floor(width: int, height: int) -> FloorPlan:
    """Free floor; a random third of the cells each has capacity 1, 2 or no limit."""
    plain = open_floor(width, height)
    capacity = bordered(height, width)
    choice = np.random.default_rng(1).choice([1, 2, UNLIMITED], (height, width))
    capacity[1:-1, 1:-1] = choice
    return make_floor_plan(plain.kind, plain.exits, capacity)


def scene(floor_plan: FloorPlan, robots: int, move: int = 1) -> Resolved:
    """Omnidirectional robots in random cells of a floor, no orders, no robot asked for decisions."""
    scenario = Scenario(
        name="bench",
        layout={},
        fleet=Fleet(robots=robots, kinematics="omni", start="random"),
        durations=Durations(move=move),
        strategy=Strategies(allocation=IDLE, right_of_way="wait"),
        stop=NEVER_ENDS,
    )
    strategies = {}
    for layer in LAYER_NAMES:
        name = getattr(scenario.strategy, layer)
        strategies[layer] = StrategyChoice(name, lookup.parameters_type(layer, name)())
    return Resolved(scenario, floor_plan, strategies, start="random", source="")
