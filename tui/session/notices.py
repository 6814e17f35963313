"""Sentences to the user: a short one in the line above the status line, a long one over the map."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from textual.app import App
from textual.notifications import SeverityLevel

from tui.render import styles
from tui.session.session import Session
from tui.widgets.word_row import Word, word

NOTICE_S: Final = 5.0
FAILURE_S: Final = 20.0
LINES_S: Final = 0.1  # between two updates of the lines under the map
NOTICE_COLOURS: Final = {
    "information": styles.COLOUR_TEXT,
    "warning": styles.COLOUR_LOADED,
    "error": styles.COLOUR_FAULT,
}


class Notice(NamedTuple):
    """A sentence in the line above the status line, for a while."""

    words: Word
    until: float
    layer: str | None = None  # with another one it goes sooner, as it does
    robot: int | None = None  # with another robot selected


class Notices:
    """What was said last in the line, and the way over the map for what does not fit."""

    def __init__(
        self, app: App[None], session: Session, line: Any, refresh: Callable[[], None]
    ) -> None:
        """`line` is the widget of the line, `refresh` writes it again."""
        self._app, self._session, self._line, self._refresh = app, session, line, refresh
        self.notice: Notice | None = None

    def say(
        self, message: str, severity: SeverityLevel = "information", timeout: float | None = None
    ) -> None:
        """Say it for so many seconds."""
        seconds = NOTICE_S if timeout is None else timeout
        if not self._fits_line(message):
            self._toast(message, severity, seconds)
            return
        until = asyncio.get_running_loop().time() + seconds
        self.notice = Notice(word(message, NOTICE_COLOURS[severity]), until)
        self._refresh()
        self._app.set_timer(seconds + LINES_S, self._refresh)

    def say_of_layer(self, message: str) -> None:
        """Say what holds as long as this layer is shown and this robot selected."""
        self.say(message)
        choice = self._session.choice
        self._let_go(message, layer=choice.layer, robot=choice.robot)

    def say_switched_off(self, message: str) -> None:
        """Say it until another layer is shown: its scale is in the same line."""
        self.say(message, "warning", FAILURE_S)
        self._let_go(message, layer=self._session.choice.layer)

    def say_failure(self) -> None:
        """The whole sentence, with the strategy's file and line."""
        if self._session.playback is not None:
            self._toast(self._session.playback.failed, "error", FAILURE_S)

    def current(self) -> Word | None:
        """What the line has still to say."""
        notice, choice = self.notice, self._session.choice
        if notice is not None:
            late = notice.until <= asyncio.get_running_loop().time()
            other_layer = notice.layer not in (None, choice.layer)
            if late or other_layer or notice.robot not in (None, choice.robot):
                self.notice = None
        return None if self.notice is None else self.notice.words

    def _let_go(self, message: str, layer: str, robot: int | None = None) -> None:
        """Of this sentence, if the line has it: with another layer or robot it goes."""
        if self.notice is not None and self.notice.words.text == message:
            self.notice = self.notice._replace(layer=layer, robot=robot)

    def _toast(self, message: str, severity: SeverityLevel, seconds: float) -> None:
        self._app.clear_notifications()  # one at a time: many would cover the status line
        App.notify(self._app, message, severity=severity, timeout=seconds, markup=False)

    def _fits_line(self, message: str) -> bool:
        fits = message.isascii() and len(message) <= self._line.size.width
        return fits and len(self._app.screen_stack) == 1 and bool(self._line.is_on_screen)
