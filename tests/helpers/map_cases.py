"""Checks of the actions that pan and zoom the map, and that zoom the timeline."""

from __future__ import annotations

import numpy as np
from action_cases import CHECKS, press, said
from viewer_harness import Watched


def pans(name: str, rows: int, columns: int) -> None:
    """An action that moves the map in these directions, and lets the followed robot go."""

    async def action(user: Watched) -> None:
        camera = user.session.pictures.camera
        while camera.zoom != camera.ladder[0]:
            camera.zoom_in()
        user.session.pictures.resize = lambda rows, columns: None  # type: ignore[method-assign]
        camera.resize(3, 20)  # so that there is something beside what is seen
        camera.centre_on(camera.floor_plan.cell(6, 3))
        user.session.choice.robot, user.session.choice.following = 0, True
        top, left = camera.top, camera.left
        await press(user, name)
        assert np.sign(camera.top - top) == rows and np.sign(camera.left - left) == columns
        assert not user.session.choice.following

    CHECKS[name] = action


for way, step in {"left": (0, -1), "right": (0, 1), "up": (-1, 0), "down": (1, 0)}.items():
    pans(f"pan_{way}", *step)
    pans(f"page_{way}", *step)


def zooms(name: str, start: str, end: str) -> None:
    """An action that goes from one step of the ladder to another; "fit" is the one that fits."""

    async def action(user: Watched) -> None:
        camera = user.session.pictures.camera
        fitting = camera.copy()
        fitting.fit()
        camera.zoom = next(step for step in camera.ladder if step.name == start)
        user.session.pictures.fitted = False
        await press(user, name)
        assert camera.zoom.name == (fitting.zoom.name if end == "fit" else end)
        assert user.session.pictures.fitted == (name == "zoom_fit")

    CHECKS[name] = action


zooms("zoom_in", "1x1", "1.5x0.75")
zooms("zoom_out", "1x1", "half")
zooms("zoom_cell", "braille 1", "1x1")
_zoom_cell_steps = CHECKS["zoom_cell"]


async def zoom_cell(user: Watched) -> None:
    """It shows what is selected in the middle of a map that is larger than the screen."""
    await _zoom_cell_steps(user)
    camera = user.session.pictures.camera
    user.session.pictures.resize = lambda rows, columns: None  # type: ignore[method-assign]
    camera.resize(3, 7)
    camera.centre_on(camera.floor_plan.cell(0, 0))
    selected = camera.floor_plan.cell(6, 3)
    user.session.choose(cell=selected)
    assert camera.place_of(selected) != (1, 3)
    await press(user, "zoom_cell")
    assert camera.place_of(selected) == (1, 3)


CHECKS["zoom_cell"] = zoom_cell
zooms("zoom_fit", "braille 1", "fit")


def zooms_time(name: str, before: int, after: int) -> None:
    """An action that changes the length of what the timeline shows, about the present tick."""

    async def action(user: Watched) -> None:
        await user.at(120)
        await user.until(lambda: user.display.timeline.past.head == 120)
        user.display.timeline.zoom(0)
        user.display.timeline.zoom(before)
        ticks, column = (
            user.display.timeline.track.part.ticks,
            user.display.timeline.track.column_of(120),
        )
        await press(user, name)
        track = user.display.timeline.track
        assert track.part.ticks == ticks * 2**-after and abs(track.column_of(120) - column) <= 4
        assert f"{track.part.last:,}" in said(user.display.timeline)

    CHECKS[name] = action


zooms_time("timeline_in", 0, 1)
zooms_time("timeline_out", 2, -1)
zooms_time("timeline_whole", 1, -1)
