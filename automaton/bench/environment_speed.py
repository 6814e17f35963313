"""The cost of a step of an environment, beside the loop alone and beside other simulators.

16 worlds of 64 omnidirectional robots on 32 x 32 cells with obstacles, tours of one stop; actions drawn
before; episodes of 256 ticks with their resets.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import msgspec
import numpy as np

from automaton.bench.measurement import (
    Measurement,
    NotMeasuredError,
    Sample,
    cpu_seconds,
    wall_seconds,
)
from automaton.environments.environment import Environment, resolved_for
from automaton.environments.external import text_of_actions
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Fleet, Orders, Scenario, Stop, Strategies

STEPPED_WORLDS, STEPPED_ROBOTS, EPISODE_TICKS = 16, 64, 256
MANY_WORLDS: Final = 128  # so that a step takes longer than handing it to a thread
STEPPING_S: Final = 0.5
NS_PER_STEP: Final = "ns per robot and step"
PERCENT_OF_EPISODE: Final = "% of an episode"
TIMES_FASTER: Final = "times"
LOOP_TICKS: Final = 4 * EPISODE_TICKS  # of a run, whose set-up is not measured
STEPPED_VIEWS: Final[dict[str, dict[str, Any]]] = {
    "5 x 5 x 3 window": {},
    "11 x 11 x 3 window": {"radius": 5},
    "5 x 5 x 3 window and features": {"features": True},
}
# Each reads a line, steps for a while, and prints ns of CPU time per robot and step.
PEER_LOOP: Final = """
import sys, time
actions = np.random.default_rng(1).integers(0, 5, (TICKS, ROBOTS))
for line in sys.stdin:
    steps, begun = 0, time.process_time_ns()
    while time.process_time_ns() - begun < SAMPLE_NS:
        env.reset(seed=steps)
        for row in actions:
            env.step(row.tolist())
        steps += len(actions)
    print((time.process_time_ns() - begun) / (steps * ROBOTS), flush=True)
"""
PEER_SIMULATORS: Final = {
    "POGEMA": """
import numpy as np
from pogema import GridConfig, pogema_v0
env = pogema_v0(grid_config=GridConfig(
    num_agents=ROBOTS, size=32, density=0.3, obs_radius=2, max_episode_steps=10**6,
    on_target="restart", seed=1))
""",
    "RWARE": """
import numpy as np
from rware.warehouse import RewardType, Warehouse
env = Warehouse(
    shelf_columns=9, column_height=7, shelf_rows=3, n_agents=ROBOTS, msg_bits=0, sensor_range=2,
    request_queue_size=ROBOTS, max_inactivity_steps=None, max_steps=None,
    reward_type=RewardType.INDIVIDUAL)
