"""Panels and layers of another distribution come in by its entry points, as ours do."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from viewer_harness import record

from automaton.errors import InputError
from tui import registration
from tui.playback import film
from tui.playback.film import Request
from tui.registration import LAYER_GROUP, PANEL_GROUP, RESERVED, layers, panels
from tui.render.layer import Layer
from tui.render.scene import Choice
from tui.viewer import view_actions
from tui.widgets.bindings import VIEWER_ACTIONS
from tui.widgets.panel import Panel

MODULE = """
import numpy as np
from tui.render.layer import Layer
from tui.widgets.panel import Panel, TextPanel, line


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
RECORDED = """
import asyncio
from tui.viewer.session import Notices
from tui.viewer.app import Viewer
from viewer_harness import screen_text, viewing

sentences = []  # a busy machine may be late to look at the screen


def recorded(method):
    def say(self, message, *rest, **options):
        sentences.append(message)
        return method(self, message, *rest, **options)

    return say


Viewer.notify, Notices.say = recorded(Viewer.notify), recorded(Notices.say)
"""
STORY = (
    RECORDED
    + """
async def story():
    async with viewing(size=(140, 40)) as user:
        print(*sentences, sep="\\n")
        await user.at(20)
        await user.press("f11")
        await user.until(lambda: user.session.playback.snapshots[0].heat is not None)
        await user.press("u")
        await user.shown()
        print(screen_text(user.app))


asyncio.run(story())
"""
)


def test_ours_are_registered_and_all_of_them_load() -> None:
    assert list(panels().by_name)[:5] == ["inspector", "why", "events", "robots", "legend"]
    assert not layers().problems and not panels().problems


GREEDY = """
from tui.render.layer import Layer
from tui.widgets import panels
from tui.widgets.panel import Panel


class Zones(Layer):
    key, label, action, position = "f12", "Mine", "layer_zones", 5


class Loud(Layer):
    action = "find"


class Late(Layer):
    position = "ten"


class Plain(Layer):
    pass


class Same(Layer):
    key = "f12,f7"


GREEDY = Panel("greedy", "my_viewer:Notes", key="f3, u, slash", position=0, listed=0, action="find")
NOTES = Panel("notes", "my_viewer:Notes", key="u")
EVENTS = panels.EVENTS
"""
GREEDY_POINTS = """
[automaton.layers]
aaa = my_viewer:Zones
loud = my_viewer:Loud
late = my_viewer:Late
none = my_viewer:Plain
route = my_viewer:Plain
zones = my_viewer:Plain
visits = my_viewer:Plain
same = my_viewer:Same

[automaton.panels]
find = my_viewer:GREEDY
follow = my_viewer:NOTES
events = my_viewer:NOTES
again = my_viewer:EVENTS
my.notes = my_viewer:NOTES
"""
TABLE = """
from collections import Counter
from tui.viewer.seek_actions import FindActions
from tui.registration import layers, panels
from tui.terminal.options import Options
from tui.viewer.app import Viewer
from tui.widgets.bindings import VIEWER_ACTIONS
from viewer_harness import mini

print(*layers().problems, *panels().problems, sep="\\n")
for action in VIEWER_ACTIONS:
    print(action.id, "has", action.keys or "no key", "and is", action.label)
print("panels", *panels().by_name)
assert max(Counter(action.id for action in VIEWER_ACTIONS).values()) == 1
keys = Counter(key for action in VIEWER_ACTIONS for key in action.keys.split(",") if key)
assert max(keys.values()) == 1, keys
viewer = Viewer(mini(), Options())
assert {action.id for action in VIEWER_ACTIONS} <= viewer._commands.keys()
print("find is of", type(viewer._commands["find"].__self__).__name__)
print("follow is of", type(viewer._commands["follow"].__self__).__name__)
"""
FAILING = """
import numpy as np
from tui.render.layer import Layer
from tui.widgets.panel import Panel, TextPanel


class Rust(Layer):
    key = "f11"

    def numbers(self, simulation, selected):
        raise ValueError("no rust")


class Smoke(Layer):
    key = "f12"

    def tints(self, scene):
        raise ValueError("no smoke")


class Turned(Layer):
    key = "U"

    def numbers(self, simulation, selected):
        return np.zeros(12, np.int32)


class Soft(Layer):
    key = "Y"

    def numbers(self, simulation, selected):
        return simulation.world.grid.cell_flags * 0.5


class Unbuilt(TextPanel):
    def __init__(self, signs, *, id=None):
        raise ValueError("no ground")


class Silent(TextPanel):
    def panel_lines(self, view, width):
        raise ValueError("no words")


UNBUILT = Panel("unbuilt", "my_viewer:Unbuilt")
SILENT = Panel("silent", "my_viewer:Silent", key="u")
"""
FAILING_POINTS = """
[automaton.layers]
rust = my_viewer:Rust
smoke = my_viewer:Smoke
turned = my_viewer:Turned
soft = my_viewer:Soft

[automaton.panels]
silent = my_viewer:SILENT
unbuilt = my_viewer:UNBUILT
"""
OF_TWELVE = "numbers() gave int32 of shape (12,), not integers of shape (126,)"
OF_HALVES = "numbers() gave float64 of shape (126,), not integers of shape (126,)"
FAILURES = (
    RECORDED
    + """
async def story():
    async with viewing(size=(140, 40)) as user:
        for key, words in (
            ("f11", "no rust"),
            ("f12", "no smoke"),
            ("U", "of shape (12,)"),
            ("Y", "gave float64"),
            ("u", "no words"),
        ):
            await user.press(key)
            await user.until(lambda: any(words in said for said in sentences), words)
            await user.until(lambda: user.session.choice.layer == "", "the plain floor")
            if key == "U":
                await user.press("f3")
                await user.until(lambda: user.display.notices.current() is None, "the scale")
        await user.press("f11")
        await user.at(20)
        await user.shown()
        print("switched off", user.session.choice.layer or "none")
        assert not user.display.column.panels["silent"].visible
        await user.press("L")
        await user.shown()
        print("next is", user.session.choice.layer)
        print(*sentences, sep="\\n")


asyncio.run(story())
"""
)
CAST = """
import sys
from pathlib import Path
from automaton.commands import main
from viewer_harness import record

record(Path("run.rec"), until=10)
sys.stderr = sys.stdout
for layer in ("turned", "soft"):
    print(main(["cast", "run.rec", "--layer", layer, "--picture", "h.svg"]), flush=True)
"""


