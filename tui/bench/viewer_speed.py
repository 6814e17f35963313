"""Measurements of the viewer: bytes and frames, CPU, keys, a slow link, seeking, the first picture.

A viewer is started in a pseudo-terminal of 200x60 (tui.bench.fleet_viewer) and timed by the output at
the other end. Several measurements share a session, which takes half a minute.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cache, partial
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Generic, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from automaton.bench.measured_kernels import random_walk
from automaton.bench.measurement import (
    MS,
    Measurement,
    NotMeasuredError,
    S,
    Sample,
    open_floor,
    scene,
    wall_seconds,
)
from automaton.bench.steering_speed import BUSY_CROWD, busy_fleet
from automaton.floor.floor_plan import DIRECTION_VECTORS, FLOOR, TURNTABLE, WALL, make_floor_plan
from automaton.history.live_run import LiveRun
from automaton.history.playback import Keyframes
from automaton.history.snapshot import take_snapshot
from automaton.history.watched_run import ReplayedRun, WatchedRun
from automaton.recording.frames import StoredFrames
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve
from tui.render.styles import (
    COLOUR_CURSOR,
    COLOUR_FLOOR,
    COLOUR_FLOOR_MARK,
    COLOUR_WALL,
    UNICODE,
    Depth,
    Look,
    style,
)
from tui.terminal.terminal_host import FRAME_END, Arrived, TerminalHost, TerminalLink

BYTES: Final = "bytes per frame"
SHARE: Final = "% of a core"
FPS: Final = "frames per second"

SLOW: Final = TerminalLink(bytes_per_second=125_000, round_trip=0.05)

FRAMES_S: Final = 6.0  # 180 frames at 30 per second
CPU_S: Final = 15.0
SEEKS: Final = 200
OPENINGS: Final = 5
OPENING_S: Final = 30.0  # for each

T = TypeVar("T")


def measurements() -> list[Measurement]:
    """All measurements; 5 minutes on an idle machine, at most 10 on a busy one."""
    return [
        *(
            measured(
                f"map only, {robots:,} robots at 1:1",
                BYTES,
                partial(frame_bytes, {**fleet(robots), "width": 198}),
            )
            for robots in (100, 1000)
        ),
        measured(
            "map only, 1,000 robots on 1000 x 1000 cells, all of it",
            BYTES,
            partial(frame_bytes, {**fleet(1000), "width": 1000, "height": 1000}),
        ),
        measured("CPU at 30 frames a second, 1,000 robots, panels", SHARE, cpu_share),
        *delivery(),
        *keys_while_busy("pinned", True),
        *keys_while_busy("not pinned", False),
        *planning_measurements(),
        *over_a_slow_link(),
        measured("seek in a recording of tabletop-1, p95", MS, seek_recorded),
        measured("seek in a live run of 1,000,000 ticks, p95", MS, seek_live),
        Measurement(
            "first complete floor, watch tabletop-1",
            S,
            lambda: first_floor,
            at_least=OPENINGS,
            at_most=OPENINGS,
        ),
    ]


def measured(name: str, unit: str, sample: Sample, most: int = 1) -> Measurement:
    """A measurement of at most `most` samples, including the first."""

    def prepare() -> Sample:
        compile_walkers()
        return sample

    return Measurement(name, unit, prepare, warm_up=False, at_most=most)


@cache
def compile_walkers() -> None:
    """Compile what viewers need, without a time limit, since nothing may be compiled yet."""

    Walk(walkers(20, 10, 5)).show(2, 1.0)


class Together(Generic[T]):
    """Several measurements from the same sessions; each session takes half a minute.

    If a session cannot be measured, all its measurements fail, and no other session is tried.
    """

    def __init__(self, take: Callable[[], T]) -> None:
        self._take = take
        self._taken: list[T] = []
        self._failed: NotMeasuredError | None = None

    def figure(self, name: str, unit: str, of: Callable[[T], float], most: int = 1) -> Measurement:
        """One of the measurements."""
        numbers = itertools.count()

        def sample() -> float:
            number = next(numbers)
            if self._failed is not None:
                raise self._failed
            if number == len(self._taken):
                self._taken.append(self._once())
            return of(self._taken[number])

        return measured(name, unit, sample, most)

    def _once(self) -> T:
        try:
            return self._take()
        except NotMeasuredError as error:
            self._failed = error
            raise


def delivery() -> list[Measurement]:
    """Frames per second when 60 are requested, and the CPU time of each."""
    sessions = Together(delivered)
    return [
        sessions.figure(f"{name} when 60 are asked for, 1,000 robots", unit, itemgetter(at))
        for at, (name, unit) in enumerate((("delivered", FPS), ("CPU of a frame", MS)))
    ]


def keys_while_busy(how: str, pinned: bool) -> list[Measurement]:
    """Key latencies while the simulation runs at full speed in a thread of the same process."""
    sessions = Together(partial(key_latencies, fleet(1000, ticks=None), pinned))
    name = f"simulation flat out, {how}"
    return [
        sessions.figure(f"key to screen, p50, {name}", MS, partial(quantile, share=0.5)),
        sessions.figure(f"key to screen, p95, {name}", MS, partial(quantile, share=0.95)),
    ]


def over_a_slow_link() -> list[Measurement]:
    """Measurements over 1 Mbit/s with a round trip of 50 ms: 300 robots, panels."""
    sessions = Together(slow_session)
    rows = (
        ("delivered over 1 Mbit/s and 50 ms, 300 robots, panels", FPS),
        ("key to screen, p95, over 1 Mbit/s and 50 ms", MS),
        ("largest backlog over 1 Mbit/s and 50 ms", "frames"),
    )
    return [sessions.figure(*row, itemgetter(at)) for at, row in enumerate(rows)]


def fleet(robots: int, **more: Any) -> dict[str, Any]:
    """Walkers on a floor that fills the map beside the panels at one column per cell."""
    return {"width": 140, "height": 54, "robots": robots, **more}


def frame_bytes(walk: dict[str, Any]) -> float:
    """Bytes per frame over FRAMES_S, including the status line."""
    with MeasuredViewer({**walk, "panels": False}) as session:
        size, frames, _ = session.watch(FRAMES_S)
        return size / some(frames)


def some(frames: int) -> int:
    """The number of frames. Raises NotMeasuredError if it is 0."""
    if not frames:
        raise NotMeasuredError(f"no frame within {FRAMES_S:g} s")
    return frames


def cpu_share() -> float:
    with MeasuredViewer(fleet(1000)) as session:
        begun, before = time.monotonic(), session.cpu()
        time.sleep(CPU_S)
        return 100 * (session.cpu() - before) / (time.monotonic() - begun)


def delivered() -> tuple[float, float]:
    """Frames per second, and ms of CPU per frame."""
    with MeasuredViewer(fleet(1000, fps=60)) as session:
        before = session.cpu()
        _, frames, seconds = session.watch(FRAMES_S)
        return frames / seconds, 1000 * (session.cpu() - before) / some(frames)


def key_latencies(walk: dict[str, Any], pinned: bool) -> list[float]:
    """Milliseconds from a key to the screen."""
    with unpinned_afterwards(), MeasuredViewer(walk) as session:
        if pinned:
            session.pin()
        return [1000 * latency for latency in session.key_latencies(PRESSES)]


def slow_session() -> tuple[float, float, float]:
    """Frames per second, ms from a key to the screen, and the maximum of frames queued."""
    with MeasuredViewer(fleet(300), SLOW) as session:
        session.host.max_frames = 0
        _, frames, seconds = session.watch(FRAMES_S)
        latency = 1000 * quantile(session.key_latencies(PRESSES), 0.95)
        return frames / seconds, latency, float(session.host.max_frames)


def seek_recorded() -> float:
    """Milliseconds to a random tick of a complete recording, including the picture's data."""
    with tempfile.TemporaryDirectory(prefix="automaton-bench-") as folder:
        path = Path(folder) / "run.rec"
        live = LiveRun(resolve("tabletop-1"), 1, path)
        live.show(10**9, 99.0)
        live.close()
        run = ReplayedRun(read_recording(path))
        while run.extend():  # as the viewer does while idle
            pass
        return seek(run)


