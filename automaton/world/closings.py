"""The closings of cells: all of a run are known before it begins, those by chance by its seed."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from automaton.scenario.changing_floor import Closing, MeanGap
from automaton.scenario.durations import Distribution
from automaton.scenario.schema import Scenario
from automaton.world.gate_cells import Gate, gates_of

MAX_CLOSINGS: Final = 4_000_000  # of a run

Array = npt.NDArray[Any]


def closings_of(gate: Gate, number: int, scenario: Scenario, seed: int) -> Array:
    """(k, 2) int64: first tick and tick after the last of the closings of a gate until the run ends."""
    closing, end = gate.section, scenario.stop.max_duration
    if not isinstance(closing, Closing):
        return np.zeros((0, 2), np.int64)
    if isinstance(closing.every, MeanGap):
        return random_closings(closing, closing.every.mean, number, seed, end)
    assert isinstance(closing.ticks, int), "checked: by schedule"
    ticks = scheduled_closings(closing, end)
    begins = np.arange(ticks.start, ticks.stop, ticks.step, dtype=np.int64)
    return np.stack([begins, begins + closing.ticks], axis=1)


def random_closings(closing: Closing, mean: float, number: int, seed: int, end: int) -> Array:
    """Closings by chance: address (CLOSINGS, row, 2 k) the gap before closing k, 2 k + 1 its length."""
    # These need Numba, as the checks of most scenarios do not.
    from automaton.engine.random_numbers import STREAM_CLOSINGS
    from automaton.world.geometric_draws import geometric
    from automaton.world.handling_times import drawn_durations

    rows: list[Array] = []
    tick, first, count = 0, 0, 256
    while tick <= end and first <= MAX_CLOSINGS:
        k = np.arange(first, first + count)
        gaps = geometric(mean, seed, STREAM_CLOSINGS, number, 2 * k)
        if isinstance(closing.ticks, Distribution):
            address = STREAM_CLOSINGS, np.full(count, number), 2 * k + 1
            drawn = drawn_durations(closing.ticks, count, seed, address)
            lengths = np.maximum(np.floor(drawn + 0.5).astype(np.int64), 1)
        else:
            lengths = np.full(count, closing.ticks)
        ends = tick + np.cumsum(gaps + lengths)
        rows.append(np.stack([ends - lengths, ends], axis=1))
        tick, first, count = int(ends[-1]), first + count, min(2 * count, 65_536)
    closings = np.concatenate(rows)
    begun: Array = closings[closings[:, 0] <= end].astype(np.int64)
    return begun


def scheduled_closings(closing: Closing, end: int) -> range:
    """The first ticks of the closings by schedule of a run that ends by some tick."""
    assert closing.begin is not None, "checked: by schedule"
    assert not isinstance(closing.every, MeanGap), "checked: by schedule"
    return range(closing.begin, max(end, closing.begin) + 1, closing.every or end + 1)


def find_too_many_closings(scenario: Scenario) -> tuple[Gate, str] | None:
    """The first gate with which cells close too often, with the scenario's seed, and the sentence."""
    count = 0
    for number, gate in enumerate(gates_of(scenario.floor)):
        if isinstance(gate.section, Closing):
            if isinstance(gate.section.every, MeanGap):
                count += len(closings_of(gate, number, scenario, scenario.seed))
            else:
                count += len(scheduled_closings(gate.section, scenario.stop.max_duration))
        if count > MAX_CLOSINGS:
            return gate, too_many_closings(count)
    return None


def too_many_closings(count: int) -> str:
    """The sentence about cells that close more often than a run can hold."""
    return (
        f"cells close {count:,} times until stop.max_duration, at most {MAX_CLOSINGS:,} are allowed; "
        "set it lower, or every larger"
    )
