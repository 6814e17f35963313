"""The worlds of an environment: runs that the driver steps, in place of the loop."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from automaton.engine.digest import DIGEST_NAMES, combine
from automaton.engine.features import FEATURES, signature
from automaton.engine.jit.kernel import first_class, jit_is_on
from automaton.engine.jit.struct_types import words_of_function
from automaton.engine.jit.structs import registered_address
from automaton.engine.state import LAYER_RIGHT_OF_WAY, NIL, STRATEGY_COUNT, Array
from automaton.environments import stepping, windows
from automaton.errors import InputError, alternatives
from automaton.runs.simulation import Simulation
from automaton.strategy import lookup

EXTERNAL: Final = {  # the right of way, by drive
    "free": "automaton.environments.external:External",
    "guided": "automaton.environments.external:Guided",
}


class SteppedWorld(Simulation):
    """A run that kernels step, in a workspace that it shares with other worlds of its thread."""

    def __init__(self, resolved: Any, seed: int, space: Any = None) -> None:
        self._space = space
        super().__init__(resolved, seed)

    def _borrow_space(self, floor: Any) -> Any:
        self._floor = floor
        return super()._borrow_space(floor) if self._space is None else self._space

    @property
    def empty_floor(self) -> Array:
        """(C,) uint16: the occupancy of the floor without robots and pods."""
        floor: Array = self._floor.occupancy
        return floor

    def new_space(self) -> Any:
        """Another workspace for worlds like this one."""
        return super()._borrow_space(self._floor)

    def _load_strategy(self, layer: str, choice: Any) -> Any:
        """Load a strategy; robots that are steered have no routes. Raises InputError for Python ones."""
        is_free = self.resolved.strategies["right_of_way"].name == EXTERNAL["free"]
        if layer == "routing" and is_free:
            return None
        strategy = super()._load_strategy(layer, choice)
        if strategy is not None and type(strategy).compiled is None:
            compiled = [name for name in lookup.names(layer) if is_compiled(layer, name)]
            raise InputError(
                f"the {layer.replace('_', ' ')} strategy {choice.name!r} is not compiled, as an "
                f"environment needs: compiled ones are {alternatives(compiled)}"
            )
        return strategy

    def _start(self) -> Iterator[int]:
        self.parts = self._loop_parts(stepping.DECIDE)
        return iter(())

    def connect(self, scene: Any, radius: int | None, logs: bool) -> list[int]:
        """The addresses of the structs of this world, for the driver."""
        worlds, batches, decisions, outputs, *_ = self.parts.structs
        planes = windows.first_planes(self.world, scene, radius or 0)
        self.episode = stepping.Episode.sized(
            {
                "n": len(self.world.robots.cell),
                "p": planes.shape[1],
                "d": len(DIGEST_NAMES) if logs else 0,
            },
            planes=planes,
            scene=scene,
        )
        self.entered = self.states[LAYER_RIGHT_OF_WAY]
        structs = (
            *(*worlds, outputs[0], *batches, decisions, *outputs[1:]),
            *(self.entered, self.episode, *self.parts.memories),
        )
        return [registered_address(one) for one in structs]

    def forget(self) -> None:
        """Another episode begins; robots are still drawn where they were, until they are shown."""
        episode = self.episode
        for array in (episode.allowed, episode.blocked, episode.refused, episode.energy):
            array[:] = 0
        for array in (episode.goal, episode.pose, episode.revision):
            array[:] = NIL

    def words(
        self, radius: int | None, features: bool, measures: bool, logs: bool, facing: bool
    ) -> Array:
        """(g, 2) int64: the words of all functions that the driver calls."""
        views = [
            None if radius is None else windows.window_kernel(radius),
            windows.fill_features if features else None,
            windows.measure_distances if measures else None,
            windows.note_digests if logs else None,
            windows.turn_views if facing else None,
        ]
        kinds = [stepping.DECIDE] * STRATEGY_COUNT
        kinds += [signature(one) if jit_is_on() else None for one in FEATURES]
        functions = list(zip(self.parts.functions, kinds, strict=True))
        kind = stepping.view_signature()
        functions += [
            (one and (first_class(one, kind) if jit_is_on() else one), kind) for one in views
        ]
        return np.array([words_of_function(*one) for one in functions], np.int64)

    @property
    def logged_digest(self) -> str:
        """The digest of the state after the last tick, if it is logged."""
        with np.errstate(over="ignore"):
            return f"{int(combine(self.episode.digests)):016x}"

    @property
    def mode(self) -> Array:
        """How each strategy decides, by number."""
        return self._mode

    @property
    def used(self) -> Array:
        """The features that the world uses, by number."""
        return self._used

    @property
    def bytes(self) -> int:
        """The memory of its arrays."""
        parts = (self.world, self.full_batch, self.batch, self.decisions, *self.states)
        constant = sum(array.nbytes for _, _, array in self.world.grid.arrays())
        arrays = {id(array): array for part in parts for _, _, array in part.arrays()}
        return int(sum(array.nbytes for array in arrays.values()) - constant)


class ActionLog:
    """The actions of an episode, and its digests."""

    def __init__(self) -> None:
        self.actions: dict[int, Array] = {}  # (n,) int8, by the tick in which they entered
        self.digests: dict[int, str] = {}  # after a tick

    def rows(self, ticks: int, robots: int) -> Array:
        """(ticks + 1, n) int8: the actions that enter in each tick."""
        rows = np.zeros((ticks + 1, robots), np.int8)
        for tick, actions in self.actions.items():
            if tick <= ticks:
                rows[tick] = actions
        return rows


def save_episode(resolved: Any, seed: int, digests: Mapping[int, str], path: Any) -> None:
    """Record an episode in a simulation; its digests by tick must be those of the environment.

    Raises InputError if the file cannot be written, and AssertionError if a digest differs.
    """
    from automaton.recording.recorder import Recorder

    try:
        with Recorder(Path(path), resolved, seed) as recorder:
            simulation = Simulation(resolved, seed, on_record=recorder)
            for tick, digest in sorted(digests.items()):
                simulation.run(tick)
                if tick and simulation.digest != digest:
                    raise AssertionError(f"tick {tick}: the run differs from the episode")
            recorder.end()
    except OSError as error:
        raise InputError(f"cannot write the recording: {error.strerror}", str(path)) from error


def is_compiled(layer: str, name: str) -> bool:
    """Whether a strategy of the catalogue is compiled."""
    return name != lookup.NO_STRATEGY and lookup.load(layer, name).compiled is not None


def free_memory() -> int | None:
    """Bytes of memory that are available; None if the system does not say so."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    for line in lines:
        name, _, amount = line.partition(":")
        if name == "MemAvailable":
            return 1024 * int(amount.split()[0])
    return None
