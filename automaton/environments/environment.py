"""`Environment`: worlds of one scenario, stepped together by compiled code into arrays of the caller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, Final

import numpy as np

from automaton.engine.jit.structs import registered_address
from automaton.engine.random_numbers import STREAM_EPISODES, random_bits_of_each
from automaton.engine.state import NIL, ORDER_LIST, Array
from automaton.environments.external import HANDLE_SHIFT, action_count, text_of_actions
from automaton.environments.reset_kernels import Copies
from automaton.environments.resets import Restorer, restored
from automaton.environments.stepped_worlds import (
    EXTERNAL,
    ActionLog,
    SteppedWorld,
    free_memory,
    save_episode,
)
from automaton.environments.stepping import (
    ADDRESS_COUNT,
    FEATURE_COUNT,
    REWARDS,
    STATE_ENDED,
    STATE_NEW,
    STATE_RUNNING,
    STATE_STOPPED,
    Course,
    StepBuffers,
    Stepper,
    compiled_driver,
)
from automaton.environments.windows import CHANNELS, scene_of, whole_planes
from automaton.errors import InputError, alternatives, nearest
from automaton.runs.simulation import no_room
from automaton.scenario.document import Override
from automaton.units import memory
from automaton.world.resolve import resolve

STEPPINGS: Final = ("tick", "decision")
HANDLINGS: Final = ("automatic", "action")
AUTORESETS: Final = ("next_step", "same_step", "disabled")
MAX_RADIUS: Final = 15
FINAL_NAMES: Final = ("observations", "features", "masks", "acting")  # with same_step
MAX_ACTION: Final = 127  # in a log; higher ones are not allowed either
Settings = Sequence[str]


class Environment:
    """W worlds of one scenario with N robots each, in which actions decide where robots move.

    `scenario`: a path, the name of a shipped one, the content of a scenario file as a dict, or a
    Scenario; `settings`: changes of it, such as "fleet.robots=32". `drive`: "free" (robots have no
    routes) or "guided" (they follow the scenario's routes, and actions interrupt them). `handling`:
    a robot that stays in its goal cell begins what it came for ("automatic"), or there is a last
    "action" for it. `radius`: of the window around each robot, in cells; None: no windows.
    `channels`: what a window shows; `features`: whether there are features, too; `facing`
    (differential robots): both are turned, so that ahead of the robot is up. `reward`: weights of
    components. `stepping`: a step is a "tick", or lasts until a robot has a "decision" to make.
    `max_ticks`: ticks after which an episode is truncated, by default the scenario's
    `stop.max_duration`. `autoreset`: "next_step", "same_step" or "disabled". `threads`: that step the
    worlds. `buffers`: arrays by name that the environment fills, instead of its own. With `log` each
    episode can be saved as a recording. Raises InputError.

        env = Environment("tabletop-mini", worlds=4, max_ticks=200)
        env.reset(seed=1)
        for _ in range(100):
            env.actions[:] = env.masks.argmax(axis=2)
            env.step()
        env.rewards.sum()
    """

    def __init__(
        self,
        scenario: Any,
        worlds: int = 1,
        settings: Settings = (),
        *,
        drive: str = "free",
        handling: str = "automatic",
        radius: int | None = 2,
        channels: Sequence[str] = ("walls", "robots", "goal"),
        features: bool = False,
        facing: bool = False,
        reward: Mapping[str, float] | None = None,
        stepping: str = "tick",
        max_ticks: int | None = None,
        autoreset: str = "next_step",
        threads: int = 1,
        buffers: Mapping[str, Any] | None = None,
        log: bool = False,
    ) -> None:
        check_name("drive", drive, EXTERNAL)
        check_name("handling", handling, HANDLINGS)
        check_name("stepping", stepping, STEPPINGS)
        check_name("autoreset", autoreset, AUTORESETS)
        for channel in channels:
            check_name("channel", channel, CHANNELS)
        weights = weights_of({"delivered": 1.0} if reward is None else reward)
        if log and autoreset == "same_step":
            raise InputError(
                "log=True needs autoreset next_step or disabled: same_step forgets episodes"
            )
        check_number("worlds", worlds, 1, None)
        check_number("threads", threads, 1, worlds)
        self.worlds, self.autoreset = worlds, autoreset
        self.drive, self.handling = drive, handling
        self.channels, self.radius = tuple(channels) if radius is not None else (), radius
        self._scenario, self._settings = scenario, settings
        self._resolved = resolved_for(scenario, settings, drive, handling=handling)
        limit = self._resolved.scenario.stop.max_duration
        self.max_ticks = limit if max_ticks is None else max_ticks
        check_number("max_ticks", self.max_ticks, 1, limit)
        self._first = SteppedWorld(self._resolved, self._resolved.scenario.seed)
        check_sight(self._first.world.rules, self.channels, radius)
        if facing:
            check_facing(self._first.world.grid.type_headings, radius is not None or features)
        self.robots = len(self._first.world.robots.cell)
        self.actions_count = action_count(self._first.world.grid.type_headings, drive == "guided")
        self.actions_count += handling == "action"
        self._check_memory(features, buffers or {})
        self._make_buffers(features, buffers or {})
        self._spaces = [self._first.workspace]
        self._spaces += [self._first.new_space() for _ in range(threads - 1)]
        self._runs = cut(worlds, threads)
        self._worlds: list[SteppedWorld | None] = [None] * worlds
        self._copies: list[Copies | None] = [None] * worlds
        self._restorer = Restorer(self._first)
        self.compiled_reset = self._restorer.draws is not None
        self._logs = [ActionLog() for _ in range(worlds)] if log else None
        self._make_stepper(weights, stepping == "decision", features, facing)
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None
        self._seed = int(self._resolved.scenario.seed)
        self._episodes = np.full(worlds, NIL, np.int64)
        self._is_closed = self._is_reset = False

    # What it is made of.

    def _shapes(self, features: bool) -> dict[str, tuple[tuple[int, ...], str]]:
        """The shape and dtype of each buffer."""
        each = self.worlds, self.robots
        side = 0 if self.radius is None else 2 * self.radius + 1
        shapes = {
            "actions": (each, "int32"),
            "masks": ((*each, self.actions_count), "int8"),
            "acting": (each, "uint8"),
            "elapsed": (each, "int32"),
            "rewards": (each, "float32"),
            "terminations": (each, "bool"),
            "truncations": (each, "bool"),
            "seeds": ((self.worlds,), "uint64"),
            "ticks": ((self.worlds,), "int64"),
            "invalid": ((self.worlds,), "int64"),
        }
        if self.radius is not None:
            shapes["observations"] = (*each, len(self.channels), side, side), "uint8"
        if features:
            shapes["features"] = (*each, FEATURE_COUNT), "float32"
        if self.autoreset == "same_step":
            views = {name: one for name, one in shapes.items() if name in FINAL_NAMES}
            shapes |= {f"final_{name}": one for name, one in views.items()}
        return shapes

    def _check_memory(self, features: bool, taken: Mapping[str, Any]) -> None:
        """Raises InputError if the worlds do not fit into the memory that is free."""
        sizes = [
            int(np.prod(shape)) * np.dtype(dtype).itemsize
            for name, (shape, dtype) in self._shapes(features).items()
            if name not in taken
        ]
        each = self._first.bytes
        self.bytes = self.worlds * each + sum(sizes)
        free = free_memory()
        if free is not None and self.bytes > free:
            fit = max((free - sum(sizes)) // each, 0)
            raise InputError(
                f"{self.worlds:,} worlds take {memory(self.bytes)}, and {memory(free)} are free: at "
                f"most {fit:,} worlds fit"
            )

    def _make_buffers(self, features: bool, taken: Mapping[str, Any]) -> None:
        shapes = self._shapes(features)
        for name in taken:
            check_name("buffer", name, shapes)
        arrays = {
            name: checked_buffer(name, taken[name], shape, dtype)
            if name in taken
            else np.zeros(shape, dtype)
            for name, (shape, dtype) in shapes.items()
        }
        self.actions, self.masks, self.acting = (
            arrays[name] for name in ("actions", "masks", "acting")
        )
        self.rewards, self.elapsed = arrays["rewards"], arrays["elapsed"]
        self.terminations, self.truncations = arrays["terminations"], arrays["truncations"]
        self.seeds, self.ticks, self.invalid = (
            arrays[name] for name in ("seeds", "ticks", "invalid")
        )
        self.observations: Array | None = arrays.get("observations")
        self.features: Array | None = arrays.get("features")
        self.final_observations: Array | None = arrays.get("final_observations")
        self.final_features: Array | None = arrays.get("final_features")
        self.final_masks: Array | None = arrays.get("final_masks")
        self.final_acting: Array | None = arrays.get("final_acting")
        each = self.worlds, self.robots
        flat = {name: arrays.get(name) for name in StepBuffers._fields}
        windows = flat["observations"]
        flat["observations"] = (
            np.zeros((*each, 0), np.uint8) if windows is None else windows.reshape((*each, -1))
        )
        if flat["features"] is None:
            flat["features"] = np.zeros((*each, 0), np.float32)
        self._buffers = StepBuffers(**flat)

    def _make_stepper(
        self, weights: Array, until_acting: bool, features: bool, facing: bool
    ) -> None:
        course = np.zeros(len(Course.meanings), np.int64).view(Course)
        course.robots, course.actions = self.robots, self.actions_count
        course.drive = int(self.drive == "guided")
        if self.handling == "action":
            course.drive |= (self.actions_count - 1) << HANDLE_SHIFT
        course.until_acting, course.max_ticks = int(until_acting), self.max_ticks
        losses = [weights[list(REWARDS).index(name)] for name in ("blocked", "energy")]
        course.counts_losses = int(features or any(losses))
        course.measures = int(features or weights[list(REWARDS).index("nearer")] != 0)
        first = self._first
        rules = first.world.rules
        sight = rules.radius if rules.radius > 0 and rules.circle else NIL
        self._scene = scene_of(first.world.grid, self.channels, self.radius or 0, sight, facing)
        self._stepper = Stepper(
            course=course,
            addresses=np.zeros((self.worlds, ADDRESS_COUNT), np.int64),
            functions=first.words(
                self.radius, features, bool(course.measures), self._logs is not None, facing
            ),
            mode=first.mode,
            used=first.used,
            weights=weights,
            state=np.full(self.worlds, STATE_ENDED, np.int64),
            buffers=self._buffers,
        )
        self._state = self._stepper.state
        self._address = registered_address(self._stepper)
        self._space_addresses = [registered_address(space) for space in self._spaces]
        self._drive = compiled_driver()

    # Episodes.

    def reset(self, seed: int | None = None, *, options: Mapping[str, Any] | None = None) -> None:
        """Begin an episode in all worlds, or in those of `options["reset_mask"]`, bool (W,).

        With `seed`, episodes are counted from 0 again; without, each world begins its next one.
        `options["seeds"]`, uint64 (W,), names the seeds of the episodes. Other options are ignored.
        """
        self._check_open()
        options = options or {}
        mask = checked_option("reset_mask", options, self.worlds, "bool")
        mask = np.ones(self.worlds, bool) if mask is None else mask
        seeds = checked_option("seeds", options, self.worlds, "uint64")
        if seed is not None:
            check_number("seed", seed, 0, None)
            self._seed = seed
            self._episodes[mask] = NIL
        self._begin(np.flatnonzero(mask), seeds)
        self._show(np.flatnonzero(mask))
        self._is_reset = True
        self._after_step()

    def _show(self, numbers: Array) -> None:
        """Bring worlds that begin to the first decisions of their robots."""
        for w in numbers.tolist():
            self._drive(self._address, self._space_addresses[self._run_of(w)], w, w + 1)

    def _begin(self, numbers: Array, seeds: Array | None = None) -> None:
        """Bring worlds to the beginning of their next episodes."""
        if not len(numbers):
            return
        self._episodes[numbers] += 1
        drawn = np.zeros(len(numbers), np.uint64)
        with np.errstate(over="ignore"):
            random_bits_of_each(
                drawn, np.uint64(self._seed), STREAM_EPISODES, self._episodes[numbers], numbers
            )
        drawn >>= np.uint64(1)
        self.seeds[numbers] = drawn if seeds is None else seeds[numbers]
        for w in numbers.tolist():
            self._begin_world(w, int(self.seeds[w]))

    def _begin_world(self, w: int, seed: int) -> None:
        """Bring a world to tick 0."""
        world, copies = self._worlds[w], self._copies[w]
        if world is None or copies is None:
            world = SteppedWorld(self._resolved, seed, self._spaces[self._run_of(w)])
            self._worlds[w] = world
            row = world.connect(self._scene, self.radius, self._logs is not None)
            self._stepper.addresses[w] = row
            if self._restorer.draws is not None:
                self._copies[w] = self._restorer.copies(world)
        else:
            assert self._restorer.draws is not None
            copies.seed[0] = seed
            restored(world, self._restorer.draws, copies)
            world.forget()
        self._state[w] = STATE_NEW
        self.invalid[w] = 0
        if self._logs is not None:
            self._logs[w] = ActionLog()

    def _run_of(self, w: int) -> int:
        """The thread that steps a world."""
        return next(k for k, (_, last) in enumerate(self._runs) if w < last)

    # Steps.

    def step(self, actions: Any = None) -> None:
        """Execute the actions of all robots, and fill the buffers.

        `actions`: (W, N) integers, which are copied into the buffer `actions`. Raises InputError
        before the first `reset`, and if the distance tables of a tick do not fit.
        """
        self._check_open()
        if not self._is_reset:
            raise InputError("call reset() before step()")
        if actions is not None:
            self._take(actions)
        if self._logs is not None:
            self._note_actions(self._logs)
        if self.autoreset == "same_step":  # the flags of episodes that the last step ended
            self.terminations[:] = self.truncations[:] = False
        elif self.autoreset == "next_step":
            self._begin(np.flatnonzero(self._state == STATE_ENDED))
        if self._pool is None:
            self._drive(self._address, self._space_addresses[0], 0, self.worlds)
        else:
            others = [
                self._pool.submit(self._drive, self._address, space, *run)
                for space, run in zip(self._space_addresses[1:], self._runs[1:], strict=True)
            ]
            self._drive(self._address, self._space_addresses[0], *self._runs[0])
            for other in others:
                other.result()
        self._after_step()
        if self.autoreset == "same_step":
            self._begin_at_once(np.flatnonzero(self._state == STATE_ENDED))

    def _begin_at_once(self, numbers: Array) -> None:
        """Begin the next episodes in the step that ended the last ones, whose rewards and flags stay."""
        if not len(numbers):
            return
        for final, shown in (
            (self.final_observations, self.observations),
            (self.final_features, self.features),
            (self.final_masks, self.masks),
            (self.final_acting, self.acting),
        ):
            if final is not None and shown is not None:
                final[numbers] = shown[numbers]
        arrays = self.rewards, self.terminations, self.truncations
        values = [array[numbers] for array in arrays]
        self._begin(numbers)
        self._show(numbers)
        for array, value in zip(arrays, values, strict=True):
            array[numbers] = value

    def _take(self, actions: Any) -> None:
        array = np.asarray(actions)
        if array.shape != self.actions.shape or array.dtype.kind not in "iub":
            raise InputError(
                f"actions are integers of the shape {self.actions.shape}; found {array.dtype} "
                f"{array.shape}"
            )
        np.copyto(self.actions, np.clip(array, -1, MAX_ACTION), casting="unsafe")

    def _after_step(self) -> None:
        if self._logs is not None:
            for w, log in enumerate(self._logs):
                log.digests[int(self.ticks[w])] = self._world(w).logged_digest
        if (self._state == STATE_STOPPED).any():
            w = int(np.argmax(self._state == STATE_STOPPED))
            world = self._worlds[w]
            assert world is not None
            raise no_room(world.world, [*self._spaces, *world.states])

    def close(self) -> None:
        """Release the threads and worlds; the environment cannot be used any more."""
        if self._pool is not None:
            self._pool.shutdown()
        self._worlds = [None] * self.worlds
        self._is_closed = True

    def _check_open(self) -> None:
        if self._is_closed:
            raise InputError("the environment is closed: make a new one")

    # Looking at it.

    def digests(self) -> Array:
        """(W,) uint64: the digest of the state of each world."""
        return np.array([int(self._world(w).digest, 16) for w in range(self.worlds)], np.uint64)

    def picture(self, w: int = 0) -> str:
        """The picture of a world as text."""
        from automaton.runs.pictures.pictures import picture_of

        return picture_of(self._world(w), brief=True)

    @property
    def whole_floor_shape(self) -> tuple[int, int, int]:
        """The shape of `whole_floor`: channels, rows, columns."""
        width = int(self._first.world.grid.width)
        return len(self.channels), len(self._scene.plane) // width - 2, width - 2

    def whole_floor(self, w: int = 0) -> Array:
        """(C, rows, columns) uint8: the channels of a world over the whole floor, for no robot alone.

        `walls` shows cells in which no robot ever stands, `ways` the exits for robots of any type,
        `orders` those that one type can do, the most of all types, and `goal` and `goals` the goal
        cells of all robots. Raises InputError without channels.
        """
        if not self.channels:
            raise InputError("radius is None, so that there are no channels: set radius")
        world = self._world(w)
        planes: Array = whole_planes(world.world, world.episode)
        with_rim = planes.reshape(len(planes), -1, world.world.grid.width)
        return with_rim[:, 1:-1, 1:-1].copy()

    def save(self, w: int, path: Any) -> None:
        """Run the latest episode of a world again in a simulation, and record it in a file.

        The environment needs `log=True`. Raises InputError.
        """
        world = self._world(w)
        if self._logs is None:
            raise InputError("only an environment made with log=True keeps actions to save")
        rows = self._logs[w].rows(int(self.ticks[w]), self.robots)
        options = self.drive, text_of_actions(rows), self.handling
        settings = (*self._settings, f"seed={world.seed}")
        save_episode(
            resolved_for(self._scenario, settings, *options),
            world.seed,
            self._logs[w].digests,
            path,
        )

    def _note_actions(self, logs: Sequence[ActionLog]) -> None:
        """Note the actions that enter in the next step."""
        for w in np.flatnonzero(self._state == STATE_RUNNING).tolist():
            world, log = self._world(w), logs[w]
            allowed = np.clip(self.actions[w], -1, MAX_ACTION)
            log.actions[int(world.world.clock.tick)] = allowed.astype(np.int8)

    def _world(self, w: int) -> SteppedWorld:
        check_number("world", w, 0, self.worlds - 1)
        world = self._worlds[w]
        if world is None:
            raise InputError("call reset() first: no episode has begun")
        return world


def resolved_for(
    scenario: Any, settings: Settings, drive: str, actions: str = "", handling: str = "automatic"
) -> Any:
    """The scenario with the right of way through which actions enter. Raises InputError."""
    if isinstance(settings, str):
        raise InputError(f"settings is a list of texts such as [{settings!r}]; found a text")
    chosen = {"name": EXTERNAL[drive], "actions": actions, "handling": handling}
    keys = ("strategy", "right_of_way")
    return resolve(scenario, (*settings, Override(f"{'.'.join(keys)}={drive}", keys, chosen)))


def check_name(kind: str, name: str, known: Iterable[str]) -> None:
    """Raises InputError for an unknown name."""
    if name not in known:
        hint = nearest(str(name), known)
        raise InputError(f"unknown {kind} {name!r}{hint}: allowed are {alternatives(known)}")


def check_number(name: str, value: Any, least: int, most: int | None) -> None:
    """Raises InputError for a number out of bounds."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_whole or value < least or (most is not None and value > most):
        bounds = f"at least {least:,}" if most is None else f"{least:,} to {most:,}"
        raise InputError(f"{name} is {bounds}; found {value!r}")


def weights_of(reward: Mapping[str, float]) -> Array:
    """(r,) float64: the weight of each component of rewards. Raises InputError."""
    for name in reward:
        check_name("component of reward", name, REWARDS)
    return np.array([float(reward.get(name, 0.0)) for name in REWARDS])


def check_sight(rules: Any, channels: Sequence[str], radius: int | None) -> None:
    """Raises InputError if windows show more than the scenario lets robots see."""
    if radius is None:
        return
    check_number("radius", radius, 0, MAX_RADIUS)
    if rules.radius == NIL:
        return
    sight = 1 if rules.radius == ORDER_LIST else int(rules.radius)
    if radius > sight:
        raise InputError(
            f"radius is {radius}, and by the scenario's information robots see {sight} cells far: it "
            f"is at most {sight}"
        )
    if "goals" in channels:
        raise InputError("the channel goals shows all robots: it needs information: everything")
    if rules.own_zones and "orders" in channels:
        raise InputError("the channel orders shows all orders: it needs information.orders: all")


def check_facing(headings: Array, has_views: bool) -> None:
    """Raises InputError if there are no views to turn, or robots have no headings to turn them by."""
    if not has_views:
        raise InputError("facing=True turns windows and features: set radius, or features=True")
    if (headings != 4).any():
        raise InputError(
            "facing=True turns views by the heading of the robot: it needs differential robots only"
        )


def cut(worlds: int, threads: int) -> list[tuple[int, int]]:
    """The first and the last world, not included, of each thread."""
    ends = [worlds * k // threads for k in range(threads + 1)]
    return list(pairwise(ends))


def checked_option(name: str, options: Mapping[str, Any], worlds: int, dtype: str) -> Array | None:
    """An option of a reset, one value for each world; None if it is left out. Raises InputError."""
    if name not in options:
        return None
    array = np.asarray(options[name])
    if array.shape != (worlds,) or array.dtype != np.dtype(dtype):
        wanted = f"an array of {dtype}, shape {(worlds,)}"
        raise InputError(f"{name} is {wanted}; found {array.dtype}, shape {array.shape}")
    return array


def checked_buffer(name: str, array: Any, shape: tuple[int, ...], dtype: str) -> Array:
    """The array, if the environment can fill it. Raises InputError."""
    wanted = f"a C-contiguous array of {dtype}, shape {shape}"
    if not isinstance(array, np.ndarray):
        raise InputError(f"{name} is {wanted}; found {type(array).__name__}")
    if array.dtype != np.dtype(dtype) or array.shape != shape:
        raise InputError(f"{name} is {wanted}; found {array.dtype}, shape {array.shape}")
    if not array.flags.c_contiguous or not array.flags.writeable:
        fault = "read-only" if array.flags.c_contiguous else "not C-contiguous"
        raise InputError(f"{name} is {wanted} that can be written; it is {fault}")
    return array
