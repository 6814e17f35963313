"""Actions on the clock: playing, stepping, jumping."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tui.actions.viewer_base import ViewerBase
from tui.terminal.options import SPEEDS

if TYPE_CHECKING:
    from tui.playback.player import Player


class TimeActions(ViewerBase):
    """Time."""

    def action_play_pause(self) -> None:
        self._turn(1)

    def action_reverse(self) -> None:
        self._turn(-1)

    def action_step_forward(self) -> None:
        self._step(1)

    def action_step_back(self) -> None:
        self._step(-1)

    def action_forward_10(self) -> None:
        self._step(10)

    def action_back_10(self) -> None:
        self._step(-10)

    def action_forward_100(self) -> None:
        self._step(100)

    def action_back_100(self) -> None:
        self._step(-100)

    def action_faster(self) -> None:
        self._set_speed(min((f for f in SPEEDS if f > self.speed), default=math.inf))

    def action_slower(self) -> None:
        self._set_speed(max((f for f in SPEEDS if f < self.speed), default=SPEEDS[0]))

    def action_normal_speed(self) -> None:
        self._set_speed(1.0)

    def action_full_speed(self) -> None:
        self._set_speed(math.inf)

    def action_go_start(self) -> None:
        self.go_to_tick(0)

    def action_go_end(self) -> None:
        if self.ready() and self.playback is not None:
            self.go_to_tick(self.playback.head, stop_at_breakpoints=True)

    def action_timeline_in(self) -> None:
        self.timeline.zoom(1)

    def action_timeline_out(self) -> None:
        self.timeline.zoom(-1)

    def action_timeline_whole(self) -> None:
        self.timeline.zoom(0)

    def action_go_to(self) -> None:
        if not self.ready():
            return
        from tui.screens.go_to_dialog import GoToScreen

        self.push_screen(GoToScreen(self.view()), self._go_to_chosen)

    def go_to_tick(self, tick: int, stop_at_breakpoints: bool = False) -> None:
        """Pause there; with `stop_at_breakpoints` at the first one on the way forward."""
        if self.ready():
            self.goal = tick
            self._player.seek(tick, stop_at_breakpoints)
            self.ordered()

    def _go_to_chosen(self, tick: int | None) -> None:
        if tick is not None:
            self.go_to_tick(tick, stop_at_breakpoints=True)

    @property
    def _player(self) -> Player:
        assert self.player is not None
        return self.player

    def _turn(self, direction: int) -> None:
        if self.ready() and not (direction > 0 and self._has_ended()):
            self._player.toggle(direction)
            self.ordered()

    def _has_ended(self) -> bool:
        """Whether there is nothing to be played any more; if so, says why."""
        playback = self.playback
        if playback is None or playback.playing or playback.tick != playback.end:
            return False
        if playback.failed:
            self.notify_failure()
        elif self.opening.comparing:
            self.notify(f"both runs have ended at tick {playback.tick:,}; r plays them backwards")
        else:
            self.notify(
                f"{self.mode(playback).text} at tick {playback.tick:,}; r plays it backwards"
            )
        return True

    def _step(self, ticks: int) -> None:
        if self.ready():
            self._player.step(ticks)
            self.ordered()

    def _set_speed(self, factor: float) -> None:
        self.speed = factor
        if self.ready():
            self._player.set_speed(factor)
            self.ordered()