def said_with(folder: Path, module: str, points: str, story: str) -> str:
    """What a story prints beside a distribution with this module and these entry points."""
    (folder / "my_viewer.py").write_text(module)
    about = folder / "my_viewer-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-viewer\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(points)
    helpers = Path(__file__).parents[2] / "helpers"
    path = os.pathsep.join((str(folder), str(helpers), os.environ.get("PYTHONPATH", "")))
    done = subprocess.run(
        [sys.executable, "-c", story],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_another_package_adds_a_panel_and_a_layer_and_a_broken_one_is_left_out(
    tmp_path: Path,
) -> None:
    said = said_with(tmp_path, MODULE, ENTRY_POINTS, STORY)
    assert "layer 'mud' is left out: AttributeError: module 'my_viewer' has no attribute" in said
    assert "panel 'wrong' is left out: AttributeError: module 'my_viewer' has no attribute" in said
    assert "dust" in said and "noted at tick 20" in said and "notes u" in said


def test_another_package_takes_no_name_action_or_key_that_is_taken(tmp_path: Path) -> None:
    said = said_with(tmp_path, GREEDY, GREEDY_POINTS, TABLE)
    assert "layer_zones has f7 and is Zones\n" in said
    assert "layer_visits has f3 and is Visits\n" in said
    assert "layer_same has f12 and is same\n" in said
    assert "panel_find has u and is find\n" in said and "panel_follow has no key" in said
    assert "find is of FindActions" in said and "follow is of MapActions" in said
    for name, why in {
        "loud": "ValueError: its action 'find' does not begin with 'layer_'",
        "late": "TypeError: position is 'ten', not of type int",
        "none": "ValueError: the action 'layer_none' is taken",
        "route": "ValueError: the action 'layer_route' is taken",
        "zones": "ValueError: the action 'layer_zones' is taken",
        "visits": "ValueError: the name is taken",
    }.items():
        assert f"layer '{name}' is left out: {why}\n" in said
    assert "panel 'events' is left out: ValueError: the name is taken\n" in said
    assert "panel 'my.notes' is left out: ValueError: a name has letters" in said
    assert "panels find inspector why events again robots legend follow\n" in said


def test_the_ids_that_no_layer_may_take_are_those_of_the_fixed_actions() -> None:
    brought = {layer.action for layer in layers().by_name.values()}
    fixed = {action.id for action in VIEWER_ACTIONS} - brought
    assert {id for id in fixed if id.startswith(("layer_", "panel_"))} == set(RESERVED)


def test_what_raises_in_a_frame_is_said_once_and_switched_off(tmp_path: Path) -> None:
    said = said_with(tmp_path, FAILING, FAILING_POINTS, FAILURES)
    assert "panel 'unbuilt' is left out: ValueError: no ground" in said
    assert "layer 'rust' is left out: ValueError: no rust" in said
    assert "layer 'smoke' is left out: ValueError: no smoke" in said
    assert "panel 'silent' is left out: ValueError: no words" in said
    assert f"layer 'turned' is left out: ValueError: {OF_TWELVE}" in said
    assert f"layer 'soft' is left out: ValueError: {OF_HALVES}" in said
    assert "switched off none" in said and "next is visits" in said


def test_a_picture_of_a_layer_with_numbers_of_another_shape_or_type_ends_with_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = said_with(tmp_path, FAILING, FAILING_POINTS, CAST)
    assert f"layer 'turned' is left out: ValueError: {OF_TWELVE}\n2\n" in said
    assert f"layer 'soft' is left out: ValueError: {OF_HALVES}\n2\n" in said
    assert not (tmp_path / "h.svg").exists()


def test_an_installation_without_entry_points_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = record(tmp_path / "run.rec", until=10)
    monkeypatch.setattr(registration, "entry_points", lambda group: ())
    nothing = registration._registered(PANEL_GROUP, "panel", Panel)
    advice = "install the project again (pip install -e .)"
    assert nothing.problems == (f"no panels are registered: {advice}",)
    no_layers = registration._registered(LAYER_GROUP, "layer", Layer)
    monkeypatch.setattr(film, "layers", lambda: no_layers)
    with pytest.raises(InputError, match=re.escape(f"no layers are registered: {advice}")):
        film.Film(path, Request(layer="visits"))


def test_a_copied_text_says_the_zones_of_the_branch(monkeypatch: pytest.MonkeyPatch) -> None:
    class Telling(Layer):
        def key_words(self, scene: Any, resolved: Any, glyphs: Any) -> list[str]:
            return [resolved]

    monkeypatch.setattr(view_actions, "layer_named", lambda name: Telling())
    session: Any = SimpleNamespace(
        choice=Choice(),
        opening=SimpleNamespace(resolved=["before"]),
        runs=(),
        scene=lambda side: None,
        glyphs=None,
    )
    capture = view_actions.CaptureActions(cast(Any, None), session, cast(Any, None))
    assert capture._key(0) == "before\n"
    session.runs = [SimpleNamespace(resolved="branched")]
    assert capture._key(0) == "branched\n"
