"""Which files a scenario consists of."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.errors import InputError
from automaton.scenario.reading import named_files


def test_a_scenario_and_the_files_beside_it_that_it_names(tmp_path: Path) -> None:
    own, floor, orders = (tmp_path / name for name in ("hall.yaml", "hall.txt", "week/orders.csv"))
    orders.parent.mkdir()
    floor.touch()
    orders.touch()
    own.write_text("layout: {file: hall.txt}\norders: {lists: [week/orders.csv, gone.csv, week]}\n")
    assert named_files(own) == (own, floor, orders)


def test_of_a_broken_scenario_its_own_file_is_known(tmp_path: Path) -> None:
    own = tmp_path / "hall.yaml"
    own.write_text("layout: {file: hall.txt")
    assert named_files(own) == (own,)
    with pytest.raises(InputError, match="no such file"):
        named_files(tmp_path / "other.yaml")


def test_a_shipped_scenario_is_found_by_its_name() -> None:
    assert [path.name for path in named_files("tabletop-mini")] == ["tabletop-mini.yaml"]
