"""A view of `Environment` as a vector environment of gymnasium: one environment for each robot or world.

    from automaton.environments.gym import FleetVectorEnv

    envs = FleetVectorEnv("tabletop-mini", worlds=16)
    observations, infos = envs.reset(seed=1)

Importing this needs gymnasium (extra `environments`).
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from automaton.environments.environment import Environment, check_name
from automaton.errors import InputError

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise InputError(
        "the views for gymnasium and PettingZoo need more packages: run "
        "pip install 'fleet-automaton[environments]'; automaton.environments.Environment works without"
    ) from error

GRANULARITIES: Final = ("robot", "world")
BINARY: Final = frozenset(("walls", "robots", "loads", "pods", "goal"))  # channels of 0 and 1


class FleetVectorEnv(VectorEnv):  # type: ignore[misc]
    """Worlds of one scenario as a vector environment of gymnasium.

    `per`: with "robot" each robot of each world is an environment, with "world" each world, whose
    reward is the sum over its robots. `num_envs` or `worlds`: how many. `copy`: whether arrays are
    fresh in each step, or the buffers of the `environment`. `render_mode`: "ansi" for pictures as
    text, one for each world. Other options are those of `Environment`. Raises InputError.

        envs = FleetVectorEnv("tabletop-mini", worlds=2, max_ticks=200)
        observations, infos = envs.reset(seed=1)
        envs.step(infos["action_mask"].argmax(axis=1))
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - declared as an attribute of instances
        "render_modes": ["ansi"],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        scenario: Any,
        num_envs: int | None = None,
        *,
        per: str = "robot",
        worlds: int | None = None,
        copy: bool = True,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        check_name("per", per, GRANULARITIES)
        check_render_mode(render_mode)
        if num_envs is not None and per == "robot":
            worlds = worlds_for(scenario, num_envs, options)
        elif num_envs is not None:
            worlds = num_envs
        env = self.environment = Environment(scenario, 1 if worlds is None else worlds, **options)
        self.render_mode, self._per_robot, self._copy = render_mode, per == "robot", copy
        self.metadata = {**self.metadata, "autoreset_mode": AutoresetMode(named(env.autoreset))}
        self.num_envs = env.worlds * env.robots if self._per_robot else env.worlds
        robots = () if self._per_robot else (env.robots,)
        self.single_observation_space = observation_space(env, robots)
        self.single_action_space = (
            spaces.MultiDiscrete([env.actions_count] * env.robots)
            if robots
            else spaces.Discrete(env.actions_count)
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; `options`: as for `Environment`, with `reset_mask` bool (num_envs,)."""
        if isinstance(seed, list):
            raise InputError(
                "seed is one number, from which each world draws its own; found a list"
            )
        if options is not None and "reset_mask" in options:
            options = options | {"reset_mask": self._worlds_of(options["reset_mask"])}
        self.environment.reset(seed, options=options)
        return self._observations(), self._infos()

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Execute actions, integers (num_envs,), or (num_envs, N) with per="world"."""
        env = self.environment
        ended = env.terminations[:, 0] | env.truncations[:, 0]
        if env.autoreset == "disabled" and ended.any():
            raise InputError(
                f"world {int(ended.argmax())} has ended: call reset with options={{'reset_mask': ...}}"
            )
        env.step(np.asarray(actions).reshape(env.actions.shape))
        return (
            self._observations(),
            self._each(env.rewards) if self._per_robot else env.rewards.sum(axis=1),
            self._each(env.terminations) if self._per_robot else env.terminations.all(axis=1),
            self._each(env.truncations) if self._per_robot else env.truncations.all(axis=1),
            self._infos(),
        )

    def render(self) -> tuple[str, ...] | None:
        """The picture of each world, with render_mode="ansi"."""
        if self.render_mode is None:
            return None
        return tuple(self.environment.picture(w) for w in range(self.environment.worlds))

    def close_extras(self, **kwargs: Any) -> None:
        """Release the worlds."""
        self.environment.close()

    def _each(self, array: Any) -> Any:
        """A buffer with a row for each environment."""
        rows = array.reshape(self.num_envs, *array.shape[2:]) if self._per_robot else array
        return rows.copy() if self._copy else rows

    def _observations(self) -> Any:
        return self._observed(self.environment.observations, self.environment.features)

    def _observed(self, windows: Any, features: Any) -> Any:
        """What each environment sees."""
        if features is None:
            return self._each(windows)
        if windows is None:
            return self._each(features)
        return {"window": self._each(windows), "features": self._each(features)}

    def _infos(self) -> dict[str, Any]:
        env = self.environment
        infos = self._of_masks(env.masks, env.acting, np.ones(self.num_envs, bool))
        if env.autoreset == "same_step":
            flags = self._each(env.terminations | env.truncations)
            ended = flags if self._per_robot else flags.all(axis=1)
            if ended.any():
                last = self._of_masks(env.final_masks, env.final_acting, ended)
                infos |= {"final_obs": self._final(ended), "_final_obs": ended}
                infos |= {"final_info": last, "_final_info": ended}
        return infos

    def _of_masks(self, masks: Any, acting: Any, there: Any) -> dict[str, Any]:
        """The infos of some environments, those that are `there`."""
        parts = {"action_mask": self._each(masks), "acting": self._each(acting)}
        return parts | {f"_{name}": there for name in parts}

    def _final(self, ended: Any) -> Any:
        """(num_envs,) objects: the last observation of each episode that ended, None for the others."""
        arrays = self._observed(
            self.environment.final_observations, self.environment.final_features
        )
        last = np.full(self.num_envs, None, object)
        for k in np.flatnonzero(ended).tolist():
            is_parted = isinstance(arrays, dict)
            last[k] = {name: part[k] for name, part in arrays.items()} if is_parted else arrays[k]
        return last

    def _worlds_of(self, mask: Any) -> Any:
        """(W,) bool: the worlds of a mask of environments. All robots of a world end together."""
        env = self.environment
        rows = np.asarray(mask, bool).reshape(env.worlds, -1)
        if (rows != rows[:, :1]).any():
            w = int((rows != rows[:, :1]).any(axis=1).argmax())
            raise InputError(
                f"reset_mask names some robots of world {w}: a world is reset as a whole"
            )
        return np.ascontiguousarray(rows[:, 0])


def observation_space(env: Environment, robots: tuple[int, ...] = ()) -> Any:
    """The space of what a robot sees, or what (N,) robots see. Raises InputError if that is nothing."""
    parts: dict[str, Any] = {}
    if env.radius is not None:
        side = 2 * env.radius + 1
        high = np.array([1 if name in BINARY else 255 for name in env.channels], np.uint8)
        shape = (*robots, len(high), side, side)
        highs = np.broadcast_to(high[:, None, None], shape)
        parts["window"] = spaces.Box(np.zeros(shape, np.uint8), highs, dtype=np.uint8)
    if env.features is not None:
        shape = (*robots, env.features.shape[2])
        parts["features"] = spaces.Box(-1.0, 1.0, shape, np.float32)
    if not parts:
        raise InputError("radius is None and features is False: robots would see nothing; set one")
    return spaces.Dict(parts) if len(parts) > 1 else next(iter(parts.values()))


def worlds_for(scenario: Any, num_envs: int, options: dict[str, Any]) -> int:
    """The number of worlds whose robots are `num_envs` environments. Raises InputError."""
    from automaton.world.resolve import resolve

    robots = resolve(scenario, tuple(options.get("settings", ()))).scenario.fleet.robots
    if num_envs < 1 or num_envs % robots:
        below = max(num_envs // robots, 1) * robots
        raise InputError(
            f"num_envs must be a multiple of the {robots} robots of the scenario, such as {below} or "
            f"{below + robots}; found {num_envs}"
        )
    return num_envs // robots


def named(autoreset: str) -> Any:
    """The value of the member of gymnasium's AutoresetMode with this name."""
    return AutoresetMode[autoreset.upper()].value


def check_render_mode(mode: str | None) -> None:
    """Raises InputError for a mode other than "ansi"."""
    if mode is not None:
        check_name("render_mode", mode, ("ansi",))


gymnasium.register(
    "automaton/Fleet-v0", vector_entry_point="automaton.environments.gym:FleetVectorEnv"
)
