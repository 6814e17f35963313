"""The lines under the map: time, the fleet, the selection, and the content of a cell.

(12, 4) shelf with load 7                                       link 48 KB/s  rtt 52 ms  fps 30
> x4 40/s  tick 1,234 of 2,616  617 s  }2 loaded  >1 empty  >1 waiting  I1 idle  23/50 delivered
"""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from textual.app import ComposeResult
from textual.widgets import Footer

from automaton.drawings import looks
from automaton.drawings.looks import DETAIL_ONE_WAY, DETAIL_SHIFT, KIND_MASK
from automaton.engine.state import (
    BATTERY_PERCENT,
    NIL,
    ORDER_DELIVERED,
    ORDER_WAITING,
    STATUS_DEPLETED,
    STATUS_FAILED,
)
from automaton.floor.floor_plan import (
    ANY_LOADS,
    CELL_KINDS,
    DIRECTIONS,
    EXIT_EAST,
    EXIT_WEST,
    FLOOR,
    TRACK,
)
from automaton.history.fleet_summary import summarize
from automaton.history.state_words import (
    carries_pods,
    gates_in,
    has_trips,
    load_words,
    pod_name,
    station_queue,
    words_of,
)
from automaton.units import Unit, number, percent
from automaton.vocabulary import COLOUR_WORDS, IN_WAIT_CYCLE, IS_DOWN, robot_word, with_cause
from tui.registration import layers
from tui.render import drawn_robots as drawn
from tui.render import styles
from tui.render.layer import scale_line
from tui.render.scene import DETAIL_PASSING, DETAIL_UNLIMITED, Scene
from tui.render.styles import ASCII, GLYPH_BITS, GLYPHS, Codes, GlyphSet, code, style, text
from tui.terminal.map_view import MapView
from tui.widgets.bindings import do

if TYPE_CHECKING:
    from tui.playback.playback_state import PlaybackState, RunFigures
    from tui.terminal.frame_pacing import LinkFigures as LinkFigures


WORD_GAP: Final = 2  # columns between two words of a line
NEARLY_DONE = 0.9  # this share of the requested speed counts as reached
SCALE_RANK = 1  # if not all words fit, hints are omitted first, then scales, then messages
EXTRA_RANK = 5  # from which words are omitted before the names of states
MAX_DESCRIBED_ROBOTS = 3  # described in one line

# Drawn states of robots, in the order of the status line.
STATE_SIGNS: Final = {  # a shape that robots have in this state
    looks.DRAW_LOADED: looks.SHAPE_FILLED,
    looks.DRAW_EMPTY: looks.SHAPE_HOLLOW,
    looks.DRAW_WAITING: looks.SHAPE_HOLLOW,
    looks.DRAW_IDLE: looks.SHAPE_RING,
    looks.DRAW_CHARGING: looks.SHAPE_PLUG,
    looks.DRAW_LOW_BATTERY: looks.SHAPE_THIN,
    looks.DRAW_PARKED: looks.SHAPE_SQUARE,
    looks.DRAW_FAULT: looks.SHAPE_HOLLOW,
}
ALWAYS_SHOWN: Final = (looks.DRAW_LOADED, looks.DRAW_EMPTY, looks.DRAW_WAITING, looks.DRAW_IDLE)
NAMED_STATES: Final = (  # states with words; the first of these for which there is room
    frozenset(STATE_SIGNS),
    frozenset(STATE_SIGNS) - {looks.DRAW_LOADED, looks.DRAW_EMPTY},
    frozenset({looks.DRAW_WAITING, looks.DRAW_FAULT}),  # their sign is that of empty robots
    frozenset({looks.DRAW_WAITING}),
    frozenset[int](),
)

# These are never omitted; others are, the last first.
LASTING_KEYS: Final = (do("panels"), do("help"), do("quit"))


class Word(NamedTuple):
    """A word of a line."""

    glyphs: tuple[int, ...]
    fg: int = styles.COLOUR_TEXT
    action: str = ""  # the action of a click
    rank: int = 0  # if the line is too narrow, the highest rank is omitted first
    codes: tuple[int, ...] = ()  # codes that replace the glyphs one by one

    @property
    def text(self) -> str:
        """The text of the word."""
        return "".join(styles.UNICODE.characters[glyph] for glyph in self.glyphs)


