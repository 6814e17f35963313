"""The viewer: its widgets, the mouse, and how it begins and ends."""

from __future__ import annotations

import asyncio
import importlib
import threading
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, ClassVar

from textual import events
from textual.app import ComposeResult, SystemCommand
from textual.binding import Binding
from textual.containers import Container, Horizontal, Vertical
from textual.filter import LineFilter
from textual.screen import Screen
from textual.scrollbar import ScrollBar, ScrollBarRender
from textual.widget import Widget

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.evidence.history.divergence import first_difference
from tui.actions.capture_actions import CaptureActions
from tui.actions.choose_actions import ChooseActions
from tui.actions.layer_actions import LayerActions
from tui.actions.map_actions import MapActions
from tui.playback.run_source import Opening
from tui.render.glyphs import ASCII
from tui.render.styles import Look
from tui.screens.help_screen import HelpScreen
from tui.terminal.ascii_only import AsciiOnly, WholeCells
from tui.terminal.frame_pacing import quiet_collector
from tui.terminal.options import Options
from tui.terminal.themes import themes
from tui.widgets.bindings import ACTIONS, COMPARING, bindings, key_text
from tui.widgets.key_line import Keys
from tui.widgets.map_view import MapView
from tui.widgets.timeline import Timeline
from tui.widgets.too_small import ACROSS, DOWN, TooSmall, size_classes

if TYPE_CHECKING:
    from tui.playback.panel_view import CellChosen, RobotChosen, TickChosen, ZoneChosen
    from tui.playback.player import Player

SETTLED_S = 1.5  # after the world is there, when the garbage collector is told to leave it alone
INTERRUPTED = 130
PANELS_MODULE = "tui.widgets.panel_column"


