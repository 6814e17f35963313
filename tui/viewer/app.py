"""The viewer app: its widgets, mouse handling, start and end."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterable, Sequence
from functools import partial
from inspect import isawaitable
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import RenderableType
from rich.segment import Segment
from textual import events
from textual.app import App, ComposeResult, SystemCommand
from textual.binding import Binding
from textual.color import Color
from textual.command import DiscoveryHit, Hits
from textual.containers import Container, Horizontal, Vertical
from textual.filter import LineFilter
from textual.notifications import SeverityLevel
from textual.screen import Screen
from textual.scrollbar import ScrollBar, ScrollBarRender
from textual.system_commands import SystemCommandsProvider
from textual.widget import Widget
from textual.widgets import Static

from automaton.engine.state import NIL
from tui.playback.run_source import Opening
from tui.registration import layers, panels
from tui.render.styles import ASCII, Depth, Look, to_ascii
from tui.screens.dialogs import ACROSS, DOWN, MIN_TERMINAL_COLUMNS, MIN_TERMINAL_ROWS, size_classes
from tui.terminal.frame_pacing import quiet_collector
from tui.terminal.map_view import MapView
from tui.terminal.options import Options
from tui.terminal.themes import themes
from tui.viewer.branch_actions import BranchActions, Reloading
from tui.viewer.seek_actions import ClockActions, FindActions
from tui.viewer.session import Actions, Command, Display, Session
from tui.viewer.view_actions import CaptureActions, LayerActions, MapActions, PanelActions
from tui.widgets.bindings import COMPARING, VIEWER_ACTIONS, HelpScreen, bindings, key_text
from tui.widgets.status import Keys
from tui.widgets.timeline import Timeline

if TYPE_CHECKING:
    from tui.playback.panel_view import CellChosen, JamChosen, RobotChosen, TickChosen, ZoneChosen


SETTLED_S = 1.5  # after the world is built: then the garbage collector freezes it
INTERRUPTED = 130
PROBLEMS_S = 20.0  # for which load failures are shown
ACTION_LABELS = {action.id: action.label for action in VIEWER_ACTIONS}
# Actions that need a world, besides those of all layers and panels.
OF_THE_WORLD = ("layer_none", "next_layer", "panels", "trails")


class Viewer(App[None]):
    """Shows one live run, or one or two recorded ones."""

    TITLE = "automaton"
    CSS_PATH = "viewer.tcss"
    ENABLE_COMMAND_PALETTE = True
    COMMANDS: ClassVar = {lambda: InOrder}
    # Long messages appear over the map, so that status line and timeline stay readable.
    CSS = """
    ToastRack { dock: top; align: right top; }
    Toast { width: 76; max-width: 100%; margin: 0; padding: 0 1; }
    """
    # Textual declares these without ClassVar.
    HORIZONTAL_BREAKPOINTS: ClassVar = ACROSS  # type: ignore[misc]
    VERTICAL_BREAKPOINTS: ClassVar = DOWN  # type: ignore[misc]
    BINDINGS: ClassVar = [
        *bindings(),
        Binding("ctrl+c", "interrupt", show=False, priority=True, system=True),
    ]

    def __init__(self, opening: Opening, options: Options) -> None:
        super().__init__()
        self.session = Session(opening, options, self.notify)
        self.main_display = Display(self, self.session)
        self.clock = ClockActions(self, self.session, self.main_display)
        self.map = MapActions(self, self.session)
        self.panels = PanelActions(self, self.session, self.main_display)
        self.layers = LayerActions(self.session, self.main_display.notices)
        self.branches = BranchActions(self, self.session, self.main_display)
        self.groups: tuple[Actions, ...] = (
            self.clock,
            self.map,
            self.panels,
            self.layers,
            self.branches,
            FindActions(self, self.session, self.main_display, self.clock, self.panels),
            CaptureActions(self, self.session, self.main_display),
            self,
        )
        self.reloading = None
        if opening.reload is not None:
            self.reloading = Reloading(self, self.session, self.main_display, self.branches)
        self._commands = {
            id: does for group in self.groups for id, does in group.commands().items()
        }
        for theme in themes():
            self.register_theme(theme)
        self.theme = f"automaton-{options.shown_theme}"
        self.set_class(self.session.look.depth <= Depth.SIXTEEN, "-few-colours")
        glyphs = self.session.glyphs
        self._spelling = [AsciiOnly()] if glyphs is ASCII else []
        ScrollBar.renderer = WholeCells if glyphs is ASCII else ScrollBarRender
        self._focused: Widget | None = None
        self.loop: asyncio.AbstractEventLoop | None = None
        self._is_opening = False
        self._awaited: list[str] = []  # actions that wait for the world
        brought = (*layers().by_name.values(), *panels().by_name.values())
        self._of_the_world = {*OF_THE_WORLD, *(one.action for one in brought)}

    def get_line_filters(self) -> Sequence[LineFilter]:
        """With --ascii, only ASCII reaches the terminal."""
        return [*super().get_line_filters(), *self._spelling]

    def compose(self) -> ComposeResult:
        display = self.main_display
        yield TooSmall()
        with Container(id="main"):
            yield display.title_line
            with Horizontal(id="body"):
                with Container(id="maps"):
                    for head, view in zip(display.heads, display.maps, strict=True):
                        with Vertical(classes="pane"):
                            yield head
                            yield view
                yield Container(id="side")
            yield display.info
            yield display.status
            yield display.timeline
            yield Keys(show_command_palette=False, compact=True)

    def on_mount(self) -> None:
        self._is_opening = True
        self.screen.set_class(self.session.opening.comparing, "-comparing")
        self.screen.add_class("-panels-side")
        self.main_display.maps[0].focus()
        self.loop = asyncio.get_running_loop()
        self.main_display.pixels.ask()  # before the first picture, which covers what it may print
        self.main_display.frames.start()
        self.call_after_refresh(self._begin)

    def on_unmount(self) -> None:
        self.main_display.pixels.end()
        self.main_display.frames.stop()
        if self.reloading is not None:
            self.reloading.close()

    # Start runs after the first picture: importing Numba takes longer than drawing the floor.

    def _begin(self) -> None:
        threading.Thread(target=self._open, name="opening", daemon=True).start()

    def _open(self) -> None:
        """Open the runs, in a thread of its own."""
        if self.session.open(self.main_display.frames.on_published, _import_panels):
            self.call_later(self._opened)
            if self.session.opening.comparing:
                self.session.compare()
                self.call_later(self.session.changed)

    async def _opened(self) -> None:
        self._is_opening = False
        self.session.ordered()
        self.session.changed()
        self.set_timer(SETTLED_S, quiet_collector)
        if not self.session.error:
            from tui.widgets.panel_column import PanelColumn, panel_widgets

            column = PanelColumn(self.session.glyphs, panel_widgets(), id="panels")
            self.main_display.column = column
            await self.query_one("#side").mount(column)
            options = self.session.options
            if options.panel in column.panels:
                column.open(options.panel)
            if options.panels != self.panels.shown:
                self.panels.show(options.panels)
            if self.reloading is not None:
                self.reloading.start()
            problems = (*layers().problems, *panels().problems, *column.problems)
            if problems:
                self.notify("; ".join(problems), severity="warning", timeout=PROBLEMS_S)
            self.session.changed()
            if self._awaited:
                self.main_display.draw()  # the first state is there
            for id in self._awaited:
                await self.action_do(id)

    # Events from Textual.

    async def on_event(self, event: events.Event) -> None:
        """A key ends the message that was there when it was pressed."""
        if isinstance(event, events.Key):
            self.main_display.notices.end()
        await super().on_event(event)

    def notify(
        self,
        message: str,
        *,
        title: str = "",
        severity: SeverityLevel = "information",
        timeout: float | None = None,
        markup: bool = False,
    ) -> None:
        """Show short messages above the status line, long ones over the map."""
        self.main_display.notices.say(message, severity, timeout)

    def on_resize(self, event: events.Resize) -> None:
        self.query_one(TooSmall).measure(*event.size)
        classes = size_classes(*event.size)
        self._keep_focus(classes["-tight"] or classes["-flat"])
        for screen in self.screen_stack:  # Textual informs only the front one
            screen.update_classes(classes)
        self.call_after_refresh(self.panels.fit)
        self.main_display.presenter.terminal_resized()
        self.session.changed()

    def _keep_focus(self, too_small: bool) -> None:
        """Restore the focus that a widget lost to the message about a small terminal."""
        if too_small:
            self._focused = self.screen.focused or self._focused
        elif self.screen.focused is None:
            last: Widget = self._focused or self.main_display.maps[0]
            last = last if last.is_attached else self.main_display.maps[0]
            self.call_after_refresh(self._focus, last)

    def _focus(self, widget: Widget) -> None:
        if self.screen_stack and widget.screen is self.screen:  # it may have ended
            widget.focus()

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        """Write an update of the compositor, which may cover a map in pixels or replace it."""
        super()._display(screen, renderable)
        written = renderable is not None and not self._batch_count and self.screen_stack
        if written and self.main_display.pixels.painted_over(renderable):
            self.main_display.changed()

    def on_cursor_position(self, event: events.CursorPosition) -> None:
        self.main_display.frames.answered(event.time)

    def on_terminal_answer(self, answer: Any) -> None:
        if self.main_display.pixels.answered(answer.text):
            self.main_display.changed()

    def on_app_blur(self) -> None:
        self.main_display.frames.pace.blurred = True

    def on_app_focus(self) -> None:
        self.main_display.frames.pace.blurred = False

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """The commands of the palette, without those that are impossible now."""
        keys = self._keys()
        for action in sorted(VIEWER_ACTIONS, key=lambda one: not one.shown):  # most used first
            if action.id not in COMPARING or self.session.opening.comparing:
                named = " or ".join(key_text(key) for key in keys.get(action.id, ()))
                told = f"{named}   {action.meaning}".strip()
                yield SystemCommand(action.label, told, partial(self.action_do, action.id))

        for label, meaning, command in self.layers.colourings():
            yield SystemCommand(label, meaning, command)

    def _keys(self) -> dict[str, list[str]]:
        """The present keys of actions, by id."""
        keys: dict[str, list[str]] = {}
        for key, binding in self._bindings:
            if binding.id is not None:
                keys.setdefault(binding.id, []).append(key)
        return keys

    # The mouse.

    def on_map_view_resized(self, event: MapView.Resized) -> None:
        maps, pictures = self.main_display.maps, self.session.pictures
        if event.view in maps:
            if self.session.opening.comparing:
                self._split()
            rows = min(view.size.height for view in maps)
            columns = min(view.size.width for view in maps)
            with self.session.kept_in_sight():
                pictures.resize(rows, columns)
        self.main_display.show_titles()
        self.session.changed()

    def _split(self) -> None:
        """Place two maps side by side or one below the other, whichever makes them larger."""
        rooms = self.query("#maps")
        if not rooms:  # the viewer is closing
            return
        room = rooms.first()
        split = self.session.pictures.split(room.size.height, room.size.width)
        if split and (room.styles.layout is None or room.styles.layout.name != split):
            room.styles.layout = split

    def on_map_view_clicked(self, event: MapView.Clicked) -> None:
        session, choice = self.session, self.session.choice
        if event.view not in self.main_display.maps:
            return
        cell = session.pictures.cell_at(choice, event.row, event.column)
        if session.pictures.centre(choice, event.row, event.column):
            session.changed()
        elif event.double:  # the first click selected it; it may have left
            if choice.robot != NIL and not choice.following:
                self.map.follow()
        elif cell is None:
            session.choose()
        else:
            choice.side = self.main_display.maps.index(event.view)
            session.choose_at(cell)
            self.panels.open_for_click()

    def on_map_view_dragged(self, event: MapView.Dragged) -> None:
        if event.view in self.main_display.maps:
            self.map.pan(-event.columns, -event.rows)

    def on_map_view_wheeled(self, event: MapView.Wheeled) -> None:
        if event.view not in self.main_display.maps:
            return
        back = event.direction in ("up", "left")
        if event.direction in ("left", "right") or event.shift:
            self.map.pan(-8 if back else 8, 0)
        elif event.ctrl:
            self.map.pan(0, -4 if back else 4)
        else:
            self.map.zoom(1 if back else -1, (event.row, event.column))

    def on_map_view_hovered(self, event: MapView.Hovered) -> None:
        session = self.session
        if event.view in self.main_display.maps:
            cell = session.pictures.cell_at(session.choice, event.row, event.column)
            session.hovered = NIL if cell is None else cell
            session.hovered_side = self.main_display.maps.index(event.view)
            session.pointing = True
            self.main_display.refresh_lines_soon()

    def on_timeline_scrubbed(self, event: Timeline.Scrubbed) -> None:
        self.clock.go_to(event.tick, stop_at_breakpoints=True)

    def on_timeline_moved(self, event: Timeline.Moved) -> None:
        self.clock.step(event.ticks)

    # Requests of panels.

    def on_robot_chosen(self, event: RobotChosen) -> None:
        self.panels.leave_full()
        self.session.choose(event.robot)
        self.session.show_robot()

    def on_cell_chosen(self, event: CellChosen) -> None:
        self.panels.leave_full()
        self.session.choose(cell=event.cell)
        self.session.show_cell(event.cell)

    def on_zone_chosen(self, event: ZoneChosen) -> None:
        self.session.choose_zone(event.zone)

    async def on_jam_chosen(self, event: JamChosen) -> None:
        await self.action_do("jam")

    def on_tick_chosen(self, event: TickChosen) -> None:
        self.panels.leave_full()
        self.clock.go_to(event.tick)

    # Actions: Textual calls `do` for all of them; some are the app's own.

    async def action_do(self, id: str) -> None:
        """Run an action of the table of bindings; one that needs a world waits for it."""
        if self._is_opening and id in self._of_the_world:
            if id not in self._awaited:  # a repeated key asks for nothing new
                self._awaited.append(id)
            self.notify(f"{ACTION_LABELS[id]}: as soon as the world is built")
            return
        done = self._commands[id]()
        if isawaitable(done):
            await done

    def commands(self) -> dict[str, Command]:
        return {
            "help": self._show_help,
            "theme": self._change_theme,
            "link_figures": self.main_display.toggle_link,
            "command_palette": self.action_command_palette,
            "quit": self.action_quit,
        }

    def _show_help(self) -> None:
        self.push_screen(HelpScreen(self._keys()))

    def _change_theme(self) -> None:
        look = self.session.look
        self.main_display.set_look(Look(look.depth, "light" if look.theme == "dark" else "dark"))
        self.theme = f"automaton-{self.session.look.theme}"

    async def action_quit(self) -> None:
        self.leave(0)

    def action_interrupt(self) -> None:
        self.leave(INTERRUPTED)

    def chosen_settings(self) -> dict[str, Any]:
        """What the user has changed since the start, by the names of the file of settings."""
        options, column = self.session.options, self.main_display.column
        if column is None:
            return {}
        first = next(iter(column.panels), "")
        chosen = {
            "theme": (self.session.look.theme, options.shown_theme),
            "speed": (self.session.speed, options.first_speed),
            "panels": (self.panels.shown, options.panels),
            "panel": (column.tabs.open, options.panel or first),
        }
        return {name: now for name, (now, before) in chosen.items() if now != before}

    def leave(self, code: int) -> None:
        """Exit with this code; signal handlers may call it, too."""
        if self.loop is None:
            raise SystemExit(code)
        self.loop.call_soon_threadsafe(lambda: self.exit(return_code=code))


def _import_panels() -> None:
    """End the runs, which takes a while."""
    from tui.widgets.panel_column import panel_widgets

    panel_widgets()


class InOrder(SystemCommandsProvider):
    """The commands of the palette in their own order."""

    async def discover(self) -> Hits:
        for label, meaning, command, _ in self.app.get_system_commands(self.screen):
            yield DiscoveryHit(label, command, help=meaning)


class TooSmall(Static):
    """States the least terminal size; disappears when the terminal grows."""

    DEFAULT_CSS = (
        "TooSmall { display: none; width: 1fr; height: 1fr; content-align: center middle; }"
    )

    def measure(self, columns: int, rows: int) -> None:
        """Show the size of the terminal."""
        self.update(
            f"automaton needs {MIN_TERMINAL_COLUMNS}x{MIN_TERMINAL_ROWS}, has {columns}x{rows}"
        )


# Themes for all widgets, from the colours of the map.


# All other widgets in ASCII: frames, scroll bars, ellipses and names.
#
# Textual draws with characters that some terminals and fonts lack. Before they reach the terminal,
# the most similar ASCII characters replace them.


class AsciiOnly(LineFilter):
    """Replaces other characters by ASCII; lines keep their lengths."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        return [
            segment if segment.control else segment._replace(text=to_ascii(segment.text))
            for segment in segments
        ]


class WholeCells(ScrollBarRender):
    """Scroll bars that end between characters, without blocks of eighths."""

    VERTICAL_BARS: ClassVar = [" "]
    HORIZONTAL_BARS: ClassVar = [" "]
