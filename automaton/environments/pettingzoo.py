"""A view of `Environment` as a parallel environment of PettingZoo: one world, whose robots are agents.

    from automaton.environments.pettingzoo import parallel_env

    env = parallel_env("tabletop-mini")
    observations, infos = env.reset(seed=1)

Importing this needs PettingZoo and gymnasium (extra `environments`).
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from automaton.environments.environment import Environment, check_name
from automaton.environments.gym import check_render_mode, observation_space
from automaton.errors import InputError, nearest

try:
    from gymnasium import spaces
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise InputError(
        "the view for PettingZoo needs it: run pip install 'fleet-automaton[environments]'"
    ) from error

MASK_PLACES: Final = ("observation", "info")
Dicts = tuple[dict[str, Any], dict[str, Any], dict[str, Any], dict[str, Any], dict[str, Any]]


class FleetParallelEnv(ParallelEnv):  # type: ignore[misc]
    """One world of a scenario as a parallel environment; agents are `robot_0` to `robot_{N-1}`.

    `mask_in`: with "observation" an agent sees {"observation", "action_mask"}; with "info" the mask is
    in its info. `copy`: whether arrays are fresh in each step, or parts of the buffers of the
    `environment`. Other options are those of `Environment`, but for `worlds` and `autoreset`. An agent
    without an action stays. Raises InputError.

        env = FleetParallelEnv("tabletop-mini", max_ticks=200)
        observations, infos = env.reset(seed=1)
        env.step({agent: 0 for agent in env.agents})
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "automaton_fleet_v0",
        "render_modes": ["ansi"],
        "is_parallelizable": True,
    }

    def __init__(
        self,
        scenario: Any,
        *,
        mask_in: str = "observation",
        copy: bool = True,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        check_name("mask_in", mask_in, MASK_PLACES)
        check_render_mode(render_mode)
        for name in {"worlds", "autoreset"} & options.keys():
            raise InputError(
                f"{name} does not apply: the view holds one world, which reset() begins"
            )
        env = self.environment = Environment(scenario, 1, autoreset="disabled", **options)
        self.render_mode, self._copy = render_mode, copy
        self._masks_are_observed = mask_in == "observation"
        self.possible_agents = [f"robot_{i}" for i in range(env.robots)]
        self.agents: list[str] = []
        space = observation_space(env)
        if self._masks_are_observed:
            mask = spaces.MultiBinary(env.actions_count)
            space = spaces.Dict({"observation": space, "action_mask": mask})
        self.observation_spaces = {agent: space for agent in self.possible_agents}
        self.action_spaces = {
            agent: spaces.Discrete(env.actions_count) for agent in self.possible_agents
        }
        if env.channels:
            shape = env.whole_floor_shape
            self.state_space = spaces.Box(0, 255, shape, np.uint8)
        self._shared: tuple[dict[str, Any], dict[str, Any]] | None = None
        # Copies of these dicts take a tenth of the time of new ones.
        self._no_rewards = dict.fromkeys(self.possible_agents, 0.0)
        self._no_flags = dict.fromkeys(self.possible_agents, False)
        self._all_flags = dict.fromkeys(self.possible_agents, True)
        self._zeros = bytes(env.rewards[0].nbytes)

    def observation_space(self, agent: str) -> Any:
        """The space of what an agent sees."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Any:
        """The space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; `options`: as for `Environment`."""
        self.environment.reset(seed, options=options)
        self.agents = list(self.possible_agents)
        return self._observed()

    def step(self, actions: dict[str, int]) -> Dicts:
        """Execute the actions of agents; all agents end together."""
        if not self.agents:
            return {}, {}, {}, {}, {}
        env = self.environment
        self._enter(actions)
        env.step()
        observations, infos = self._observed()
        has_ended, is_cut = bool(env.terminations[0, 0]), bool(env.truncations[0, 0])
        if has_ended or is_cut:
            self.agents = []
        row = env.rewards[0]
        return (
            observations,
            self._no_rewards.copy()
            if row.tobytes() == self._zeros
            else dict(zip(self.possible_agents, row.tolist(), strict=True)),
            (self._all_flags if has_ended else self._no_flags).copy(),
            (self._all_flags if is_cut else self._no_flags).copy(),
            infos,
        )

    def _enter(self, actions: dict[str, int]) -> None:
        """Set the actions of agents; others stay. Raises InputError."""
        agents, most = self.possible_agents, self.environment.actions_count - 1
        if list(actions) != agents:
            for agent in actions.keys() - self._no_flags.keys():
                raise InputError(
                    f"there is no agent {agent!r}{nearest(str(agent), agents)}: they are robot_0 to "
                    f"{agents[-1]}"
                )
            actions = dict.fromkeys(agents, 0) | actions
        try:
            row = np.fromiter(actions.values(), np.int64, len(agents))
        except (OverflowError, TypeError, ValueError):
            row = np.full(1, -1, np.int64)  # no action
        if row.view(np.uint64).max() > most:  # as unsigned numbers, negative ones are large
            allowed = range(most + 1)
            agent = next(one for one in agents if actions[one] not in allowed)
            raise InputError(f"the action of {agent} must be 0 to {most}, found {actions[agent]}")
        self.environment.actions[0] = row

    def render(self) -> str | None:
        """The picture of the world as text, with render_mode="ansi"."""
        return None if self.render_mode is None else self.environment.picture()

    def state(self) -> NDArray[np.uint8]:
        """(C, rows, columns) uint8: the channels of the environment over the whole floor."""
        return self.environment.whole_floor()

    def close(self) -> None:
        """Release the world."""
        self.environment.close()

    def _observed(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """What each agent sees, and its infos; without `copy` the same arrays in each step."""
        if self._copy:
            return self._parts(copy=True)
        if self._shared is None:
            self._shared = self._parts(copy=False)
        observations, infos = self._shared
        return dict(observations), dict(infos)

    def _parts(self, copy: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        env, agents = self.environment, self.possible_agents
        windows, features, masks = (
            () if array is None else list(array[0].copy() if copy else array[0])
            for array in (env.observations, env.features, env.masks)
        )
        sights: Any = windows or features
        if windows and features:
            pairs = zip(windows, features, strict=True)
            sights = [{"window": window, "features": numbers} for window, numbers in pairs]
        if self._masks_are_observed:
            rows = zip(agents, sights, masks, strict=True)
            observations = {
                agent: {"observation": sight, "action_mask": mask} for agent, sight, mask in rows
            }
            return observations, {agent: {} for agent in agents}
        pairs = zip(agents, masks, strict=True)
        infos = {agent: {"action_mask": mask} for agent, mask in pairs}
        return dict(zip(agents, sights, strict=True)), infos


def parallel_env(scenario: Any, **options: Any) -> FleetParallelEnv:
    """Make the environment, by PettingZoo's usual name. Raises InputError."""
    return FleetParallelEnv(scenario, **options)
