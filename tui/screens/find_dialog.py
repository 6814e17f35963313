"""Find robots, loads, cells, zones, or robots that meet a condition, with matches while typing.

Examples: 17, load 7, pod 12, 12,4, station 11, station P1, zone 9, waiting > 20, jam, starved, and
names or numbers from the scenario: packing, door 2, lifts, block 1, closing 3, order A-17, line 12,
sku B4
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar, Final, NamedTuple

import numpy as np
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.widgets import Input, Static

from automaton.engine.state import NIL, Array
from automaton.errors import InputError, nearest
from automaton.floor.floor_plan import KIND_BY_NAME, WALL
from automaton.history.breakpoints import robots_where
from automaton.history.state_words import load_words
from automaton.scenario.order_lines import line_texts, listed_lines
from automaton.units import count
from automaton.vocabulary import robot_word
from automaton.world.gate_cells import cells_of, gates_of
from tui.playback.panel_view import View, middle_robot
from tui.screens.dialogs import Dialog
from tui.widgets.panel import Line, Rows, TypedInput, cell_link, dim, line
from tui.widgets.pod_facts import has_pods, makes_trips
from tui.widgets.zone_facts import checked_station, checked_zone, partition_of, robots_in

FIND_EXAMPLES: Final = (
    "17, robot 17, order 7, load 7, line 7, pod 12, 12,4, station 11, door 1, lift 1, zone 9, "
    "a name that the scenario gives, or a condition: waiting > 20 and loaded, deadlock, "
    "stalled > 50, battery < 20, queueing, jam, starved"
)

GATES: Final = re.compile(r"(door|lift|block|closing)(?:s| (\d{1,9}))")

Places = tuple[tuple[int, ...], tuple[int, ...]]  # robots, or else cells
Preview = Callable[["Found"], None]


class Found(NamedTuple):
    """Robots, cells or zones to step through, starting at index `first`."""

    text: str
    robots: tuple[int, ...] = ()
    cells: tuple[int, ...] = ()
    first: int = 0
    zones: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.places)

    @property
    def places(self) -> tuple[int, ...]:
        """The robots, cells or zones."""
        return self.robots or self.cells or self.zones

    @property
    def many(self) -> str:
        """Their number and kind in words."""
        kind = "robot" if self.robots else "cell" if self.cells else "zone"
        return count(len(self.places), kind)


class FindScreen(Dialog[Found]):
    """Enter takes the match under the cursor; the user can step through the others later.

    It is below the map, or beside it in place of the panels, so that matches are visible on the map.
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

    def __init__(self, view: View, text: str = "", preview: Preview = lambda matches: None) -> None:
        """`preview` receives the matches whenever they or the selected match change."""
        super().__init__()
        self._view, self._text, self._preview = view, text, preview

    def inside(self) -> ComposeResult:
        yield TypedInput(self._text, placeholder="robot 17", compact=True)
        yield Static(FIND_EXAMPLES, classes="hint", markup=False)
        yield Static("", id="many", markup=False)
        yield MatchList(self._view)

    def on_mount(self) -> None:
        self._look(self._text)

    def on_input_changed(self, event: Input.Changed) -> None:
        self._look(event.value)

    def _look(self, text: str) -> None:
        """Show the matches of a text."""
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
        """Move to another match."""
        self.query_one(MatchList).action_move(rows)
        self._show_on_map()


class MatchList(Rows, can_focus=False):
    """The list of matches; accepting goes to the one under the cursor."""

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
            dim(f"{robot_word(fleet, robot)} at {view.floor_plan.xy(int(cell))}{words}"),
        )

    def chosen(self, index: int) -> None:
        self.post_message(self.Chosen())


# Parsing of the user's text.