def word(words: str, fg: int = styles.COLOUR_TEXT, action: str = "", rank: int = 0) -> Word:
    """An ASCII word."""
    return Word(text(words), fg, action, rank)


class WordLine(MapView, can_focus=False):
    """Words aligned left and words aligned right; each can be clicked.

    Only changed characters are written.
    """

    DEFAULT_CSS = "WordLine { height: 1; width: 1fr; }"

    def set_words(self, left: Sequence[Word], right: Sequence[Word] = ()) -> bool:
        """Show these words; returns whether anything changed."""
        width = self.size.width
        if not width:
            return False
        left, right = _fitting(left, right, width)
        self._places: list[tuple[int, int, str]] = []
        codes = np.full(
            (1, width), code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), 0), np.uint32
        )
        at = 0
        for one in left:
            at = self._put(codes, at, one) + WORD_GAP
        at = width - columns_of(right)
        for one in right:
            at = self._put(codes, at, one) + WORD_GAP
        if self.shown is not None and np.array_equal(codes, self.shown):
            return False
        self.present(codes)
        return True

    def _put(self, codes: Codes, at: int, one: Word) -> int:
        row = codes[0, max(at, 0) : at + len(one.glyphs)]
        row[:] = code(
            style(one.fg, styles.COLOUR_VOID), np.array(one.glyphs[: len(row)], np.uint32)
        )
        if one.codes:
            row[:] = one.codes[: len(row)]
        self._places.append((at, at + len(one.glyphs), one.action))
        return at + len(one.glyphs)

    async def on_map_view_clicked(self, event: MapView.Clicked) -> None:
        event.stop()
        for begin, end, action in getattr(self, "_places", []):
            if action and begin <= event.column < end:
                await self.app.run_action(do(action))


def columns_of(words: Sequence[Word]) -> int:
    """The columns that words need, with gaps between them."""
    return sum(len(one.glyphs) + WORD_GAP for one in words) - WORD_GAP if words else 0


def lasting(words: Sequence[Word]) -> list[Word]:
    """The words that do not give way to the names of states."""
    return [one for one in words if one.rank < EXTRA_RANK]


def _fitting(
    left: Sequence[Word], right: Sequence[Word], width: int
) -> tuple[list[Word], list[Word]]:
    """The words that fit, the lowest rank first; words of rank 0 are always kept."""
    both = [*left, *right]
    used, kept = -WORD_GAP, set()
    for at in sorted(range(len(both)), key=lambda at: both[at].rank):
        wide = len(both[at].glyphs) + WORD_GAP
        if not both[at].rank or used + wide <= width:
            used += wide
            kept.add(at)
    words = [
        [both[at] for at in part if at in kept]
        for part in (range(len(left)), range(len(left), len(both)))
    ]
    return words[0], words[1]


# The status line.


def time_words(
    playback: PlaybackState, side: int, factor: float, tick: Unit, glyphs: GlyphSet
) -> list[Word]:
    """The playback's state and speed, and the shown tick of a run."""
    arrows = glyphs.robot if glyphs is ASCII else glyphs.loaded
    signs = {1: arrows[0], -1: arrows[2]}
    plays = (signs[playback.playing],) if playback.playing else word("||").glyphs
    shown, end = playback.snapshots[side].tick, playback.ends[side]
    last = playback.head if end is None else end
    rest = "" if shown == last else f"of {last:,}"
    return [
        Word(plays, styles.COLOUR_DONE if playback.playing else styles.COLOUR_LOADED, "play_pause"),
        word(_speed(playback, factor), styles.COLOUR_TEXT, "faster"),
        word(f"tick {shown:,}", styles.COLOUR_SELECTED, "go_to"),
        *([word(rest, styles.COLOUR_DIM, "go_end", 3)] if rest else []),
        *_time(shown, tick),
    ]


def _speed(playback: PlaybackState, factor: float) -> str:
    """The requested speed and, if less, the achieved one."""
    achieved = f"{playback.achieved:,.0f}/s"
    if math.isinf(factor):
        return f"max {achieved}" if playback.achieved else "max"
    asked = f"x{factor:g} {playback.asked:g}/s"
    late = playback.playing and 0 < playback.achieved < NEARLY_DONE * playback.asked
    return f"{asked} ({achieved})" if late else asked


