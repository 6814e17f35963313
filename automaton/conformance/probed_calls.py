"""A strategy around another one, which watches each of its calls.

Probe           counts calls and robots, and takes the CPU time of each call
WriteProbe      compares everything that the strategy must not change before and after each call
SightProbe      makes each call again with all that the robot may not see replaced by other values,
                and replays the calls of each robot to a new object
GuardProbe      with the JIT off: arrays that refuse negative and too large indices
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from automaton.engine.holders import enter_holders, remove_holders
from automaton.engine.jit.structs import DECISION, SCRATCH, STATIC, Struct, window
from automaton.engine.state import LAYER_NAMES, NIL, Array
from automaton.engine.visibility import is_visible, mask_world
from automaton.strategy.contract import Strategy

REPLAYED_CALLS = 150  # calls of a run that are replayed to a new object
EMPTY_CALLS = 200  # calls without robots, whose time is that of entering compiled code


class CallFault(NamedTuple):
    """What a probe has noticed: the tick, the identity of the robot or NIL, and a sentence."""

    tick: int
    robot: int
    text: str


class Probe(Strategy):
    """Pass every call on to a strategy; count the calls and the robots."""

    def __init__(self, inner: Strategy) -> None:
        super().__init__(inner.parameters)
        self.inner = inner
        self.layer = inner.layer  # type: ignore[misc]
        for name in ("period", "holders", "watches_chargers", "steers"):
            setattr(self, name, getattr(inner, name))
        self.run: Any = None  # the simulation, once it exists
        self.calls = self.decisions = 0
        self.ns: list[tuple[int, int]] = []  # CPU time and robots of each call
        self.breaches: list[CallFault] = []

    def __getattr__(self, name: str) -> Any:
        """Further attributes of the strategy, for which strategies of other layers ask."""
        return getattr(self.__dict__["inner"], name)

    def reset(self, view: Any) -> Struct:
        """The state of the strategy."""
        self.inner.other_layers = self.other_layers
        return self.inner.reset(view)

    def wait_ranges(self) -> Any:
        """The waits of the strategy."""
        return self.inner.wait_ranges()

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        """Pass the call on."""
        self.calls += 1
        self.decisions += int(batch.count)
        self.watched(view, batch, decisions, memory, workspace)

    def watched(self, *arguments: Any) -> None:
        """Make the call, and take its CPU time."""
        begun = time.thread_time_ns()
        call(self.inner, *arguments)
        self.ns.append((time.thread_time_ns() - begun, max(1, int(arguments[1].count))))

    def entering_ns(self, arguments: tuple[Any, ...]) -> int:
        """The time of a call that has no robots: that of entering compiled code from Python."""
        if type(self.inner).compiled is None:
            return 0
        self.run.batch.count = 0
        least = []
        for _ in range(EMPTY_CALLS):
            begun = time.thread_time_ns()
            call(self.inner, *arguments)
            least.append(time.thread_time_ns() - begun)
        return min(least)

    @property
    def own(self) -> Any:
        """The decisions of the layer."""
        return getattr(self.run.decisions, self.layer)

    def note(self, batch: Any, text: str) -> None:
        """Note a breach in the present call."""
        robots = self.run.world.robots
        robot = int(robots.identity[batch.robot[0]]) if batch.count == 1 else NIL
        self.breaches.append(CallFault(self.run.tick, robot, text))


def call(strategy: Strategy, *arguments: Any) -> None:
    """Call a strategy in either form."""
    compiled = type(strategy).compiled
    if compiled is None:
        strategy.decide(*arguments)
    else:
        compiled(*arguments)


class WriteProbe(Probe):
    """Notes what a call has changed beyond its own rows, its state and the workspace."""

    def __init__(self, inner: Strategy) -> None:
        super().__init__(inner)
        self.watched_memory: list[tuple[str, memoryview, int]] = []

    def watched(self, *arguments: Any) -> None:
        """Compare checksums before and after the call."""
        batch = self.run.batch
        self.watched_memory = self.watched_memory or list(self.memory_to_watch())
        rows = int(batch.count)
        before = self.checksums(rows)
        call(self.inner, *arguments)
        for place, value in enumerate(self.checksums(rows)):
            if before[place] != value:
                self.note(batch, f"it has changed {self.watched_memory[place][0]}")
                return

    def checksums(self, rows: int) -> list[int]:
        """Checksums of the watched memory; `rows`: rows of the decisions that belong to the batch."""
        return [zlib.crc32(part[rows * size :]) for _, part, size in self.watched_memory]

    def memory_to_watch(self) -> Iterator[tuple[str, memoryview, int]]:
        """The bytes of each array by name, and the size of a row if the batch owns its first rows.

        Structs never replace their arrays, so that they are listed once a run.
        """
        known = set()
        for name, array, is_by_row in self.arrays_to_watch():
            if array.size and (array.ctypes.data, array.nbytes) not in known:
                known.add((array.ctypes.data, array.nbytes))  # views share arrays with the world
                part = array.reshape(-1).view(np.uint8).data
                yield name, part, array.itemsize if is_by_row else 0

    def arrays_to_watch(self) -> Iterator[tuple[str, Array, bool]]:
        """Name and array of all that a call must not change, and whether the batch owns its rows."""
        run = self.run
        for name, struct in (("view", run.visible_world), ("world", run.world)):
            yield from ((f"{name}.{part}", array, False) for part, _, array in struct.arrays())
        for part, _, array in run.batch.arrays():
            yield f"batch.{part}", array, False
        for layer in LAYER_NAMES:
            for part, declared, array in getattr(run.decisions, layer).arrays():
                if layer != self.layer:
                    yield f"decisions.{layer}.{part}", array, False
                elif declared.role == DECISION and len(declared.extents) == 1:
                    yield f"rows of decisions.{layer}.{part} beyond the batch", array, True
        for strategy, state in zip(run.strategies, run.states, strict=True):
            if strategy is not None and strategy is not self:
                for part, declared, array in state.arrays():
                    if declared.role != SCRATCH:
                        yield f"the state of {strategy.layer}: {part}", array, False


Copies = list[tuple[Array, Array]]  # arrays, and their values at a time


class Call(NamedTuple):
    """A call as it was: what the strategy saw and remembered before, and what it decided."""

    tick: int
    i: int
    saw: Copies
    decided: list[Array]


class SightProbe(Probe):
    """Notes decisions that depend on what a robot may not see, or that another robot has seen."""

    def __init__(self, inner: Strategy) -> None:
        super().__init__(inner)
        self.log: list[Call] = []
        self.arguments: tuple[Any, ...] = ()

    def watched(self, *arguments: Any) -> None:
        """Decide, decide again with other hidden values, and compare."""
        self.arguments = arguments
        batch, i = arguments[1], int(arguments[1].robot[0])
        own, remembered = self.own, copies(arrays_of(self.memory))
        blank = copies(arrays_of(own))
        logs = type(self.inner).compiled is None and len(self.log) < REPLAYED_CALLS
        saw = self.copied_view() + remembered + blank if logs else []
        call(self.inner, *arguments)
        decided, after = copies(arrays_of(own)), copies(arrays_of(self.memory))
        first = self.rows()
        if logs:
            self.log.append(Call(self.run.tick, i, saw, first))
        truth = self.replace_hidden(i)
        if truth is None:
            return
        self.mask(i)
        put_back(remembered + blank)
        call(self.inner, *arguments)
        if not are_equal(first, self.rows()):
            self.note(batch, "decides otherwise when what it may not see is different")
        put_back(truth)
        self.mask(i)
        put_back(decided + after)

    @property
    def memory(self) -> Struct:
        """The state that the strategy sees in a call."""
        state: Struct = self.run.visible_states[LAYER_NAMES.index(self.layer)]
        return state

    def mask(self, i: int) -> None:
        """Make the visible copies again for robot i."""
        run = self.run
        if self.holders:
            remove_holders(run.visible_world)
        mask_world(run.world, run.visible_world, i)
        if self.holders:
            enter_holders(run.visible_world)

    def copied_view(self) -> Copies:
        """All of the visible world that may change, and the batch."""
        parts = [
            array
            for struct in (self.run.visible_world, self.run.batch)
            for _, declared, array in struct.arrays()
            if declared.role != STATIC
        ]
        return copies(array for array in parts if array.flags.writeable)

    def rows(self) -> list[Array]:
        """Copies of the decisions of the one robot that is asked."""
        return [
            array[:1].copy()
            for _, declared, array in self.own.arrays()
            if declared.role == DECISION and declared.extents
        ]

    def replace_hidden(self, i: int) -> Copies | None:
        """Give robots out of sight other values in the true world; None if all are in sight.

        One of them stands in another free cell out of sight. Returns what restores the truth.
        """
        world = self.run.world
        robots, occupancy = world.robots, world.traffic.occupancy
        hidden = [j for j in range(len(robots.cell)) if not is_visible(world, i, j)]
        if not hidden:
            return None
        truth = copies([array for _, declared, array in robots.arrays() if declared.is_per_robot])
        truth += copies([occupancy])
        for name in ("charge", "busy", "route_length", "goal_cell", "order", "load", "priority"):
            array = getattr(robots, name)
            array[hidden] = np.roll(array[hidden], 1)
        robots.charge[hidden] //= 2
        for j in hidden:
            here = int(robots.cell[j])
            if here != NIL and robots.claim[j] == NIL and self.move(i, j, here):
                break
        return truth

    def move(self, i: int, j: int, here: int) -> bool:
        """Put robot j into a free cell out of sight of robot i; returns whether there is one."""
        world = self.run.world
        robots, occupancy = world.robots, world.traffic.occupancy
        held = {int(cell) for cell in (*robots.cell, *robots.claim, *robots.home)}
        for cell in world.grid.drivable.tolist():
            if cell in held or world.grid.cell_flags[cell] != world.grid.cell_flags[here]:
                continue
            robots.cell[j] = cell
            if not is_visible(world, i, j):
                occupancy[[cell, here]] = occupancy[[here, cell]]
                return True
        robots.cell[j] = here
        return False

    def replay(self) -> None:
        """Replay the calls of each robot to an object of its own, after the run."""
        if not self.log:
            return
        identity = self.run.world.robots.identity.copy()
        for robot in sorted({int(identity[one.i]) for one in self.log}):
            fresh = type(self.inner)(self.inner.parameters)
            fresh.other_layers = self.other_layers
            fresh.reset(self.run.view)
            for one in self.log:
                if identity[one.i] != robot:
                    continue
                put_back(one.saw)
                call(fresh, *self.arguments)
                if not are_equal(one.decided, self.rows()):
                    text = "decides otherwise if only the calls about this robot are replayed"
                    self.breaches.append(CallFault(one.tick, robot, text))
                    return


def arrays_of(struct: Struct) -> Iterator[Array]:
    """The arrays of a struct that calls may change."""
    return (array for _, _, array in struct.arrays() if array.flags.writeable and array.size)


def copies(arrays: Any) -> Copies:
    """The arrays with copies of their values."""
    return [(array, array.copy()) for array in arrays]


def put_back(values: Copies) -> None:
    """Write values back into their arrays."""
    for array, value in values:
        window(array, writable=True)[...] = value


def are_equal(some: list[Array], others: list[Array]) -> bool:
    """Whether all arrays are equal."""
    return all(np.array_equal(one, other) for one, other in zip(some, others, strict=True))


# With the JIT off: indices are checked.


class OutsideError(IndexError):
    """An index below 0 or beyond the end."""


class GuardedArray(np.ndarray):
    """An array that refuses indices which compiled code would use unchecked."""

    def __getitem__(self, index: Any) -> Any:
        check_index(index, self.shape)
        return super().__getitem__(index)

    def __setitem__(self, index: Any, value: Any) -> None:
        check_index(index, self.shape)
        super().__setitem__(index, value)


def check_index(index: Any, shape: tuple[int, ...]) -> None:
    """Raises OutsideError if a number in an index is outside."""
    numbers = index if isinstance(index, tuple) else (index,)
    for number, size in zip(numbers, shape, strict=False):
        if isinstance(number, int | np.integer) and not 0 <= number < size:
            raise OutsideError(f"index {number} of an array of {size}")


class GuardedStruct:
    """A struct whose arrays are guarded."""

    def __init__(self, struct: Any) -> None:
        self.__dict__["struct"] = struct

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.__dict__["struct"], name)
        if isinstance(value, Struct):
            return GuardedStruct(value)
        is_plain = type(value) is np.ndarray and value.ndim
        return value.view(GuardedArray) if is_plain else value

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.__dict__["struct"], name, value)


class GuardProbe(Probe):
    """Gives a compiled strategy guarded arrays; kernels must run as Python."""

    def watched(self, *arguments: Any) -> None:
        """Make the call with guarded arguments."""
        call(self.inner, *map(GuardedStruct, arguments))


def guard_states() -> None:
    """Guard the states that strategies look up (`State.of`), for the rest of this process."""
    plain = Struct.of.__func__  # type: ignore[attr-defined]

    def of(cls: Any, memory: Any) -> Any:
        return GuardedStruct(plain(cls, memory))

    Struct.of = classmethod(of)  # type: ignore[assignment, method-assign]