def seek_live() -> float:
    run = LiveRun(resolve("tabletop-mini", ["stop={when: never, max_duration: 1000000}"]), 1)
    run.show(10**9, 99.0)
    return seek(run)


def seek(run: WatchedRun) -> float:
    """Milliseconds to a random tick, 95th percentile."""
    ticks = np.random.default_rng(1).integers(0, run.head + 1, SEEKS)

    def seconds_to(tick: int) -> float:
        def go() -> None:
            run.show(tick, 99.0)
            take_snapshot(run.shown)

        return wall_seconds(go)

    return 1000 * quantile([seconds_to(int(tick)) for tick in ticks], 0.95)


class unpinned_afterwards:
    """Afterwards, let this process use all its cores again."""

    def __enter__(self) -> None:
        self._cores = os.sched_getaffinity(0)

    def __exit__(self, *error: object) -> None:
        os.sched_setaffinity(0, self._cores)


def first_floor() -> float:
    """Seconds from the command to a picture that shows all turntables of the floor."""
    floor_plan = resolve("tabletop-1").floor_plan
    count = int((floor_plan.kind == TURNTABLE).sum())
    sign = UNICODE.characters[UNICODE.turntable].encode()
    with tempfile.TemporaryDirectory(prefix="automaton-bench-") as state:
        command = [sys.executable, "-m", "automaton", "watch", "tabletop-1", "--no-record"]
        environ = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        environ["XDG_STATE_HOME"] = environ["XDG_CONFIG_HOME"] = state
        begun = time.monotonic()
        with TerminalHost(command, environ=environ) as host:
            seen: Callable[[], bool] = lambda: host.output().count(sign) >= count  # noqa: E731
            try:
                host.wait_for(seen, "the floor", OPENING_S)
            except TimeoutError as error:
                raise NotMeasuredError(f"no floor was seen within {OPENING_S:g} s") from error
            total = 0
            for event in host.history:
                total += getattr(event, "data", b"").count(sign)
                if total >= count:
                    return event.at - begun
    raise NotMeasuredError("the floor was not seen whole")


