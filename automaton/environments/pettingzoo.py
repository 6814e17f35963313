"""A view of `Environment` as a parallel environment of PettingZoo: one world, whose robots are agents.

    from automaton.environments.pettingzoo import parallel_env

    env = parallel_env("tabletop-mini")
    observations, infos = env.reset(seed=1)

Importing this needs PettingZoo and gymnasium (extra `environments`).
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

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
        self._shared: tuple[dict[str, Any], dict[str, Any]] | None = None
        self._number = {agent: i for i, agent in enumerate(self.possible_agents)}

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
        env, agents = self.environment, self.agents
        self._enter(actions)
        env.step()
        observations, infos = self._observed()
        has_ended, is_cut = bool(env.terminations[0, 0]), bool(env.truncations[0, 0])
        if has_ended or is_cut:
            self.agents = []
        return (
            observations,
            dict(zip(agents, env.rewards[0].tolist(), strict=True)),
            dict.fromkeys(agents, has_ended),
            dict.fromkeys(agents, is_cut),
            infos,
        )

    def _enter(self, actions: dict[str, int]) -> None:
        """Set the actions of agents; others stay. Raises InputError."""
        row, most = self.environment.actions[0], self.environment.actions_count - 1
        if len(actions) != len(self._number) or not all(map(self._number.__contains__, actions)):
            for agent in actions.keys() - self._number.keys():
                hint, last = nearest(str(agent), self._number), self.possible_agents[-1]
                raise InputError(f"there is no agent {agent!r}{hint}: they are robot_0 to {last}")
            actions = dict.fromkeys(self.possible_agents, 0) | actions
        row[:] = list(map(actions.__getitem__, self.possible_agents))
        if row.min() < 0 or row.max() > most:
            agent = next(one for one in actions if not 0 <= actions[one] <= most)
            raise InputError(
                f"the action of {agent} must be 0 to {most}, found {int(actions[agent])}"
            )

    def render(self) -> str | None:
        """The picture of the world as text, with render_mode="ansi"."""
        return None if self.render_mode is None else self.environment.picture()

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
            None if array is None else list(array[0].copy() if copy else array[0])
            for array in (env.observations, env.features, env.masks)
        )
        if windows is None or features is None:
            observations: Any = features if windows is None else windows
        else:
            pairs = zip(windows, features, strict=True)
            observations = [{"window": window, "features": numbers} for window, numbers in pairs]
        if self._masks_are_observed:
            pairs = zip(observations, masks or (), strict=True)
            observations = [{"observation": one, "action_mask": mask} for one, mask in pairs]
            infos: dict[str, Any] = {agent: {} for agent in agents}
        else:
            pairs = zip(agents, masks or (), strict=True)
            infos = {agent: {"action_mask": mask} for agent, mask in pairs}
        return dict(zip(agents, observations, strict=True)), infos


def parallel_env(scenario: Any, **options: Any) -> FleetParallelEnv:
    """Make the environment, by PettingZoo's usual name. Raises InputError."""
    return FleetParallelEnv(scenario, **options)
