"""A recording is played again without its strategies: every array is as it was, at every tick."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from played_back import check_at, digests_of, playback_of, recorded
from random_cases import Case, cases

from automaton.engine.decision_stream import first_other_tick
from automaton.engine.observation import EVENT_CHARGING
from automaton.engine.state import BATTERY_PERCENT
from automaton.errors import InputError
from automaton.history.playback import Keyframes, Playback
from automaton.history.watched_run import ReplayedRun
from automaton.recording import frames as stored
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.frames import Recording
from automaton.recording.recorder import Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify
from automaton.world.resolve import resolve

ALLOCATION = ("independent", "cooperative", "adaptive", "independent-python")
SIGHT = ("everything", "orders", "{radius: 3}")


def check_everywhere(recording: Recording) -> None:
    """Tick by tick, then in one go, and back to a tick in between."""
    digests, playback = digests_of(recording), playback_of(recording)
    for tick in range(len(digests) + 1):
        check_at(playback, digests, tick)
    for tick in (len(digests) // 3, len(digests), 0, len(digests)):
        check_at(playback, digests, tick)


@pytest.mark.parametrize("sight", SIGHT)
@pytest.mark.parametrize("allocation", ALLOCATION)
@pytest.mark.parametrize("floor", ["tabletop-mini", "tabletop-2", "crossing"])
def test_every_tick_of_the_shipped_strategies(floor: str, allocation: str, sight: str) -> None:
    settings = [f"strategy.allocation={allocation}", f"information={sight}"]
    check_everywhere(recorded(resolve(floor, settings), until=400))


@pytest.mark.parametrize("way", ["wait", "retreat"])
def test_a_whole_run(way: str) -> None:
    settings = ["fleet.robots=5", f"strategy.right_of_way={way}", "stop.max_duration=3000"]
    recording = recorded(resolve("tabletop-1", settings))
    digests, playback = digests_of(recording), playback_of(recording)
    check_at(playback, digests, len(digests))
    assert playback.simulation.finished == (len(digests) < 3000)


@settings(max_examples=examples(40))
@given(cases())
def test_random_decisions_legal_and_illegal(case: Case) -> None:
    check_everywhere(recorded(case.resolved, storage=case.storage))


ZONES = {"zoning": "example_strategies:HalfAndHalf", "charging": "example_strategies:ChargeFirst"}


CHARGING = """
name: charging
layout:
  picture: |
    AB..c.
    .ss.d.
    ......