# 10,000 robots that plan with `pibt`, live at full speed.
#
# The aisles are one-way, and every robot always has an order of two stops. Distance tables are
# computed on demand, most of them in the first ticks, which are not measured.

PLANNING_ROBOTS: Final = 10_000
FIRST_TICK: Final = 200
STARTED_S: Final = 60.0  # then measure, even if a busy machine has not reached FIRST_TICK
WATCHED_S: Final = 15.0
PRESSES: Final = 100


class Watched(NamedTuple):
    """Results of one session."""

    rate: float  # ticks per second
    cpu: float  # ms per tick in the thread that computes the fleet,
    cpu_screen: float  # and in all others
    median: float  # ms from a key to the screen
    late: float  # 95th percentile of these


def planning_measurements() -> list[Measurement]:
    """All results of one session, which takes some minutes."""
    sessions = Together(watch_planners)
    rows = (
        ("ticks per second", "1/s"),
        ("CPU of a tick", "ms"),
        ("CPU of the screen per tick", "ms"),
        ("key to screen, p50", MS),
        ("key to screen, p95", MS),
    )
    return [
        sessions.figure(f"{name}, 10,000 robots that plan", unit, itemgetter(at), most=1)
        for at, (name, unit) in enumerate(rows)
    ]


def compile_planners() -> None:
    """Compile what the viewer needs, without a time limit: nothing may be compiled yet."""
    run = LiveRun(resolve(busy_fleet("pibt", BUSY_CROWD._replace(robots=PLANNING_ROBOTS))), 1)
    run.close()


