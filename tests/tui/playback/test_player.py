"""The player: what orders do, in its own thread and on a clock that the test turns."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from manual_clock import FLEET, ManualClock, clock, live, manual_player, recorded

from automaton.history.live_run import LiveRun, branch_of
from automaton.history.watched_run import WatchedRun
from automaton.verification.verification import verify
from tui.playback.playback_state import PlaybackState
from tui.playback.player import IDLE_S, NORMAL_TICKS_PER_S, REWIND, Player
from tui.registration import layer_named, layers
from tui.terminal.options import SPEEDS

__all__ = ["clock"]
FAILING = ("strategy.right_of_way=example_strategies:FailsLater",)


@pytest.fixture
def player() -> Iterator[Player]:
    player = Player([live(*FLEET)])
    yield player
    player.close()


def when(player: Player, holds: Callable[[PlaybackState], Any]) -> PlaybackState:
    """The first shot for which something holds."""
    for _ in range(20_000):
        playback = player.latest()
        if holds(playback):
            return playback
        time.sleep(0.001)
    raise AssertionError(f"it never comes to that: {player.latest()}")


# In its own thread


def test_orders_from_several_threads_are_all_carried_out(player: Player) -> None:
    threads = [
        threading.Thread(target=lambda: [player.step(1) for _ in range(50)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert when(player, lambda playback: playback.tick == 200).playing == 0


def test_it_plays_to_the_end_and_back_at_full_speed(player: Player) -> None:
    player.set_speed(math.inf)
    player.play()
    playback = when(player, lambda playback: playback.end is not None and not playback.playing)
    assert playback.tick == playback.end == playback.head and playback.snapshots[0].finished
    assert playback.seq >= 1 and not playback.error
    player.seek(100)
    when(player, lambda playback: playback.tick == 100)
    player.play(-1)
    assert (
        when(player, lambda playback: not playback.playing and playback.tick == 0).asked == math.inf
    )


def test_a_failing_strategy_is_a_sentence_and_the_past_can_still_be_seen() -> None:
    player = Player([live(*FAILING)])
    player.set_speed(math.inf)
    player.play()
    playback = when(player, lambda playback: playback.error)
    assert "FailsLater' raised ZeroDivisionError: own mistake" in playback.error
    assert playback.tick == playback.head == playback.end == 49 == playback.snapshots[0].tick
    player.seek(10)
    assert when(player, lambda playback: playback.tick == 10).error == ""
    player.play()
    assert when(player, lambda playback: playback.tick == 49 and not playback.playing)
    player.close()


def test_closing_leaves_a_whole_recording(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    player = Player([live(*FLEET, path=path)])
    player.set_speed(math.inf)
    player.play()
    when(player, lambda playback: playback.tick > 300)
    player.close()
    player.close()
    head = player.runs[0].head
    found = verify(path)
    assert found.passed and found.recording.ticks == head and not player._thread.is_alive()


def test_an_order_that_goes_wrong_does_not_end_the_thread(player: Player) -> None:
    def broken(run: WatchedRun) -> WatchedRun:
        raise KeyError("nothing")

    told: list[str] = []
    player.exchange(broken, told.append)
    player._enqueue_request(lambda: 1 // 0)
    assert "ZeroDivisionError" in when(player, lambda playback: playback.error).error
    assert told == ["internal error, KeyError: 'nothing'"]
    player.select(99)
    player.show_layer("no such layer")
    player.seek(30)
    assert when(player, lambda playback: playback.tick == 30).error == ""


def test_a_branch_takes_the_place_of_the_run(player: Player) -> None:
    told: list[str] = []
    player.seek(300)
    when(player, lambda playback: playback.tick == 300)
    player.exchange(lambda run: branch_of(run, ("seed=4",)), told.append)
    player.exchange(lambda run: branch_of(run, ("strategy.right_of_way=wait",)), told.append)
    player.step(10)
    playback = when(player, lambda playback: playback.tick == 310)
    assert "seed cannot change" in told[0] and told[1:] == [""] and playback.head == 310
    run = player.runs[0]
    assert isinstance(run, LiveRun) and run.resolved.strategies["right_of_way"].name == "wait"


# By hand


@pytest.mark.parametrize("speed", SPEEDS[:-1])
def test_ticks_keep_time(speed: float, clock: ManualClock) -> None:
    player = manual_player(clock)
    player.settle()
    player.set_speed(speed)
    player.play()
    player.turn()
    began, first = clock.now, player.latest().tick
    while clock.now < began + 16 / speed:
        player.turn()
    passed = (clock.now - began) * NORMAL_TICKS_PER_S * speed
    assert abs(player._tick - first - passed) <= 2
    assert player.latest().playing == 1 and player.latest().asked == NORMAL_TICKS_PER_S * speed


@pytest.mark.parametrize("speed", [1, 64, math.inf])
def test_backwards_keeps_time_too_but_no_faster_than_it_can(
    speed: float, clock: ManualClock
) -> None:
    player = manual_player(clock)
    player.seek(500)
    player.settle()
    player.set_speed(speed)
    player.play(-1)
    player.turn()
    began = clock.now
    for _ in range(100):
        player.turn()  # it waits in each of them: ManualClock sees to that
    passed = (clock.now - began) * NORMAL_TICKS_PER_S * min(speed, REWIND)
    assert abs(500 - player._tick - passed) <= 2 and player._tick < 500
    assert len(clock.waits) >= 100


def test_a_player_at_rest_does_nothing_but_wait(clock: ManualClock, monkeypatch: Any) -> None:
    player = manual_player(clock)
    seq = player.settle().seq
    monkeypatch.setattr(WatchedRun, "extend", lambda *_: pytest.fail("it computes"))
    clock.waits.clear()
    player.turn(50)
    assert clock.waits == [IDLE_S] * 50 and player.latest().seq == seq


def test_a_recording_is_gone_through_once_while_nothing_is_asked(
    clock: ManualClock, tmp_path: Path
) -> None:
    player = manual_player(clock, recorded(tmp_path, 700))
    playback = player.settle()
    assert (
        playback.tick == 0
        and playback.known == 700 == playback.head == playback.end
        and not playback.live
    )
    clock.waits.clear()
    player.turn(20)
    assert clock.waits == [IDLE_S] * 20 and player.latest().seq == playback.seq


def test_steps_and_seeks(clock: ManualClock) -> None:
    player = manual_player(clock)
    for order, tick in ((5, 5), (-2, 3), (-9, 0), (100, 100), (1, 101)):
        player.step(order)
        assert player.settle().tick == tick
    player.seek(40)
    player.step(2)
    assert player.settle().tick == 42
    player.seek(-5)
    assert player.settle().tick == 0
    player.play()
    player.turn(3)
    player.seek(77)
    playback = player.settle()
    assert playback.tick == 77 and playback.playing == 0 and playback.snapshots[0].tick == 77


def test_a_pause_stops_a_long_way_too(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET, "stop={when: never, max_duration: 1000000000}"))
    player.seek(900_000_000)
    player.turn(3)
    player.pause()
    tick = player.settle().tick
    assert 0 < tick < 900_000_000
    player.turn(5)
    assert player.latest().tick == tick


def test_play_stops_at_both_ends(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET, "stop.max_duration=50"))
    player.set_speed(math.inf)
    player.play()
    playback = player.settle()
    assert (playback.tick, playback.end, playback.playing) == (50, 50, 0)
    player.play(-1)
    playback = player.settle()
    assert (playback.tick, playback.playing, playback.head) == (0, 0, 50)


LAYERS = [
    *("visits", "waiting", "congestion", "flow", "streets", "street-waits"),
    *("difference", "service-zones", "traffic-zones"),
    *("explored", "predicted"),
]
MOVES = ("flow", "streets")  # show the moves out of a cell
COUNTING = ("visits", "waiting", "congestion", "street-waits", "explored", "predicted")


def test_figures_and_layers(clock: ManualClock) -> None:
    player = manual_player(clock)
    player.seek(200)
    player.select(2)
    playback = player.settle()
    assert playback.snapshots[0].selected == 2 and playback.figures[0].tick == 200
    assert len(playback.figures[0].operations) == 4 and (playback.figures[0].active <= 1).all()
    assert list(layers().by_name) == LAYERS
    for layer in ("", *LAYERS):
        player.show_layer(layer)
        snapshot = player.settle().snapshots[0]
        shown = layer_named(layer)
        counts = shown.heat and not shown.arrows and not shown.compares
        assert (snapshot.heat is not None) == counts == (layer in COUNTING)
        assert (snapshot.flow is not None) == (layer in MOVES)
