"""The player with two runs, with breakpoints, and with runs that cannot go on."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from manual_clock import FLEET, ManualClock, clock, live, manual_player, recorded

from automaton.errors import InputError
from automaton.history.breakpoints import breakpoint_of
from automaton.history.watched_run import WatchedRun
from tui.playback.playback_state import RecordedCells
from tui.playback.player import STATE_INTERVAL_S, UNSEEN_S

__all__ = ["clock"]
FAILING = ("strategy.right_of_way=example_strategies:FailsLater",)


# Two runs


def test_two_runs_are_always_at_the_same_tick(clock: ManualClock, tmp_path: Path) -> None:
    player = manual_player(
        clock, live(*FLEET), recorded(tmp_path, 400, "strategy.right_of_way=wait")
    )
    player.set_speed(math.inf)
    orders = [player.play, lambda: player.seek(30), lambda: player.play(-1), player.pause]
    for order in [*orders, lambda: player.seek(390), player.play, lambda: player.step(-3)]:
        order()
        for _ in range(5):
            playback = player.turn()
            for snapshot in playback.snapshots:
                assert snapshot.tick == min(playback.tick, 400) or snapshot.tick == playback.tick
    playback = player.settle()
    assert playback.head == player.runs[0].head


def test_the_shorter_run_waits_at_its_end(clock: ManualClock, tmp_path: Path) -> None:
    player = manual_player(clock, recorded(tmp_path, 300), recorded(tmp_path, 200))
    player.seek(10_000)
    playback = player.settle()
    assert playback.tick == 300 == playback.end
    assert [snapshot.tick for snapshot in playback.snapshots] == [300, 200]
    player.step(-50)
    assert [s.tick for s in player.settle().snapshots] == [250, 200]
    player.step(-100)
    assert [s.tick for s in player.settle().snapshots] == [150, 150]


def test_times_in_cells_are_the_same_on_the_way_back(tmp_path: Path) -> None:
    run = recorded(tmp_path, 700)
    forwards, back = (RecordedCells(run.header, run.frames, 1.0) for _ in range(2))
    wanted = {tick: forwards.until(tick).copy() for tick in (0, 30, 512, 513, 690)}
    for tick in sorted(wanted, reverse=True):
        assert np.array_equal(back.until(tick), wanted[tick]), tick
    assert wanted[690].sum() > 512


def test_two_fleets_of_different_size(clock: ManualClock) -> None:
    player = manual_player(clock, live("fleet.robots=5"), live("fleet.robots=2"))
    player.select(4)
    player.seek(50)
    playback = player.settle()
    assert not playback.error and [len(s.robots) for s in playback.snapshots] == [5, 2]
    assert playback.snapshots[1].route.size == 0


def test_when_one_of_two_fails_both_stay_together(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET), live(*FLEET, *FAILING))
    player.seek(400)
    playback = player.settle()
    assert "own mistake" in playback.error
    # How far they came before depends on the machine.
    assert [snapshot.tick for snapshot in playback.snapshots] == [
        playback.tick,
        min(playback.tick, 49),
    ]


# Breakpoints


def begins(run: WatchedRun, text: str) -> dict[int, list[int]]:
    """Ticks at which a breakpoint begins to hold, and for which robots."""
    point, found, before = breakpoint_of(text), {}, set[int]()
    while run.tick != run.end:
        run.show(run.tick + 1, 99)
        now = set(point.test(run.shown, run.floor_plan).tolist())
        if now - before:
            found[run.tick] = sorted(now - before)
        before = now
    return found


@pytest.mark.parametrize(
    "text", ["delivered", "delivered 7", "stalled > 12", "wait cycle", "loaded and y > 2"]
)
def test_it_stops_at_each_tick_where_a_condition_begins_to_hold(
    text: str, clock: ManualClock
) -> None:
    stops = list(begins(live(*FLEET), text).items())[:6]
    assert stops
    player = manual_player(clock)
    player.set_breakpoints([breakpoint_of(text)])
    player.set_speed(math.inf)
    for tick, culprits in stops:
        player.play()
        playback = player.settle()
        assert (playback.tick, list(playback.breakpoint_robots)) == (tick, culprits)
        assert playback.stopped.startswith(f"{text}: robot {culprits[0]}") and not playback.playing
    player.step(1)
    assert player.settle().stopped == ""


def test_every_way_forward_stops_at_a_breakpoint_but_no_jump_and_not_the_way_back(
    clock: ManualClock,
) -> None:
    player = manual_player(clock)
    player.set_speed(math.inf)
    player.set_breakpoints([breakpoint_of("delivered")])
    player.play()
    first = player.settle().tick
    assert first > 1
    ways = (
        player.play,
        lambda: player.seek(first + 50, stop_at_breakpoints=True),
        lambda: player.step(100),
    )
    for way in ways:
        player.seek(first - 5)
        assert player.settle().stopped == ""
        way()
        playback = player.settle()
        assert playback.tick == first and playback.stopped.startswith("delivered: robot ")
    player.step(1)
    assert (player.settle().tick, player.latest().stopped) == (first + 1, "")
    player.step(-1)
    assert (player.settle().tick, player.latest().stopped) == (first, "")
    player.seek(0)
    player.seek(first + 50)
    assert (player.settle().tick, player.latest().stopped) == (first + 50, "")
    player.play(-1)
    assert player.settle().tick == 0


def test_of_two_runs_each_is_stopped_at_its_own_breakpoints(
    clock: ManualClock, tmp_path: Path
) -> None:
    runs = [recorded(tmp_path, 400), recorded(tmp_path, 399, "strategy.right_of_way=wait")]
    mine, its = (begins(run, "stalled > 15") for run in runs)
    player = manual_player(clock, *runs)
    player.set_breakpoints([breakpoint_of("stalled > 15")])
    player.set_speed(math.inf)
    player.seek(0)
    met = []
    for tick in sorted({*mine, *its}):
        player.play()
        playback = player.settle()
        sides = [side for side, found in enumerate((mine, its)) if tick in found]
        assert (playback.tick, playback.side) == (tick, sides[0])
        assert list(playback.breakpoint_robots) == (mine, its)[sides[0]][tick]
        named = [f"run {'AB'[side]}, robot {(mine, its)[side][tick][0]}" for side in sides]
        told = [one.removesuffix(" and others") for one in playback.stopped.split("; ")]
        assert told == [f"stalled > 15: {name}" for name in named]
        met.append(sides)
    assert [0, 1] in met and [1] in met  # both at once, and one alone
    player.play()
    assert player.settle().tick == 400


def test_an_unreadable_recording_is_a_sentence(clock: ManualClock, tmp_path: Path) -> None:
    run = recorded(tmp_path, 600)
    del run.frames.payloads[3]
    player = manual_player(clock, run)
    player.seek(600)
    playback = player.settle()
    assert "altered" in playback.error and playback.snapshots[0].tick == playback.tick < 600
    with pytest.raises(InputError):
        run.show(600, 99)


def test_shots_are_no_more_frequent_than_a_screen_can_show(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET, "stop={when: never, max_duration: 1000000000}"))
    player.set_speed(math.inf)
    player.play()
    player.turn()
    seq = player.latest().seq
    player.turn(5)  # the clock stands still: nothing waits at full speed
    assert player.latest().seq <= seq + 1
    for pause, fresh in ((1.5 * STATE_INTERVAL_S, 1), (1.5 * STATE_INTERVAL_S, 0), (UNSEEN_S, 1)):
        seq = player._playback.seq
        clock.now += pause
        player._carry_on(1)
        assert player._playback.seq == seq + fresh, (
            "a shot that nobody has looked at yet lasts longer"
        )
    clock.now += 1.5 * STATE_INTERVAL_S
    seq = player.latest().seq
    assert player.turn().seq == seq + 1
    clock.now += 1.5 * STATE_INTERVAL_S
    assert player.turn().seq == seq + 2


def test_a_speed_that_was_not_measured_yet_is_not_told(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET, "stop={when: never, max_duration: 1000000000}"))
    player.play()
    for order in (lambda: player.set_speed(4), lambda: player.play(-1)):
        player.turn()
        clock.now += 3.0
        assert player.turn(3).achieved > 0
        order()
        assert player.turn().achieved == 0


def test_two_live_runs_are_computed_in_step(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET), live(*FLEET, "strategy.right_of_way=wait"))
    player.set_speed(math.inf)
    for order in (player.play, lambda: player.seek(30), lambda: player.seek(200), player.play):
        order()
        for _ in range(5):
            playback = player.turn()
            ends = [playback.tick if end is None else end for end in playback.ends]
            ticks = [snapshot.tick for snapshot in playback.snapshots]
            assert ticks == [min(playback.tick, end) for end in ends]
            fronts = [run.leading_simulation.tick for run in player.runs]
            assert fronts[0] == fronts[1] or player.runs[0].end == fronts[0] < fronts[1]


def test_where_two_live_runs_part_is_known_once_they_have(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET), live(*FLEET, "strategy.right_of_way=wait"))
    player.seek(2)
    assert player.settle().divergence is None
    player.seek(60)
    parted = player.settle().divergence
    assert parted is not None and parted.tick is not None
    for tick, equal in ((parted.tick - 1, True), (parted.tick, False)):
        player.seek(tick)
        robots = [snapshot.robots for snapshot in player.settle().snapshots]
        assert (robots[0].executed == robots[1].executed).all() == equal


def test_live_runs_that_end_are_compared_to_their_ends(clock: ManualClock) -> None:
    for limit, text in (
        (20, "the runs are equal in all 20 ticks"),
        (30, "the runs are equal up to tick 20, where one ends"),
    ):
        player = manual_player(
            clock, live("stop.max_duration=20"), live(f"stop.max_duration={limit}")
        )
        player.seek(99)
        parted = player.settle().divergence
        assert parted is not None and parted.text == text


def test_live_runs_with_other_fleets_differ_from_the_start(clock: ManualClock) -> None:
    player = manual_player(clock, live("fleet.robots=2"), live("fleet.robots=3"))
    parted = player.settle().divergence
    assert parted is not None and parted.tick == 0


# A deadlock that can only repeat


def test_it_stops_once_where_a_deadlock_can_only_repeat(clock: ManualClock) -> None:
    player = manual_player(clock, live("fleet.robots=5", "strategy.right_of_way=wait"))
    player.seek(20_000)
    stopped = player.settle()
    assert stopped.stuck is not None and stopped.stops == 1
    assert stopped.stuck + 500 <= stopped.tick < 20_000
    before = player.runs[0].leading_simulation.world.robots.cell.copy()
    player.seek(stopped.tick + 300)  # asked again, it goes on
    later = player.settle()
    assert (later.tick, later.stuck) == (stopped.tick + 300, None)
    assert (player.runs[0].leading_simulation.world.robots.cell == before).all()


def test_a_deadlock_that_a_strategy_resolves_late_is_not_taken_for_stuck(
    clock: ManualClock,
) -> None:
    late = live("fleet.robots=5", "strategy.right_of_way=example_strategies:RetreatsLate")
    player = manual_player(clock, late)
    player.seek(1500)
    halted = player.settle()
    active = late.leading_simulation.world.tally.active.max()
    assert active < 1000 and late.leading_simulation.world.deadlocks.number.any()
    player.seek(3000)
    assert (halted.stuck, player.settle().stuck) == (None, None)
    assert late.leading_simulation.world.tally.active.max() > 2000


def test_a_fleet_that_delivers_is_never_taken_for_stuck(clock: ManualClock) -> None:
    player = manual_player(clock, live(*FLEET))
    player.seek(20_000)
    assert player.settle().stuck is None