def _time(ticks: int, tick: Unit) -> list[Word]:
    """The time in the scenario's unit, unless that is a tick."""
    if tick.size == 1:
        return []
    return [word(f"{number(tick.of(ticks))} {tick.plural}", styles.COLOUR_DIM, rank=4)]


def mode_word(
    playback: PlaybackState, side: int, name: str, recorded: bool = False, whole: bool = True
) -> Word:
    """The kind of run, or how it ended; the end is never omitted, however narrow the screen."""
    if playback.failed:
        return word("failed", styles.COLOUR_FAULT, "play_pause")
    is_over = playback.ended(side) or playback.stuck is not None
    if is_over and playback.snapshots[side].robots.wait_cycle_ticks.any():
        return word("deadlocked", styles.COLOUR_FAULT, "why")
    if playback.ended(side):
        return word(
            end_of(playback, side, recorded, whole),
            styles.COLOUR_DONE if whole else styles.COLOUR_WAITING,
        )
    if recorded:
        return (
            word(name, styles.COLOUR_DIM, "", 5)
            if whole
            else word("cut short", styles.COLOUR_WAITING)
        )
    if playback.tick < playback.head:
        return word("past", styles.COLOUR_LOADED, "go_end", 5)
    return word(name, styles.COLOUR_DONE, "", 5)


def end_of(playback: PlaybackState, side: int, recorded: bool, whole: bool) -> str:
    """How a run ended."""
    if playback.snapshots[side].finished:
        return "finished"
    if not whole:
        return "cut short"
    return "ended" if recorded else "limit reached"


def fleet_words(
    scene: Scene, figures: RunFigures, glyphs: GlyphSet, room: int, is_still: bool
) -> list[Word]:
    """Numbers of robots by their drawn state, of starved robots, and of delivered orders.

    States have words as far as all this fits into `room` columns. While the picture `is_still`, states
    without robots make room for words; else the line would jump.
    """
    said: list[Word] = []
    done = _done_words(scene, figures)
    for named in NAMED_STATES:
        for zeros in (True, False) if is_still and named else (True,):
            said = [*state_words(scene, glyphs, named, zeros), *done]
            if columns_of(lasting(said)) <= room:
                return said
    return said


def _done_words(scene: Scene, figures: RunFigures) -> list[Word]:
    """Starved robots, a jam, and what is delivered."""
    assert scene.snapshot is not None
    now, starved, jam = summarize(scene.snapshot), len(figures.starved), figures.jam
    said = []
    if starved:
        said.append(word(f"{starved:,} starved", styles.COLOUR_FAULT, "robots", 1))
    if jam is not None:
        said.append(word(f"jam {len(jam.robots):,}", styles.COLOUR_FAULT, "jam", 1))
    done = f"{now.delivered:,}/{now.orders:,} delivered"
    said.append(word(done, styles.COLOUR_DONE, "events", 2))
    if now.lines:
        lines = word(f"{now.lines_done:,}/{now.lines:,} lines", styles.COLOUR_DONE, "events", 5)
        said.append(lines)
    return said


def state_words(
    scene: Scene, glyphs: GlyphSet, named: Container[int], with_zeros: bool = True
) -> list[Word]:
    """The number of robots in each drawn state, with its sign and colour; they add up to the fleet.

    Of states that are not `named`, the sign alone is shown. `with_zeros`: states without robots are
    shown if any robot of this floor can often be in them, so that the line seldom jumps.
    """
    robots = drawn.robots_of(scene)
    count = np.bincount(robots.state, minlength=len(looks.STATE_COLOURS))
    signs = drawn.shape_glyphs(glyphs)
    assert scene.snapshot is not None
    stuck = (scene.snapshot.robots.wait_cycle_ticks > 0).any()  # these wait, too
    said = []
    for state, shape in STATE_SIGNS.items():
        common = state in ALWAYS_SHOWN or (state == looks.DRAW_CHARGING and scene.floor.battery)
        common &= state != looks.DRAW_WAITING or not stuck
        if count[state] or (common and with_zeros):
            name = looks.STATE_COLOURS[state]
            name = _fault_words(scene) if state == looks.DRAW_FAULT else name
            shown = f" {name}" if state in named else ""
            number_of_robots = word(f"{count[state]:,}{shown}").glyphs
            colour = int(drawn.BODY_COLOURS[state]) if count[state] else styles.COLOUR_DIM
            sign = int(signs[shape, 0])
            action = "why" if state == looks.DRAW_FAULT else "robots"
            said.append(Word((sign, *number_of_robots), colour, action, 1))
    return said


