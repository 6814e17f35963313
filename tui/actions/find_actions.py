"""Actions that find: robots, orders, cells, zones and events, and the way from one to the next."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from textual.app import App

from automaton.engine.state import NIL
from tui.actions import Command
from tui.actions.clock_actions import ClockActions
from tui.actions.panel_actions import PanelActions
from tui.playback.frame_cache import robot_cell
from tui.render.scene import NO_CELLS
from tui.session.display import Display
from tui.session.session import Session

if TYPE_CHECKING:
    from tui.screens.find_dialog import Found


class Before:
    """What the map showed before something was looked for."""

    def __init__(self, session: Session) -> None:
        choice, pictures = session.choice, session.pictures
        self._marked = choice.matches, choice.match_cells
        self._view = pictures.camera.copy(), pictures.fitted

    def restore(self, session: Session) -> None:
        """Show it again."""
        choice, pictures = session.choice, session.pictures
        choice.matches, choice.match_cells = self._marked
        rows, columns = pictures.camera.rows, pictures.camera.columns
        pictures.camera, pictures.fitted = self._view
        pictures.resize(rows, columns)
        session.changed()


class FindActions:
    """Finding and selecting."""

    def __init__(
        self,
        app: App[None],
        session: Session,
        display: Display,
        clock: ClockActions,
        panels: PanelActions,
    ) -> None:
        self._app, self._session, self._display = app, session, display
        self._clock, self._panels = clock, panels
        self._found: Found | None = None
        self._at_found = 0  # which of them was shown last
        self._stepping = "events"  # or "found": the list that was used last
        panels.before["events"] = self._step_through_events

    def commands(self) -> dict[str, Command]:
        return {
            "find": self._find,
            "next_event": partial(self._step_through, 1),
            "previous_event": partial(self._step_through, -1),
            "next_robot": partial(self._neighbour, 1),
            "previous_robot": partial(self._neighbour, -1),
            "next_difference": self._go_to_difference,
            "jam": self._go_to_jam,
            "clear": self._clear,
        }

    def _find(self) -> None:
        if not self._session.ready():
            return
        from tui.screens.find_dialog import FindScreen

        text = "" if self._found is None else self._found.text
        before = Before(self._session)
        self._app.screen.add_class("-finding")  # makes room

        def taken(chosen: Found | None) -> None:
            self._app.screen.remove_class("-finding")
            if chosen is None:
                before.restore(self._session)
            else:
                self._take_found(chosen)

        self._app.push_screen(FindScreen(self._session.view(), text, self._preview), taken)

    def _mark(self, matches: Found) -> None:
        """Have the map show the matches."""
        choice = self._session.choice
        choice.matches = np.array(matches.robots, np.int32)
        cells = matches.cells or self._cells_of(matches.zones)
        choice.match_cells = np.array(cells, np.int32)

    def _cells_of(self, zones: tuple[int, ...]) -> list[int]:
        session = self._session
        of_zone = partial(session.pictures.zone_cells, session.playback, side=session.choice.side)
        return [cell for zone in zones for cell in of_zone(zone)]

    def _preview(self, matches: Found) -> None:
        """Mark it while it is typed, and bring the match under the cursor on the screen."""
        session, playback = self._session, self._session.playback
        self._mark(matches)
        if matches and playback is not None:
            place = matches.places[matches.first]
            if matches.robots:
                place = robot_cell(playback, replace(session.choice, robot=place))
            elif matches.zones:
                place = next(iter(self._cells_of((place,))), NIL)
            session.show_cell(place)
        session.changed()

    def _take_found(self, found: Found) -> None:
        self._found, self._stepping = found, "found"
        self._mark(found)
        self._panels.leave_full()
        self._show_found(found.first)

    def _step_through_events(self) -> bool:
        self._stepping = "events"
        return True

    def _step_through(self, direction: int) -> None:
        """To the next of what was found or, if that was not the last list, to the next event."""
        session = self._session
        if not session.ready() or session.playback is None:
            return
        if self._stepping == "found" and self._found is not None:
            self._show_found(self._at_found + direction)
            return
        rows = session.runs[session.choice.side].event_history.events
        listed = self._listed_events(len(rows))
        ticks, now = rows[listed, 0], session.playback.tick
        candidates = listed[ticks > now if direction > 0 else ticks < now]
        if not len(candidates):
            session.notify("no later event is known" if direction > 0 else "no earlier event")
            return
        tick, _, robot, *_ = (int(n) for n in rows[candidates[0 if direction > 0 else -1]])
        self._clock.go_to(tick)
        if robot != NIL:
            session.choose(robot)

    def _listed_events(self, many: int) -> NDArray[np.int64]:
        """The events that the list shows under its filter."""
        column = self._display.column
        listed: NDArray[np.int64] | None = (
            None if column is None else column.listed_events(self._session.view())
        )
        return np.arange(many) if listed is None else listed[listed < many]

    def _show_found(self, index: int) -> None:
        assert self._found is not None
        places = self._found.places
        self._at_found = index % len(places)
        place = places[self._at_found]
        if self._found.robots:
            self._session.choose(place)
            self._session.show_robot()
        elif self._found.zones:
            self._session.choose_zone(place)
        else:
            self._session.choose(cell=place)
            self._session.show_cell(place)

    def _neighbour(self, step: int) -> None:
        session = self._session
        if not session.ready() or session.playback is None:
            return
        many = len(session.playback.snapshots[session.choice.side].robots)
        before = session.choice.robot
        session.choose((before + step) % many if before != NIL else (0 if step > 0 else many - 1))
        session.show_robot()

    def _go_to_difference(self) -> None:
        session, divergence = self._session, self._session.divergence
        if session.is_alone():
            return
        if divergence is None:
            equal = "so far the runs are equal"
            session.notify(equal if session.opening.live else "the runs are still being compared")
        elif divergence.tick is None:
            session.notify(divergence.text)
        else:
            self._clock.go_to(divergence.tick)

    def _go_to_jam(self) -> None:
        session = self._session
        if not session.ready() or session.playback is None:
            return
        from tui.screens.find_dialog import find

        found = find("jam", session.view())
        if found:
            self._take_found(found)
        else:
            session.notify("no jam: no robots stand together without progress for long")

    def _clear(self) -> None:
        self._session.choose()
        self._found, self._stepping = None, "events"
        self._session.choice.matches = self._session.choice.match_cells = NO_CELLS
        self._session.hovered = NIL
        self._app.screen.remove_class("-map-alone")
        self._panels.leave()
        self._session.changed()