class Viewer(MapActions, ChooseActions, LayerActions, CaptureActions):
    """Shows one live run, or one or two recorded ones."""

    TITLE = "automaton"
    CSS_PATH = "viewer.tcss"
    ENABLE_COMMAND_PALETTE = True
    # What does not fit into a line is said over the map: status and time line stay readable.
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
        super().__init__(opening, options)
        for theme in themes():
            self.register_theme(theme)
        self.theme = f"automaton-{options.theme}"
        self._spelling = [AsciiOnly()] if self.glyphs is ASCII else []
        ScrollBar.renderer = WholeCells if self.glyphs is ASCII else ScrollBarRender
        self._focused: Widget | None = None
        self.loop: asyncio.AbstractEventLoop | None = None
        self._ending = threading.Lock()
        self._ended = False

    def get_line_filters(self) -> Sequence[LineFilter]:
        """With --ascii nothing else gets to the terminal."""
        return [*super().get_line_filters(), *self._spelling]

    def compose(self) -> ComposeResult:
        yield TooSmall()
        with Container(id="main"):
            yield self.title_line
            with Horizontal(id="body"):
                with Container(id="maps"):
                    for head, view in zip(self.heads, self.maps, strict=True):
                        with Vertical(classes="pane"):
                            yield head
                            yield view
                yield Container(id="side")
            yield self.info
            yield self.status
            yield self.timeline
            yield Keys(show_command_palette=False, compact=True)

    def on_mount(self) -> None:
        self.screen.set_class(self.opening.comparing, "-comparing")
        self.screen.add_class("-panels-side")
        self.maps[0].focus()
        self.loop = asyncio.get_running_loop()
        self.frames.start()
        self.call_after_refresh(self._begin)

    def on_unmount(self) -> None:
        self.frames.stop()

    # The runs come after the first picture: importing Numba takes longer than drawing the floor.

    def _begin(self) -> None:
        threading.Thread(target=self._open, name="opening", daemon=True).start()

    def _open(self) -> None:
        """In a thread of its own."""
        player: Player | None = None
        error = ""
        try:
            from tui.playback.player import Player

            importlib.import_module(PANELS_MODULE)
            player = self._playing_runs(Player(self.opening.begin()))
            player.published = self.frames.on_published
        except InputError as wrong:
            error = str(wrong)
        except Exception as wrong:
            error = f"internal error, {type(wrong).__name__}: {wrong}"
        with self._ending:
            if self._ended:
                if player is not None:
                    player.close()
                return
            self.player = player
        self.call_later(self._opened, error)
        if self.opening.comparing:
            self._compare()

    def _compare(self) -> None:
        """Find where two runs part; in the opening's thread."""
        from tui.playback.player import sentence

        try:
            self.divergence = first_difference(*self.opening.recordings)
        except Exception as wrong:
            self.broken = sentence(wrong)
        self.call_later(self.changed)

    def _playing_runs(self, player: Player) -> Player:
        player.set_speed(self.options.speed)
        if self.options.at is not None:
            player.seek(self.options.at)
        elif not self.options.paused:
            player.play()
        return player

    async def _opened(self, error: str) -> None:
        self.error = error
        self.ordered()
        self.changed()
        self.set_timer(SETTLED_S, quiet_collector)
        if not error:
            from tui.widgets.panel_column import PanelColumn

            self.column = PanelColumn(self.look, self.glyphs, id="panels")
            await self.query_one("#side").mount(self.column)
            self.changed()

    def close_runs(self) -> None:
        """Nothing is computed any more, and what was recorded is whole; from any thread."""
        with self._ending:
            if not self._ended and self.player is not None:
                self.player.close()
            self._ended = True

    # What Textual tells.

    def on_resize(self, event: events.Resize) -> None:
        self.query_one(TooSmall).measure(*event.size)
        classes = size_classes(*event.size)
        self._keep_focus(classes["-tight"] or classes["-flat"])
        for screen in self.screen_stack:  # Textual tells the one in front only
            screen.update_classes(classes)
        self.presenter.terminal_resized()
        self.changed()

    def _keep_focus(self, too_small: bool) -> None:
        """What gives way to the message loses the focus; it gets it back."""
        if too_small:
            self._focused = self.screen.focused or self._focused
        elif self.screen.focused is None:
            last: Widget = self._focused or self.maps[0]
            last = last if last.is_attached else self.maps[0]
            self.call_after_refresh(self._focus, last)

    def _focus(self, widget: Widget) -> None:
        if self.screen_stack and widget.screen is self.screen:  # it may have ended meanwhile
            widget.focus()

    def on_cursor_position(self) -> None:
        self.frames.answered()

    def on_app_blur(self) -> None:
        self.frames.pace.blurred = True

    def on_app_focus(self) -> None:
        self.frames.pace.blurred = False

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """What cannot be done now is not in the palette."""
        keys = self._keys()
        for action in ACTIONS:
            if action.id not in COMPARING or self.opening.comparing:
                named = " or ".join(key_text(key) for key in keys.get(action.id, ()))
                told = f"{named}   {action.meaning}".strip()
                yield SystemCommand(action.label, told, getattr(self, f"action_{action.id}"))

    def _keys(self) -> dict[str, list[str]]:
        """The keys that are bound to actions now, by id."""
        keys: dict[str, list[str]] = {}
        for key, binding in self._bindings:
            if binding.id is not None:
                keys.setdefault(binding.id, []).append(key)
        return keys

    # The mouse.

    def on_map_view_resized(self, event: MapView.Resized) -> None:
        if event.view in self.maps:
            if self.opening.comparing:
                self._split()
            rows = min(view.size.height for view in self.maps)
            columns = min(view.size.width for view in self.maps)
            self.pictures.resize(rows, columns)
        self.show_titles()
        self.changed()

    def _split(self) -> None:
        """Put two maps where they are larger: beside or below each other."""
        rooms = self.query("#maps")
        if not rooms:  # the viewer is being left
            return
        room = rooms.first()
        split = self.pictures.split(room.size.height, room.size.width)
        if split and (room.styles.layout is None or room.styles.layout.name != split):
            room.styles.layout = split

    def on_map_view_clicked(self, event: MapView.Clicked) -> None:
        if event.view not in self.maps:
            return
        cell = self._cell_at(event.view, event.row, event.column)
        if self._in_minimap(event.row, event.column):
            self._centre(event.row, event.column)
        elif cell is None:
            self.choose()
        else:
            self.choice.side = self.maps.index(event.view)
            self.choose_at(cell)
            if event.double and self.choice.robot != NIL and not self.choice.following:
                self.action_follow()

    def on_map_view_dragged(self, event: MapView.Dragged) -> None:
        if event.view in self.maps:
            self.pan(-event.columns, -event.rows)

    def on_map_view_wheeled(self, event: MapView.Wheeled) -> None:
        if event.view not in self.maps:
            return
        back = event.direction in ("up", "left")
        if event.direction in ("left", "right") or event.shift:
            self.pan(-8 if back else 8, 0)
        elif event.ctrl:
            self.pan(0, -4 if back else 4)
        else:
            self.zoom(1 if back else -1, (event.row, event.column))

    def on_map_view_hovered(self, event: MapView.Hovered) -> None:
        if event.view in self.maps:
            cell = self._cell_at(event.view, event.row, event.column)
            self.hovered = NIL if cell is None else cell
            self.hovered_side = self.maps.index(event.view)
            self.pointing = True
            self.refresh_lines_soon()

    def on_timeline_scrubbed(self, event: Timeline.Scrubbed) -> None:
        self.go_to_tick(event.tick, stop_at_breakpoints=True)

    def on_timeline_moved(self, event: Timeline.Moved) -> None:
        if self.ready() and self.player is not None:
            self.player.step(event.ticks)
            self.ordered()

    def _cell_at(self, view: MapView, row: int, column: int) -> int | None:
        if row < 0 or self._in_minimap(row, column):
            return None
        return self.pictures.camera.cell_at(row, column)

    def _in_minimap(self, row: int, column: int) -> bool:
        corner = self.pictures.corner(self.choice)
        return corner is not None and corner.holds(row, column)

    def _centre(self, row: int, column: int) -> None:
        """Go to what was clicked in the minimap."""
        corner = self.pictures.corner(self.choice)
        assert corner is not None
        cell = corner.minimap.cell_at(row - corner.top, column - corner.left)
        if cell is not None:
            self.choice.following = self.pictures.fitted = False
            self.pictures.camera.centre_on(cell)
            self.changed()

    # What panels ask for.

    def on_robot_chosen(self, event: RobotChosen) -> None:
        self.leave_full_panels()
        self.choose(event.robot)
        self.show_robot()

    def on_cell_chosen(self, event: CellChosen) -> None:
        self.leave_full_panels()
        self.choose(cell=event.cell)
        self.show_cell(event.cell)

    def on_zone_chosen(self, event: ZoneChosen) -> None:
        self.choose_zone(event.zone)

    def on_tick_chosen(self, event: TickChosen) -> None:
        self.leave_full_panels()
        self.go_to_tick(event.tick)

    # Actions of the viewer itself.

    def action_help(self) -> None:
        self.push_screen(HelpScreen(self._keys()))

    def action_theme(self) -> None:
        light = self.look.theme == "dark"
        self.look = Look(self.look.depth, "light" if light else "dark")
        self.theme = f"automaton-{self.look.theme}"
        lines = (self.title_line, self.info, self.status, self.timeline)
        for view in (*self.maps, *self.heads, *lines):
            view.set_appearance(self.look, self.glyphs)
        if self.column is not None:
            self.column.set_appearance(self.look, self.glyphs)
        self.changed()

    def action_link_figures(self) -> None:
        self.link_shown = not self.link_shown
        self.changed()

    async def action_quit(self) -> None:
        self.leave(0)

    def action_interrupt(self) -> None:
        self.leave(INTERRUPTED)

    def leave(self, code: int) -> None:
        """End with this exit code; also from a signal's handler."""
        if self.loop is None:
            raise SystemExit(code)
        self.loop.call_soon_threadsafe(lambda: self.exit(return_code=code))
