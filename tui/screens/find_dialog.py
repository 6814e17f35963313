"""Find: robots, loads, cells, zones, or robots for which a condition holds; matches while typing."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final

import numpy as np
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.widgets import Input, Static

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.history.explanation import load_words
from automaton.units import count
from tui.playback.panel_view import View
from tui.screens.dialog import Dialog
from tui.screens.find_query import Found, find
from tui.widgets.robot_columns import doing
from tui.widgets.rows import Rows
from tui.widgets.service_zone_facts import partition_of
from tui.widgets.styled_lines import Line, cell_link, dim, line
from tui.widgets.traffic_zone_facts import robots_in
from tui.widgets.typed_fields import TypedInput

EXAMPLES: Final = (
    "17, robot 17, order 7, load 7, line 7, pod 12, 12,4, station 11, door 1, lift 1, zone 9, "
    "a name that the scenario gives, or a condition: waiting > 20 and loaded, deadlock, "
    "stalled > 50, battery < 20, queueing, jam, starved"
)


Preview = Callable[[Found], None]


def no_preview(matches: Found) -> None:
    """There is no map."""


class MatchList(Rows, can_focus=False):
    """What was found; the one under the cursor will be gone to."""

    DEFAULT_CSS = "MatchList { height: 8; }"

    class Chosen(Message):
        """A match was clicked."""

    def __init__(self, view: View) -> None:
        super().__init__()
        self.view = view
        self.found = Found("")

    @property
    def shows_cursor(self) -> bool:
        return True

    def set_content(self, found: Found) -> None:
        """List these matches."""
        self.found, self.cursor = found, found.first
        self.update_rows(len(found.places))
        self.scroll_to(y=found.first, animate=False)
        self.refresh()

    def row(self, index: int) -> Line:
        view = self.view
        if self.found.zones:
            zone = self.found.zones[index]
            service_zones = partition_of(view)
            if service_zones is not None:
                many = int(np.count_nonzero(service_zones.design.zone == zone))
                return line(f"zone {zone + 1}  ", dim(count(many, "station")))
            return line(f"zone {zone}  ", dim(count(len(robots_in(view, zone)), "robot")))
        if not self.found.robots:
            cell = self.found.cells[index]
            name = view.floor_plan.kind_of(cell).name
            return line(cell_link(view.floor_plan, cell).text, dim(f"  {name}"))
        robot, fleet = self.found.robots[index], view.snapshot.robots
        off = fleet.home[robot] if fleet.bay[robot] == NIL else fleet.bay[robot]
        cell = off if fleet.cell[robot] == NIL else fleet.cell[robot]
        load = int(fleet.load[robot])
        words = "" if load == NIL else f", {load_words(view.snapshot, load)}"
        return line(
            f"robot {robot}  ",
            dim(f"{doing(fleet, robot)} at {view.floor_plan.xy(int(cell))}{words}"),
        )

    def chosen(self, index: int) -> None:
        self.post_message(self.Chosen())


class FindScreen(Dialog[Found]):
    """Enter takes the match under the cursor; the others can be stepped through later.

    It lies below the map, or in the place of the panels beside it: what matches is seen on the map.
    """

    DEFAULT_CSS = """
    FindScreen { align: right bottom; background: $background 25%; }
    FindScreen.-normal > Vertical, FindScreen.-wide > Vertical {
        width: 35%; min-width: 42; max-width: 56;
    }
    FindScreen.-narrow Rows, FindScreen.-low Rows { height: 4; }
    FindScreen.-short Rows { height: 3; }
    FindScreen.-narrow Horizontal, FindScreen.-low Horizontal { margin-top: 0; }
    FindScreen.-narrow > Vertical { width: 100%; }
    FindScreen.-narrow .hint { height: 1; }
    """

    HEADING = "Find"
    ACCEPT = "Go there"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "move(-1)", "Previous match", show=False),
        Binding("down", "move(1)", "Next match", show=False),
    ]

    def __init__(self, view: View, text: str = "", preview: Preview = no_preview) -> None:
        """`preview` gets what is found whenever that, or the match under the cursor, changes."""
        super().__init__()
        self._view, self._text, self._preview = view, text, preview

    def inside(self) -> ComposeResult:
        yield TypedInput(self._text, placeholder="robot 17", compact=True)
        yield Static(EXAMPLES, classes="hint", markup=False)
        yield Static("", id="many", markup=False)
        yield MatchList(self._view)

    def on_mount(self) -> None:
        self._look(self._text)

    def on_input_changed(self, event: Input.Changed) -> None:
        self._look(event.value)

    def _look(self, text: str) -> None:
        """Show what matches by now."""
        found, wrong = Found(text), ""
        if text.strip():
            try:
                found = find(text, self._view)
            except InputError as error:
                wrong = str(error)
        self.query_one(MatchList).set_content(found)
        told = found.many if found else "nothing matches now" if text.strip() else ""
        self.query_one("#many", Static).update("" if wrong else told)
        self.complain(wrong)
        self._show_on_map()

    def _show_on_map(self) -> None:
        matches = self.query_one(MatchList)
        self._preview(matches.found._replace(first=matches.cursor))

    def on_input_submitted(self) -> None:
        self.accept()

    def on_match_list_chosen(self) -> None:
        self.accept()

    def accept(self) -> None:
        """Close with the matches, if there are any."""
        matches = self.query_one(MatchList)
        if matches.found:
            self.dismiss(matches.found._replace(first=matches.cursor))

    def action_move(self, rows: int) -> None:
        """Choose another match."""
        self.query_one(MatchList).action_move(rows)
        self._show_on_map()
