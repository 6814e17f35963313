"""Replay of a recorded run from the recorded decisions, with keyframes in memory for going back.

No strategy is needed. Each keyframe is stored as its difference from the state at tick 0, so on a large
floor only cells that robots have reached take space.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import ClassVar, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.decision_stream import ReplayState, repeat
from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.observation import Observation
from automaton.engine.observed_ticks import show_ticks
from automaton.engine.state import LAYER_NAMES, NIL, Array, Clock, World
from automaton.errors import InputError
from automaton.recording.contents import FRAME_TICKS, Content
from automaton.recording.frames import Recording, StoredFrames, changed, resolved_of
from automaton.runs.simulation import Simulation
from automaton.runs.state_copy import arrays_of_run, copy_clock, ragged_arrays, used_entries
from automaton.strategy.contract import Strategy, WaitRanges
from automaton.strategy.lookup import NO_STRATEGY
from automaton.world.resolved import Resolved

FIRST_WORDS = 4096


class ReplayStrategy(Strategy):
    """Repeats recorded decisions; the playback loads them into its memory."""

    compiled = repeat
    layer: ClassVar[str] = ""

    def __init__(self, layer: str, number: int, rules: Content, words: list[np.ndarray]) -> None:
        super().__init__()
        self.layer = layer  # type: ignore[misc]
        self.period = int(rules["period"][number])
        self.steers = bool(rules["steered"][0])
        self.watches_chargers = bool(rules["watches_chargers"][0])
        self._wait: WaitRanges = tuple(int(w) for w in rules["wait"])  # type: ignore[assignment]
        self._words = words

    def reset(self, view: World) -> ReplayState:
        return ReplayState.sized(layer=LAYER_NAMES.index(self.layer), words=self._words[0])

    def wait_ranges(self) -> WaitRanges:
        return self._wait


def _last_digest(content: Content, tick: int, until: int) -> int:
    """The last tick after `tick` up to `until` for which a frame holds digests, or `tick`."""
    first = content["first"]
    rows = np.flatnonzero(content["digests"][tick + 1 - first : until + 1 - first].any(axis=1))
    return tick + 1 + int(rows[-1]) if len(rows) else tick


class Playback:
    """A run that can go to any tick of its recording, forwards and backwards.

    `keyframes` may be shared with the run that makes them. More frames may be added meanwhile.
    """

    def __init__(
        self,
        header: Content,
        frames: StoredFrames,
        keyframes: Keyframes | None = None,
        on_observe: Callable[[Simulation], None] | None = None,
    ) -> None:
        self.header = header
        self.frames = frames
        self._on_observe = on_observe or Simulation.empty_observation
        self._words = [np.zeros(FIRST_WORDS, np.int64)]
        self._fault: tuple[int, str] | None = None  # tick and message of an error in the recording
        self._loaded: int | None = None  # first tick of the frame in memory
        self._observed = header.get("observed")
        self.simulation = self._simulation(self.frames.rules_at(0), None)
        if self._observed is not None:
            self._enter(np.zeros((1, 1), np.uint16), self._observed["first"], 0, 0)
        world, observation = self.simulation.world, self.simulation.observation
        self.keyframes = Keyframes(world, observation) if keyframes is None else keyframes

    @property
    def tick(self) -> int:
        """The present tick."""
        return self.simulation.tick

    def go_to(self, tick: int) -> None:
        """Go to a tick, or to the last recorded tick if that is earlier."""
        tick = min(tick, self.frames.last_tick)
        at = self.tick
        if tick == at:
            return
        nearest = self.keyframes.before(tick)
        if tick < at or nearest > at:
            self._rebuild_for(nearest)
            world, observation = self.simulation.world, self.simulation.observation
            if not self.keyframes.fits(
                nearest, world, observation
            ):  # a branch begins there with other zones
                self.simulation = self._simulation(self.frames.rules_at(nearest), None)
                world, observation = self.simulation.world, self.simulation.observation
            self.keyframes.restore(nearest, world, observation)
            self.simulation.update_finished()
        while self.tick < tick:
            self._advance(tick)
        self._rebuild_for(tick)  # a branch at this tick shows its own rules

    def _advance(self, tick: int) -> None:
        """Play to a tick, or to the end of the loaded frame."""
        if self._fault is not None and self.tick >= self._fault[0]:
            raise InputError(self._fault[1])
        content = self.frames.ticks_with(self.tick + 1)
        if content is None or content["first"] > self.tick + 1:
            raise InputError("the recording has fewer ticks than it declares: the file was altered")
        self._rebuild_for(self.tick)
        self._load(content)
        last = min(tick, content["first"] + len(content["executed"]) - 1)
        self._play(_last_digest(content, self.tick, last))
        if self.tick >= content["first"]:
            self._check(content["digests"][self.tick - content["first"]])
        self._play(last)

    def _play(self, tick: int) -> None:
        if self._observed is not None:
            self._show(tick)
            return
        self.simulation.run(until=tick)
        if self.tick < tick:
            self._fail(f"the run ends at tick {self.tick}, before its recording")

    def _show(self, tick: int) -> None:
        """Show the ticks of an observed run up to a tick, within the loaded frame."""
        content = self.frames.ticks_with(tick)
        assert content is not None, "it is loaded"
        while self.tick < tick:
            self._enter(content["executed"], content["changes"], content["first"], tick)
            self._on_observe(self.simulation)

    def _enter(self, executed: Array, changes: Array, first: int, until: int) -> None:
        world, observation = self.simulation.world, self.simulation.observation
        executed = np.array(executed, np.uint16, order="C")  # the kernel takes one kind of array
        show_ticks(
            world, observation, executed, np.array(changes, np.int64, order="C"), first, until
        )

    def _check(self, recorded: Array) -> None:
        """Raise InputError if the digest of the state differs from the recorded one."""
        if not recorded.any() or list(self.header["digest_names"]) != list(DIGEST_NAMES):
            return
        differs = np.flatnonzero(recorded != self.simulation.digests())
        if len(differs):
            self._fail(
                f"{DIGEST_NAMES[differs[0]]} differs from the recording after tick {self.tick}"
            )

    def _fail(self, what: str) -> None:
        """Stop the playback: from here on the recording belongs to another run."""
        self._fault = (
            self.tick,
            f"in the replay {what}: the recording was made by another version, or altered",
        )
        raise InputError(self._fault[1])

    def _load(self, content: Content) -> None:
        words = content["decisions"]
        if content["first"] != self._loaded:
            if len(words) > len(self._words[0]):
                self._words[0] = np.zeros(2 * len(words), np.int64)
                self.simulation = self._simulation(self.frames.rules_at(self.tick), self.simulation)
            self._words[0][: len(words)] = words
            self._loaded = content["first"]
        for state in self.simulation.states:
            if isinstance(state, ReplayState):
                state.cursor, state.end = 0, len(words)

    def _rebuild_for(self, tick: int) -> None:
        """Change the rules where the run has a branch."""
        rules = self.frames.rules_at(tick)
        if rules["tick"] != self._since:
            self.simulation = self._simulation(rules, self.simulation)

    def _simulation(self, rules: Content, before: Simulation | None) -> Simulation:
        self._since = rules["tick"]
        resolved = self._resolved(rules)
        return Simulation(
            resolved,
            self.header["seed"],
            on_observe=self._on_observe,
            strategies=[
                None
                if choice.name == NO_STRATEGY or self._observed is not None
                else ReplayStrategy(layer, number, rules, self._words)
                for number, (layer, choice) in enumerate(resolved.choices)
            ],
            after=before,
        )

    def _resolved(self, rules: Content) -> Resolved:
        """The scenario under these rules, with full information: decisions are recorded anyway."""
        resolved = resolved_of(changed(self.header, rules), with_strategies=False)
        scenario = msgspec.structs.replace(resolved.scenario, information="everything")
        return replace(resolved, scenario=scenario)


# Keyframes in memory: states of a run to which playback can return.


KEYFRAME_BYTES: Final = 256 * 1024 * 1024  # limit for all keyframes
OBJECT_BYTES: Final = 200  # overhead of an array: 80 % of a small fleet's keyframe


class Delta(NamedTuple):
    """An array as its difference from a base array, or in full if that is shorter."""

    where: Array | None  # flat indices; None: `values` is the full array
    values: Array


NO_CHANGE: Final = Delta(np.zeros(0, np.int32), np.zeros(0, np.int32))  # shared by all arrays


class Keyframe(NamedTuple):
    """The state after a tick."""

    tick: int
    arrays: dict[str, Delta]
    routes: Array  # the steps of all routes, concatenated
    plans: Array  # the orders of all plans, concatenated
    clock: Clock

    @property
    def nbytes(self) -> int:
        deltas = (delta for delta in self.arrays.values() if delta is not NO_CHANGE)
        parts = [a for delta in deltas for a in delta if a is not None]
        return sum(
            part.nbytes + OBJECT_BYTES for part in (*parts, self.routes, self.plans, self.clock)
        )


class Keyframes:
    """The keyframes of one run in the order of their ticks; the first one is usually of tick 0."""

    def __init__(
        self, world: World, observation: Observation, budget: int = KEYFRAME_BYTES
    ) -> None:
        self.budget = budget
        self.ticks: list[int] = []  # ticks of the keyframes, ascending
        arrays = arrays_of_run(world, observation)
        self._base = {name: array.copy() for name, array in arrays.items()}
        self._frames: list[Keyframe] = []
        self._bytes = 0
        self.keep(world, observation)

    def before(self, tick: int) -> int:
        """The tick of the last keyframe up to `tick`. Raises InputError if it was dropped."""
        place = bisect_right(self.ticks, tick)
        if not place:
            raise InputError(
                f"the part of the run before tick {self.ticks[0]:,} is no longer stored"
            )
        return self.ticks[place - 1]

    def keep(self, world: World, observation: Observation) -> None:
        """Store the state; beyond the budget, drop the keyframes that leave the smallest gaps."""
        tick = int(world.clock.tick)
        if self.ticks and tick <= self.ticks[-1]:
            return
        arrays = {
            name: _delta(array, self._base[name])
            for name, array in arrays_of_run(world, observation).items()
        }
        routes, plans = (
            rows.reshape(-1)[used_entries(rows, used)] for rows, used in ragged_arrays(world)
        )
        frame = Keyframe(tick, arrays, routes, plans, world.clock.copy())
        self._frames.append(frame)
        self.ticks.append(tick)
        self._bytes += frame.nbytes
        while self._bytes > self.budget and len(self._frames) > 2:
            ticks = np.array(self.ticks)
            self._drop(1 + int(np.argmin(ticks[2:] - ticks[:-2])))

    def forget_until(self, tick: int) -> None:
        """Drop keyframes before `tick`, but keep the newest."""
        while len(self.ticks) > 1 and self.ticks[0] < tick:
            self._drop(0)

    def _drop(self, index: int) -> None:
        self._bytes -= self._frames.pop(index).nbytes
        del self.ticks[index]

    def fits(self, tick: int, world: World, observation: Observation) -> bool:
        """Whether a keyframe fits the arrays of a world; it does not if a branch has other zones."""
        frame = self._at(tick)
        return all(
            array.shape == self._shape(frame, name)
            for name, array in arrays_of_run(world, observation).items()
        )

    def _at(self, tick: int) -> Keyframe:
        return self._frames[bisect_right(self.ticks, self.before(tick)) - 1]

    def _shape(self, frame: Keyframe, name: str) -> tuple[int, ...]:
        where, values = frame.arrays[name]
        shape: tuple[int, ...] = (values if where is None else self._base[name]).shape
        return shape

    def restore(self, tick: int, world: World, observation: Observation) -> int:
        """Restore the last keyframe up to `tick` to a world; return its tick.

        Arrays that do not fit (`fits`) stay unchanged.
        """
        frame = self._at(tick)
        for name, array in arrays_of_run(world, observation).items():
            where, values = frame.arrays[name]
            if array.shape != self._shape(frame, name):
                continue
            if where is None:
                np.copyto(array, values)
            else:
                np.copyto(array, self._base[name])
                array.reshape(-1)[where] = values
        for (rows, used), values in zip(
            ragged_arrays(world), (frame.routes, frame.plans), strict=True
        ):
            rows.reshape(-1)[used_entries(rows, used)] = values
        copy_clock(world.clock, frame.clock)
        return frame.tick


def _delta(array: Array, base: Array) -> Delta:
    if array.shape != base.shape:  # a branch has other zones
        return Delta(None, array.copy())
    where = np.flatnonzero(array.reshape(-1) != base.reshape(-1)).astype(np.int32)
    if not where.size:
        return NO_CHANGE
    values = array.reshape(-1)[where]
    if where.nbytes + values.nbytes < array.nbytes:
        return Delta(where, values)
    return Delta(None, array.copy())


# What real robots did that the rules of motion forbid.


TWO_ROBOTS: Final = "two robots in a cell for one"
SWAP: Final = "two robots that swapped their cells"


class Breach(NamedTuple):
    """Something that a model of one robot in a cell rules out, and where it was seen first."""

    what: str
    times: int
    tick: int
    robots: tuple[int, int]
    cell: tuple[int, int]  # x, y

    def __str__(self) -> str:
        one, other = self.robots
        where = f"first in tick {self.tick:,}: robots {one} and {other} at {self.cell}"
        times = "once" if self.times == 1 else f"{self.times:,} times"
        return f"{self.what}: {times}, {where}"


def breaches_of(
    recording: Recording, show: Callable[[str, int], None] = lambda what, tick: None
) -> list[Breach]:
    """What the robots of an observed run did against the rules of motion; `show`: the progress.

    Between two messages positions are interpolated. So two robots count that are in one cell for longer
    than positions may be wrong, once however long; and swaps within this time.
    """
    playback = Playback(recording.header, recording.stored())
    floor_plan = playback.simulation.resolved.floor_plan
    capacity, gap = floor_plan.capacity.ravel(), recording.header["observed"]["gap"]
    first: dict[str, Breach] = {}
    times: Counter[str] = Counter()
    past = deque([_cells(playback)], maxlen=gap)
    lasts: dict[tuple[int, int], int] = {}  # ticks that two robots have been together
    swapped: set[tuple[int, int]] = set()
    for tick in range(1, recording.ticks + 1):
        playback.go_to(tick)
        now = _cells(playback)
        lasts = {pair: lasts.get(pair, 0) + 1 for pair in _robots_together(now, capacity)}
        swaps = set(_swaps(past[0], now))
        new = [(TWO_ROBOTS, *pair) for pair, ticks in sorted(lasts.items()) if ticks == gap + 1]
        new += [(SWAP, *pair) for pair in sorted(swaps - swapped)]
        for what, one, other in new:
            times[what] += 1
            if what not in first:
                first[what] = Breach(what, 0, tick, (one, other), floor_plan.xy(int(now[one])))
        swapped = swaps
        past.append(now)
        if tick % FRAME_TICKS == 0:
            show("rules", tick)
    return [breach._replace(times=times[what]) for what, breach in first.items()]


def _cells(playback: Playback) -> Array:
    """(n,) the cell of each robot, by identity."""
    robots = playback.simulation.world.robots
    cells: Array = robots.cell[robots.at_index].astype(np.int64)
    return cells


def _robots_together(cell: Array, capacity: Array) -> Iterator[tuple[int, int]]:
    """Yield pairs of neighbours in the list of the robots of each cell with too many robots."""
    order = np.argsort(cell, kind="stable")
    same = np.diff(cell[order]) == 0
    same &= (cell[order][1:] != NIL) & (capacity[cell[order][1:]] == 1)
    for at in np.flatnonzero(same).tolist():
        yield int(order[at]), int(order[at + 1])


def _swaps(before: Array, now: Array) -> Iterator[tuple[int, int]]:
    """Yield the pairs of robots that have changed places."""
    moved = np.flatnonzero((before != now) & (before != NIL) & (now != NIL)).tolist()
    came = {(int(before[robot]), int(now[robot])): robot for robot in moved}
    for robot in moved:
        other = came.get((int(now[robot]), int(before[robot])))
        if other is not None and robot < other:
            yield robot, other
