"""A table of all robots, sorted by any column; only the rows in sight are written."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from textual.binding import Binding, BindingType

from automaton.engine.robot_states import STATUS_DEPLETED, STATUS_FAILED
from automaton.engine.state import Array
from tui.playback.panel_view import RobotChosen, View
from tui.widgets.panel import PanelWidget
from tui.widgets.robot_columns import ROBOT_TABLE_COLUMNS, Column, ordered
from tui.widgets.rows import Rows
from tui.widgets.signs import UNICODE, Signs
from tui.widgets.styled_lines import Line, Link, Span, line


class Robots(Rows, PanelWidget):
    """The number stays in sight; the columns beside it as far as there is room, from `first` on."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("c", "sort(1)", "Sort by the next column", show=False),
        Binding("C", "sort(-1)", "Sort by the previous column", show=False),
        Binding("V", "turn_round", "Sort the other way round", show=False),
        Binding("right", "columns(1)", "Columns farther right", show=False),
        Binding("left", "columns(-1)", "Columns farther left", show=False),
    ]

    def __init__(self, signs: Signs = UNICODE, *, id: str | None = None) -> None:
        super().__init__(signs, id=id)
        self.view: View | None = None
        self.columns: list[Column] = [ROBOT_TABLE_COLUMNS[0]]
        self.column, self.greatest_first = 0, False
        self.first = 1  # the first column beside the number
        self.order: Array = np.zeros(0, np.int64)

    def show(self, view: View) -> None:
        """List the robots; the cursor stays with its robot."""
        under = int(self.order[self.cursor]) if self.cursor < len(self.order) else 0
        if self.view is not None and view.robot != self.view.robot and view.robot >= 0:
            under = view.robot
        self.view = view
        self._enter_columns(view)
        self.order = ordered(view, self.columns[self.column], self.greatest_first)
        self.cursor = int(np.flatnonzero(self.order == under)[0])
        self.heading = [self._titles()]
        self.update_rows(len(self.order))

    def _enter_columns(self, view: View) -> None:
        """Columns with something to say; one that was there stays."""
        sorted_by, before = self.columns[self.column], self.columns
        self.columns = [one for one in ROBOT_TABLE_COLUMNS if one in before or one.there(view)]
        self.column = self.columns.index(sorted_by)

    def shown(self) -> list[int]:
        """The columns for which there is room."""
        columns, room = [0], self.width - self._wide(0)
        for at in range(self.first, len(self.columns)):
            room -= 1 + self._wide(at)
            if room < 0:
                break
            columns.append(at)
        return columns

    def _wide(self, at: int) -> int:
        assert self.view is not None
        digits = len(str(len(self.view.snapshot.robots) - 1)) if at == 0 else 0
        return max(self.columns[at].width, len(self.columns[at].title), digits) + 1

    def _titles(self) -> Line:
        """The head of the table; signs at its ends lead to columns that have no room."""
        spans: list[Span] = []
        columns = self.shown()
        for at in columns:
            sign = self._sign() if at == self.column else ""
            text = _aligned(self.columns[at].title + sign, self._wide(at), self.columns[at])
            gap = self.signs.before if at == self.first > 1 else " "
            if at:
                spans.append(Span(gap, "title", ("columns", -1)))
            spans.append(Span(text, "title", ("sort", at)))
        if columns[-1] < len(self.columns) - 1:
            used = sum(len(span.text) for span in spans)
            spans.append(Span(" " * max(0, self.width - used - 1)))
            spans.append(Span(self.signs.beyond, "title", ("columns", 1)))
        return tuple(spans)

    def _sign(self) -> str:
        return self.signs.falling if self.greatest_first else self.signs.rising

    def row(self, index: int) -> Line:
        assert self.view is not None
        view, robot = self.view, int(self.order[index])
        cells = [
            _aligned(self.columns[at].text(view, robot), self._wide(at), self.columns[at])
            for at in self.shown()
        ]
        text = " ".join(cells)
        fleet = view.snapshot.robots
        if robot == view.robot:
            return line(Span(self.signs.here + text[1:], "title"))
        wrong = fleet.wait_cycle_ticks[robot] or fleet.status[robot] in (
            STATUS_DEPLETED,
            STATUS_FAILED,
        )
        look = "fault" if wrong else "dim" if fleet.parked[robot] else "plain"
        return line(Span(text, look))

    def chosen(self, index: int) -> None:
        """Select the robot."""
        self.post_message(RobotChosen(int(self.order[index])))

    def follow(self, link: Link, column: int = 0) -> None:
        kind, number = link
        if kind == "columns":
            self.action_columns(number)
        elif number == self.column:
            self.action_turn_round()
        else:
            self.sort_by(number)

    def sort_by(self, column: int, greatest_first: bool | None = None) -> None:
        """Sort by a column, as it is looked at most often or as told."""
        own = self.columns[column].greatest_first
        self.column = column
        self.greatest_first = own if greatest_first is None else greatest_first
        if self.view is not None:
            if column and column not in self.shown():
                self.first = column
            self.show(self.view)

    def action_sort(self, step: int) -> None:
        """Sort by the next column."""
        self.sort_by((self.column + step) % len(self.columns))

    def action_turn_round(self) -> None:
        """Sort the other way round."""
        self.sort_by(self.column, not self.greatest_first)

    def action_columns(self, step: int) -> None:
        """Show other columns, where there is no room for all."""
        all_shown = len(self.shown()) == len(self.columns)
        if step < 0 or (self.shown()[-1] < len(self.columns) - 1 and not all_shown):
            self.first = max(1, min(self.first + step, len(self.columns) - 1))
        if self.view is not None:
            self.show(self.view)

    def on_resize(self) -> None:
        super().on_resize()
        if self.view is not None:
            self.show(self.view)


def _aligned(text: str, width: int, column: Column) -> str:
    return text.rjust(width) if column.right else text.ljust(width)
