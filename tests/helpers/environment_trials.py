"""What an environment promises, at length: run by hand.

    nice python tests/helpers/environment_trials.py [STEPS [SCENARIO ...]]

1. Each shipped scenario whose other layers are compiled: 3 seeds, W = 1, 7 and 64 worlds, threads 1 and
   2; the digests of a world are equal at each of STEPS steps (default 500), and in a simulation that
   repeats its actions.
2. Random floors of all kinematics: a million robot steps of allowed actions, none illegal, none invalid;
   and a move or a turn is allowed exactly where the engine's own rules of right of way do not bar it.
3. 200 seeds for each generator of orders with a compiled reset: the digest of a fresh simulation.
4. With `views` instead of STEPS, only: the tests of PettingZoo for each of these scenarios, with warnings
   as errors, and the nanoseconds of an agent's step with 64 robots.
Exits with 1 if anything differs.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import steering_trials

from automaton.engine.right_of_way import bar_to_step, bar_to_turn
from automaton.engine.state import NIL
from automaton.environments import Environment
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import shipped

SEEDS = (1, 2, 3)
BATCHES = ((1, 1), (7, 1), (7, 2), (64, 2))  # worlds and threads
FLOOR_STEPS = 1_000_000  # of robots
RESETS = 200
VIEW_TICKS = 30  # of episodes
TIMED_STEPS = 900
GENERATORS: dict[str, dict[str, Any]] = {
    "tours": {"generator": "tours", "count": 30, "stops": 3},
    "tours in turn": {"generator": "tours", "count": 30, "stops": 2, "assign": "round-robin"},
}


def chosen(env: Environment, w: int, step: int) -> Any:
    """Allowed actions of a world, which depend on its number and the step alone."""
    draws = np.random.default_rng([w, step]).random(env.masks[w].shape)
    return (draws * env.masks[w]).argmax(axis=1)


def digests(env: Environment, steps: int, worlds: int) -> list[list[int]]:
    """The digests of the first worlds after each step."""
    found = []
    for step in range(steps):
        for w in range(env.worlds):
            env.actions[w] = chosen(env, w, step)
        env.step()
        found.append([int(env._world(w).digest, 16) for w in range(worlds)])
    return found


def batches(name: str, seed: int, steps: int) -> str:
    """How an episode differs alone, in batches and in threads; "" if it does not."""
    expected: list[list[int]] = []
    for worlds, threads in BATCHES:
        env = Environment(name, worlds, threads=threads)
        env.reset(seed=seed)
        found = digests(env, steps // 8 if worlds > 7 else steps, 1)  # the large batch costs more
        env.close()
        expected = expected or found
        if found != expected[: len(found)]:
            first = next(k for k, row in enumerate(found) if row != expected[k])
            return f"{worlds} worlds, {threads} threads: step {first} differs"
    return ""


def repeated(name: str, seed: int, steps: int, drive: str, handling: str) -> str:
    """How a saved episode differs from a simulation; "" if it does not."""
    env = Environment(name, 1, drive=drive, handling=handling, log=True)
    env.reset(seed=seed)
    digests(env, steps, 1)
    with tempfile.TemporaryDirectory() as folder:
        try:
            env.save(0, Path(folder) / "run.rec")
        except AssertionError as error:
            return f"{drive}: {error}"
    illegal = int(env._world(0).world.tally.illegal.sum())
    invalid = int(env.invalid[0])
    return f"{drive}: {illegal} illegal, {invalid} invalid" if illegal or invalid else ""


def unlike_rules(env: Environment, w: int) -> str:
    """Where a mask differs from the rules of right of way; "" if it does not."""
    world, mask = env._world(w).world, env.masks[w]
    robots, first = world.robots, 1 + (env.drive == "guided")
    for i in range(env.robots):
        if not env.acting[w, i] or robots.cell[i] == NIL or robots.parked[i]:
            continue
        headings, heading = int(world.grid.type_headings[robots.type[i]]), int(robots.heading[i])
        ways = {1: range(4), 2: (heading, heading + 2), 4: (heading,)}[headings]
        bars = [bar_to_step(world, i, way) for way in ways]
        bars += [bar_to_turn(world, i, turn) for turn in {1: (), 2: (1,), 4: (3, 1)}[headings]]
        if [bar == NIL for bar in bars] != mask[i, first : first + len(bars)].astype(bool).tolist():
            return f"robot {i}: mask {mask[i].tolist()}, rules {bars}"
        if env.handling == "action" and mask[i, -1] != (robots.cell[i] == robots.goal_cell[i]):
            return f"robot {i}: mask {mask[i].tolist()}, in its goal cell or not"
    return ""


def floors() -> Iterator[str]:
    """What is illegal or invalid on random floors."""
    done, seed, floors_tried = 0, 0, 0
    while done < FLOOR_STEPS:
        seed += 1
        try:
            scenario = steering_trials.scenario_of("pibt", seed)
            ways = {"drive": ("free", "guided")[seed % 2]}
            ways |= {"handling": ("automatic", "action")[seed // 2 % 2]}
            env = Environment(scenario, 4, **ways, radius=1)
        except InputError:
            continue
        floors_tried += 1
        env.reset(seed=seed)
        for step in range(120):
            for w in range(env.worlds):
                env.actions[w] = chosen(env, w, step)
            env.step()
            unlike = unlike_rules(env, step % env.worlds)
            if unlike:
                yield f"floor {seed}, step {step}: {unlike}"
                break
            if env.invalid.any():
                yield f"floor {seed}, step {step}: {env.invalid.tolist()} invalid"
                break
        illegal = [env._world(w).world.tally.illegal.tolist() for w in range(env.worlds)]
        if np.any(illegal):
            yield f"floor {seed}: {illegal} illegal"
        done += 120 * env.worlds * env.robots
    print(f"{done:,} robot steps on {floors_tried:,} floors", flush=True)


def resets() -> Iterator[str]:
    """Where a compiled reset differs from a simulation."""
    for name, orders in GENERATORS.items():
        for kinematics in ("omni", "differential"):
            scenario = {
                "name": "resets",
                "layout": {"generator": "random", "columns": 9, "rows": 9, "obstacles": 0.2},
                "fleet": {"robots": 7, "kinematics": kinematics, "start": "random"},
                "orders": orders,
                "stop": {"when": "never", "max_duration": 9},
            }
            env = Environment(scenario, 1)
            if not env.compiled_reset:
                yield f"{name}, {kinematics}: the reset is not compiled"
                continue
            env.reset(seed=1)
            for seed in range(RESETS):
                env.step(np.ones((1, 7), int))
                env._begin_world(0, seed)
                fresh = Simulation(env._resolved, seed)
                if env._world(0).digest != fresh.digest:
                    yield f"{name}, {kinematics}: seed {seed} differs"
        print(f"{name}: {RESETS} seeds for each kinematics", flush=True)


def views(names: list[str]) -> int:
    """Test and time the views; return 1 if a test fails."""
    from pettingzoo.test import parallel_api_test, parallel_seed_test

    from automaton.environments.pettingzoo import parallel_env

    faults = 0
    for name in names:
        try:
            with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
                warnings.simplefilter("error")
                make = partial(parallel_env, name, max_ticks=VIEW_TICKS)
                parallel_api_test(make(), 2 * VIEW_TICKS)
                parallel_seed_test(make, VIEW_TICKS)
        except InputError as error:
            print(f"{name}: {error}", flush=True)
        except Exception as error:
            faults += 1
            print(f"{name}: FAILS: {type(error).__name__}: {error}", flush=True)
        else:
            print(f"{name}: passes", flush=True)
    for options in ({}, {"copy": False}, {"copy": False, "mask_in": "info"}):
        env = parallel_env("random-400", settings=["fleet.robots=64"], **options)
        env.reset(seed=1)
        actions = dict.fromkeys(env.agents, 1)
        begun = time.process_time()
        for _ in range(TIMED_STEPS):
            env.step(actions)
        ns = (time.process_time() - begun) / TIMED_STEPS / len(actions) * 1e9
        print(f"PettingZoo, 64 agents, {options or 'default'}: {ns:.0f} ns per agent and step")
    return int(faults > 0)


def main(steps: int, names: list[str]) -> int:
    faults = 0
    for name in names:
        begun = time.process_time()
        try:
            Environment(name, 1)
        except InputError as error:
            print(f"{name}: {error}", flush=True)
            continue
        told = [batches(name, seed, steps) for seed in SEEDS]
        ways = product(("free", "guided"), ("automatic", "action"))
        told += [repeated(name, 1, min(steps, 100), *way) for way in ways]
        told = [one for one in told if one]
        faults += len(told)
        seconds = time.process_time() - begun
        print(f"{name}: {'; '.join(told) or 'equal'} ({seconds:.0f} s)", flush=True)
    for fault in (*floors(), *resets()):
        faults += 1
        print(fault, flush=True)
    return 1 if faults else 0


if __name__ == "__main__":
    given = sys.argv[1:]
    if given[:1] == ["views"]:
        sys.exit(views(given[1:] or list(shipped())))
    sys.exit(main(int(given[0]) if given else 500, given[1:] or list(shipped())))
