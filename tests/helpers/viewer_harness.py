"""The viewer without a terminal, for tests: a small live run or two recorded ones, paused."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from automaton.history.live_run import branch_of
from automaton.history.watched_run import ReplayedRun
from automaton.recording.recorder import Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from tui.playback.run_source import Opening, live, recorded
from tui.terminal.options import Options
from tui.viewer import app as viewer_app
from tui.viewer.app import Viewer
from tui.viewer.session import Display, Session

PATIENCE_S = 60.0


def screen_text(app: Viewer) -> str:
    """What a person sees, dialogs included."""
    return "\n".join(
        strip.text for strip in app.screen._compositor.render_strips(app.size)
    ).replace("\N{BRAILLE PATTERN BLANK}", " ")


class Watched:
    """A viewer, and somebody who uses it."""

    def __init__(self, app: Viewer, pilot: Pilot[Any]) -> None:
        self.app = app
        self.pilot = pilot
        self.patience = PATIENCE_S

    @property
    def session(self) -> Session:
        return self.app.session

    @property
    def display(self) -> Display:
        return self.app.main_display

    async def until(self, condition: Callable[[], Any], what: str = "") -> None:
        """Wait until it holds, but not for ever."""
        begun = time.monotonic()
        while not condition():
            assert time.monotonic() - begun < self.patience, (
                what or "what was waited for did not come"
            )
            await asyncio.sleep(0.02)

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)

    @property
    def tick(self) -> int:
        assert self.session.playback is not None
        return self.session.playback.tick

    async def at(self, tick: int) -> None:
        """Go there, and wait until it is shown, also in the lines."""
        self.app.clock.go_to(tick)
        await self.until(
            lambda: self.tick == tick and not self.display._texts_stale, f"tick {tick}"
        )

    async def shown(self) -> None:
        """Wait until nothing is left to be drawn."""
        player = self.session.player
        assert player is not None
        known = [-1]
        while known[-1] != player.latest().known or self.session.playback is not player.latest():
            known.append(player.latest().known)  # a recording is read ahead meanwhile
            await self.pilot.pause(0.3)
        before, now = "", screen_text(self.app)
        while before != now:
            await self.pilot.pause(0.3)
            before, now = now, screen_text(self.app)

    def toasts(self) -> list[str]:
        """What is said over the map, and last what is said for a while in the line under it."""
        notice = self.display.notices.notice
        said = [] if notice is None else [notice.words.text]
        return [*(toast.message for toast in self.app._notifications), *said]


def mini(*settings: str) -> Opening:
    """A live run that is not recorded."""
    return live(resolve("tabletop-mini", settings), None)


def record(path: Path, *settings: str, until: int = 600) -> Path:
    """Record the beginning of a run."""
    resolved = resolve("tabletop-mini", settings)
    with Recorder(path, resolved, resolved.scenario.seed) as recorder:
        Simulation(resolved, on_record=recorder).run(until=until)
    return path


def branch(path: Path, to: Path, tick: int, *settings: str) -> Path:
    """Record what follows, to the end, from a recorded run with other settings from a tick on."""
    run = ReplayedRun(read_recording(path))
    run.show(tick, 99)
    other = branch_of(run, settings, to)
    other.show(99_999, 99)
    other.close()
    return to


def compared(folder: Path) -> Opening:
    """Two recordings that part after a while."""
    waits = "strategy.right_of_way=wait"
    return recorded(record(folder / "a.rec"), record(folder / "b.rec", waits))


def laid_out(app: Viewer) -> bool:
    """Whether the maps have their final size, and the camera knows it."""
    rows = min(view.size.height for view in app.main_display.maps)
    shown = all(view.shown is not None for view in app.main_display.maps)
    return shown and 1 < rows == app.session.pictures.camera.rows


@asynccontextmanager
async def viewing(
    opening: Opening | None = None,
    size: tuple[int, int] = (120, 36),
    options: Options | None = None,
    toasts: bool = False,
) -> AsyncIterator[Watched]:
    """A viewer whose run and panels are there."""
    app = Viewer(opening or mini(), options or Options(paused=True, color="true"))
    with pytest.MonkeyPatch.context() as patch:
        # It would look through all objects of this process, and keep them for good.
        patch.setattr(viewer_app, "quiet_collector", lambda: None)
        try:
            async with app.run_test(size=size, notifications=toasts) as pilot:
                user = Watched(app, pilot)
                await user.until(
                    lambda: (
                        app.session.playback is not None and app.main_display.column is not None
                    ),
                    app.session.error,
                )
                await user.until(
                    lambda: (
                        app.main_display.column.is_mounted
                        and laid_out(app)
                        and app.main_display.timeline.past is not None
                    )
                )
                yield user
        finally:
            app.session.close()
