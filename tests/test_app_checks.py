"""Each check of an action fails when the action does nothing."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from test_app_actions import CHECKS, carry_out
from viewing import Watched

from tui.app import Viewer


@pytest.mark.parametrize("name", list(CHECKS))
def test_without_its_body_the_check_of_an_action_fails(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    users: list[Watched] = []
    called = []

    def nothing(app: Viewer) -> None:
        called.append(app)
        users[0].patience = 0.5  # nothing comes of it: do not wait for long

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Viewer, f"action_{name}", nothing)
    with pytest.raises(AssertionError):
        asyncio.run(carry_out(name, tmp_path, users.append))
    assert called, "the key did not even reach the action"
