"""Actions on the clock: playing, stepping, jumping."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from textual.app import App

from tui.actions import Command
from tui.session.display import Display
from tui.session.session import Session
from tui.terminal.options import SPEEDS

if TYPE_CHECKING:
    from tui.playback.player import Player


class ClockActions:
    """Time."""

    def __init__(self, app: App[None], session: Session, display: Display) -> None:
        self._app, self._session, self._display = app, session, display

    def commands(self) -> dict[str, Command]:
        return {
            "play_pause": partial(self._turn, 1),
            "reverse": partial(self._turn, -1),
            "step_forward": partial(self.step, 1),
            "step_back": partial(self.step, -1),
            "forward_10": partial(self.step, 10),
            "back_10": partial(self.step, -10),
            "forward_100": partial(self.step, 100),
            "back_100": partial(self.step, -100),
            "faster": self._faster,
            "slower": self._slower,
            "normal_speed": partial(self.set_speed, 1.0),
            "full_speed": partial(self.set_speed, math.inf),
            "go_start": partial(self.go_to, 0),
            "go_end": self._go_end,
            "go_to": self._ask_for_tick,
            "timeline_in": partial(self._display.timeline.zoom, 1),
            "timeline_out": partial(self._display.timeline.zoom, -1),
            "timeline_whole": partial(self._display.timeline.zoom, 0),
        }

    def go_to(self, tick: int, stop_at_breakpoints: bool = False) -> None:
        """Pause there; with `stop_at_breakpoints` at the first one on the way forward."""
        if self._session.ready():
            self._session.goal = tick
            self._player.seek(tick, stop_at_breakpoints)
            self._session.ordered()

    def step(self, ticks: int) -> None:
        """Pause so many ticks later, or earlier."""
        if self._session.ready():
            self._player.step(ticks)
            self._session.ordered()

    def set_speed(self, factor: float) -> None:
        """Times ten ticks a second; math.inf for as fast as it goes."""
        self._session.speed = factor
        if self._session.ready():
            self._player.set_speed(factor)
            self._session.ordered()

    @property
    def _player(self) -> Player:
        assert self._session.player is not None
        return self._session.player

    def _faster(self) -> None:
        speed = self._session.speed
        self.set_speed(min((factor for factor in SPEEDS if factor > speed), default=math.inf))

    def _slower(self) -> None:
        speed = self._session.speed
        self.set_speed(max((factor for factor in SPEEDS if factor < speed), default=SPEEDS[0]))

    def _go_end(self) -> None:
        if self._session.ready() and self._session.playback is not None:
            self.go_to(self._session.playback.head, stop_at_breakpoints=True)

    def _ask_for_tick(self) -> None:
        if not self._session.ready():
            return
        from tui.screens.dialogs import GoToScreen

        self._app.push_screen(GoToScreen(self._session.view()), self._take_tick)

    def _take_tick(self, tick: int | None) -> None:
        if tick is not None:
            self.go_to(tick, stop_at_breakpoints=True)

    def _turn(self, direction: int) -> None:
        if self._session.ready() and not (direction > 0 and self._has_ended()):
            self._player.toggle(direction)
            self._session.ordered()

    def _has_ended(self) -> bool:
        """Whether there is nothing to be played any more; if so, says why."""
        session = self._session
        playback = session.playback
        if playback is None or playback.playing or playback.tick != playback.end:
            return False
        if playback.failed:
            self._display.notices.say_failure()
            return True
        end = f"at tick {playback.tick:,}; r plays"
        if session.opening.comparing:
            session.notify(f"both runs have ended {end} them backwards")
        else:
            session.notify(f"{self._display.mode(playback).text} {end} it backwards")
        return True
