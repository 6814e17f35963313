"""Actions on the panels: off, beside or below the map, or in its place; and which one is open."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np
from textual.app import App

from automaton.engine.observation import is_waiting
from automaton.engine.state import NIL
from tui.actions import Command
from tui.registration import panels
from tui.session.display import Display
from tui.session.session import Session

WIDE: Final = 100  # columns from which panels have room beside the map
BESIDE_COLUMNS: Final = 36  # of a panel beside the map on a narrow screen,
BELOW_SHARE: Final = 0.45  # or the part of the rows that it has below it,
LEAST_ROWS: Final = 6  # and how many these are at least
ABOUT_CHOICE: Final = ("inspector", "why")  # panels about what is selected on the map


class PanelActions:
    """Panels."""

    def __init__(self, app: App[None], session: Session, display: Display) -> None:
        self._app, self._session, self._display = app, session, display
        self.shown = "side"  # off, side or full; on a narrow screen "side" counts as off,
        self.opened = False  # unless a panel was opened there, beside or below the map
        # Before a panel is opened by its key; False: there is nothing to open it for.
        self.before: dict[str, Callable[[], bool]] = {
            "why": self._choose_waiting,
            "inspector": self._choose_pointed,
        }

    def commands(self) -> dict[str, Command]:
        opening: dict[str, Command] = {
            panel.action: partial(self._open_by_key, name)
            for name, panel in panels().by_name.items()
        }
        return {**opening, "panels": self._turn, "compare_side": self._change_side}

    def _open_by_key(self, name: str) -> None:
        before = self.before.get(name)
        if before is None or (self._session.ready() and before()):
            self.open(name)

    def show(self, panels: str) -> None:
        """Off, side or full; on a narrow screen the side is where it leaves more of the map."""
        self.shown, column = panels, self._display.column
        self.opened = panels == "side" and self._is_narrow
        self.fit()
        for name in ("off", "side", "full"):
            self._app.screen_stack[0].set_class(name == panels, f"-panels-{name}")
        if column is not None:
            column.set_class(panels == "full", "full")
        if panels != "full" or column is None:
            self._display.maps[0].focus()
        self._display.refresh_panels()

    def fit(self) -> None:
        """Put an open panel of a narrow screen beside or below the map."""
        screen, pictures = self._app.screen_stack[0], self._session.pictures
        body, side = screen.query_one("#body"), screen.query_one("#side")
        opened, room = self.opened and self._is_narrow, body.size
        rows = max(LEAST_ROWS, round(BELOW_SHARE * room.height))
        beside = len(self._display.maps) == 1 and pictures.larger_beside(
            room.height, room.width, rows, BESIDE_COLUMNS
        )
        screen.set_class(opened, "-panels-open")
        screen.set_class(opened and not beside, "-panels-below")
        side.styles.height = rows if opened and not beside else None

    def open(self, name: str, focus: bool = True) -> None:
        """Show this panel; on a narrow screen, and in place of the map, its key closes it again.

        With `focus` it gets the keys, unless there is room for all panels beside the map.
        """
        column = self._display.column
        if not self._session.ready() or column is None:
            return
        if (self._seen == "full" or self.opened) and column.name_open == name:
            self.leave()
            return
        self._app.screen.remove_class("-map-alone")
        if self._seen == "off":
            self.show("side")
        column.open(name, focus=focus and (self.opened or self.shown == "full"))
        self._display.refresh_panels()
        if name in ABOUT_CHOICE:
            self._app.call_after_refresh(self._session.show_choice)

    def open_for_click(self) -> None:
        """Something on the map was clicked: open the inspector, unless a panel shows it already."""
        column, is_robot = self._display.column, self._session.choice.robot != NIL
        if column is None or self._app.screen.has_class("-map-alone"):
            return
        is_shown = column.name_open == "inspector" or (
            is_robot and column.name_open in ABOUT_CHOICE
        )
        if self._seen == "off" or not is_shown:
            self.open("inspector", focus=False)

    def leave_full(self) -> None:
        """Show the map again."""
        if self.shown == "full":
            self.show("side")

    def leave(self) -> None:
        """The map as it is without having opened a panel."""
        self.leave_full()
        if self.opened:
            self.opened = False
            self.fit()
            self._display.maps[0].focus()

    @property
    def _is_narrow(self) -> bool:
        return self._app.size.width < WIDE

    @property
    def _seen(self) -> str:
        is_hidden = self.shown == "side" and self._is_narrow and not self.opened
        return "off" if is_hidden else self.shown

    def _turn(self) -> None:
        self.show({"off": "side", "side": "full", "full": "off"}[self._seen])

    def _change_side(self) -> None:
        session, choice = self._session, self._session.choice
        if session.is_alone():
            return
        choice.side = (choice.side + 1) % len(self._display.maps)
        session.changed()
        own = session.opening.heads[choice.side].own
        self._display.notices.say(f"panels tell of {'AB'[choice.side]} {own}", timeout=3)

    def _choose_waiting(self) -> bool:
        """Select the robot that has waited longest, if none is selected."""
        session = self._session
        if session.playback is None:
            return False
        if session.choice.robot == NIL:
            longest = self._longest_waiting()
            if longest == NIL:
                session.notify("no robot waits; click one to select it")
                return False
            session.choose(longest)
            session.show_robot()
        return True

    def _longest_waiting(self) -> int:
        playback = self._session.playback
        assert playback is not None
        robots = playback.snapshots[self._session.choice.side].robots
        kept = np.flatnonzero(is_waiting(robots.cause))
        return int(kept[np.argmin(robots.since[kept])]) if len(kept) else NIL

    def _choose_pointed(self) -> bool:
        """Select what the mouse points at, or something if nothing is selected."""
        session, choice = self._session, self._session.choice
        if session.pointing and session.hovered != NIL:
            choice.side = session.hovered_side
            session.choose_at(session.hovered)
        elif choice.robot == choice.cell == choice.zone == NIL:
            self._choose_middle()
        return True

    def _choose_middle(self) -> None:
        """Of the map: something has to be inspected."""
        camera = self._session.pictures.camera
        middle = camera.cell_at(camera.rows // 2, camera.columns // 2)
        cell = middle if self._session.hovered == NIL else self._session.hovered
        if cell is not None:
            self._session.choose_at(cell)
