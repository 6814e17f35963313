"""The loop with nothing to do, and the digest of a small world."""

from __future__ import annotations

from automaton.bench.bench_floors import IDLE
from automaton.bench.measurement import NS_PER_TICK, US, Measurement, Sample, cpu_seconds
from automaton.build.resolve import resolve
from automaton.runs.simulation import Simulation

TICKS, DIGESTS = 200_000, 2_000


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
    """A sampler: us for a digest of the whole state, asked for from Python."""
    simulation = idle_fleet()

    def sample() -> float:
        return 1e6 * cpu_seconds(lambda: [simulation.digest for _ in range(digests)]) / digests

    return sample


def idle_fleet(zoning: str = "none") -> Simulation:
    """Five robots that stay in their parking bays for ever, with a strategy for zoning if wanted."""
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
