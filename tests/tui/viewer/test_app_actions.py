"""Every action of the viewer, by its key."""

from __future__ import annotations

import asyncio
from pathlib import Path

import map_cases  # its checks are entered into the table
import pytest
from action_cases import CHECKS
from docs_pages import page
from viewer_actions import carry_out, rows_of_actions
from viewer_harness import mini, viewing

from tui.terminal.options import Options
from tui.viewer.app import Viewer
from tui.widgets.bindings import TOPICS, VIEWER_ACTIONS

__all__ = ["map_cases"]


def test_a_branch_brings_its_zones(folder: Path) -> None:
    async def story() -> None:
        async with viewing(mini()) as user:
            await user.at(20)
            before = user.session.pictures.floors[0].traffic_zones.count
            user.app.branches.take(("world.traffic_zones=directed",))
            await user.until(
                lambda: user.session.pictures.floors[0].traffic_zones.count == 2 * before
            )

    asyncio.run(story())


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_action_of_the_table_is_carried_out_by_one_group() -> None:
    viewer = Viewer(mini(), Options())
    ids = [id for group in viewer.groups for id in group.commands()]
    assert sorted(ids) == sorted([*(action.id for action in VIEWER_ACTIONS), "command_palette"])


def test_every_action_has_a_check_and_no_check_is_without_action() -> None:
    assert set(CHECKS) == {action.id for action in VIEWER_ACTIONS}
    assert sorted(name for row in rows_of_actions() for name in row) == sorted(CHECKS)


@pytest.mark.parametrize("names", rows_of_actions(), ids=lambda names: names[0])
def test_a_check_passes_with_its_action_and_fails_where_it_does_nothing(
    names: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asyncio.run(carry_out(names, folder, monkeypatch))


def test_the_page_on_watching_gives_every_layer_its_own_key() -> None:
    text = page("docs/how-to/watch-a-fleet.md").text
    row = next(line for line in text.splitlines() if line.startswith("| **Layers** |"))
    (layers,) = [topic.actions for topic in TOPICS if topic.name == "Layers"]
    for action in layers:
        for key in action.keys.split(","):
            written = key.upper() if key.startswith("f") else key
            told = row.partition(f"`{written}`")[2].partition(", `")[0].lower()
            what = {"layer_none": "none", "next_layer": "goes through"}.get(
                action.id, action.id.removeprefix("layer_")
            )
            assert what in told, key