def find(text: str, view: View) -> Found:
    """The matches of a text now. Raises InputError with examples of valid input."""
    words = " ".join(text.lower().split())
    if number := re.fullmatch(r"(?:robot )?(\d{1,9})", words):
        return Found(words, robots=(_robot(int(number[1]), view),))
    if (named := named_places(words, view)) is not None:
        return Found(words, *named)
    if has_pods(view) and (places := _with_pods(words, view)):
        return places
    if number := re.fullmatch(r"(?:load|order) (\d{1,9})", words):
        return _order(words, int(number[1]), view)
    if number := re.fullmatch(r"zone (\d{1,9})", words):
        return Found(words, zones=(checked_zone(view, int(number[1])),))
    if number := re.fullmatch(r"station (\d{1,9})", words):
        return Found(words, cells=(checked_station(view, int(number[1])),))
    if pair := re.fullmatch(r"\(?(-?\d{1,9}) ?, ?(-?\d{1,9})\)?", words):
        return Found(words, cells=(_cell(int(pair[1]), int(pair[2]), view),))
    if words in ("jam", "starved"):
        return _without_progress(words, view)
    kind = KIND_BY_NAME.get(words, KIND_BY_NAME.get(words.removesuffix("s")))
    if words == "shelves":
        kind = KIND_BY_NAME["shelf"]
    if kind is not None and kind.code != WALL:
        cells = np.flatnonzero(view.floor_plan.kind.reshape(-1) == kind.code)
        return Found(words, cells=tuple(cells.tolist()))
    robots = robots_where(" ".join(text.split()), view.snapshot, view.floor_plan)
    return Found(words, robots=tuple(robots.tolist()))


def _robot(number: int, view: View) -> int:
    n = len(view.snapshot.robots)
    if number >= n:
        raise InputError(f"there is no robot {number}; robots are numbered from 0 to {n - 1}")
    return number


def _without_progress(words: str, view: View) -> Found:
    """Starved robots: all of them, or those of the largest jam."""
    figures = view.playback.figures[view.side]
    if words == "starved":
        return Found(words, robots=tuple(figures.starved.tolist()))
    if figures.jam is None:
        return Found(words)
    first = middle_robot(figures.jam, view.snapshot, view.floor_plan)
    return Found(words, robots=figures.jam.robots, first=first)


def _with_pods(words: str, view: View) -> Found | None:
    """A pod or station by name or number, or a trip, where robots carry pods."""
    snapshot = view.snapshot
    if words.startswith("pod ") and snapshot.pod_names:
        return _pod(words, view)
    if (number := re.fullmatch(r"trip (\d{1,9})", words)) and makes_trips(view):
        return _order(words, int(number[1]), view)
    names = [name.lower() for name in snapshot.station_names]
    name = words.removeprefix("station ")
    if name in names and (name != words or not name.isdigit()):
        return Found(words, cells=(int(snapshot.pod_stations.cell[names.index(name)]),))
    if name != words:
        raise InputError(
            f"there is no station {name}; stations are {', '.join(snapshot.station_names)}"
        )
    return None


def _pod(words: str, view: View) -> Found:
    """The cell of a pod, or the robot that carries it."""
    snapshot = view.snapshot
    name = words.removeprefix("pod ")
    names = [one.lower() for one in snapshot.pod_names]
    if name not in names and not (name.isdecimal() and 1 <= int(name) <= len(names)):
        there = f"pods are numbered from 1 to {len(names)}"
        raise InputError(
            f"there is no pod {name}{nearest(name, snapshot.pod_names) or f'; {there}'}"
        )
    pod = names.index(name) if name in names else int(name) - 1
    return Found(words, *places_of_pods([pod], view))


def _order(words: str, number: int, view: View) -> Found:
    """The robot that carries or will fetch the load; else the cell of the load."""
    orders, slots = view.snapshot.orders, view.snapshot.slots
    if number >= len(orders.state):
        raise InputError(
            f"there is no order {number}; orders are numbered from 0 to {len(orders.state) - 1}"
        )
    if orders.reserved_by[number] != NIL:
        return Found(words, robots=(int(orders.reserved_by[number]),))
    place = (
        orders.current_slot[number] if orders.current_slot[number] != NIL else orders.target[number]
    )
    return Found(words, cells=() if place == NIL else (int(slots.cell[place]),))