def _fault_words(scene: Scene) -> str:
    """What is wrong with the robots in the colour of faults."""
    assert scene.snapshot is not None
    in_cycle = scene.snapshot.robots.wait_cycle_ticks > 0
    are_down = np.isin(scene.snapshot.robots.status, (STATUS_DEPLETED, STATUS_FAILED))
    if in_cycle.any() and are_down.any():
        return COLOUR_WORDS[looks.STATE_COLOURS[looks.DRAW_FAULT]]
    return IS_DOWN if are_down.any() else IN_WAIT_CYCLE


def choice_words(robot: int, following: bool, layer: str, rank: int = 2) -> list[Word]:
    """The selected robot and the layer."""
    said = []
    if robot != NIL:
        text = f"{'follows ' if following else ''}robot {robot}"
        said.append(
            word(text, styles.COLOUR_CURSOR if following else styles.COLOUR_TEXT, "follow", rank)
        )
    if layer:
        said.append(word(layer, styles.COLOUR_LOADED, "next_layer", rank + 1))
    return said


def head_words(own: str, common: str, width: int) -> list[Word]:
    """The head of one of two maps: its own words and, if they fit, the common ones."""
    words = own if len(own) <= width else f"{own[: max(0, width - 3)]}..."
    return [word(words), *([word(common, styles.COLOUR_DIM, rank=1)] if common else [])]


def end_words(playback: PlaybackState | None, side: int) -> list[Word]:
    """At the right of a head: the end of its run, if reached."""
    ended = playback is not None and playback.ended(side)
    text = (
        f"ended at tick {playback.snapshots[side].tick:,}" if playback is not None and ended else ""
    )
    # The empty word keeps a gap before the other head.
    return [*([word(text, styles.COLOUR_WAITING)] if text else []), word("")]


# The line above the status line.


def long_tick_words(tick: int, seconds: float, waited: bool) -> str:
    """The tick that takes long, and whether a request waits for it."""
    took = f"{seconds:.1f}" if seconds < 1 else f"{int(seconds):,}"
    waits = "; your request waits for it" if waited else ""
    return f"computing tick {tick:,}, {took} s{waits}"


def going_words(begun: int, tick: int, goal: int) -> str:
    """How far it is on the way to a requested tick."""
    share = percent(max(0, tick - begun) / max(1, goal - begun), 0)
    return f"going to {goal:,}: {share}, esc stops"


def stuck_words(begun: int) -> str:
    """Why a run has stopped: a deadlock that it can only repeat."""
    return f"deadlock since tick {begun:,} can only repeat: d goes to its beginning"


class Notice(NamedTuple):
    """A message above the status line, with the conditions that end it."""

    words: Word
    until: float
    layer: str | None = None  # it ends when another layer is shown
    robot: int | None = None  # or another robot selected


def hint_words(
    signs: Sequence[tuple[tuple[tuple[int, ...], ...], str]], name: str = ""
) -> list[Word]:
    """A legend of the signs on the map; if there is room, the scenario, and where all commands are."""
    hint = word("ctrl+p all commands", styles.COLOUR_DIM, "command_palette", 3 + len(signs))
    named = [word(name, styles.COLOUR_DIM, rank=2 + len(signs))] if name else []
    return [hint, *named, *legend_words(signs, 2)]


def legend_words(
    entries: Sequence[tuple[tuple[tuple[int, ...], ...], str]], rank: int
) -> list[Word]:
    """The entries of a legend as words; the last ones are omitted first, from this rank on."""
    plain, said = style(styles.COLOUR_DIM, styles.COLOUR_VOID), []
    for entry, (rows, meaning) in enumerate(entries):
        written = (int(code(plain, glyph)) for glyph in text(f" {meaning}"))
        shown = [at for at, sign in enumerate(rows[0]) if sign & int(GLYPHS)]
        signs = rows[0][shown[0] : shown[-1] + 1]  # without blanks beside them
        codes = (*signs, *written)
        said.append(
            Word(
                tuple(one & int(GLYPHS) for one in codes),
                styles.COLOUR_DIM,
                "legend",
                rank + entry,
                codes,
            )
        )
    return said