def watch_planners() -> Watched:
    """Let the fleet spread out, watch it for WATCHED_S, then press keys."""
    fleet = {"right_of_way": "pibt", "robots": PLANNING_ROBOTS, "ticks": None}
    compile_planners()
    with MeasuredViewer(fleet) as session:
        with contextlib.suppress(TimeoutError):
            session.host.wait_for(lambda: session.tick >= FIRST_TICK, "the first ticks", STARTED_S)
        if session.tick == 0:
            raise NotMeasuredError(f"no tick of 10,000 robots within {STARTED_S:g} s")
        begun, before = time.monotonic(), session.tick
        computing, screen = session.cpu_of_simulation(), session.cpu()
        time.sleep(WATCHED_S)
        ticks, seconds = session.tick - before, time.monotonic() - begun
        computing, screen = session.cpu_of_simulation() - computing, session.cpu() - screen
        latencies = [1000 * latency for latency in session.key_latencies(PRESSES)]
        return Watched(
            ticks / seconds,
            1000 * computing / max(1, ticks),
            1000 * screen / max(1, ticks),
            quantile(latencies, 0.5),
            quantile(latencies, 0.95),
        )


# A session.


BUILDING_S = 120.0  # until there is a fleet, already compiled
SETTLE_S = 3.0  # for imports, the last garbage collection, the first link figures
ESCAPE = "\x1b[27u"
KEY_S = 10.0  # a key without a visible effect by then counts as this latency
KEYS_S = 40.0  # for all keys of a session; a busy machine handles fewer
HERTZ = os.sysconf("SC_CLK_TCK")


