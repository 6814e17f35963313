"""Actions that find: robots, orders, cells, zones and events, and the way from one to the next."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from tui.actions.panel_actions import PanelActions
from tui.render.scene import NO_CELLS

if TYPE_CHECKING:
    from tui.screens.find_query import Found


class FindActions(PanelActions):
    """Finding and selecting."""

    found: Found | None = None
    at_found = 0  # which of them was shown last
    stepping = "events"  # or "found": the list that was used last

    def action_find(self) -> None:
        if not self.ready():
            return
        from tui.screens.find_dialog import FindScreen

        text = "" if self.found is None else self.found.text
        self.push_screen(FindScreen(self.view(), text), self._take_found)

    def _take_found(self, found: Found | None) -> None:
        if found is None:
            return
        self.found, self.stepping = found, "found"
        self.choice.found = np.array(found.robots, np.int32)
        self.leave_full_panels()
        self._show_found(found.first)

    def action_next_event(self) -> None:
        self._step_through(1)

    def action_previous_event(self) -> None:
        self._step_through(-1)

    def _step_through(self, direction: int) -> None:
        """To the next of what was found or, if that was not the last list, to the next event."""
        if not self.ready() or self.playback is None:
            return
        if self.stepping == "found" and self.found is not None:
            self._show_found(self.at_found + direction)
            return
        rows = self.runs[self.choice.side].event_history.events
        listed = self._listed_events(len(rows))
        ticks = rows[listed, 0]
        candidates = listed[
            ticks > self.playback.tick if direction > 0 else ticks < self.playback.tick
        ]
        if not len(candidates):
            self.notify("no later event is known" if direction > 0 else "no earlier event")
            return
        tick, _, robot, *_ = (int(n) for n in rows[candidates[0 if direction > 0 else -1]])
        self.go_to_tick(tick)
        if robot != NIL:
            self.choose(robot)

    def _listed_events(self, many: int) -> NDArray[np.int64]:
        """The events that the list shows under its filter."""
        if self.column is None:
            return np.arange(many)
        found: NDArray[np.int64] = self.column.events.matching(self.view())
        return found[found < many]

    def _show_found(self, index: int) -> None:
        assert self.found is not None
        places = self.found.places
        self.at_found = index % len(places)
        place = places[self.at_found]
        if self.found.robots:
            self.choose(place)
            self.show_robot()
        elif self.found.zones:
            self.choose_zone(place)
        else:
            self.choose(cell=place)
            self.show_cell(place)

    def action_next_robot(self) -> None:
        self._neighbour(1)

    def action_previous_robot(self) -> None:
        self._neighbour(-1)

    def _neighbour(self, step: int) -> None:
        if not self.ready() or self.playback is None:
            return
        many = len(self.playback.snapshots[self.choice.side].robots)
        before = self.choice.robot
        self.choose((before + step) % many if before != NIL else (0 if step > 0 else many - 1))
        self.show_robot()

    def action_clear(self) -> None:
        self.choose()
        self.found, self.stepping = None, "events"
        self.choice.found = NO_CELLS
        self.hovered = NIL
        self.screen.remove_class("-map-alone")
        self.leave_full_panels()
        self.changed()

    def choose_zone(self, zone: int) -> None:
        """Select a zone, and bring its middle on the screen unless some of it is there."""
        self.choose(zone=zone)
        cells = self.pictures.zone_cells(self.playback, zone, self.choice.side)
        if cells and not any(self.pictures.camera.place_of(cell) is not None for cell in cells):
            self.show_cell(cells[len(cells) // 2])

    def choose_at(self, cell: int) -> None:
        """Select the robot in a cell, or the cell if there is none."""
        if self.playback is None:
            self.choose(cell=cell)
            return
        robots = self.playback.snapshots[self.choice.side].robots
        at = np.where(robots.cell == NIL, robots.bay, robots.cell)
        here = np.flatnonzero(at == cell)
        self.choose(int(here[0]) if len(here) else NIL, NIL if len(here) else cell)