def link_words(figures: LinkFigures) -> list[Word]:
    """Measurements of the connection to the terminal."""
    trip = "-" if math.isnan(figures.round_trip) else f"{1000 * figures.round_trip:.0f} ms"
    trip = trip if figures.answers else "no answer"
    return [
        word(f"{figures.kilobytes:.1f} KB/s", styles.COLOUR_DIM),
        word(f"rtt {trip}", styles.COLOUR_DIM),
        word(f"fps {figures.fps:.0f} of {figures.allowed}", styles.COLOUR_DIM),
    ]


def scale_words(scene: Scene, glyphs: GlyphSet) -> list[Word]:
    """The scale of the layer as one word, shown whole or not at all; [] without a scale."""
    codes: list[int] = []
    plain = style(styles.COLOUR_DIM, styles.COLOUR_VOID)
    for part in scale_line(scene, glyphs):
        blank = [int(code(plain, glyphs.blank))] if codes else []
        signs = [int(code(plain, glyph)) for glyph in text(part)] if isinstance(part, str) else part
        after_sign = isinstance(part, tuple) and codes and _is_sign(codes[-1], plain)
        codes += [*([] if after_sign else blank), *signs]
    if not codes:
        return []
    shown = tuple(one & int(GLYPHS) for one in codes)
    return [Word(shown, styles.COLOUR_DIM, rank=SCALE_RANK, codes=tuple(codes))]


def _is_sign(one: int, plain: int) -> bool:
    """Whether a code is a sign; no blank separates signs."""
    return one >> GLYPH_BITS != plain


# A cell in one line.
#
# (12, 4) shelf with load 7 for (20, 3), reserved by robot 2
# (3, 0) track along x, robot 1 with load 4 waiting: head-on
# (5, 3) station P1 with 2 open lines, 1 in its queue, robot 1 with pod 2 at stop


def describe(scene: Scene, cell: int) -> str:
    """A cell of the floor in one line."""
    parts = [place(scene, cell) + " " + ground(scene, cell) + _content(scene, cell)]
    if scene.snapshot is not None:
        snapshot = scene.snapshot
        parts += [words_of(snapshot, gate) for gate in gates_in(snapshot, cell)]
    for layer in layers().by_name.values():
        parts += layer.cell_words(scene, cell)
    if scene.values is not None and scene.floor.drivable[cell]:
        parts += scene.map_layer.value_words(int(scene.values[cell]))
    return ", ".join(parts + _robots(scene, cell))


def place(scene: Scene, cell: int) -> str:
    x, y = scene.floor.floor_plan.xy(cell)
    return f"({x}, {y})"


def ground(scene: Scene, cell: int) -> str:
    """The kind of a cell with its details."""
    number = int(scene.floor.looks.reshape(-1)[cell])
    kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
    if kind == TRACK:
        return f"track along {'x' if detail & (EXIT_EAST | EXIT_WEST) else 'y'}"
    if kind == FLOOR and DETAIL_ONE_WAY <= detail < DETAIL_ONE_WAY + 4:
        return f"one-way floor {DIRECTIONS[detail - DETAIL_ONE_WAY]}"
    if kind == FLOOR and detail == DETAIL_PASSING:
        return "passing aisle"
    if kind == FLOOR and detail == DETAIL_UNLIMITED:
        return "floor for any number of robots"
    return CELL_KINDS[kind].name.replace("-", " ")


def _content(scene: Scene, cell: int) -> str:
    """The content of a slot."""
    slot, snapshot = int(scene.floor.slot_in[cell]), scene.snapshot
    if snapshot is None:
        return ""
    if slot == NIL:
        return _left(scene, cell)
    if carries_pods(snapshot):
        return _pod_words(scene, cell, slot)
    orders, slots = snapshot.orders, snapshot.slots
    text = ""
    kind = scene.floor.floor_plan.kind_of(cell)
    waiting = np.count_nonzero((orders.state == ORDER_WAITING) & (orders.current_slot == slot))
    if kind.holds == ANY_LOADS and kind.gives and kind.takes:
        arrived = np.count_nonzero((orders.state == ORDER_DELIVERED) & (orders.target == slot))
        text = f" with {waiting} loads to fetch, {arrived} brought"
    elif kind.holds == ANY_LOADS and kind.gives:
        text = f" with {waiting} loads"
    elif kind.holds == ANY_LOADS:
        arrived = (orders.state == ORDER_DELIVERED) & (orders.target == slot)
        text = f" with {np.count_nonzero(arrived)} loads"
    elif (order := int(slots.content[slot])) != NIL:
        text = f" with load {order}"
        if orders.target[order] != NIL:
            text += f" for {place(scene, int(slots.cell[orders.target[order]]))}"
        if orders.reserved_by[order] != NIL:
            text += f", to be fetched by robot {orders.reserved_by[order]}"
    else:
        text = ", empty"
    text += _left(scene, cell)
    return text + (
        f", reserved by robot {slots.reserved_by[slot]}" if slots.reserved_by[slot] != NIL else ""
    )


