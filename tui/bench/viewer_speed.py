"""The viewer's figures: bytes and frames, CPU, keys, a slow link, seeking, the first picture.

Every sample starts the viewer in a pseudo-terminal of 200x60 and looks at what comes out of it.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

import numpy as np

from automaton.bench.measurement import MS, SECONDS, Measurement, NotMeasuredError, wall_seconds
from automaton.floor.cells import TURNTABLE
from automaton.history.live_run import LiveRun
from automaton.history.snapshot import take_snapshot
from automaton.history.watched_run import RecordedRun, Run
from automaton.recording.recording_reader import read_recording
from automaton.world.resolve import resolve
from tui.bench import planning_speed
from tui.bench.viewer_measurement import Together, measured
from tui.bench.viewer_session import Session, quantile
from tui.render.glyphs import UNICODE
from tui.terminal.terminal_host import Link, TerminalHost

BYTES: Final = "bytes per frame"
SHARE: Final = "% of a core"
FPS: Final = "frames per second"
SLOW: Final = Link(bytes_per_second=125_000, round_trip=0.05)
FRAMES_S: Final = 6.0  # 180 frames of 30 per second
CPU_S: Final = 15.0
PRESSES: Final = 100
SEEKS: Final = 200
OPENINGS: Final = 5
OPENING_S: Final = 30.0  # for each


def measurements() -> list[Measurement]:
    """All of them; five minutes on an idle machine, ten at most on one that is busy."""
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
        *planning_speed.measurements(),
        *over_a_slow_link(),
        measured("seek in a recording of tabletop-1, p95", MS, seek_recorded),
        measured("seek in a live run of 1,000,000 ticks, p95", MS, seek_live),
        Measurement(
            "first complete floor, watch tabletop-1",
            SECONDS,
            lambda: first_floor,
            at_least=OPENINGS,
            at_most=OPENINGS,
        ),
    ]


def delivery() -> list[Measurement]:
    """Frames when 60 a second are asked for, and what each costs."""
    sessions = Together(delivered)
    return [
        sessions.figure(f"{name} when 60 are asked for, 1,000 robots", unit, itemgetter(at))
        for at, (name, unit) in enumerate((("delivered", FPS), ("CPU of a frame", MS)))
    ]


def keys_while_busy(how: str, pinned: bool) -> list[Measurement]:
    """While the simulation runs flat out in a thread of the same process."""
    sessions = Together(partial(key_latencies, fleet(1000, ticks=None), pinned))
    name = f"simulation flat out, {how}"
    return [
        sessions.figure(f"key to screen, p50, {name}", MS, partial(quantile, share=0.5)),
        sessions.figure(f"key to screen, p95, {name}", MS, partial(quantile, share=0.95)),
    ]


def over_a_slow_link() -> list[Measurement]:
    """Over 1 Mbit/s and 50 ms there and back, 300 robots, panels."""
    sessions = Together(slow_session)
    rows = (
        ("delivered over 1 Mbit/s and 50 ms, 300 robots, panels", FPS),
        ("key to screen, p95, over 1 Mbit/s and 50 ms", MS),
        ("largest backlog over 1 Mbit/s and 50 ms", "frames"),
    )
    return [sessions.figure(*row, itemgetter(at)) for at, row in enumerate(rows)]


def fleet(robots: int, **more: Any) -> dict[str, Any]:
    """Walkers on a floor that fills the map beside the panels at one column for each cell."""
    return {"width": 140, "height": 54, "robots": robots, **more}


def frame_bytes(walk: dict[str, Any]) -> float:
    """All bytes of a while, the status line's included, by its frames."""
    with Session({**walk, "panels": False}) as session:
        size, frames, _ = session.watch(FRAMES_S)
        return size / some(frames)


def some(frames: int) -> int:
    """The number of frames. Raises NotMeasuredError where none came."""
    if not frames:
        raise NotMeasuredError(f"no frame within {FRAMES_S:g} s")
    return frames


def cpu_share() -> float:
    with Session(fleet(1000)) as session:
        begun, before = time.monotonic(), session.cpu()
        time.sleep(CPU_S)
        return 100 * (session.cpu() - before) / (time.monotonic() - begun)


def delivered() -> tuple[float, float]:
    """Frames a second, and ms of CPU for each."""
    with Session(fleet(1000, fps=60)) as session:
        before = session.cpu()
        _, frames, seconds = session.watch(FRAMES_S)
        return frames / seconds, 1000 * (session.cpu() - before) / some(frames)


def key_latencies(walk: dict[str, Any], pinned: bool) -> list[float]:
    """ms from a key to the screen."""
    with unpinned_afterwards(), Session(walk) as session:
        if pinned:
            session.pin()
        return [1000 * latency for latency in session.key_latencies(PRESSES)]


def slow_session() -> tuple[float, float, float]:
    """Frames a second, ms of a key, and most frames in front of the link, keys included."""
    with Session(fleet(300), SLOW) as session:
        session.host.max_frames = 0
        _, frames, seconds = session.watch(FRAMES_S)
        latency = 1000 * quantile(session.key_latencies(PRESSES), 0.95)
        return frames / seconds, latency, float(session.host.max_frames)


def seek_recorded() -> float:
    """ms to a tick anywhere in a whole recording, the picture's data included."""
    with tempfile.TemporaryDirectory(prefix="automaton-bench-") as folder:
        path = Path(folder) / "run.rec"
        live = LiveRun(resolve("tabletop-1"), 1, path)
        live.show(10**9, 99.0)
        live.close()
        run = RecordedRun(read_recording(path))
        while run.extend():  # as the viewer does while nothing else is to be done
            pass
        return seek(run)


def seek_live() -> float:
    run = LiveRun(resolve("tabletop-mini", ["stop={when: never, max_duration: 1000000}"]), 1)
    run.show(10**9, 99.0)
    return seek(run)


def seek(run: Run) -> float:
    """ms, p95."""
    ticks = np.random.default_rng(1).integers(0, run.head + 1, SEEKS)

    def seconds_to(tick: int) -> float:
        def go() -> None:
            run.show(tick, 99.0)
            take_snapshot(run.shown)

        return wall_seconds(go)

    return 1000 * quantile([seconds_to(int(tick)) for tick in ticks], 0.95)


class unpinned_afterwards:
    """This process may use all its cores again."""

    def __enter__(self) -> None:
        self._cores = os.sched_getaffinity(0)

    def __exit__(self, *error: object) -> None:
        os.sched_setaffinity(0, self._cores)


def first_floor() -> float:
    """Seconds from the command to a picture with all turntables of the floor."""
    floor_plan = resolve("tabletop-1").floor_plan
    count = int((floor_plan.kind == TURNTABLE).sum())
    sign = UNICODE.characters[UNICODE.turntable].encode()
    with tempfile.TemporaryDirectory(prefix="automaton-bench-") as state:
        command = [sys.executable, "-m", "automaton", "watch", "tabletop-1", "--no-record"]
        environ = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        environ["XDG_STATE_HOME"] = state
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
