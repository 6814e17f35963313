"""Panels and layers of another distribution come in by its entry points, as ours do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tui.registration import layers, panels

MODULE = """
import numpy as np
from tui.render.layer import Layer
from tui.widgets.panel import Panel
from tui.widgets.styled_lines import line
from tui.widgets.text_panel import TextPanel


class Dust(Layer):
    key, label, unit = "f11", "Dust", "grains"

    def numbers(self, simulation, selected):
        return np.arange(simulation.world.grid.cell_flags.size, dtype=np.int32)


class Notes(TextPanel):
    def panel_lines(self, view, width):
        return [line(f"noted at tick {view.snapshot.tick}")]


NOTES = Panel("notes", "my_viewer:Notes", key="u", label="Notes")
WRONG = Panel("wrong", "my_viewer:NoSuchWidget")
"""
ENTRY_POINTS = """
[automaton.layers]
dust = my_viewer:Dust
mud = my_viewer:Mud

[automaton.panels]
notes = my_viewer:NOTES
wrong = my_viewer:WRONG
"""
STORY = """
import asyncio
from viewer_harness import screen_text, viewing


async def story():
    async with viewing(size=(140, 40)) as user:
        print(*user.toasts(), sep="\\n")
        await user.at(20)
        await user.press("f11")
        await user.until(lambda: user.session.playback.snapshots[0].heat is not None)
        await user.press("u")
        await user.shown()
        print(screen_text(user.app))


asyncio.run(story())
"""


def test_ours_are_registered_and_all_of_them_load() -> None:
    assert list(panels().by_name)[:5] == ["inspector", "why", "events", "robots", "legend"]
    assert not layers().problems and not panels().problems


def test_another_package_adds_a_panel_and_a_layer_and_a_broken_one_is_left_out(
    tmp_path: Path,
) -> None:
    (tmp_path / "my_viewer.py").write_text(MODULE)
    folder = tmp_path / "my_viewer-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: my-viewer\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text(ENTRY_POINTS)
    helpers = Path(__file__).parents[2] / "helpers"
    path = os.pathsep.join((str(tmp_path), str(helpers), os.environ.get("PYTHONPATH", "")))
    done = subprocess.run(
        [sys.executable, "-c", STORY],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    said = done.stdout
    assert "layer 'mud' is left out: AttributeError: module 'my_viewer' has no attribute" in said
    assert "panel 'wrong' is left out: AttributeError: module 'my_viewer' has no attribute" in said
    assert "dust" in said and "noted at tick 20" in said and "notes u" in said
