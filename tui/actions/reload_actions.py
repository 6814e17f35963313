"""What the viewer does when the files of its scenario change: show the new floor, or what is wrong."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from textual.app import App

from tui.actions.branch_actions import BranchActions
from tui.playback.reloading import Reloader
from tui.playback.run_source import Opening
from tui.screens.reload_error import ReloadErrorScreen
from tui.session.display import Display
from tui.session.session import Session

if TYPE_CHECKING:
    from tui.playback.player import Player


class Reloading:
    """Brings the thread that looks at the files together with what is shown."""

    def __init__(
        self, app: App[None], session: Session, display: Display, branches: BranchActions
    ) -> None:
        """Raises InputError if the scenario is gone."""
        self._app, self._session, self._display = app, session, display
        self._branches = branches
        reload = session.opening.reload
        assert reload is not None
        self._reloader = Reloader(
            reload.scenario,
            reload.load,
            lambda opening, player: self._later(self._loaded, opening, player),
            lambda sentence: self._later(self._failed, sentence),
        )

    def start(self) -> None:
        """Begin to look at the files."""
        self._reloader.start()

    def close(self) -> None:
        """Look at them no more."""
        self._reloader.close()

    def _later(self, *call: object) -> None:
        """From the thread: in the app's."""
        self._app.call_later(*call)  # type: ignore[arg-type]

    def _loaded(self, opening: Opening, player: Player) -> None:
        if isinstance(self._app.screen, ReloadErrorScreen):
            self._app.screen.dismiss()
        before = self._session.reopen(opening, player)
        if before is not None:
            threading.Thread(target=before.close, name="closing", daemon=True).start()
        self._branches.renew()
        self._display.show_titles()
        self._session.notify("the files were changed and loaded again: tick 0")
        self._session.ordered()
        self._session.changed()

    def _failed(self, sentence: str) -> None:
        screen = self._app.screen
        if isinstance(screen, ReloadErrorScreen):
            screen.complain(sentence)
        else:
            self._app.push_screen(ReloadErrorScreen(sentence))