fleet: {robots: 2}
battery: {initial_charge: [40, 100], charge_rate: 10, drain: {move: 0}}
"""


def test_zoning_and_charging_are_repeated(tmp_path: Path) -> None:
    path = tmp_path / "charging.yaml"
    settings = [f"strategy.{layer}={name}" for layer, name in ZONES.items()]
    path.write_text(CHARGING)
    recording = recorded(resolve(path, settings), until=120)
    check_everywhere(recording)
    playback = playback_of(recording)
    playback.go_to(60)
    assert sorted(playback.simulation.world.robots.service_zone.tolist()) == [0, 1]
    run = ReplayedRun(recording)
    run.show(120, 99)
    charged = [row for row in run.event_history.events.tolist() if row[1] == EVENT_CHARGING]
    assert 50 * BATTERY_PERCENT in [row[4] for row in charged if row[2] == 0], (
        "after its first tick"
    )


# Keyframes and order


@pytest.fixture(scope="module")
def long() -> Recording:
    return recorded(resolve("tabletop-1", ["fleet.robots=4", "stop.max_duration=1500"]))


@settings(max_examples=examples(15))
@given(
    wanted=st.lists(st.integers(0, 1500), min_size=1, max_size=8),
    spacing=st.sampled_from([1, 2, 7, 64, 255, 256, 257, 1000, 5000]),
    budget=st.sampled_from([1, 50_000, 10**9]),
)
def test_ticks_in_any_order(wanted: list[int], spacing: int, budget: int, long: Recording) -> None:
    digests, playback = digests_of(long), playback_of(long)
    world, observation = playback.simulation.world, playback.simulation.observation
    playback.keyframes = Keyframes(world, observation, budget)
    for tick in range(spacing, 1501, max(spacing, 100)):
        playback.go_to(tick)
        playback.keyframes.keep(playback.simulation.world, playback.simulation.observation)
    for tick in wanted:
        check_at(playback, digests, tick)


def test_keyframes_at_every_tick_restore_every_tick() -> None:
    recording = recorded(resolve("tabletop-mini", ["stop.max_duration=300"]))
    digests, playback = digests_of(recording), playback_of(recording)
    for tick in range(1, 301):
        playback.go_to(tick)
        playback.keyframes.keep(playback.simulation.world, playback.simulation.observation)
    assert playback.keyframes.ticks == list(range(301))
    for tick in (300, 1, 150, 0, 299):
        check_at(playback, digests, tick)


def test_keyframes_keep_within_their_budget() -> None:
    recording = recorded(resolve("tabletop-mini", ["stop.max_duration=250"]))
    playback = playback_of(recording)
    playback.go_to(250)
    playback.keyframes.keep(playback.simulation.world, playback.simulation.observation)
    playback.keyframes.budget = 40 * playback.keyframes._frames[-1].nbytes
    playback.go_to(0)
    while len(playback.keyframes.ticks) > 1:
        playback.keyframes._drop(1)
    for tick in range(1, 251):
        playback.go_to(tick)
        playback.keyframes.keep(playback.simulation.world, playback.simulation.observation)
        assert playback.keyframes._bytes <= playback.keyframes.budget
    ticks = playback.keyframes.ticks
    assert ticks[0] == 0 and ticks == sorted(ticks) and len(ticks) > 4
    check_at(playback, digests_of(recording), 249)


def test_what_was_observed_is_the_same_after_going_back(long: Recording) -> None:
    def seen(playback: Playback) -> list[Any]:
        observation = playback.simulation.observation
        names = (
            "cause",
            "blocker",
            "wanted",
            "since",
            "wait_cycle_ticks",
            "lost",
            "lost_ticks_by_cell",
            "flow",
        )
        return [getattr(observation, name).copy() for name in names]

    straight, jumping = playback_of(long), playback_of(long)
    for tick in (700, 200, 1400, 900, 1):
        jumping.go_to(tick)
        jumping.keyframes.keep(jumping.simulation.world, jumping.simulation.observation)
    for tick in (5, 250, 900, 1350):
        straight.go_to(tick)
        jumping.go_to(tick)
        for one, other in zip(seen(straight), seen(jumping), strict=True):
            assert np.array_equal(one, other)


# What is not here, cut short, or altered


def test_a_plug_in_that_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "leaving.py"
    module.write_text(
        "from automaton.strategy.per_robot import *\nfrom example_strategies import eager\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    resolved = resolve(
        "tabletop-mini", ["strategy.allocation=leaving:eager", "stop.max_duration=300"]
    )
    path = tmp_path / "run.rec"
    with Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, on_record=recorder).run()
    digests = digests_of(read_recording(path))
    module.unlink()
    del sys.modules["leaving"]
    with pytest.raises(InputError, match="leaving"):
        verify(path)
    run = ReplayedRun(read_recording(path))
    for tick in (300, 120, 0, 299):
        assert run.show(tick, 99) == tick
        assert not tick or np.array_equal(run.shown.digests(), digests[tick - 1])


def test_a_recording_cut_anywhere_plays_to_its_last_whole_frame(tmp_path: Path) -> None:
    resolved = resolve("tabletop-mini", ["stop.max_duration=600"])
    path, cut = tmp_path / "run.rec", tmp_path / "cut.rec"
    with Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, on_record=recorder).run()
    data, digests = path.read_bytes(), digests_of(read_recording(path))
    ends = set()
    for length in range(len(data), 0, -997):
        cut.write_bytes(data[:length])
        try:
            run = ReplayedRun(read_recording(cut))
        except InputError as error:
            assert "cut short" in str(error)
            continue
        last = run.show(10_000, 99)
        ends.add(last)
        assert last == run.end == read_recording(cut).ticks
        assert not last or np.array_equal(run.shown.digests(), digests[last - 1])
    assert {600, 0} < ends


def altered(recording: Recording) -> tuple[Recording, list[dict[str, Any]]]:
    """One whose ticks and decisions may be changed, and what it says of them."""
    frames = [frame._replace(content=dict(frame.content)) for frame in recording.frames]
    ticks = [frame.content for frame in frames if frame.kind == FRAME_KIND_TICKS]
    for content in ticks:
        content["decisions"] = content["decisions"].copy()
    return Recording(recording.header, frames, complete=True), ticks


def test_an_altered_decision_is_told_in_a_sentence(long: Recording) -> None:
    recording, ticks = altered(long)
    words, last = ticks[1]["decisions"], ticks[2]["first"] - 1
    first = int(words[0]) >> 3
    words[0] += 8  # a tick later
    run = ReplayedRun(recording)
    found = []
    for _ in range(2):  # and again, if one tries again
        with pytest.raises(InputError, match="differs from the recording after tick"):
            run.show(1500, 99)
        assert first <= run.tick <= last
        assert run.shown.tick == run.tick
        found.append(run.tick)
    assert found[0] == found[1], "it is played no further"
    assert run.show(200, 99) == 200 == run.shown.tick


def test_a_missing_frame_is_told(long: Recording) -> None:
    recording, ticks = altered(long)
    frames = [frame for frame in recording.frames if frame.content is not ticks[2]]
    run = ReplayedRun(Recording(recording.header, frames, complete=True))
    with pytest.raises(InputError, match="altered"):
        run.show(1500, 99)


@settings(max_examples=examples(60))
@given(data=st.data())
def test_no_altered_stream_crashes_or_goes_on_for_ever(data: Any, long: Recording) -> None:
    recording, ticks = altered(long)
    content = ticks[data.draw(st.integers(0, 2))]
    words = content["decisions"]
    extreme = st.sampled_from([0, -1, 65535, 2**31, 2**40, 2**63 - 1, -(2**63)])
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(words) - 1))
        change = data.draw(st.one_of(extreme, st.integers(0, 2**20)))
        words[place] = data.draw(st.sampled_from([change, words[place] ^ change]))
    content["decisions"] = words[: data.draw(st.sampled_from([len(words), len(words) - 1, 1, 0]))]
    playback = playback_of(recording)
    try:
        playback.go_to(800)
    except InputError as error:
        assert "altered" in str(error) and "\n" not in str(error)
    original = digests_of(long)
    assert playback.tick <= 800
    if playback.tick == 800:
        assert np.array_equal(playback.simulation.digests(), original[799])


def test_where_two_streams_differ() -> None:
    def tick_of(one: list[int], other: list[int]) -> int:
        return int(first_other_tick(np.array(one, np.int64), np.array(other, np.int64)))

    five, six = [5 << 3 | 2, 1 << 16 | 1, 7], [6 << 3 | 2, 1 << 16 | 2, 7, 8]
    assert tick_of([*five, *six], [*five, *six[:3], 9]) == 6
    assert tick_of([*five, *six], [*five, *six[:3]]) == 6
    assert tick_of([*five, *six], five) == 6 == tick_of(five, [*five, *six])
    assert tick_of(six, [*five, *six]) == 5
    assert tick_of([five[0], five[1], 8], five) == 5
    assert tick_of([], five) == 5


def test_frames_follow_each_other(long: Recording) -> None:
    ticks = [frame.content for frame in long.stored() if frame.kind == stored.FRAME_KIND_TICKS]
    assert all(a["first"] + len(a["executed"]) == b["first"] for a, b in pairwise(ticks))
