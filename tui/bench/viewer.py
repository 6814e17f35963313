"""The viewer's figures: bytes and frames, CPU, keys, a slow link, the first picture.

Every sample starts the viewer in a pseudo-terminal of 200x60 and looks at what comes out of it.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from automaton.bench.measurement import SECONDS, Measurement, Sample
from automaton.scenario.resolve import resolve
from automaton.world.cells import TURNTABLE
from tui.bench.session import Session, quantile
from tui.render.glyphs import UNICODE
from tui.terminal_host import Link, TerminalHost

BYTES: Final = "bytes per frame"
SHARE: Final = "% of a core"
FPS: Final = "frames per second"
MS: Final = "ms"
SLOW: Final = Link(bytes_per_second=125_000, round_trip=0.05)
FRAMES_S: Final = 10.0  # 300 frames of 30 per second
CPU_S: Final = 30.0
PRESSES: Final = 100
LONG: Final = 3  # samples of what takes half a minute each


def measurements() -> list[Measurement]:
    """All of them; some minutes."""
    flat_out = fleet(1000, ticks=None)
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
        measured("delivered when 60 are asked for, 1,000 robots", FPS, delivered),
        measured(
            "key to screen, p50, simulation flat out, pinned", MS, partial(key, flat_out, 0.5)
        ),
        measured(
            "key to screen, p95, simulation flat out, pinned", MS, partial(key, flat_out, 0.95)
        ),
        measured(
            "key to screen, p95, simulation flat out, not pinned",
            MS,
            partial(key, flat_out, 0.95, pinned=False),
        ),
        measured("delivered over 1 Mbit/s and 50 ms, 300 robots, panels", FPS, slow_frames),
        measured("key to screen, p95, over 1 Mbit/s and 50 ms", MS, slow_key),
        measured("largest backlog over 1 Mbit/s, in frames", "frames", slow_backlog),
        Measurement("first complete floor, watch tabletop-1", SECONDS, lambda: first_floor),
    ]


def measured(name: str, unit: str, sample: Sample) -> Measurement:
    return Measurement(name, unit, lambda: sample, warm_up=False, at_most=LONG)


def fleet(robots: int, **more: Any) -> dict[str, Any]:
    """Walkers on a floor that fills the map beside the panels at one column for each cell."""
    return {"width": 140, "height": 54, "robots": robots, **more}


def frame_bytes(walk: dict[str, Any]) -> float:
    """All bytes of a while, the status line's included, by its frames."""
    with Session({**walk, "panels": False}) as session:
        size, frames, _ = session.watch(FRAMES_S)
        return size / frames


def cpu_share() -> float:
    with Session(fleet(1000)) as session:
        begun, before = time.monotonic(), session.cpu()
        time.sleep(CPU_S)
        return 100 * (session.cpu() - before) / (time.monotonic() - begun)


def delivered() -> float:
    with Session(fleet(1000, fps=60)) as session:
        _, frames, seconds = session.watch(FRAMES_S)
        return frames / seconds


def key(walk: dict[str, Any], share: float, pinned: bool = True) -> float:
    with unpinned_afterwards(), Session(walk) as session:
        if pinned:
            session.pin()
        return 1000 * quantile(session.key_latencies(PRESSES), share)


def slow_frames() -> float:
    with Session(fleet(300), SLOW) as session:
        _, frames, seconds = session.watch(FRAMES_S)
        return frames / seconds


def slow_key() -> float:
    with Session(fleet(300), SLOW) as session:
        return 1000 * quantile(session.key_latencies(PRESSES), 0.95)


def slow_backlog() -> float:
    with Session(fleet(300), SLOW) as session:
        session.host.max_backlog = 0
        size, frames, _ = session.watch(FRAMES_S)
        return session.host.max_backlog * frames / size


class unpinned_afterwards:
    """This process may use all its cores again."""

    def __enter__(self) -> None:
        self._cores = os.sched_getaffinity(0)

    def __exit__(self, *error: object) -> None:
        os.sched_setaffinity(0, self._cores)


def first_floor() -> float:
    """Seconds from the command to a picture with all turntables of the floor."""
    plan = resolve("tabletop-1").plan
    count = int((plan.kind == TURNTABLE).sum())
    sign = UNICODE.characters[UNICODE.turntable].encode()
    with tempfile.TemporaryDirectory(prefix="automaton-bench-") as state:
        command = [sys.executable, "-m", "automaton", "watch", "tabletop-1", "--no-record"]
        environ = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        environ["XDG_STATE_HOME"] = state
        begun = time.monotonic()
        with TerminalHost(command, environ=environ) as host:
            seen: Callable[[], bool] = lambda: host.output().count(sign) >= count  # noqa: E731
            host.wait_for(seen, "the floor")
            total = 0
            for event in host.history:
                total += getattr(event, "data", b"").count(sign)
                if total >= count:
                    return event.at - begun
    raise RuntimeError("the floor was not seen")
