"""The viewer on 10,000 robots that plan with `pibt`, live and as fast as it goes, in 200x60.

One-way aisles, every robot always has an order of two stops. Distance tables are computed as they are
needed, most of them in the first ticks, which are not measured.
"""

from __future__ import annotations

import contextlib
import time
from operator import itemgetter
from typing import Final, NamedTuple

from automaton.bench.measurement import MS, Measurement, NotMeasuredError
from automaton.bench.steering_speed import CROWD, busy_fleet
from automaton.history.live_run import LiveRun
from automaton.world.resolve import resolve
from tui.bench.viewer_measurement import Together
from tui.bench.viewer_session import Session, quantile

ROBOTS: Final = 10_000
FIRST_TICK: Final = 200
STARTED_S: Final = 60.0  # after these it is measured from the tick that a busy machine has reached
WATCHED_S: Final = 15.0
PRESSES: Final = 100


class Watched(NamedTuple):
    """What one session gives."""

    rate: float  # ticks per second
    cpu: float  # ms per tick of the thread that computes the fleet,
    cpu_screen: float  # and of all others
    median: float  # ms from a key to the screen
    late: float  # the same, p95


def measurements() -> list[Measurement]:
    """All that one session gives; some minutes."""
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
    """Compile what the viewer will need, without a limit of time: it may be the first run here."""
    run = LiveRun(resolve(busy_fleet("pibt", CROWD._replace(robots=ROBOTS))), 1)
    run.close()


def watch_planners() -> Watched:
    """Let the fleet spread, watch it for a while, then press keys."""
    fleet = {"right_of_way": "pibt", "robots": ROBOTS, "ticks": None}
    compile_planners()
    with Session(fleet) as session:
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
