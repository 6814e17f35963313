"""Runs with a past: gone back and on, branched off and verified, and what the chronicle tells."""

from __future__ import annotations

import errno
import functools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from automaton.engine.observation import DELAY_COLUMNS, DELIVERED_ORDERS, EVENT_DELIVERED
from automaton.history.event_history import (
    STRIP_SAMPLES,
    STRIP_TICKS,
    AppendLog,
    EventHistory,
    LostByRows,
)
from automaton.history.live_run import LiveRun, branch_of
from automaton.history.playback import Playback
from automaton.history.watched_run import ReplayedRun, WatchedRun
from automaton.recording.frames import MAGIC
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.strategy.api import NIL, REASON_PICKED, InputError, Strategy
from automaton.strategy.per_robot import drop_at, park, per_robot, take
from automaton.verification.verification import verify
from automaton.world.resolve import resolve

FLEET = ("fleet.robots=4",)
LIMITED = (*FLEET, "information={radius: 3}", "strategy.allocation=test_run_history:in_turn")


class Moody(Strategy):
    """Right of way with state that no memory holds: every third robot asked retreats."""

    layer = "right_of_way"
    period = 2

    def __init__(self, parameters: Any = None) -> None:
        super().__init__(parameters)
        self.question = 0

    def decide(self, view, batch, decisions, memory, workspace):
        for k in range(batch.count):
            self.question += 1
            if self.question % 97 == 0 and not view.robots.parked[batch.robot[k]]:
                decisions.right_of_way.command[k], decisions.right_of_way.value[k] = 3, 1


@per_robot("allocation", memory=1)
def in_turn(me, view):
    """Which order it takes depends on how often this robot was asked before."""
    me.memory[0] += 1
    if me.reason == REASON_PICKED:
        return drop_at(view.target_of(me.load))
    orders = view.open_orders()
    return take(orders[int(me.memory[0]) % len(orders)]) if orders else park()


HIDDEN = (*FLEET, "strategy.right_of_way=test_run_history:Moody")


def live(*settings: str, name: str = "tabletop-1", path: Path | None = None) -> LiveRun:
    return LiveRun(resolve(name, settings), 7, path)


def go(run: WatchedRun, tick: int) -> WatchedRun:
    assert run.show(tick, 99) == tick == run.tick == run.shown.tick
    return run


def straight(*settings: str, name: str = "tabletop-1", until: int) -> Simulation:
    simulation = Simulation(resolve(name, settings), 7)
    simulation.run(until)
    return simulation


@functools.cache
def digests_of_each_tick(*settings: str) -> list[Any]:
    """Those of a run that goes straight on, from tick 0 to tick 1000."""
    simulation = Simulation(resolve("tabletop-1", settings), 7)
    digests = [simulation.digests()]
    for tick in range(1, 1001):
        simulation.run(tick)
        digests.append(simulation.digests())
    return digests


def same(one: Simulation, other: Simulation) -> bool:
    return np.array_equal(one.digests(), other.digests())


def told(run: WatchedRun) -> tuple[list[Any], list[Any]]:
    return run.event_history.events.tolist(), run.event_history.curve.rows.tolist()


# Going back and on


@settings(max_examples=examples(8))
@given(stops=st.lists(st.integers(0, 900), min_size=1, max_size=6))
@pytest.mark.parametrize("settings", [FLEET, LIMITED, HIDDEN])
def test_a_run_that_was_rewound_goes_on_as_if_nothing_had_been(
    settings: tuple[str, ...], stops: list[int]
) -> None:
    run = live(*settings)
    for stop in stops:
        go(run, stop)
        assert np.array_equal(run.shown.digests(), digests_of_each_tick(*settings)[stop])
    assert run.head == max(stops)
    go(run, 1000)
    assert np.array_equal(run.shown.digests(), digests_of_each_tick(*settings)[1000])
    assert told(run) == told_in_one_go(*settings)


@functools.cache
def told_in_one_go(*settings: str) -> tuple[list[Any], list[Any]]:
    return told(go(live(*settings), 1000))


def test_a_budget_is_kept_and_the_way_goes_on() -> None:
    run = live(*FLEET)
    reached = [run.show(1500, 0.0)]
    while reached[-1] < 1500:
        reached.append(run.show(1500, 0.0))
        assert reached[-1] > reached[-2]
    assert len(reached) > 1 and same(run.shown, straight(*FLEET, until=1500))


def test_a_run_shows_nothing_after_its_end() -> None:
    run = live("stop.max_duration=100")
    assert run.end is None
    assert run.show(5000, 99) == 100 == run.end
    assert run.show(-3, 99) == 0


