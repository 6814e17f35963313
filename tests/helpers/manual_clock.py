"""A player on a clock that the test turns, instead of a thread of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from automaton.history.live_run import LiveRun
from automaton.history.watched_run import ReplayedRun, WatchedRun
from automaton.recording.recording_reader import read_recording
from automaton.world.resolve import resolve
from tui.playback.playback_state import PlaybackState
from tui.playback.player import IDLE_S, Player

FLEET = ("fleet.robots=4",)


def live(*settings: str, name: str = "tabletop-1", path: Path | None = None) -> LiveRun:
    return LiveRun(resolve(name, settings), 7, path)


class ManualClock:
    """Stands in for the time module and for the player's condition: waiting passes time."""

    def __init__(self) -> None:
        self.now = 100.0
        self.waits: list[float] = []
        self.hooks: list[Callable[[], None]] = []

    def monotonic(self) -> float:
        self.now += 1e-6  # looking at a clock takes time
        return self.now

    def wait(self, pause: float) -> None:
        assert pause > 0, "a wait that does not wait"
        self.waits.append(pause)
        self.now += pause

    def notify(self) -> None:
        pass

    def __enter__(self) -> ManualClock:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class ManualPlayer(Player):
    """A player whose loop the test turns."""

    clock: ManualClock
    loops = 0

    def turn(self, times: int = 1) -> PlaybackState:
        self._carry_on(times)
        return self.latest()

    def _carry_on(self, times: int) -> None:
        for _ in range(times):
            self.loops = 0
            self._alive = True
            self._run_thread()

    def settle(self, most: int = 3000) -> PlaybackState:
        """Turn until it waits for the next order."""
        for _ in range(most):
            waited = len(self.clock.waits)
            self.turn()
            if self.clock.waits[waited:] == [IDLE_S]:
                return self.latest()
        raise AssertionError("it never comes to rest")

    def _wait_for_request(self, busy: bool) -> None:
        super()._wait_for_request(busy)
        self._alive = False


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> ManualClock:
    clock = ManualClock()
    monkeypatch.setattr("tui.playback.player.time", clock)
    return clock


def manual_player(clock: ManualClock, *runs: WatchedRun) -> ManualPlayer:
    player = ManualPlayer(runs or [live(*FLEET)], start=False)
    player.clock = clock
    player._wake = clock  # type: ignore[assignment]
    return player


def recorded(folder: Path, ticks: int, *settings: str) -> ReplayedRun:
    path = folder / f"{ticks}.rec"
    run = live(*FLEET, f"stop.max_duration={ticks}", *settings, path=path)
    run.show(ticks, 99)
    run.close()
    return ReplayedRun(read_recording(path))
