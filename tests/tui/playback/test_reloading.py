"""When the files of a scenario count as changed: once they were written, in whatever way."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tui.viewer.branch_actions import ScenarioFiles


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    (tmp_path / "hall.txt").write_text("b..d\n")
    own = tmp_path / "hall.yaml"
    own.write_text("layout: {file: hall.txt}\n")
    return own


def looks(files: ScenarioFiles, many: int = 3) -> list[bool]:
    return [files.settled_change() for _ in range(many)]


def test_nothing_happens_while_nothing_is_written(hall: Path) -> None:
    assert not any(looks(ScenarioFiles(str(hall))))


def test_a_change_counts_once_it_is_the_same_at_two_looks(hall: Path) -> None:
    files, floor = ScenarioFiles(str(hall)), hall.with_name("hall.txt")
    floor.write_text("b...d\n")
    assert not files.settled_change()
    floor.write_text("b....d\n")
    assert looks(files, 2) == [False, True], "somebody still wrote"
    files.note_loading()
    assert not any(looks(files))


def test_a_file_that_another_is_put_in_place_of_has_changed(hall: Path) -> None:
    files, floor = ScenarioFiles(str(hall)), hall.with_name("hall.txt")
    times = floor.stat()
    other = hall.with_name(".hall.txt.swp")
    other.write_text("b.#d\n")  # as long as the one before,
    os.utime(other, ns=(times.st_atime_ns, times.st_mtime_ns))  # and as old
    other.replace(floor)
    assert looks(files, 2) == [False, True]


def test_a_file_that_is_gone_for_a_while_is_still_looked_at(hall: Path) -> None:
    files, floor = ScenarioFiles(str(hall)), hall.with_name("hall.txt")
    floor.unlink()
    assert looks(files, 2) == [False, True]
    files.note_loading()
    assert not any(looks(files))
    floor.write_text("b..d\n")
    assert looks(files, 2) == [False, True]


def test_files_that_are_named_later_are_looked_at(hall: Path) -> None:
    files = ScenarioFiles(str(hall))
    other = hall.with_name("other.txt")
    other.write_text("b.d\n")
    hall.write_text("layout: {file: other.txt}\n")
    assert looks(files, 2) == [False, True]
    files.note_loading()
    other.write_text("b..d\n")
    assert looks(files, 2) == [False, True]
