"""`automaton` alone, on a terminal."""

from __future__ import annotations

import os
from pathlib import Path

import command_in_terminal

from tui.viewer.picker import Openable, choices


def test_scenarios_and_recordings_of_the_folder_come_before_the_shipped_scenarios(
    tmp_path: Path,
) -> None:
    (tmp_path / "mine.yaml").write_text("layout: {generator: tabletop}\nfleet: {robots: 1}\n")
    (tmp_path / "study.yaml").write_text("scenario: tabletop-1\nmatrix: {}\n")
    (tmp_path / "broken.yaml").write_text("fleet: [\n")
    (tmp_path / "run.rec").write_bytes(b"")
    os.utime(tmp_path / "run.rec", (0, 0))
    (tmp_path / ".#mine.yaml").symlink_to("user@host.1234")  # an editor's lock, which leads nowhere
    offered = choices(tmp_path)
    assert offered[:2] == [Openable("run.rec", "recording"), Openable("mine.yaml", "scenario")]
    assert {one.kind for one in offered[2:]} == {"shipped"}
    assert offered[0].command == ["replay", "run.rec"] and offered[2].command[0] == "watch"


def test_the_picture_of_a_choice_moves_and_enter_opens_it(tmp_path: Path) -> None:
    with command_in_terminal.automaton(tmp_path, columns=120, rows=30) as session:
        session.wait_for_text("tabletop-mini")
        session.press("tabletop-mini")
        session.wait_for_text("Figure 4")
        session.press("\r")
        session.wait_for_text("tick ")
        session.press("q")
        assert session.host.wait_for_end() == 0
