"""Views of environments: what gymnasium and PettingZoo expect of them, and what they refuse."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from pettingzoo.test import parallel_api_test, parallel_seed_test

from automaton.environments import Environment
from automaton.environments.gym import FleetVectorEnv
from automaton.environments.pettingzoo import parallel_env
from automaton.errors import InputError

MINI = "tabletop-mini"
TICKS = 12
STEPS = 40


class OneWorld(gymnasium.Env[Any, Any]):
    """One world of a vector environment, as an environment of its own."""

    def __init__(self, seeds: list[int]) -> None:
        self.fleet = FleetVectorEnv(MINI, 1, per="world", max_ticks=TICKS, autoreset="disabled")
        self.observation_space = self.fleet.single_observation_space
        self.action_space = self.fleet.single_action_space
        self.seeds = iter(seeds)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        chosen = np.array([next(self.seeds)], np.uint64)
        seen, infos = self.fleet.reset(options={"seeds": chosen})
        return seen[0], {"action_mask": infos["action_mask"][0]}

    def step(self, action: Any) -> Any:
        seen, rewards, ends, cuts, infos = self.fleet.step(action[None])
        return seen[0], rewards[0], ends[0], cuts[0], {"action_mask": infos["action_mask"][0]}


def walked(envs: Any, actions: Any, mode: str) -> list[Any]:
    """What a vector environment returns; with "disabled" it is reset as soon as all worlds end."""
    seen, infos = envs.reset(seed=5)
    returned = [(seen, infos["action_mask"])]
    for row in actions:
        seen, rewards, ends, cuts, infos = envs.step(row)
        last = [one for one in infos.get("final_obs", ()) if one is not None]
        is_last = "final_info" in infos
        final = infos["final_info"]["action_mask"][ends | cuts] if is_last else ()
        returned.append((seen, rewards, ends, cuts, infos["action_mask"], np.array(last), final))
        if mode == "disabled" and (ends | cuts).all():
            seen, infos = envs.reset(options={"reset_mask": ends | cuts})
            returned.append((seen, infos["action_mask"]))
    return returned


@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled"])
def test_worlds_are_as_environments_of_their_own(mode: str) -> None:
    fleet = FleetVectorEnv(MINI, 2, per="world", max_ticks=TICKS, autoreset=mode)
    fleet.action_space.seed(1)
    actions = [fleet.action_space.sample() for _ in range(STEPS)]
    seeds = seeds_of(fleet.environment.worlds)
    makers: list[Callable[[], OneWorld]] = [lambda own=own: OneWorld(own) for own in seeds]
    apart = SyncVectorEnv(makers, autoreset_mode=AutoresetMode[mode.upper()])
    assert fleet.metadata["autoreset_mode"] == apart.metadata["autoreset_mode"]
    assert fleet.observation_space == apart.observation_space
    for one, other in zip(walked(fleet, actions, mode), walked(apart, actions, mode), strict=True):
        for array, same in zip(one, other, strict=True):
            np.testing.assert_array_equal(array, same)


def seeds_of(worlds: int) -> list[list[int]]:
    """The seeds of the first episodes of each world after reset(seed=5)."""
    env = Environment(MINI, worlds, max_ticks=TICKS)
    rows = []
    for episode in range(STEPS // TICKS + 2):
        env.reset(seed=None if episode else 5)
        rows.append(env.seeds.tolist())
    return [list(column) for column in zip(*rows, strict=True)]


def test_each_robot_can_be_an_environment() -> None:
    envs = gymnasium.make_vec(
        "automaton.environments.gym:automaton/Fleet-v0",
        num_envs=6,
        scenario=MINI,
        features=True,
        render_mode="ansi",
    )
    seen, infos = envs.reset(seed=3, options={"unknown": 1})
    assert seen in envs.observation_space and infos["action_mask"].shape == (6, 4)
    draws = np.random.default_rng(1).random((20, *infos["action_mask"].shape))
    for draw in draws:
        seen, rewards, ends, _, infos = envs.step((draw * infos["action_mask"]).argmax(axis=1))
    assert seen in envs.observation_space and rewards.shape == ends.shape == (6,)
    pictures = envs.render()
    assert pictures is not None and len(pictures) == 2 and "tick 21" in str(pictures[0])
    envs.close()
    with pytest.raises(InputError, match="is closed"):
        envs.unwrapped.environment.step()


def test_arrays_are_fresh_or_the_buffers() -> None:
    fresh, shared = (FleetVectorEnv(MINI, worlds=1, copy=copy) for copy in (True, False))
    for envs, shares in ((fresh, False), (shared, True)):
        seen, infos = envs.reset(seed=1)
        assert np.shares_memory(seen, envs.environment.observations) == shares
        assert np.shares_memory(infos["action_mask"], envs.environment.masks) == shares


def test_the_state_shows_the_floor_for_all_robots() -> None:
    scenario = {
        "name": "drawn",
        "layout": {"picture": "...\n.#."},
        "fleet": {"robots": 2, "kinematics": "omni", "start": [[0, 0], [2, 0]]},
        "orders": {"list": [{"stops": [[2, 1]]}, {"stops": [[0, 1]]}]},
        "stop": {"when": "delivered", "max_duration": 100},
    }
    env = parallel_env(scenario)
    env.reset()
    walls, robots, goals = env.state().tolist()
    assert walls == [[0, 0, 0], [0, 1, 0]]
    assert robots == [[1, 0, 1], [0, 0, 0]]
    assert goals == [[0, 0, 0], [1, 0, 1]]
    assert env.state() in env.state_space


@pytest.mark.parametrize("options", [{}, {"mask_in": "info", "features": True, "copy": False}])
def test_a_parallel_environment_passes_the_tests_of_pettingzoo(options: dict[str, Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(parallel_env(MINI, max_ticks=TICKS, **options), num_cycles=2 * TICKS)
        parallel_seed_test(lambda: parallel_env(MINI, max_ticks=TICKS, **options), num_cycles=TICKS)


def test_agents_end_together_and_one_without_an_action_stays() -> None:
    env = parallel_env(MINI, max_ticks=2, render_mode="ansi")
    seen, _ = env.reset(seed=1)
    assert seen["robot_0"] in env.observation_space("robot_0") and "tick 1" in str(env.render())
    env.step({"robot_1": 1})
    _, _, _, cuts, _ = env.step({})
    assert set(cuts) == set(env.possible_agents) and all(cuts.values())
    assert env.agents == [] and env.step({}) == ({}, {}, {}, {}, {})
    env.close()


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: FleetVectorEnv(MINI, 7),
            "a multiple of the 3 robots of the scenario, such as 6 or 9",
        ),
        (lambda: FleetVectorEnv(MINI, per="wrold"), "unknown per 'wrold' (did you mean 'world'?)"),
        (lambda: FleetVectorEnv(MINI, render_mode="rgb"), "allowed are ansi"),
        (lambda: FleetVectorEnv(MINI, radius=None), "robots would see nothing"),
        (lambda: FleetVectorEnv(MINI).reset(seed=[1, 2, 3]), "seed is one number"),
        (lambda: FleetVectorEnv(MINI).step([0, 0, 0]), "call reset() before step()"),
        (
            lambda: FleetVectorEnv(MINI).reset(options={"reset_mask": [True, False, True]}),
            "reset_mask names some robots of world 0",
        ),
        (
            lambda: ended(FleetVectorEnv(MINI, max_ticks=1, autoreset="disabled")),
            "world 0 has ended",
        ),
        (lambda: parallel_env(MINI, worlds=2), "worlds does not apply"),
        (lambda: stepped({"robot_9": 0}), "there is no agent 'robot_9'"),
        (lambda: stepped({"robot_1": 4}), "the action of robot_1 must be 0 to 3, found 4"),
    ],
)
def test_bad_input_gets_a_sentence(make: Callable[[], Any], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        make()
    assert sentence in str(caught.value)


def ended(envs: FleetVectorEnv) -> None:
    envs.reset()
    for _ in range(2):
        envs.step([0] * envs.num_envs)


def stepped(actions: dict[str, int]) -> None:
    env = parallel_env(MINI)
    env.reset()
    env.step(actions)