def _pod_words(scene: Scene, cell: int, slot: int) -> str:
    """The pod in a storage cell, or the queue of a station."""
    assert scene.snapshot is not None
    snapshot = scene.snapshot
    station = int(snapshot.pod_stations.station_at[cell])
    if station != NIL:
        queue = len(station_queue(snapshot, station))
        lines = int(snapshot.pod_stations.open_lines[station])
        lines_open = f"{lines:,} open lines, " if has_trips(snapshot) else ""
        return f" {snapshot.station_names[station]} with {lines_open}{queue} in its queue"
    pod, keeper = int(snapshot.slots.content[slot]), int(snapshot.slots.reserved_by[slot])
    if pod == NIL:
        return ", empty" + (f", reserved by robot {keeper}" if keeper != NIL else "")
    trip = int(snapshot.pods.trip[pod])
    fetcher = NIL if trip == NIL else int(snapshot.orders.reserved_by[trip])
    trip_name = f"{'trip' if has_trips(snapshot) else 'order'} {trip}"
    text = f" with {pod_name(snapshot, pod)}" + (f", wanted by {trip_name}" if trip != NIL else "")
    return text + (f", to be fetched by robot {fetcher}" if fetcher != NIL else "")


def _left(scene: Scene, cell: int) -> str:
    """Loads that robots had to leave in a cell."""
    if scene.snapshot is None or cell not in scene.left_loads:
        return ""
    slots, first = scene.snapshot.slots, len(scene.floor.slots_cell)
    loads = slots.content[first:][slots.cell[first:] == cell].tolist()
    return "".join(f", load {load} was left there" for load in loads if load != NIL)


def _robots(scene: Scene, cell: int) -> list[str]:
    """The robots in a cell, and those entering it."""
    if scene.snapshot is None:
        return []
    robots = scene.snapshot.robots
    at = np.where(robots.cell == NIL, robots.bay, robots.cell)
    here, coming = np.flatnonzero(at == cell).tolist(), np.flatnonzero(robots.claim == cell)
    said = [_robot(scene, robot) for robot in here[:MAX_DESCRIBED_ROBOTS]]
    if len(here) > MAX_DESCRIBED_ROBOTS:
        said.append(f"and {len(here) - MAX_DESCRIBED_ROBOTS} robots more")
    return said + [f"robot {robot} comes" for robot in coming.tolist()]


def _robot(scene: Scene, robot: int) -> str:
    assert scene.snapshot is not None
    robots = scene.snapshot.robots
    words = [f"robot {robot}"]
    if robots.load[robot] != NIL:
        words.append(f"with {load_words(scene.snapshot, int(robots.load[robot]))}")
    if scene.floor.battery:
        words.append(f"at {robots.charge[robot] / BATTERY_PERCENT:.0f} %")
    words.append(with_cause(robot_word(robots, robot), robots, robot))
    return " ".join(words)


# The keys at the foot of the screen.


class Keys(Footer):
    """A footer of the keys that fit, always with help and quit."""

    def compose(self) -> ComposeResult:
        keys: list[Any] = list(super().compose())
        while _columns(keys) > self.app.size.width:
            others = [key for key in keys if key.action not in LASTING_KEYS]
            if not others:
                break
            keys.remove(others[-1])
        yield from keys

    def on_resize(self) -> None:
        self.refresh(recompose=True)


def _columns(keys: list[Any]) -> int:
    """Columns of these keys in a row, with a blank between two."""
    return sum(len(f"{key.key_display} {key.description}") + 1 for key in keys) - 1