def test_a_recording_and_its_run_show_the_same(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    run = live(*FLEET, "stop.max_duration=700", path=path)
    go(run, 700)
    run.close()
    again = ReplayedRun(read_recording(path))
    assert again.complete and again.end == 700 and not again.live
    for tick in (700, 3, 350):
        assert same(go(again, tick).shown, go(run, tick).shown)
    assert again.metrics() == run.metrics() and told(again) == told(run)


def test_the_shown_tick_stays_when_the_front_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    go(live(*FLEET, path=path), 700).close()
    run = go(ReplayedRun(read_recording(path)), 50)
    assert run.extend() and run.leading_simulation.tick > 50
    assert run.tick == 50 == run.shown.tick and same(run.shown, straight(*FLEET, until=50))


# Branches

CHANGES = {
    "nothing": (),
    "a strategy": ("strategy.right_of_way=wait",),
    "parameters": ("strategy.right_of_way={name: retreat, retries: 2}",),
    "a Python strategy": ("strategy.allocation=independent-python",),
    "hidden state": ("strategy.right_of_way=test_run_history:Moody",),
    "zoning": ("strategy.zoning=example_strategies:HalfAndHalf",),
    "durations": ("durations.move=3", "durations.turn=2"),
    "sight": ("information={radius: 2}",),
    "the order list": ("information=orders",),
    "following": ("world.following=none",),
    "slow zones": (
        "world={slowdown: zones, traffic_zones: directed, extra_tick_probability: 0.1}",
    ),
    "picks of no time": ("durations={pick: 0, drop: 0}",),
    "the stop": ("stop={when: never, max_duration: 650}",),
}
# Each change is made in a run or in a branch of one; two at the ends are made twice.
NAMES = [*CHANGES, "nothing"]
PAIRS = [*zip(NAMES[::2], NAMES[1::2], strict=True)]


@pytest.mark.parametrize("before", [FLEET, LIMITED, HIDDEN], ids=["plain", "limited", "hidden"])
@pytest.mark.parametrize(("one", "then"), PAIRS, ids=map(", ".join, PAIRS))
def test_a_branch_verifies_plays_and_branches_again(
    one: str, then: str, before: tuple[str, ...], tmp_path: Path
) -> None:
    path, further = tmp_path / "branch.rec", tmp_path / "further.rec"
    branch = branch_of(go(live(*before), 300), CHANGES[one], path)
    assert branch.tick == 300
    go(branch, 500)
    check_file(branch, path, [500, 301, 300, 299, 20, 450])
    second = branch_of(go(ReplayedRun(read_recording(path)), 400), CHANGES[then], further)
    third = branch_of(go(go(second, 450), 350), ("durations.pick=9",))
    assert same(go(third, 350).shown, go(branch, 350).shown)
    go(second, 600)
    check_file(second, further, [600, 401, 400, 299, 301, 450, 0])


@pytest.mark.parametrize("zoned", ["before", "after"])
def test_a_state_kept_at_the_branch_has_not_the_zones_that_follow(
    zoned: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """How long computing takes decides which states are kept: here all, that of the branch too."""
    keep_all_states(monkeypatch)
    zones, none = CHANGES["zoning"], ("strategy.zoning=none",)
    before, change = (zones, none) if zoned == "before" else ((), zones)

    def fresh() -> LiveRun:
        return branch_of(go(live(*FLEET, *before), 300), change)

    branch = go(fresh(), 300)
    go(branch, 400)
    assert 300 in branch.keyframes.ticks
    for tick in (301, 300, 250, 320, 400):
        assert same(go(branch, tick).shown, go(fresh(), tick).shown), tick


def test_a_branch_of_zones_can_be_branched_off_at_once() -> None:
    zoned = branch_of(go(live(*FLEET), 300), CHANGES["zoning"])
    other = branch_of(zoned, ("durations.move=3",))
    assert same(other.shown, zoned.shown)
    assert not same(go(other, 400).shown, go(zoned, 400).shown)


def test_a_recorded_branch_and_its_run_show_the_same_with_all_states_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_all_states(monkeypatch)
    path = tmp_path / "branch.rec"
    branch = go(branch_of(go(live(*FLEET), 300), CHANGES["zoning"], path), 350)
    check_file(branch, path, [350, 301, 300, 299])


def keep_all_states(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("KEYFRAME_S", "KEYFRAME_TIME_RATIO"):
        monkeypatch.setattr(f"automaton.history.watched_run.{name}", 0.0)


def check_file(run: LiveRun, path: Path, ticks: list[int]) -> None:
    """The recording of a run is right, and shows what the run showed."""
    run.close()
    found = verify(path)
    assert found.report.violations == [] or found.report.violations == ()
    assert found.difference is None and found.passed
    again = ReplayedRun(read_recording(path))
    for tick in ticks:
        assert same(go(again, tick).shown, go(run, tick).shown), tick
    assert told(again) == told(run)


@pytest.mark.parametrize("before", [FLEET, LIMITED, HIDDEN])
def test_a_branch_without_a_change_repeats_the_future(before: tuple[str, ...]) -> None:
    run = go(live(*before), 800)
    for tick in (0, 1, 255, 256, 257, 799):
        branch = branch_of(go(run, tick), ())
        shown = go(branch, 800).shown
        assert np.array_equal(shown.digests(), digests_of_each_tick(*before)[800]), tick
        assert told(branch)[0] == told(run)[0]


@pytest.mark.parametrize("tick", [0, 1, 64, 256])
def test_a_branch_at_any_tick_verifies(tick: int, tmp_path: Path) -> None:
    path = tmp_path / "branch.rec"
    branch = branch_of(go(live(*FLEET), tick), CHANGES["a strategy"], path)
    go(branch, 400)
    check_file(branch, path, [400, tick, 0, tick + 1])
    again = branch_of(go(ReplayedRun(read_recording(path)), 350), ())
    assert same(go(again, 400).shown, go(branch, 400).shown)


def test_a_branch_makes_a_difference() -> None:
    run = go(live(*FLEET), 300)
    branch = branch_of(run, CHANGES["durations"])
    assert not same(go(branch, 400).shown, go(run, 400).shown)
    assert (
        branch.event_history.curve.rows[:300].tolist()
        == run.event_history.curve.rows[:300].tolist()
    )


def test_a_branch_at_the_last_tick_goes_on_when_the_limit_is_raised(tmp_path: Path) -> None:
    path = tmp_path / "branch.rec"
    run = go(live(*FLEET, "stop.max_duration=300"), 300)
    branch = branch_of(run, ("stop.max_duration=600",), path)
    assert branch.end is None
    go(branch, 600)
    check_file(branch, path, [600, 300, 10])
    assert read_recording(path).complete


def test_a_finished_run_goes_on_when_more_is_asked_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_all_states(monkeypatch)
    path = tmp_path / "branch.rec"
    run = live("stop.when=delivered", name="tabletop-mini")
    last = run.show(10**6, 99)
    assert run.shown.finished and run.end == last
    branch = branch_of(run, ("stop.when=parked",), path)
    assert branch.show(10**6, 99) > last and branch.shown.finished
    check_file(branch, path, [last, branch.tick, 5, last + 1, 6, last])


def test_a_branch_can_be_rewound_at_little_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    keep_all_states(monkeypatch)
    run = go(live(*FLEET), 1500)
    assert len(branch_of(run, ()).keyframes.ticks) > 5


def test_a_limit_that_is_past_already_ends_the_run_at_once(tmp_path: Path) -> None:
    path = tmp_path / "branch.rec"
    branch = branch_of(go(live(*FLEET), 200), ("stop.max_duration=10",), path)
    assert branch.end == 200 == branch.show(900, 99)
    check_file(branch, path, [200, 0])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("seed=3", "seed cannot change during a run; allowed: strategy, durations"),
        ("fleet.robots=2", "fleet cannot change"),
        ("strategy.routing=shrotest", "did you mean 'shortest'"),
        ("durations.move=0", "durations.move"),
    ],
)
def test_what_cannot_be_changed_is_told(change: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "branch.rec"
    path.write_bytes(MAGIC + b"older")
    run = go(live(*FLEET), 200)
    with pytest.raises(InputError) as error:
        branch_of(run, (change,), path)
    assert told in str(error.value) and "\n" not in str(error.value)
    assert path.read_bytes() == MAGIC + b"older"
    assert same(go(run, 300).shown, straight(*FLEET, until=300))


def test_a_past_that_this_version_computes_otherwise_is_no_base(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.rec"
    run = live(*HIDDEN, path=path)
    go(run, 500)
    run.close()
    path.with_name("branch.rec").write_bytes(MAGIC + b"older")
    monkeypatch.setattr(Moody, "period", 3)
    recorded = go(ReplayedRun(read_recording(path)), 500)
    with pytest.raises(InputError, match="the run differs at tick 500"):
        branch_of(recorded, (), path.with_name("branch.rec"))
    assert path.with_name("branch.rec").read_bytes() == MAGIC + b"older"


# Strategies that fail


def test_a_run_whose_strategy_fails_ends_with_the_tick_before(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    run = live(*FLEET, "strategy.right_of_way=example_strategies:FailsLater", path=path)
    with pytest.raises(InputError, match=r"FailsLater' raised ZeroDivisionError: own mistake"):
        run.show(400, 99)
    assert run.tick == run.head == run.end == 49 == run.shown.tick and not run.live
    assert run.event_history.known == 49
    assert run.show(400, 99) == 49 and go(run, 20) and go(run, 49)
    run.close()
    recording = read_recording(path)
    assert recording.ticks == 49 and not recording.complete
    assert same(go(ReplayedRun(recording), 49).shown, run.shown)


# The chronicle


def test_the_chronicle_takes_each_tick_once() -> None:
    run = go(live(*FLEET), 600)
    first = told(run)
    for tick in (100, 600, 0, 599, 300):
        go(run, tick)
    assert told(run) == first and run.event_history.known == 600
    go(run, 900)
    assert told(run)[0][: len(first[0])] == first[0]
    assert told(run) == told(go(live(*FLEET), 900))
    ticks = run.event_history.events[:, 0]
    assert (np.diff(ticks) >= 0).all() and ticks[0] >= 1 and ticks[-1] <= 900


def test_a_chronicle_may_be_played_to_again_and_again(tmp_path: Path) -> None:
    path, event_history = tmp_path / "run.rec", EventHistory()
    run = go(live(*FLEET, path=path), 700)
    run.close()
    recording = read_recording(path)
    playback = Playback(recording.header, recording.stored(), on_observe=event_history)
    for tick in (100, 50, 300, 299, 301, 10, 700):
        playback.go_to(tick)
    assert (event_history.events.tolist(), event_history.curve.rows.tolist()) == told(run)


def test_deliveries_in_the_chronicle_are_those_of_the_orders() -> None:
    run = live(*FLEET)
    last = run.show(10**6, 99)
    events = run.event_history.events
    mine = {(t, s) for t, code, _, s, _ in events.tolist() if code == EVENT_DELIVERED}
    delivered = run.shown.world.orders.delivered
    assert mine == {(int(t), order) for order, t in enumerate(delivered) if t != NIL}
    for tick in (1, 700, last):
        count = ((delivered != NIL) & (delivered <= tick)).sum()
        assert run.event_history.curve.rows[tick - 1, DELIVERED_ORDERS] == count
        index = run.event_history.index_at(tick)
        assert (events[:index, 0] <= tick).all() and (events[index:, 0] > tick).all()


class FullDisk:
    """A file of which nothing more can be written after so many bytes."""

    def __init__(self, file: Any, room: int) -> None:
        self.file, self.room = file, room

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)

    def write(self, data: bytes) -> int:
        self.room -= len(data)
        if self.room < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return int(self.file.write(data))


def test_a_full_disk_ends_the_recording_and_not_the_run(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    run = live(*FLEET, path=path)
    assert run.recorder.file is not None
    run.recorder.file._file = FullDisk(run.recorder.file._file, 4_000)  # type: ignore[assignment]
    last = run.show(10**6, 99)
    assert (
        run.leading_simulation.finished
        and "No space left" in run.warning
        and str(path) in run.warning
    )
    assert same(go(run, 300).shown, straight(*FLEET, until=300))  # the past is in memory
    run.close()
    kept = read_recording(path.with_name("run.rec.part"))
    assert not path.exists() and 0 < kept.ticks < last


def test_lost_time_by_rows_can_be_read_while_it_is_thinned(monkeypatch: pytest.MonkeyPatch) -> None:
    lost = np.zeros((5 * 4, DELAY_COLUMNS), np.int32)
    simulation = SimpleNamespace(tick=0, observation=SimpleNamespace(lost_ticks_by_cell=lost))
    strip, seen = LostByRows(len(lost), 4), []
    append = AppendLog.append

    def watched(log: AppendLog, rows: Any) -> None:
        append(log, rows)
        seen.append(len(strip.rows))

    for tick in range(1, STRIP_SAMPLES * STRIP_TICKS + 1):
        simulation.tick = tick
        strip.look(simulation, False)
    assert strip.rows[:, 0].tolist() == [*range(STRIP_TICKS, tick + 1, STRIP_TICKS)]
    monkeypatch.setattr(AppendLog, "append", watched)
    simulation.tick = tick + 3
    strip.look(simulation, False)
    assert not seen
    strip.look(simulation, True)
    assert min(seen) == STRIP_SAMPLES and len(strip.rows) == STRIP_SAMPLES // 2 + 1
    assert strip.next_sample(tick + 3) == tick + 2 * STRIP_TICKS


def test_the_strip_of_lost_time_does_not_depend_on_how_fast_the_machine_is() -> None:
    runs = [live(*FLEET) for _ in range(2)]
    runs[0].show(300, 99)
    for tick in range(1, 301):
        runs[1].show(tick, 99)
    strips = [run.lost.rows.tolist() for run in runs]
    assert strips[0] == strips[1] and len(strips[0]) == 300 // STRIP_TICKS
