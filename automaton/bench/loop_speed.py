"""The idle loop, a layer asked every tick, and the digest of a small world."""

from __future__ import annotations

from functools import partial

from automaton.bench.measurement import (
    IDLE,
    NS_PER_TICK,
    US,
    US_PER_TICK,
    Measurement,
    Sample,
    cpu_seconds,
)
from automaton.engine.state import LAYER_ZONING
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

TICKS, DIGESTS = 200_000, 2_000
COMPILED = "automaton.bench.idle_strategies:EveryTick"
IN_PYTHON = "automaton.bench.idle_strategies:EveryTickInPython"
COMPILED_TICKS, PYTHON_TICKS = 200_000, 20_000


def measurements() -> list[Measurement]:
    """Five idle robots of the table-top warehouse: a tick, and a digest."""
    return [
        Measurement("loop, idle fleet", NS_PER_TICK, prepare_loop),
        Measurement("digest", US, prepare_digest),
    ]


def prepare_loop(ticks: int = TICKS) -> Sample:
    """A sampler: ns per tick."""
    simulation = idle_fleet()
    return lambda: 1e9 * seconds_of(simulation, ticks) / ticks


def prepare_digest(digests: int = DIGESTS) -> Sample:
    """A sampler: us for a digest of the whole state, called from Python."""
    simulation = idle_fleet()

    def sample() -> float:
        return 1e6 * cpu_seconds(lambda: [simulation.digest for _ in range(digests)]) / digests

    return sample


def idle_fleet(zoning: str = "none") -> Simulation:
    """Five robots that always stay in their parking bays, optionally with a zoning strategy."""
    settings = (
        "fleet.robots=5",
        f"strategy.allocation={IDLE}",
        f"strategy.zoning={zoning}",
        "stop.when=never",
        "stop.max_duration=2000000000",
    )
    simulation = Simulation(resolve("tabletop-1", settings))
    simulation.run(1)
    return simulation


def seconds_of(simulation: Simulation, ticks: int) -> float:
    """CPU seconds of the next ticks."""
    until = simulation.tick + ticks
    return cpu_seconds(lambda: simulation.run(until))


def layer_measurements() -> list[Measurement]:
    """One measurement for each form of a strategy."""
    return [
        Measurement(
            "layer asked every tick, compiled",
            US_PER_TICK,
            partial(prepare_layer, COMPILED, COMPILED_TICKS),
        ),
        Measurement(
            "layer asked every tick, Python",
            US_PER_TICK,
            partial(prepare_layer, IN_PYTHON, PYTHON_TICKS),
        ),
    ]


def prepare_layer(strategy: str, ticks: int) -> Sample:
    """A sampler: us per tick with the layer minus us per tick without, measured in succession."""
    without, asked = idle_fleet(), idle_fleet(strategy)

    def sample() -> float:
        before = int(asked.world.tally.batches[LAYER_ZONING])
        base = seconds_of(without, ticks)
        difference = seconds_of(asked, ticks) - base
        if asked.world.tally.batches[LAYER_ZONING] - before != ticks:
            raise AssertionError("the layer was not asked every tick")
        return 1e6 * difference / ticks

    return sample
