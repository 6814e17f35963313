"""A run: a world, its strategies, and the compiled loop that advances it from tick to tick.

Also the loading of the loop, the error for distance tables that do not fit, and the picture of a run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from automaton import garbage
from automaton.drawings.floor_svg import FloorPicture
from automaton.drawings.looks import THEMES, Theme
from automaton.drawings.moment import drawn_floor, empty_moment, moment_of
from automaton.engine import loop as loop_kernels
from automaton.engine.digest import DIGEST_NAMES, combine, digest_world
from automaton.engine.distance_tables import (
    BYTES_PER_WORD,
    STOP_NO_ROOM,
    DistanceTables,
)
from automaton.engine.features import (
    FEATURES,
    absent,
    absent_feature,
    compiled_feature,
    used_features,
)
from automaton.engine.holders import NO_STATE_ROWS, state_rows
from automaton.engine.jit.compile_progress import COMPILING
from automaton.engine.jit.kernel import first_compilation_announced, jit_is_on
from automaton.engine.jit.structs import Struct, registered_address, window
from automaton.engine.record_codes import KEYFRAME_TICKS
from automaton.engine.state import (
    FOLLOWING_CONVOY,
    LAYER_ALLOCATION,
    LAYER_NAMES,
    MAX_BUSY,
    NIL,
    STRATEGY_COUNT,
    Array,
    Clock,
    Memory,
    Workspace,
    World,
)
from automaton.errors import InputError, alternatives
from automaton.runs.first_compilation import compiled_side_by_side
from automaton.runs.interruption import give_up, interruptible
from automaton.runs.metric_sums import TASK_SUMS
from automaton.runs.progress import asked_count, done_count
from automaton.runs.state_copy import plan_anew, take_over
from automaton.strategy import lookup
from automaton.strategy.contract import (
    NoState,
    Strategy,
    check_counters,
    check_decides,
    checked_period,
    checked_state,
    checked_wait_ranges,
    compiled_decide,
)
from automaton.strategy.patience import Watchdog
from automaton.units import count, memory
from automaton.world.building import (
    build_buffers,
    build_observation,
    build_record,
    build_sight,
    build_watch,
    build_world,
    digest_interval,
)
from automaton.world.resolved import Resolved, StrategyChoice

RECORD_TICKS = 256  # ticks that the buffers of a recording hold
OBSERVED_TICKS = 1024  # ticks that the buffers of an observation hold
# The state is compared after some Python decisions only: two digests take longer than a short decision.
ALWAYS_CHECKED = 100  # the first decisions, all checked
CHECKED_EVERY = 256  # period of the checks after them
MOVING_LAYERS = ("routing", "right_of_way")
NO_STATE = NoState()  # of absent strategies; shared by all runs
NO_MEMORY = Memory(address=registered_address(NO_STATE), rows=NO_STATE_ROWS)


def rules_of_moves(resolved: Resolved) -> tuple[Any, ...]:
    """What costs of ways and plans of moves depend on: durations, rules, weights of streets."""
    scenario = resolved.scenario
    return scenario.durations, scenario.world, resolved.floor_plan


class LoopParts(NamedTuple):
    """The arguments of the compiled loop, and what they refer to.

    Kernels hold no references: a freed array would be overwritten while the loop uses it.
    """

    structs: tuple[Any, ...]
    memories: tuple[Memory, ...]  # by number of the strategy
    functions: list[Any]  # strategies, then features
    visible: list[Struct]  # the state of each strategy as it sees it in a call
    behind: list[Struct]  # the structs behind the memories


class Simulation:
    """One run of a resolved scenario.

    `seed` replaces the seed of the scenario. `storage` permutes the order in which robots are stored
    (the digest does not change). `on_record` records and `on_observe` observes every tick: these
    functions are called when the buffers are full and before `run` returns, and must empty them.
    `strategies` (one for each layer, or None) replace the strategies of the scenario; strategies of
    robot types are dropped unless they follow in the sequence. `after` is a simulation from whose
    state this one continues. A Python strategy has `patience` seconds for each decision (None: no
    limit). Exceptions of strategies propagate out of `run`.
    """

    def __init__(
        self,
        resolved: Resolved,
        seed: int | None = None,
        storage: Array | None = None,
        on_record: Callable[[Simulation], None] | None = None,
        on_observe: Callable[[Simulation], None] | None = None,
        strategies: Sequence[Strategy | None] | None = None,
        after: Simulation | None = None,
        patience: float | None = None,
    ) -> None:
        self.seed = resolved.scenario.seed if seed is None else seed
        self.resolved = resolved = resolved.of_seed(self.seed)
        self.python_decisions = 0  # number of decisions of Python strategies so far
        self._watchdog = None if patience is None else Watchdog(patience)
        in_convoy = after is not None and after.world.rules.following == FOLLOWING_CONVOY
        orders = None if after is None else len(after.world.orders.state)
        world, floor = build_world(
            resolved, self.seed, storage, in_convoy=in_convoy, order_number=orders
        )
        self.world: World = world
        self.workspace = self._borrow_space(floor)
        # (m,) int32: least driving time of each delivered order in ticks; NIL until it is computed.
        self.least = np.full(len(self.world.orders.state), NIL, np.int32)
        # (m, 2) int32: driving ticks by the ways that streets choose, and by the shortest; or NIL.
        guided = len(self.least) if resolved.scenario.streets is not None else 0
        self.guided = np.full((guided, 2), NIL, np.int32)
        self.visible_world = build_sight(self.world, floor)
        self.view: World = self.visible_world.read_only()
        self.full_batch, self.batch, self.decisions = build_buffers(self.world)
        self._batch_view = self.batch.read_only()
        self.on_record = on_record
        self.record = build_record(self.world, RECORD_TICKS if on_record else 0, len(DIGEST_NAMES))
        self.world.clock.recording = 1 if on_record else 0
        self.world.clock.digest_every = digest_interval(self.world) if on_record else 1
        self.on_observe = on_observe
        self.observation = build_observation(self.world, OBSERVED_TICKS if on_observe else 0)
        self.world.clock.observing = 1 if on_observe else 0
        self._watch = build_watch(self.world)
        picked = (
            [self._load_strategy(layer, choice) for layer, choice in resolved.choices]
            if strategies is None
            else list(strategies)
        )
        if len(picked) == len(LAYER_NAMES):
            self.world.rules.allocation[:] = LAYER_ALLOCATION
        picked += [None] * (STRATEGY_COUNT - len(picked))
        # By strategy number; None where a strategy is absent.
        self.strategies = [
            self._validate_strategy(number, strategy) for number, strategy in enumerate(picked)
        ]
        for strategy in self.strategies:
            if strategy is not None:
                strategy.other_layers = {
                    layer: other
                    for layer, other in zip(LAYER_NAMES, self.strategies, strict=False)
                    if other is not None
                }
        if after is not None:
            take_over(self.world, self.observation, after.world, after.observation)
            others = self._robots_of_other_allocations(after.resolved)
            self.world.robots.order_queue_length[others] = 0  # no strategy continues these plans
            if self.world.rules.steered[0] != after.world.rules.steered[0]:
                plan_anew(self.world)
            self.update_finished()
        with self._constants_kept():
            self._states = [self._state(strategy) for strategy in self.strategies]
        # State by robot type no longer fits where types are split by load, or no longer are.
        if (
            after is not None
            and strategies is None
            and self.world.rules.loaded_types == after.world.rules.loaded_types
        ):
            self._restore_states(after)
        self._mode = np.array([mode_of(strategy) for strategy in self.strategies], np.uint8)
        self._used = used_features(self.world, self._mode)
        with COMPILING.expected(self._to_be_compiled()):
            self._ticks = self._start()

    def _borrow_space(self, floor: Any) -> Workspace:
        space: Workspace = floor.borrow_space(self, self.world.rules.table_bytes)
        return space

    def _to_be_compiled(self) -> list[Any]:
        """The functions that the first tick needs compiled."""
        loop = [] if "loop" in _LOOPS else [loop_kernels.ticks]
        features = [FEATURES[number].kernel for number in np.flatnonzero(self._used)]
        kinds = [type(strategy) for strategy in self.strategies if strategy is not None]
        return [*loop, *features, *(kind.compiled for kind in kinds if kind.compiled is not None)]

    def continue_with(self, resolved: Resolved) -> Simulation:
        """Return a simulation that continues from the state of this one with another scenario.

        Floor, fleet and orders must be the same. Strategies that stay keep their state; new ones
        start from the present state. This simulation must not be run any more.
        """
        return Simulation(
            resolved,
            self.seed,
            storage=self.world.robots.identity,
            on_record=self.on_record,
            on_observe=self.on_observe,
            after=self,
            patience=self._watchdog.seconds if self._watchdog else None,
        )

    def _restore_states(self, before: Simulation) -> None:
        """Restore the states and objects of strategies that stay; some keep data in the object.

        Strategies that move robots get a new state where their costs of ways and plans no longer fit.
        """
        known = list(before.resolved.choices)
        is_alike = rules_of_moves(self.resolved) == rules_of_moves(before.resolved)
        for number, choice in enumerate(self.resolved.choices):
            if choice in known and (is_alike or choice[0] not in MOVING_LAYERS):
                was = known.index(choice)
                self.strategies[number] = before.strategies[was]
                self._states[number] = before._states[was].copied()

    def _robots_of_other_allocations(self, before: Resolved) -> Array:
        """(n,) bool: robots whose allocation strategy differs from the one before the branch."""
        types = len(self.resolved.fleet.types)
        names = []
        for resolved in (self.resolved, before):
            numbers = resolved.allocation_of_types or [0] * types
            names.append([resolved.allocations[number].name for number in numbers])
        others: Array = (np.array(names[0]) != names[1])[self.world.robots.type % types]
        return others

    def _load_strategy(self, layer: str, choice: StrategyChoice) -> Strategy | None:
        """Load a strategy that the scenario chooses for a layer."""
        if choice.name == lookup.NO_STRATEGY:
            return None
        kind = lookup.load(layer, choice.name)
        with self._within_patience():
            strategy: Strategy = kind(choice.parameters)
        return strategy

    def _within_patience(self) -> AbstractContextManager[None]:
        """Limit the time of a strategy's decision while inside."""
        return self._watchdog.watching() if self._watchdog else nullcontext()

    def _validate_strategy(self, number: int, strategy: Strategy | None) -> Strategy | None:
        """Validate a strategy; write its period, its waits and its flags to the rules."""
        if strategy is not None:
            check_decides(strategy)
            as_read = self._as_read(strategy)
            refinement = 1 if as_read is strategy else int(self.world.rules.refinement)
            period = checked_period(as_read)
            # If strategies decide in every fine tick, period 1 means every fine tick.
            is_fine = period == 1 and self.world.rules.stride == 1
            self.world.rules.period[number] = period if is_fine else period * refinement
            self.world.rules.holders[number] = bool(strategy.holders)
            if strategy.layer == "charging":
                self.world.rules.watches_chargers[0] = bool(strategy.watches_chargers)
            if strategy.layer == "right_of_way":
                *waits, retries = checked_wait_ranges(as_read)
                longest = refinement * max(waits)
                if longest > MAX_BUSY:
                    raise InputError(
                        f"with refine {refinement} the longest right-of-way wait is {longest:,} ticks; "
                        f"the maximum is {MAX_BUSY:,}"
                    )
                self.world.rules.wait[:] = [*(refinement * wait for wait in waits), retries]
                self.world.rules.steered[0] = int(strategy.steers)
        return strategy

    def _as_read(self, strategy: Strategy) -> Strategy:
        """Return the strategy with its parameters in the ticks of the unrefined scenario.

        A strategy that is not from the scenario is returned as it is: its ticks are those of the run.
        """
        if self.resolved.coarse is not None:
            pairs = zip(self.resolved.choices, self.resolved.coarse.choices, strict=True)
            for (_, fine), (_, coarse) in pairs:
                if strategy.parameters is fine.parameters:
                    return type(strategy)(coarse.parameters)
        return strategy

    def _state(self, strategy: Strategy | None) -> Struct:
        if strategy is None:
            return NO_STATE
        with self._within_patience():
            state = strategy.reset(self.view)
        check_counters(strategy, TASK_SUMS)
        return checked_state(strategy, state, self.view)

    def _start(self) -> Iterator[int]:
        loop, decide_type = _compiled_loop(self.strategies, np.flatnonzero(self._used).tolist())
        parts = self._loop_parts(decide_type)
        self.parts = parts
        ticks: Iterator[int] = loop(*parts.structs, parts.memories, self._used, *parts.functions)
        return ticks

    def _loop_parts(self, decide_type: Any) -> LoopParts:
        """What the compiled loop runs on; the functions are compiled or loaded."""
        structs = (
            (self.world, self.visible_world, self.view),
            (self.full_batch, self.batch, self._batch_view),
            self.decisions,
            (self.record, self.observation, self._watch),
            self.workspace,
            self._mode,
        )
        mode = self._mode
        for index in np.flatnonzero(mode == loop_kernels.MODE_INTERPRETED):
            self._states[index] = self._states[index].copied()  # strategies may change theirs
        functions = [
            compiled_decide(type(strategy).compiled, decide_type)  # type: ignore[arg-type]
            if strategy is not None and kind == loop_kernels.MODE_COMPILED
            else absent(decide_type)
            for strategy, kind in zip(self.strategies, mode, strict=True)
        ]
        functions += [
            compiled_feature(number) if is_used else absent_feature(number)
            for number, is_used in enumerate(self._used)
        ]
        self._states = [state.stopped_by(self.workspace.stop) for state in self._states]
        # Under a radius a strategy sees only the rows of the robot that it decides for.
        limited = self.world.rules.radius > 0
        visible = [
            state.cleared() if limited and state is not NO_STATE else state
            for state in self._states
        ]
        views = [
            state.writable_view() if kind == loop_kernels.MODE_INTERPRETED else state
            for state, kind in zip(visible, mode, strict=True)
        ]
        memories = [
            NO_MEMORY
            if view is NO_STATE
            else Memory(
                address=registered_address(view),
                rows=state_rows(*pair) if limited else NO_STATE_ROWS,
            )
            for view, *pair in zip(views, self._states, visible, strict=True)
        ]
        if loop_kernels.MODE_INTERPRETED in mode:
            self._decisions_view = self.decisions.writable_view()
            self._memory_views = [memory.writable_view() for memory in memories]
            # With the JIT off, kernels write to the arrays that Python sees.
            self._workspace_view = (
                self.workspace.for_kernels_only() if jit_is_on() else self.workspace
            )
        return LoopParts(structs, tuple(memories), functions, visible, views)

    @property
    def states(self) -> list[Any]:
        """The state of each strategy by number, a struct of its own class."""
        return self._states

    @property
    def visible_states(self) -> list[Struct]:
        """The state of each strategy as it sees it in a call: under a radius, of one robot alone."""
        return self.parts.visible

    def arguments(self, number: int) -> tuple[Any, ...]:
        """The arguments with which a Python strategy, by its number, is called."""
        memory, space = self._memory_views[number], self._workspace_view
        return self.view, self._batch_view, self._decisions_view, memory, space

    @property
    def counted(self) -> dict[str, int]:
        """Totals over all robots of the counters that strategies keep (`Strategy.counters`)."""
        found: dict[str, int] = {}
        for strategy, state in zip(self.strategies, self._states, strict=True):
            for name, field in strategy.counters.items() if strategy else ():
                found[name] = found.get(name, 0) + int(attrgetter(field)(state).sum())
        return found

    @property
    def tick(self) -> int:
        """Ticks executed so far."""
        return int(self.world.clock.tick)

    @property
    def finished(self) -> bool:
        """Whether the scenario's stop condition holds."""
        return bool(self.world.clock.finished)

    def run(self, until: int | None = None) -> None:
        """Run to the stop condition, to tick `until`, or to the scenario's `stop.max_duration`.

        Ctrl-C, SIGTERM and `interrupt` end the run at once, even in mid-tick, with KeyboardInterrupt.
        The simulation cannot be run any more; the recording is complete up to the tick before.
        """
        limit = self.resolved.scenario.stop.max_duration
        limit = limit if until is None else min(until, limit)
        # With the JIT off, NumPy warns where hashes wrap.
        with interruptible(self.workspace.stop), np.errstate(over="ignore"), self._constants_kept():
            try:
                self._run_to(limit)
            except KeyboardInterrupt:
                if self.on_record:
                    self.on_record(self)  # writes the ticks before this one
                raise

    def _run_to(self, limit: int) -> None:
        self.world.clock.stop_tick = self._next_pause(limit)
        for event in self._ticks:
            if event == loop_kernels.LOOP_GIVEN_UP:
                if self.workspace.stop[0] == STOP_NO_ROOM:
                    raise no_room(self.world, [self.workspace, *self._states])
                give_up()
            if event != loop_kernels.LOOP_PAUSED:
                self._decide(event)
                continue
            if self.on_record:
                self.on_record(self)
            if self.on_observe:
                self.on_observe(self)
            if self.finished or self.world.clock.tick >= limit:
                return
            self.world.clock.stop_tick = self._next_pause(limit)

    @contextmanager
    def _constants_kept(self) -> Iterator[None]:
        """Restore constants that other runs share if a Python strategy overwrote them inside.

        Raises InputError in this case.
        """
        in_python = [
            f"the {layer.replace('_', '-')} strategy '{choice.name}'"
            for (layer, choice), strategy in zip(
                self.resolved.choices, self.strategies, strict=False
            )
            if strategy is not None and type(strategy).compiled is None
        ]
        constants = constants_of(self.world) if in_python else []
        written = []
        try:
            yield
        finally:
            for name, array, value in constants:
                if not np.array_equal(array, value):
                    window(array, writable=True)[...] = value
                    written.append(name)
        if written:
            who = " or ".join(in_python)
            raise InputError(f"{who} has written to {written[0]} of the world")

    def _next_pause(self, limit: int) -> int:
        """The tick of the next pause; a recording pauses at each keyframe."""
        if self.on_record is None:
            return limit
        return min(limit, (self.tick // KEYFRAME_TICKS + 1) * KEYFRAME_TICKS)

    def interrupt(self) -> None:
        """Make `run`, in another thread, raise KeyboardInterrupt as soon as possible."""
        self.workspace.stop[0] = 1

    def update_finished(self) -> None:
        """Evaluate the stop condition again after the state or the rules were replaced."""
        self.world.clock.finished = self.tick > 0 and loop_kernels.is_finished(self.world)

    def empty_record(self) -> None:
        """Empty the recording buffers; `on_record` calls this after copying them."""
        clock = self.world.clock
        clock.recorded_ticks = clock.change_rows = clock.decision_words = 0

    def empty_observation(self) -> None:
        """Empty the observation buffers; `on_observe` calls this after copying them."""
        self.observation.count[:] = 0

    def _decide(self, number: int) -> None:
        strategy = self.strategies[number]
        assert strategy is not None
        self.python_decisions += 1
        checked = (
            self.python_decisions <= ALWAYS_CHECKED or self.python_decisions % CHECKED_EVERY == 0
        )
        before = (self.digests(), self.world.clock.copy()) if checked else None
        with self._within_patience():
            strategy.decide(*self.arguments(number))
        changed = self._changed_since(*before) if before else ()
        if changed:
            raise PermissionError(f"it has written to {changed[0]} of the world")

    def _changed_since(self, digests: Array, clock: Clock) -> Sequence[str]:
        """Names of arrays of the state that have changed since these digests, else of the clock."""
        arrays = [DIGEST_NAMES[k] for k in np.flatnonzero(self.digests() != digests)]
        return arrays or ([] if np.array_equal(self.world.clock, clock) else ["the clock"])

    def digests(self) -> Array:
        """(D,) uint64: the digest of each array of the state, named by DIGEST_NAMES."""
        out = np.zeros(len(DIGEST_NAMES), np.uint64)
        with np.errstate(over="ignore"):
            digest_world(self.world, out)
        return out

    @property
    def digest(self) -> str:
        """The digest of the whole state, 16 hex digits."""
        with np.errstate(over="ignore"):
            return f"{int(combine(self.digests())):016x}"

    def picture(self, theme: Theme = "light", follow: int = NIL) -> FloorPicture:
        """Draw the floor and its robots now; `follow`: number of a robot to mark. Raises InputError.

        The picture distinguishes waiting from driving robots only if the run is observed (`on_observe`).
        """
        return floor_picture(self.resolved, self.world, self.observation, theme, follow)

    def _repr_html_(self) -> str:
        """Show the floor in a notebook."""
        return self.picture()._repr_html_()


def mode_of(strategy: Strategy | None) -> int:
    """Return how a strategy decides: compiled, interpreted, or absent."""
    if strategy is None:
        return loop_kernels.MODE_ABSENT
    is_compiled = type(strategy).compiled is not None
    return loop_kernels.MODE_COMPILED if is_compiled else loop_kernels.MODE_INTERPRETED


def compile_strategy(kind: type[Strategy]) -> None:
    """Compile a strategy's decision kernel; a loop must exist already. Raises InputError."""
    if kind.compiled is not None:
        compiled_decide(kind.compiled, _LOOPS["loop"][1])


def constants_of(world: World) -> list[tuple[str, Array, Array]]:
    """Name, array and a copy of the value of every constant of a world (`grid` and `rules`)."""
    return [
        (f"{group}.{name}", array, array.copy())
        for group in ("grid", "rules")
        for name, _, array in getattr(world, group).arrays()
    ]


_LOOPS: dict[str, Any] = {}


def _compiled_loop(
    strategies: Sequence[Strategy | None], features: Sequence[int]
) -> tuple[Any, Any]:
    """The loop, compiled or loaded once per process because all worlds have the same types."""
    if "loop" not in _LOOPS:
        kinds = [type(strategy) for strategy in strategies if strategy is not None]
        with first_compilation_announced(), compiled_side_by_side(kinds, features):
            _LOOPS["loop"] = loop_kernels.compile_loop()  # type: ignore[no-untyped-call]
        COMPILING.finish(loop_kernels.ticks)
        garbage.resume()
    found: tuple[Any, Any] = _LOOPS["loop"]
    return found


def no_room(world: World, structs: Iterable[Struct]) -> InputError:
    """The error for the first distance tables among these structs that have run out of room."""
    tables = next(one for one in tables_in(structs) if one.status.refused)
    robots, size = len(world.robots.cell), BYTES_PER_WORD * int(tables.status.words)
    at_once = max(int(tables.status.rows) - 1, 0)
    return InputError(
        f"tick {world.clock.tick} needs more distance tables than fit in world.distance_tables "
        f"({memory(world.rules.table_bytes)}), which holds {count(at_once, 'table')} of {memory(size)}; "
        f"set it to {memory((robots + 1) * size)} to hold one table for each of "
        f"{count(robots, 'robot')}"
    )


def tables_in(structs: Iterable[Struct]) -> Iterator[DistanceTables]:
    """The distance tables in these structs and in the structs nested in them."""
    for one in structs:
        if isinstance(one, DistanceTables):
            yield one
        else:
            parts = (getattr(one, name) for name in one._fields)
            yield from tables_in(part for part in parts if isinstance(part, Struct))


def empty_floor(resolved: Resolved) -> FloorPicture:
    """The floor of a scenario without robots and loads."""
    return FloorPicture(drawn_floor(resolved), empty_moment(), resolved.scenario.name)


def floor_picture(
    resolved: Resolved, world: Any, observation: Any, theme: Theme, follow: int
) -> FloorPicture:
    """Draw a world; `follow`: number of the robot to mark, or NIL. Raises InputError."""
    robots = resolved.scenario.fleet.robots
    if theme not in THEMES:
        raise InputError(f"unknown theme {theme!r}: allowed are {alternatives(THEMES)}")
    if not NIL <= follow < robots:
        raise InputError(f"there is no robot {follow}: the last one is robot {robots - 1}")
    floor = drawn_floor(resolved)
    moment = moment_of(floor, world, observation)
    done, asked = done_count(world.orders, world.lines), asked_count(world)
    caption = (
        f"{resolved.scenario.name}, {count(robots, 'robot')}: tick {moment.tick:,}, "
        f"{done:,} of {count(asked, 'order')} done"
    )
    return FloorPicture(floor, moment, caption, theme, follow)
