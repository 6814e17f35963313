"""However long a run gets, what is kept of it stays within bounds, and says where it begins."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from manual_clock import FLEET, ManualClock, clock, live, manual_player

from automaton.engine.observation import DELIVERED_ORDERS, EVENT_DEADLOCK, EVENT_ORDER_TAKEN
from automaton.errors import InputError
from automaton.history.event_history import (
    AppendLog,
    Curve,
    DownsampledSeries,
    EventHistory,
)
from automaton.history.live_run import FrameStore, LiveRecorder, LiveRun, branch_of
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_HEADER,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
)
from automaton.recording.frames import FRAME
from automaton.recording.recording_reader import read_recording

__all__ = ["clock"]


# Events and metrics


@given(sizes=st.lists(st.integers(0, 40), max_size=40), most=st.integers(2, 60))
def test_of_too_many_rows_the_oldest_go(sizes: list[int], most: int) -> None:
    growing, whole = AppendLog(2, most), np.zeros((0, 2), np.int32)
    for size in sizes:
        fresh = np.arange(2 * size, dtype=np.int32).reshape(-1, 2) + len(whole)
        before = growing.log
        kept = before.rows.copy()
        growing.append(fresh)
        whole = np.concatenate((whole, fresh))
        log = growing.log
        assert np.array_equal(log.rows, whole[log.dropped :])
        assert np.array_equal(before.rows, kept), "a reader has seen a row change"
        assert len(log.rows) <= max(most, 1024)
        assert log.dropped == 0 or len(log.rows) >= min(most // 2, len(whole))


@given(sizes=st.lists(st.integers(0, 50), max_size=30), most=st.integers(2, 20))
def test_a_curve_keeps_every_power_of_two(sizes: list[int], most: int) -> None:
    thinning, ticks = DownsampledSeries(3, most), 0
    for size in sizes:
        last = np.arange(ticks + 1, ticks + size + 1, dtype=np.int32)
        thinning.append(np.stack((last, last, 7 * last), axis=1))
        ticks += size
        curve = thinning.curve
        assert curve.ticks == ticks and len(curve.rows) <= most
        assert curve.every == 1 or len(curve.rows) >= most // 2
        assert curve.rows[:, 0].tolist() == list(range(curve.every, ticks + 1, curve.every))
        asked = np.arange(ticks + 5)
        told = curve.at(asked, 2)
        assert np.array_equal(told, 7 * (np.minimum(asked, ticks) // curve.every * curve.every))
        assert np.array_equal(
            curve.until(ticks // 2).at(asked[: ticks // 2], 2), told[: ticks // 2]
        )


def test_a_curve_without_rows_is_zero() -> None:
    assert Curve(np.zeros((0, 3), np.int32), 1, 0).at(np.arange(3), 0).tolist() == [0, 0, 0]


def test_a_chronicle_of_a_very_long_run_is_small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("automaton.history.event_history.MAX_EVENTS", 2000)
    monkeypatch.setattr("automaton.history.event_history.MAX_TICKS_KEPT", 50)
    monkeypatch.setattr("automaton.history.event_history.MAX_CURVE_ROWS", 256)
    event_history = EventHistory()
    for first in range(1, 100_000, 1000):
        event_history(observed(first, 1000))
    log, curve = event_history.log, event_history.curve
    assert event_history.known == 100_000 == curve.ticks
    assert len(log.rows) <= 2000 and len(log.rows) + log.dropped == 10_000
    assert log.rows[-1, 0] == 99_991 and event_history.index_at(99_981) == len(log.rows) - 1
    assert len(curve.rows) <= 256 and curve.at(np.array([51_200]), DELIVERED_ORDERS) == 512
    assert 25 <= len(event_history.deadlocks) <= 1024 and event_history.deadlocks[-1] == 99_901


def observed(first: int, ticks: int) -> Any:
    """As much of a simulation as a chronicle reads: an event every 10 ticks, some deadlocks."""
    at = np.arange(first, first + ticks)
    events = np.zeros((ticks, 5), np.int64)
    events[:, 0], events[:, 1] = at, np.where(at % 100 == 1, EVENT_DEADLOCK, EVENT_ORDER_TAKEN)
    events = events[at % 10 == 1]
    curve = np.stack((at, at, at // 100), axis=1)
    counts = SimpleNamespace(events=len(events), curve_rows=ticks)
    watch = SimpleNamespace(events=events, curve=curve, count=counts)
    world = SimpleNamespace(clock=SimpleNamespace(tick=first + ticks - 1))
    return SimpleNamespace(observation=watch, world=world, empty_observation=lambda: None)


# Frames


def test_frames_that_are_recorded_are_read_back_from_the_file(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    run, alone = live(*FLEET, path=path), live(*FLEET)
    for one in (run, alone):
        one.show(1200, 99)
        one.recorder.flush()
    store = run.recorder._store
    assert not store._memory and len(store) > 5
    written = read_recording(tmp_path / "run.rec.part").stored().payloads
    for mine, other in zip(run.frames.payloads, written, strict=True):
        assert (mine.kind, mine.tick, mine.data) == (other.kind, other.tick, bytes(other.data))
    run.show(300, 99)
    run.close()
    run.show(200, 99)  # the file has another name now
    path.unlink()
    run.show(100, 99)  # and now none
    alone.show(100, 99)
    assert run.shown.digest == alone.shown.digest


def test_a_file_that_was_cut_meanwhile_is_noticed(tmp_path: Path) -> None:
    run = live(*FLEET, path=tmp_path / "run.rec")
    run.show(900, 99)
    with (tmp_path / "run.rec.part").open("r+b") as file:
        file.truncate(200)
    with pytest.raises(InputError, match=r"run\.rec\.part.* truncated"):
        run.show(300, 99)


def test_a_journal_writes_what_a_recording_needs(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    run = live(*FLEET, "stop.max_duration=2500", path=path)
    run.show(2500, 99)
    run.close()
    recording = read_recording(path)
    kinds = [payload.kind for payload in recording.stored().payloads]
    assert recording.complete and FRAME_KIND_KEYFRAME in kinds and FRAME_KIND_HEADER not in kinds
    sizes = [len(payload.data) + FRAME.size for payload in recording.stored().payloads]
    assert path.stat().st_size > sum(sizes)


def small(budget: int) -> LiveRun:
    """A live run that keeps little of its past."""
    run = live(*FLEET)
    run.recorder._store.budget = budget
    return run


def test_of_a_past_beyond_the_budget_the_beginning_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    for limit in ("KEYFRAME_S", "KEYFRAME_TIME_RATIO"):  # however slow the machine: often
        monkeypatch.setattr(f"automaton.history.watched_run.{limit}", 0)
    run, whole = small(8000), live(*FLEET)
    run.show(1300, 99)
    whole.show(1300, 99)
    store = run.recorder._store
    assert store._bytes <= 8000 and 0 < run.recorder.first <= run.first < 1300
    assert run.keyframes.ticks[0] == run.first
    run.show(1299, 99)  # what is not in a frame yet goes into one, which may cost the oldest
    between = (run.first + 1300) // 2  # where the past begins hangs on how fast it was computed
    for tick in (1299, run.first, run.first + 1, between, 1300):
        assert run.show(tick, 99) == tick == whole.show(tick, 99)
        assert run.shown.digest == whole.shown.digest
    assert run.show(3, 99) == run.first
    with pytest.raises(InputError, match="is no longer stored"):
        run.frames.ticks_with(5)
    branch = branch_of(run, ())  # it is computed again from the beginning
    assert branch.tick == run.first and branch.shown.digest == run.shown.digest


def test_a_budget_leaves_the_last_frame_and_a_state_to_begin_with() -> None:
    run = small(1)
    for tick in range(0, 1200, 50):
        run.show(tick, 99)
    assert run.first >= run.recorder.first > 0
    last = run.tick
    assert run.show(run.first, 99) == run.first and run.show(last, 99) == last


def test_the_player_says_that_a_tick_is_not_kept(clock: ManualClock) -> None:
    run = small(2000)
    player = manual_player(clock, run)
    player.seek(1300)
    assert player.settle().tick == 1300
    player.seek(2)
    playback = player.settle()
    assert (
        playback.tick == run.first > 2
        and f"ticks before {run.first:,} are not kept any more" in playback.error
    )
    player.play(-1)
    playback = player.settle()
    assert playback.tick == run.first and not playback.playing
    player.seek(1300)
    assert player.settle().error == ""


def test_what_memory_need_not_hold_is_not_held() -> None:
    run = live(*FLEET)
    run.show(3000, 99)
    run.recorder.flush()
    kinds = {run.recorder._store.kinds[index] for index in run.recorder._store._memory}
    assert kinds == {FRAME_KIND_TICKS, FRAME_KIND_CONDITIONS}
    assert run.leading_simulation.world.clock.digest_every > 1
    assert isinstance(run.recorder, LiveRecorder) and isinstance(run.recorder._store, FrameStore)
