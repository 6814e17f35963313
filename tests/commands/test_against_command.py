"""`watch --against`: two live runs that begin together, in text and in the viewer."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from action_cases import said
from viewer_harness import viewing

from automaton.commands import main
from automaton.recording.recording_reader import read_recording
from automaton.world.resolve import resolve
from tui.playback.run_source import live_pair, recorded

WAIT = "strategy.right_of_way=wait"
SHORT = ["watch", "tabletop-mini", "--set", "stop.max_duration=300"]


def test_both_runs_are_recorded_and_compared_like_recordings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "kept.rec"
    assert main([*SHORT, "--against", WAIT, "--record", str(kept)]) == 1
    printed = capsys.readouterr().out
    assert "\nthe runs differ first at tick 7: robot 2\n" in printed
    other = tmp_path / "kept-against.rec"
    assert read_recording(other).header["scenario"]["strategy"]["right_of_way"] == "wait"
    assert main(["replay", str(kept), str(other)]) == 0
    assert "\nthe runs differ first at tick 7: robot 2\n" in capsys.readouterr().out


def test_two_runs_are_described_after_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    told = ["--describe", "--sentences", "1", "--no-record"]
    assert main([*SHORT, "--against", "seed=2", "--seed", "1", *told]) == 1
    lines = capsys.readouterr().out.splitlines()
    titles = [line for line in lines if line.startswith("tabletop-mini, 3 robots, seed ")]
    assert {title.split(", ")[2].split(":")[0] for title in titles} == {"seed 1", "seed 2"}
    assert lines[-1].startswith("the runs differ ")


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("layout.tables=6", "--against: floors of different sizes cannot be compared"),
        ("stratgy.routing=x", "--against stratgy.routing=x: unknown key 'stratgy' (did you mean"),
    ],
)
def test_bad_settings_are_one_sentence(
    setting: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*SHORT, "--against", setting]) == 2
    error = capsys.readouterr().err
    assert sentence in error and error.count("\n") == 1


def test_the_viewer_shows_both_with_their_difference(tmp_path: Path) -> None:
    opening = live_pair(resolve("tabletop-mini"), resolve("tabletop-mini", (WAIT,)), tmp_path / "a")

    async def story() -> None:
        async with viewing(opening) as user:
            first = "A right_of_way=retreat  tabletop-mini, 3 robots, seed 1"
            await user.until(lambda: said(user.display.heads[0]).startswith(first))
            assert said(user.display.heads[1]).startswith("B right_of_way=wait")
            await user.press("x")
            await user.until(lambda: "so far the runs are equal" in said(user.display.info))
            await user.at(40)
            await user.until(lambda: user.session.divergence is not None)
            await user.press("x")
            await user.until(lambda: user.tick == 7)
            await user.shown()
            assert [s.tick for s in user.session.playback.snapshots] == [7, 7]

    asyncio.run(story())
    assert [path.name for path in opening.paths] == ["a", "a-against"]
    assert len(recorded(*opening.paths).recordings) == 2
