"""Each check of an action fails when the action does nothing."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from action_cases import CHECKS
from docs_pages import page
from viewer_actions import carry_out
from viewer_harness import Watched

from tui.viewer.app import Viewer
from tui.widgets.bindings import TOPICS


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


@pytest.mark.parametrize("name", list(CHECKS))
def test_without_its_body_the_check_of_an_action_fails(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    users: list[Watched] = []
    called = []

    does = Viewer.action_do

    async def do(app: Viewer, id: str) -> None:
        if id != name:
            await does(app, id)
            return
        called.append(app)
        users[0].patience = 0.1  # nothing comes of it: do not wait for long

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Viewer, "action_do", do)
    with pytest.raises(AssertionError):
        asyncio.run(carry_out(name, tmp_path, users.append))
    assert called, "the key did not even reach the action"
