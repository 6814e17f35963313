"""Actions that go to ticks, robots and places: playing, stepping, jumping, finding."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from textual.app import App

from automaton.engine.state import NIL
from tui.playback.frame_cache import robot_cell
from tui.render.scene import NO_CELLS
from tui.terminal.options import SPEEDS
from tui.viewer.session import Command, Display, Session
from tui.viewer.view_actions import PanelActions

if TYPE_CHECKING:
    from tui.playback.player import Player
    from tui.screens.find_dialog import Found


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
        """Go to a tick and pause; with `stop_at_breakpoints`, pause at the first one before it."""
        if self._session.ready():
            playback = self._session.playback
            self._session.goal, self._session.goal_from = tick, playback.tick if playback else 0
            self._player.seek(tick, stop_at_breakpoints)
            self._session.ordered()

    def step(self, ticks: int) -> None:
        """Go by `ticks`, negative for back, and pause."""
        if self._session.ready():
            self._session.goal = None
            self._player.step(ticks)
            self._session.ordered()

    def set_speed(self, factor: float) -> None:
        """Set the speed in units of ten ticks per second; math.inf for full speed."""
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
            self._session.goal = None
            self._player.toggle(direction)
            self._session.ordered()

    def _has_ended(self) -> bool:
        """Whether the end has been reached; if so, notify the user."""
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


class FindActions:
    """Actions that find robots, orders, cells, zones and events, and step through them."""

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
        self._at_found = 0  # index of the match shown last
        self._stepping = "events"  # or "found": the list used last
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
            "deadlock": self._go_to_deadlock,
            "bottleneck": self._go_to_bottleneck,
            "clear": self._clear,
        }

    def _find(self) -> None:
        if not self._session.ready():
            return
        from tui.screens.find_dialog import FindScreen

        text = "" if self._found is None else self._found.text
        before = Before(self._session)
        self._app.screen.add_class("-finding")  # makes room for the dialog

        def taken(chosen: Found | None) -> None:
            self._app.screen.remove_class("-finding")
            if chosen is None:
                before.restore(self._session)
            else:
                self._take_found(chosen)

        self._app.push_screen(FindScreen(self._session.view(), text, self._preview), taken)

    def _mark(self, matches: Found) -> None:
        """Mark the matches on the map."""
        choice = self._session.choice
        choice.matches = np.array(matches.robots, np.int32)
        cells = matches.cells or self._cells_of(matches.zones)
        choice.match_cells = np.array(cells, np.int32)

    def _cells_of(self, zones: tuple[int, ...]) -> list[int]:
        session = self._session
        of_zone = partial(session.pictures.zone_cells, session.playback, side=session.choice.side)
        return [cell for zone in zones for cell in of_zone(zone)]

    def _preview(self, matches: Found) -> None:
        """Mark the matches while the user types, and bring the selected one onto the screen."""
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

    def _step_through_events(self) -> None:
        self._stepping = "events"

    def _step_through(self, direction: int) -> None:
        """Go to the next match, or to the next event if the events were used last."""
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
        """Indices of the events that pass the filter of the list."""
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
            if place < len(self._session.view().snapshot.robots):  # the fleet may have shrunk
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

    def _go_to_deadlock(self) -> None:
        session = self._session
        if not session.ready() or session.playback is None:
            return
        if (stuck := session.playback.stuck) is not None:
            self._clock.go_to(stuck)
            return
        ticks = session.runs[session.choice.side].event_history.deadlocks
        before = ticks[ticks < session.playback.tick]
        if len(before):
            self._clock.go_to(int(before[-1]))
        else:
            session.notify("no deadlock so far")

    def _go_to_bottleneck(self) -> None:
        """Number a saturated station and the three worst places on the map, and go to the next one."""
        session = self._session
        if not session.ready() or session.playback is None:
            return
        worst = session.playback.figures[session.choice.side].slow_places
        if not worst:
            session.notify("no time has been lost so far")
            return
        cells = [one.cell for one in worst]
        at = cells.index(session.choice.cell) if session.choice.cell in cells else NIL
        at = (at + 1) % len(worst)
        session.choice.slow_places = tuple(
            tuple(one.cell for one in figures.slow_places) for figures in session.playback.figures
        )
        session.choose(cell=cells[at])
        session.show_cell(cells[at])
        others = [
            f"{number}: {100 * one.share:.0f} %"
            for number, one in enumerate(worst, 1)
            if number != at + 1 and one.ticks
        ]
        rest = ", ".join(others) + " of lost time" * bool(others and not worst[at].ticks)
        session.notify("; ".join(filter(None, (f"{at + 1} {worst[at].words}", rest))))

    def _clear(self) -> None:
        if self._session.goal is not None and self._session.player is not None:
            self._session.goal = None  # on the way to a tick: stop there
            self._session.player.pause()
            self._session.ordered()
            return
        self._session.choose()
        self._session.choice.slow_places = ()
        self._found, self._stepping = None, "events"
        self._session.choice.matches = self._session.choice.match_cells = NO_CELLS
        self._session.hovered, self._session.choice.card = NIL, False
        self._app.screen.remove_class("-map-alone")
        self._panels.leave()
        self._session.changed()


class Before:
    """The marks and the view of the map before a search."""

    def __init__(self, session: Session) -> None:
        choice, pictures = session.choice, session.pictures
        self._marked = choice.matches, choice.match_cells
        self._view = pictures.camera.copy(), pictures.fitted

    def restore(self, session: Session) -> None:
        """Restore them."""
        choice, pictures = session.choice, session.pictures
        choice.matches, choice.match_cells = self._marked
        rows, columns = pictures.camera.rows, pictures.camera.columns
        if self._view[0].floor_plan is pictures.camera.floor_plan:  # not reloaded meanwhile
            pictures.camera, pictures.fitted = self._view
        pictures.resize(rows, columns)
        session.changed()