class MeasuredViewer:
    """A viewer session on a fleet (`tui.bench.fleet_viewer`)."""

    def __init__(
        self,
        fleet: dict[str, Any],
        link: TerminalLink | None = None,
        columns: int = 200,
        rows: int = 60,
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
        self._notes = Path(self._folder.name) / "notes"
        command = [sys.executable, "-m", "tui.bench.fleet_viewer"]
        command.append(json.dumps({**fleet, "notes": str(self._notes)}))
        environ = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        for name in ("NO_COLOR", "LINES", "COLUMNS"):
            environ.pop(name, None)
        self.host = TerminalHost(command, rows=rows, columns=columns, environ=environ, link=link)

    def __enter__(self) -> Self:
        try:
            self.host.wait_for(self._notes.exists, "a fleet", BUILDING_S)
        except TimeoutError as error:
            self.__exit__(type(error), error, error.__traceback__)
            raise NotMeasuredError(f"no viewer with a fleet within {BUILDING_S:g} s") from error
        time.sleep(SETTLE_S)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.host.close()
        self._folder.cleanup()

    @property
    def simulating(self) -> int:
        """Native id of the thread that computes the fleet."""
        return int(self._notes.read_text().split()[0])

    @property
    def tick(self) -> int:
        """The shown tick, at most NOTES_S old."""
        return int(self._notes.read_text().split()[1])

    def threads(self) -> list[int]:
        """All threads of the viewer's process."""
        return [int(name) for name in os.listdir(f"/proc/{self.host.process.pid}/task")]

    def cpu(self) -> float:
        """Seconds of CPU used by the viewer without its simulation."""
        return sum(self._cpu_of(one) for one in self.threads() if one != self.simulating)

    def cpu_of_simulation(self) -> float:
        """Seconds of CPU used by the thread that computes the fleet."""
        return self._cpu_of(self.simulating)

    def _cpu_of(self, thread: int) -> float:
        stat = Path(f"/proc/{self.host.process.pid}/task/{thread}/stat").read_text()
        values = stat.rpartition(")")[2].split()
        return (int(values[11]) + int(values[12])) / HERTZ

    def pin(self) -> None:
        """Pin the viewer to the first core, its simulation and this process to the second."""
        cores = sorted(os.sched_getaffinity(0))
        if len(cores) < 2:
            return
        for thread in self.threads():
            own = cores[1] if thread == self.simulating else cores[0]
            os.sched_setaffinity(thread, {own})
        os.sched_setaffinity(0, {cores[1]})

    def watch(self, seconds: float) -> tuple[int, int, float]:
        """(bytes, frames, seconds) from now on."""
        begun, before = time.monotonic(), self.host.output()
        time.sleep(seconds)
        data = self.host.output()[len(before) :]
        return len(data), data.count(FRAME_END), time.monotonic() - begun

    def key_latencies(self, presses: int) -> list[float]:
        """Seconds from a key to the change of a cell: the wall in the middle gets the cursor.

        Every other key removes the cursor again, and the next key waits until it has vanished: if
        both came between two frames, neither would be visible. After KEYS_S seconds the rest is
        skipped. Raises NotMeasuredError if the viewer ends.
        """
        cursor, wall = cursor_colour(), wall_style()
        latencies: list[float] = []
        begun = time.monotonic()
        for number in range(presses):
            if latencies and time.monotonic() - begun > KEYS_S:
                break
            time.sleep(0.15)
            if number % 2 == 0:
                latencies.append(self._latency("i", lambda frame: cursor in frame))
            else:
                gone = lambda frame: wall in frame and cursor not in frame  # noqa: E731
                latencies.append(self._latency(ESCAPE, gone))
        return latencies

    def _latency(self, key: str, shows: Callable[[bytes], bool]) -> float:
        """Seconds until a frame shows the key's effect, at most KEY_S."""
        begin, pressed = len(self.host.history), time.monotonic()
        self.host.send(key)
        with contextlib.suppress(TimeoutError):
            self.host.wait_for(lambda: self._shown_at(begin, shows) is not None, key, KEY_S)
        if self.host.process.poll() is not None:
            raise NotMeasuredError("the viewer has ended")
        shown = self._shown_at(begin, shows)
        return KEY_S if shown is None else shown - pressed

    def _shown_at(self, begin: int, shows: Callable[[bytes], bool]) -> float | None:
        """The time at which such a frame had arrived completely; None: not yet."""
        rest = b""
        for event in self.host.history[begin:]:
            if isinstance(event, Arrived):
                *frames, rest = (rest + event.data).split(FRAME_END)
                if any(map(shows, frames)):
                    return event.at
        return None


def cursor_colour() -> bytes:
    """The colour of a selected cell, as it is sent; in half blocks it is a foreground."""
    look = Look(Depth.TRUE, "dark")
    background = look.css(int(style(COLOUR_FLOOR_MARK, COLOUR_CURSOR)))[1].lstrip("#")
    red, green, blue = (int(background[k : k + 2], 16) for k in (0, 2, 4))
    return f"8;2;{red};{green};{blue}".encode()


def wall_style() -> bytes:
    """The sequence of a wall, which is written again only where a cursor was."""
    return Look(Depth.TRUE, "dark").sgr(int(style(COLOUR_WALL, COLOUR_FLOOR))).encode()


def quantile(values: Sequence[float], share: float) -> float:
    """The quantile of the values at this share."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


# A run without end or decisions, to watch: the random-walk fleet of the bare step.


class Walk(WatchedRun):
    """Every robot tries a random move in every tick. The run keeps no past."""

    def __init__(self, resolved: Resolved) -> None:
        super().__init__({}, StoredFrames([]), resolved)
        self._walkers = Simulation(resolved, on_observe=self.event_history)
        self._walkers.world.robots.parked[:] = 0
        self._keyframes = Keyframes(self._walkers.world, self._walkers.observation, budget=0)

    @property
    def live(self) -> bool:
        return True

    @property
    def leading_simulation(self) -> Simulation:
        return self._walkers

    @property
    def head(self) -> int:
        return self._walkers.tick

    @property
    def end(self) -> int | None:
        return None

    @property
    def keyframes(self) -> Keyframes:
        return self._keyframes

    def _compute(self, until: int) -> None:
        world = self._walkers.world
        random_walk(world, self._walkers.tick + 1, until + 1)
        world.clock.tick = until


def walkers(width: int, height: int, robots: int) -> Resolved:
    """An open floor with robots, and a pillar in the middle where a cursor is visible."""
    free = open_floor(width, height)
    kind, leave = free.kind.copy(), free.exits.copy()
    # Two rows, since a wall surrounded by walls is not drawn.
    rows, columns = slice(height // 2, height // 2 + 2), slice(width // 2 - 1, width // 2 + 4)
    kind[rows, columns], leave[rows, columns] = WALL, 0
    leave &= exits_into(kind == FLOOR)
    return scene(make_floor_plan(kind, leave), robots)


def exits_into(drivable: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(h, w) the exits that lead to a drivable cell."""
    exits = np.zeros(drivable.shape, np.uint8)
    for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
        exits |= np.roll(drivable, (-dy, -dx), (0, 1)).astype(np.uint8) << np.uint8(direction)
    return exits