""",
}


def scenario() -> Scenario:
    """The scenario of all measurements."""
    tours = {"generator": "tours", "count": 8 * STEPPED_ROBOTS, "stops": 1, "assign": "round-robin"}
    return Scenario(
        name="bench",
        layout={"generator": "random", "columns": 32, "rows": 32, "obstacles": 0.3},
        fleet=Fleet(robots=STEPPED_ROBOTS, kinematics="omni", start="random"),
        orders=msgspec.convert(tours, Orders),
        strategy=Strategies(allocation="greedy"),
        stop=Stop(when="never", max_duration=1_000_000),
    )


def measurements() -> list[Measurement]:
    """Steps with each view, the loop alone, resets and threads."""
    steps = [
        Measurement(f"environment, {name}", NS_PER_STEP, partial(prepare_steps, options))
        for name, options in STEPPED_VIEWS.items()
    ]
    return [
        Measurement("the loop alone, equal robots", NS_PER_STEP, prepare_loop),
        *steps,
        Measurement("environment, beyond the loop alone", NS_PER_STEP, prepare_difference),
        Measurement("environment, resets", PERCENT_OF_EPISODE, prepare_resets),
        Measurement(
            f"{MANY_WORLDS} worlds, two threads faster than one", TIMES_FASTER, prepare_threads
        ),
    ]


def peer_measurements(python: str) -> list[Measurement]:
    """Other simulators, and how many times faster an environment is, in turns with them."""
    listed: list[Measurement] = []
    for name in PEER_SIMULATORS:
        listed += [
            Measurement(name, NS_PER_STEP, partial(prepare_peer, python, name)),
            Measurement(
                f"environment faster than {name}",
                TIMES_FASTER,
                partial(prepare_ratio, python, name),
            ),
        ]
    return listed


def made(
    threads: int = 1, worlds: int = STEPPED_WORLDS, **options: Any
) -> tuple[Environment, Callable[[], None]]:
    """An environment, and a function that steps an episode, with its reset."""
    env = Environment(scenario(), worlds, max_ticks=EPISODE_TICKS - 1, threads=threads, **options)
    draws = np.random.default_rng(1)
    actions = draws.integers(0, 5, (EPISODE_TICKS, worlds, STEPPED_ROBOTS), dtype=np.int32)
    env.reset(seed=1)

    def episode() -> None:
        for row in actions:
            env.actions[:] = row
            env.step()

    return env, episode


def per_step(episode: Callable[[], None]) -> float:
    """ns of CPU time per robot and step, over a while."""
    seconds, steps = 0.0, 0
    while seconds < STEPPING_S:
        seconds += cpu_seconds(episode)
        steps += EPISODE_TICKS * STEPPED_WORLDS * STEPPED_ROBOTS
    return 1e9 * seconds / steps


def prepare_steps(options: dict[str, Any]) -> Sample:
    """A sampler: ns per robot and step, masks and rewards included."""
    _, episode = made(**options)
    return lambda: per_step(episode)


def prepare_loop() -> Sample:
    """A sampler: ns per robot and tick of runs whose robots do equal actions."""
    draws = np.random.default_rng(1)
    actions = text_of_actions(draws.integers(0, 5, (LOOP_TICKS + 1, STEPPED_ROBOTS), dtype=np.int8))
    resolved = resolved_for(scenario(), (), "free", actions)

    def sample() -> float:
        seconds, runs = 0.0, 0
        while seconds < STEPPING_S:
            seconds += cpu_seconds(partial(Simulation(resolved, runs).run, LOOP_TICKS))
            runs += 1
        return 1e9 * seconds / (runs * LOOP_TICKS * STEPPED_ROBOTS)

    return sample


def prepare_difference() -> Sample:
    """A sampler: ns of an environment minus ns of the loop alone, in turns."""
    steps, loop = prepare_steps({}), prepare_loop()
    return lambda: steps() - loop()


def prepare_resets() -> Sample:
    """A sampler: CPU time of resets, as a share of whole episodes."""
    env, episode = made()

    def sample() -> float:
        resets = sum(cpu_seconds(env.reset) for _ in range(8)) / 8
        return (
            100
            * resets
            / (1e-9 * per_step(episode) * EPISODE_TICKS * STEPPED_WORLDS * STEPPED_ROBOTS)
        )

    return sample


def prepare_threads() -> Sample:
    """A sampler: the time on the wall with one thread / that with two."""
    one, two = (made(threads, MANY_WORLDS)[1] for threads in (1, 2))
    return lambda: wall_seconds(one) / wall_seconds(two)


def prepare_peer(python: str, name: str) -> Sample:
    """A sampler: ns per robot and step of another simulator, in a process of its own."""
    values = STEPPED_ROBOTS, EPISODE_TICKS, int(1e9 * STEPPING_S)
    head = f"ROBOTS, TICKS, SAMPLE_NS = {values}\n"
    try:
        peer = subprocess.Popen(
            [python, "-c", head + PEER_SIMULATORS[name] + PEER_LOOP],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
    except OSError as error:
        raise NotMeasuredError(f"{python} does not start: {error.strerror}") from error

    def sample() -> float:
        assert peer.stdin is not None and peer.stdout is not None and peer.stderr is not None
        try:
            peer.stdin.write("\n")
            peer.stdin.flush()
            return float(peer.stdout.readline())
        except (OSError, ValueError):
            last = (peer.stderr.read().strip().splitlines() or ["it has ended"])[-1]
            raise NotMeasuredError(f"{name} in {python}: {last}") from None

    return sample


def prepare_ratio(python: str, name: str) -> Sample:
    """A sampler: ns per robot and step of another simulator / those of an environment."""
    peer, steps = prepare_peer(python, name), prepare_steps({})
    return lambda: peer() / steps()
