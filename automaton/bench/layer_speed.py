"""The fixed cost of a layer that is asked every tick: an idle fleet with and without the layer."""

from __future__ import annotations

from functools import partial

from automaton.bench.loop_speed import idle_fleet, seconds_of
from automaton.bench.measurement import US_PER_TICK, Measurement, Sample
from automaton.engine.state import LAYER_ZONING

COMPILED = "automaton.bench.idle_strategies:EveryTick"
IN_PYTHON = "automaton.bench.idle_strategies:EveryTickInPython"
COMPILED_TICKS, PYTHON_TICKS = 200_000, 20_000


def measurements() -> list[Measurement]:
    """One for each way in which a strategy may be written."""
    return [
        Measurement(
            "layer asked every tick, compiled",
            US_PER_TICK,
            partial(prepare, COMPILED, COMPILED_TICKS),
        ),
        Measurement(
            "layer asked every tick, Python",
            US_PER_TICK,
            partial(prepare, IN_PYTHON, PYTHON_TICKS),
        ),
    ]


def prepare(strategy: str, ticks: int) -> Sample:
    """A sampler: us per tick with the layer less us per tick without, one after the other."""
    without, asked = idle_fleet(), idle_fleet(strategy)

    def sample() -> float:
        before = int(asked.world.tally.batches[LAYER_ZONING])
        base = seconds_of(without, ticks)
        difference = seconds_of(asked, ticks) - base
        if asked.world.tally.batches[LAYER_ZONING] - before != ticks:
            raise AssertionError("the layer was not asked every tick")
        return 1e6 * difference / ticks

    return sample