def _cell(x: int, y: int, view: View) -> int:
    floor_plan = view.floor_plan
    if not floor_plan.holds(x, y) and floor_plan.cell(x, y) not in floor_plan.bays[:, 0]:
        raise InputError(
            f"there is no cell ({x}, {y}); the floor goes from (0, 0) "
            f"to ({floor_plan.width - 1}, {floor_plan.height - 1})"
        )
    return floor_plan.cell(x, y)


# Names from the scenario: locations, doors, lifts, orders, lines, SKUs.


def named_places(words: str, view: View) -> Places | None:
    """Robots or cells that these words name, or None. Raises InputError."""
    location = _location(words, view)
    if location:
        return (), location
    if gate := GATES.fullmatch(words):
        return (), _gates(gate[1], gate[2], view)
    if makes_trips(view):
        kind, _, name = words.partition(" ")
        if kind in ("order", "line", "sku") and name:
            lines = _lines(kind, name, view)
            return places_of_pods(np.unique(_pods_of_lines(lines, view)).tolist(), view)
    return None


def places_of_pods(pods: Iterable[int], view: View) -> Places:
    """The robots that carry some of the pods or, if none, the cells of the pods."""
    snapshot = view.snapshot
    slots = {pod: int(snapshot.pods.slot[pod]) for pod in pods if pod != NIL}
    carried = [pod for pod, slot in slots.items() if slot == NIL]
    robots = {int(snapshot.orders.reserved_by[snapshot.pods.trip[pod]]) for pod in carried}
    if robots:
        return tuple(sorted(robots)), ()
    return (), tuple(int(snapshot.slots.cell[slot]) for slot in slots.values())


def _location(words: str, view: View) -> tuple[int, ...]:
    locations = view.run.resolved.scenario.locations
    assert not isinstance(locations, str), "its file has been read"
    cells = (cell for name, cell in locations.items() if name.lower() == words)
    return tuple(view.floor_plan.cell(*cell) for cell in cells)


def _gates(kind: str, number: str | None, view: View) -> tuple[int, ...]:
    """The cells of one gate of a kind, or of all."""
    floor = view.run.resolved.scenario.floor
    gates = [gate for gate in gates_of(floor) if gate.name.startswith(kind)]
    if number is not None:
        there = f"{kind}s are numbered from 1 to {len(gates)}" if gates else f"there are no {kind}s"
        chosen = [gate for gate in gates if gate.name == f"{kind} {int(number)}"]
        if not chosen:
            raise InputError(f"there is no {kind} {int(number)}; {there}")
        gates = chosen
    return tuple(cell for gate in gates for cell in cells_of(gate, view.floor_plan))


def _lines(kind: str, name: str, view: View) -> Array:
    """(k,) the lines of an order or SKU, or one line by number. Raises InputError."""
    of_order = view.snapshot.lines.order
    listed = listed_lines(view.run.resolved.scenario.orders)
    texts: Sequence[str] = ()
    if kind != "line" and listed:
        places, texts = line_texts(listed, kind)
        named = [at for at, text in enumerate(texts) if text.lower() == name]
        if named:
            return np.flatnonzero(np.isin(places, named))
    count = {"line": len(of_order), "order": int(of_order.max()) + 1, "sku": 0}[kind]
    if not name.isdecimal() or int(name) >= count:
        numbered = f"{kind}s are numbered from 0 to {count - 1}" if count else "no line names it"
        raise InputError(f"there is no {kind} {name}{nearest(name, texts) or f'; {numbered}'}")
    if kind == "line":
        return np.array([int(name)])
    return np.flatnonzero(of_order == int(name))


def _pods_of_lines(lines: Array, view: View) -> Array:
    """(k,) the known pods of these lines; for the others, all pods that hold their SKUs."""
    table, pods = view.snapshot.lines, view.snapshot.pods
    pod = np.where(table.pod[lines] == NIL, table.taken_from[lines], table.pod[lines])
    open_skus = np.unique(table.sku[lines[pod == NIL]])
    held = [pods.sku_pod[pods.sku_first[sku] : pods.sku_first[sku + 1]] for sku in open_skus]
    return np.concatenate([pod[pod != NIL], *held])
