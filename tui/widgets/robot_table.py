"""The table of all robots, sorted by any column; only visible rows are written."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final, NamedTuple

import numpy as np
from textual.binding import Binding, BindingType

from automaton.engine.observation import (
    CAUSE_REDUCED_SPEED,
    CAUSES,
    is_waiting,
    waited_ticks,
)
from automaton.engine.state import (
    BATTERY_FULL,
    NIL,
    STATUS_DEPLETED,
    STATUS_FAILED,
    Array,
)
from automaton.history.state_words import carries_pods
from automaton.units import percent
from automaton.vocabulary import STATE_WORDS, cause_name, robot_states, robot_word
from tui.playback.panel_view import RobotChosen, View
from tui.widgets.panel import (
    UNICODE_SIGNS,
    Line,
    Link,
    PanelWidget,
    Rows,
    Signs,
    Span,
    cut,
    length,
    line,
)
from tui.widgets.robot_facts import has_batteries, has_types, type_of
from tui.widgets.zone_facts import partition_of, queued

FIXED: Final = 2  # columns that are always shown: number and state
LEAST_CAUSE: Final = len("head-on...")


class Robots(Rows, PanelWidget):
    """A table: number and state of the robot, and the columns from `first` on that fit."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("c", "sort(1)", "Sort by the next column", show=False),
        Binding("C", "sort(-1)", "Sort by the previous column", show=False),
        Binding("V", "turn_round", "Sort the other way round", show=False),
        Binding("right", "columns(1)", "Columns farther right", show=False),
        Binding("left", "columns(-1)", "Columns farther left", show=False),
    ]

    def __init__(self, signs: Signs = UNICODE_SIGNS, *, id: str | None = None) -> None:
        super().__init__(signs, id=id)
        self.view: View | None = None
        self.columns: list[RobotColumn] = [ROBOT_TABLE_COLUMNS[0]]
        self.column, self.greatest_first = 0, False
        self.first = FIXED  # the first column after those that stay
        self.order: Array = np.zeros(0, np.int64)

    def show(self, view: View) -> None:
        """List the robots; the cursor stays with its robot."""
        under = int(self.order[self.cursor]) if self.cursor < len(self.order) else 0
        if self.view is not None and view.robot != self.view.robot and view.robot >= 0:
            under = view.robot
        self.view = view
        self._enter_columns(view)
        self.order = ordered(view, self.columns[self.column], self.greatest_first)
        at = np.flatnonzero(self.order == under)  # none: the other fleet is larger
        self.cursor = int(at[0]) if len(at) else 0
        self.heading = [self._titles()]
        self.update_rows(len(self.order))

    def _enter_columns(self, view: View) -> None:
        """Columns with content; a column that was shown once stays."""
        sorted_by, before = self.columns[self.column], self.columns
        self.columns = [one for one in ROBOT_TABLE_COLUMNS if one in before or one.there(view)]
        self.column = self.columns.index(sorted_by)

    def shown(self) -> dict[int, int]:
        """The widths of the columns that fit; a last one of text may be cut."""
        widths = {at: self._wide(at) for at in range(min(FIXED, len(self.columns)))}
        for at in range(self.first, len(self.columns)):
            room = self.width - sum(widths.values()) - len(widths)
            least = self.columns[at].least or self._wide(at)
            if room < least:
                break
            widths[at] = min(room, self._wide(at))
        while len(widths) > FIXED + 1 and self._titles_end(widths) > self.width:
            widths.popitem()
        return widths

    def _wide(self, at: int) -> int:
        assert self.view is not None
        digits = len(str(len(self.view.snapshot.robots) - 1)) if at == 0 else 0
        return max(self.columns[at].width, len(self.columns[at].title) + 1, digits)

    def _titles_end(self, widths: dict[int, int]) -> int:
        """The columns that the titles need, with the number of columns further right."""
        last = self.columns[max(widths)]
        total = sum(widths.values()) + len(widths) - 1
        total -= 0 if last.right else widths[max(widths)] - len(last.title) - 1
        hidden = len(self.columns) - 1 - max(widths)
        return total + (len(f" +{hidden}{self.signs.beyond}") if hidden else 0)

    def _titles(self) -> Line:
        """The head of the table; numbers at its ends count hidden columns and link to them."""
        spans: list[Span] = []
        widths = self.shown()
        for at, wide in widths.items():
            sign = self._sign() if at == self.column else ""
            text = _aligned(self.columns[at].title + sign, wide, self.columns[at])
            if at == self.first > FIXED:
                before = f"{self.first - FIXED}{self.signs.before}"
                spans[-1] = spans[-1]._replace(text=f"{spans[-1].text} "[: -len(before)])
                spans.append(Span(before, "title", ("columns", -1)))
            elif at:
                spans.append(Span(" "))
            spans.append(Span(text, "title", ("sort", at)))
        hidden = len(self.columns) - 1 - max(widths)
        if hidden:
            used = length(spans) - len(spans[-1].text) + len(spans[-1].text.rstrip())
            spans[-1] = spans[-1]._replace(text=spans[-1].text.rstrip())
            beyond = f"{hidden} more{self.signs.beyond}"
            if used + 1 + len(beyond) > self.width:
                beyond = f"+{hidden}{self.signs.beyond}"
            spans.append(Span(" " * max(0, self.width - used - len(beyond))))
            spans.append(Span(beyond, "title", ("columns", 1)))
        return tuple(spans)

    def _sign(self) -> str:
        return self.signs.falling if self.greatest_first else self.signs.rising

    def row(self, index: int) -> Line:
        assert self.view is not None
        view, robot = self.view, int(self.order[index])
        cells = [
            _aligned(self.columns[at].text(view, robot), wide, self.columns[at])
            for at, wide in self.shown().items()
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
        """Sort by a column, in the given order or in the column's usual one."""
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
        """Reverse the order."""
        self.sort_by(self.column, not self.greatest_first)

    def action_columns(self, step: int) -> None:
        """Scroll the columns if not all fit."""
        if step < 0 or max(self.shown()) < len(self.columns) - 1:
            self.first = max(FIXED, min(self.first + step, len(self.columns) - 1))
        if self.view is not None:
            self.show(self.view)

    def on_resize(self) -> None:
        super().on_resize()
        if self.view is not None:
            self.show(self.view)


def _aligned(text: str, width: int, column: RobotColumn) -> str:
    if column.right:
        return text.rjust(width)
    return "".join(span.text for span in cut(line(text), width)).ljust(width)


# Columns.


class RobotColumn(NamedTuple):
    """A column; `keys` and `text` are by robot."""

    title: str
    width: int
    keys: Callable[[View], Array]  # (n,) the sort keys
    text: Callable[[View, int], str]
    greatest_first: bool  # order at the first click
    right: bool = True
    there: Callable[[View], bool] = lambda view: True  # whether it has content
    least: int = 0  # width to which its text may be cut; 0: never


def ordered(view: View, column: RobotColumn, greatest_first: bool) -> Array:
    """(n,) robots sorted by a column; ties by number."""
    keys = column.keys(view).astype(np.float64)  # unsigned keys cannot be negated
    order: Array = np.argsort(-keys if greatest_first else keys, kind="stable")
    return order


def _waited(view: View) -> Array:
    fleet = view.snapshot.robots
    waited = waited_ticks(fleet.cause, fleet.since, view.snapshot.tick)
    ticks: Array = np.where(is_waiting(fleet.cause), waited, 0)
    return ticks


def _waited_of(view: View, robot: int) -> int:
    fleet = view.snapshot.robots
    if not is_waiting(fleet.cause[robot]):
        return 0
    return int(waited_ticks(fleet.cause[robot], fleet.since[robot], view.snapshot.tick))


def _load(view: View, robot: int) -> str:
    """The robot's load or pod."""
    load = int(view.snapshot.robots.load[robot])
    if load != NIL and carries_pods(view.snapshot):
        return view.snapshot.pod_names[int(view.snapshot.trips.pod[load])]
    return _or_blank(load, NIL)


def _cell(view: View, robot: int) -> str:
    fleet = view.snapshot.robots
    if fleet.cell[robot] != NIL:
        return ",".join(map(str, view.floor_plan.xy(int(fleet.cell[robot]))))
    return "in bay" if fleet.bay[robot] != NIL else "off"


def _queue(view: View, robot: int) -> list[int]:
    """By robot, the number of orders waiting in the zones that it serves."""
    if partition_of(view) is None:
        return []
    served = np.flatnonzero(view.snapshot.service_zones.server == robot).tolist()
    return queued(view, served)


def _or_blank(value: int, absent: int) -> str:
    return "" if value == absent else f"{value:,}"


ROBOT_TABLE_COLUMNS: Final = (
    RobotColumn("#", 1, lambda v: np.arange(len(v.snapshot.robots)), lambda v, r: str(r), False),
    RobotColumn(
        "doing",
        max(map(len, STATE_WORDS)),
        lambda v: robot_states(v.snapshot.robots),
        lambda v, r: robot_word(v.snapshot.robots, r),
        False,
        right=False,
    ),
    RobotColumn("waits", 5, _waited, lambda v, r: _or_blank(int(_waited_of(v, r)), 0), True),
    RobotColumn(
        "cause",
        max(len(cause.name) for cause in CAUSES),
        lambda v: v.snapshot.robots.cause,
        lambda v, r: cause_name(v.snapshot.robots, r),
        True,
        right=False,
        least=LEAST_CAUSE,
    ),
    RobotColumn(
        "type",
        12,
        lambda v: v.run.resolved.fleet.type_of,
        lambda v, r: kind.name if (kind := type_of(v, r)) else "",
        False,
        right=False,
        there=has_types,
    ),
    RobotColumn(
        "battery",
        7,
        lambda v: v.snapshot.robots.charge,
        lambda v, r: percent(int(v.snapshot.robots.charge[r]) / BATTERY_FULL),
        False,
        there=has_batteries,
    ),
    RobotColumn(
        "load",
        5,
        lambda v: v.snapshot.robots.load,
        _load,
        True,
    ),
    RobotColumn(
        "order",
        5,
        lambda v: v.snapshot.robots.order,
        lambda v, r: _or_blank(int(v.snapshot.robots.order[r]), NIL),
        True,
    ),
    RobotColumn(
        "ahead",
        5,
        lambda v: v.snapshot.robots.order_queue_length,
        lambda v, r: _or_blank(int(v.snapshot.robots.order_queue_length[r]), 0),
        True,
        there=lambda v: bool(v.snapshot.robots.order_queue_length.any()),
    ),
    RobotColumn(
        "zone",
        4,
        lambda v: v.snapshot.robots.service_zone,
        lambda v, r: _or_blank(int(v.snapshot.robots.service_zone[r]) + 1, 0),
        False,
        there=lambda v: partition_of(v) is not None,
    ),
    RobotColumn(
        "queue",
        5,
        lambda v: np.array([len(_queue(v, r)) for r in range(len(v.snapshot.robots))]),
        lambda v, r: _or_blank(len(_queue(v, r)), 0),
        True,
        there=lambda v: partition_of(v) is not None,
    ),
    RobotColumn("cell", 7, lambda v: v.snapshot.robots.cell, _cell, False),
    RobotColumn(
        "slowed",
        6,
        lambda v: v.snapshot.robots.lost[:, CAUSE_REDUCED_SPEED],
        lambda v, r: _or_blank(int(v.snapshot.robots.lost[r, CAUSE_REDUCED_SPEED]), 0),
        True,
    ),
    RobotColumn(
        "active",
        6,
        lambda v: v.playback.figures[v.side].active,
        lambda v, r: percent(float(v.playback.figures[v.side].active[r]), 0),
        True,
    ),
    RobotColumn(
        "ops",
        6,
        lambda v: v.playback.figures[v.side].operations,
        lambda v, r: f"{int(v.playback.figures[v.side].operations[r]):,}",
        True,
    ),
)
