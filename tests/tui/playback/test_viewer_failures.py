"""What the viewer does when something goes wrong around it: files, threads, strategies that hang."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from manual_clock import FLEET, ManualClock, clock, live, manual_player

from automaton.history.live_run import LiveRun, branch_of
from automaton.history.playback import NO_CHANGE, OBJECT_BYTES, Keyframes
from automaton.recording.frames import StoredFrames
from automaton.strategy.api import InputError, Strategy
from tui.playback import player as player_module
from tui.playback.player import Player

__all__ = ["clock"]
ASKED, LET_GO = threading.Event(), threading.Event()


class Hangs(Strategy):
    """Does not answer before it is let go."""

    layer = "right_of_way"
    period = 10

    def decide(self, view: Any, *_: Any) -> None:
        ASKED.set()
        LET_GO.wait(60)


def test_a_shot_brings_the_runs_that_its_snapshots_are_of(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET))
    player.seek(50)
    before = player.settle()
    player.exchange(lambda run: branch_of(run, ("strategy.right_of_way=wait",)), lambda _: None)
    after = player.settle()
    assert before.runs[0] is not after.runs[0]
    assert after.runs[0].event_history.known == after.snapshots[0].tick == 50


def test_a_shot_that_fails_leaves_the_last_one_with_the_reason(
    clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    player = manual_player(clock, live(*FLEET))
    player.seek(30)
    before = player.settle()

    def broken(*_: Any) -> None:
        raise MemoryError("no room for a picture")

    monkeypatch.setattr(player_module, "take_snapshot", broken)
    player.seek(60)
    playback = player.turn(3)
    assert "no room for a picture" in playback.error and playback.snapshots is before.snapshots
    monkeypatch.undo()
    player.seek(90)
    assert player.settle().tick == 90


def test_a_strategy_that_hangs_does_not_keep_the_player(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(player_module, "PLAYER_JOIN_TIMEOUT_S", 0.2)
    LET_GO.clear()
    player = Player([live(*FLEET, "strategy.right_of_way=test_viewer_failures:Hangs")])
    player.seek(40)
    assert ASKED.wait(60)
    player.close()  # returns
    assert player._thread.is_alive()
    LET_GO.set()
    player._thread.join(60)


def test_a_branch_is_given_up_when_the_viewer_is_left() -> None:
    run = live(*FLEET)
    run.show(900, 99)
    asked: list[int] = []

    def give_up() -> bool:
        asked.append(run.tick)
        return len(asked) > 2

    run.give_up = give_up
    with pytest.raises(InputError, match="given up"):
        branch_of(run, ())


def test_a_branch_that_does_not_fit_leaves_no_file(tmp_path: Path) -> None:
    run = live(*FLEET)
    run.show(100, 99)
    run.frames = StoredFrames([])  # so that its past cannot be computed again
    with pytest.raises(InputError):
        branch_of(run, (), tmp_path / "branch.rec")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_gone_is_said_and_the_other_run_is_closed(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    first, second = live(*FLEET, path=gone / "a.rec"), live(*FLEET, path=tmp_path / "b.rec")
    player = Player([first, second], start=False)
    (gone / "a.rec.part").unlink()
    gone.rmdir()
    player.close()
    assert "No such file" in first.warning and (tmp_path / "b.rec").exists()


def test_the_budget_of_keyframes_counts_what_an_array_costs() -> None:
    run: LiveRun = live(*FLEET)
    simulation = run.leading_simulation
    keyframes = Keyframes(simulation.world, simulation.observation)
    simulation.run(20)
    keyframes.keep(simulation.world, simulation.observation)
    first, later = keyframes._frames
    changed = [delta for delta in later.arrays.values() if delta is not NO_CHANGE]
    assert 10 < len(changed) < len(later.arrays), "the others share one object"
    assert later.nbytes > len(changed) * OBJECT_BYTES > first.nbytes
