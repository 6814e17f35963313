"""The looks of cells and robots in a drawing: colours by meaning, and looks as numbers.

Robots have the colours of Okabe and Ito, which colour-blind people can distinguish; floor, walls and
shelves are greys. Shape is always the second channel. The look of a cell is its kind, with a detail
in the higher bits. The look of a robot is a state, which determines its colour, a shape and a front.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.engine.observation import CAUSE_NO_ORDER, is_waiting
from automaton.engine.robot_states import is_charging
from automaton.engine.state import (
    BATTERY_PERCENT,
    NIL,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_TOWED,
)
from automaton.floor.floor_plan import (
    ALL_EXITS,
    BAY,
    CELL_KINDS,
    DIRECTION_VECTORS,
    FLOOR,
    STORAGE,
    SYMBOLS,
    TRACK,
    TURNTABLE,
    WALL,
    FloorPlan,
    opposite_exits,
)

Theme = Literal["dark", "light"]
THEMES: Final[tuple[Theme, ...]] = ("dark", "light")

# 0xRRGGBB, dark and light.
PALETTE: Final[dict[str, tuple[int, int]]] = {
    "floor": (0x121212, 0xFFFFFF),
    "void": (0x080808, 0xEEEEEE),
    "mark": (0x444444, 0xBCBCBC),
    "track": (0x6C6C6C, 0x8A8A8A),
    "direction": (0x5F8787, 0x5F8787),
    "wall": (0x585858, 0x585858),
    "rack": (0x767676, 0x767676),
    "shelf": (0x8A8A8A, 0x808080),
    "parking-bay": (0x7A7AA8, 0x7474A0),
    "turntable": (0xA8648C, 0x96648A),
    "charger": (0xAFAF5F, 0x75750A),
    "destination": (0x2C7FD0, 0x2A2AA8),
    "dock": (0x5FA35F, 0x4A7F4A),
    "station": (0xB87878, 0xA05050),
    "load": (0xB08860, 0x7A5C45),
    "dim": (0x8F8F8F, 0x6C6C6C),
    "text": (0xD0D0D0, 0x262626),
    "done": (0x009E73, 0x007A58),
    "cursor": (0x5FFFD7, 0x20D8B0),
    "parked": (0x5F87AF, 0x5F7F9F),
    "idle": (0xBFBFBF, 0x4F4F4F),
    "charging": (0xF0E442, 0x4E7A00),
    "empty": (0x56B4E9, 0x0072B2),
    "loaded": (0xE69F00, 0xA85F00),
    "low battery": (0xE06FD0, 0x6A2BD9),
    "waiting": (0xFFC8D8, 0xA0107A),
    "fault": (0xFF5F1F, 0xC8102E),
    "selected": (0xFFFFFF, 0x000000),
}

Looks = NDArray[np.uint8]
DETAIL_SHIFT: Final = 4
KIND_MASK: Final = (1 << DETAIL_SHIFT) - 1
LOOK_COUNT: Final = 16 << DETAIL_SHIFT
DETAIL_INSIDE: Final = 1  # detail of a wall with only walls around it
DETAIL_ONE_WAY: Final = 1  # 1 to 4: details of floor, 1 + direction
KIND_COLOURS: Final = {
    kind.code: {"floor": "mark", "storage": "mark"}.get(kind.name, kind.name) for kind in CELL_KINDS
}
LETTERED_KINDS: Final = ("destination", "charger", "parking-bay", "dock", "station")
# The letters with which scenarios draw these cells; text pictures use them, too.
CELL_LETTERS: Final = {
    CELL_KINDS[symbol.kind].name: letter
    for letter, symbol in SYMBOLS.items()
    if CELL_KINDS[symbol.kind].name in LETTERED_KINDS
}
# States of a robot, the worst last.
DRAW_PARKED: Final = 0
DRAW_IDLE: Final = 1  # on the floor without an order
DRAW_CHARGING: Final = 2
DRAW_EMPTY: Final = 3
DRAW_LOADED: Final = 4
DRAW_LOW_BATTERY: Final = 5
DRAW_WAITING: Final = 6
DRAW_FAULT: Final = 7  # in a wait cycle, or down
STATE_COLOURS: Final = (
    *("parked", "idle", "charging", "empty", "loaded", "low battery", "waiting", "fault"),
)
# Shapes of a robot.
SHAPE_HOLLOW: Final = 0
SHAPE_FILLED: Final = 1  # with a load
SHAPE_SQUARE: Final = 2  # parked
SHAPE_PLUG: Final = 3  # charging
SHAPE_VOID: Final = 4  # empty battery
SHAPE_CROSS: Final = 5  # broken
SHAPE_THIN: Final = 6  # low battery
SHAPE_BOXED: Final = 7  # low battery, with a load
SHAPE_RING: Final = 8  # idle
WITH_LOAD: Final = (SHAPE_FILLED, SHAPE_BOXED)
LOW_CHARGE: Final = 20 * BATTERY_PERCENT


def rgb(name: str, theme: Theme) -> tuple[int, int, int]:
    """Red, green and blue of a colour, 0 to 255 each."""
    value = PALETTE[name][THEMES.index(theme)]
    return value >> 16, value >> 8 & 255, value & 255


def blended(name: str, ground: str, share: float, theme: Theme) -> tuple[int, int, int]:
    """The blend of `share` of a colour over 1 - `share` of a ground."""
    over, under = rgb(name, theme), rgb(ground, theme)
    red, green, blue = (round(u + (o - u) * share) for o, u in zip(over, under, strict=True))
    return red, green, blue


def css(colour: tuple[int, int, int]) -> str:
    """A colour in CSS notation."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


# Cells.


def looks_of(floor_plan: FloorPlan) -> Looks:
    """(height + 2, width + 2) kind and detail of each cell; the detail of rails is their exits."""
    kind, exits = floor_plan.kind, floor_plan.exits
    detail = np.zeros_like(kind)
    rails = (kind == TRACK) | (kind == TURNTABLE)
    detail[rails] = exits[rails]
    onwards = exits & ~_exits_into(kind == STORAGE)
    for direction in range(4):
        detail[(kind == FLOOR) & _one_way(onwards, direction)] = DETAIL_ONE_WAY + direction
    detail[(kind == WALL) & ~beside(kind != WALL)] = DETAIL_INSIDE
    return np.asarray(kind | detail << DETAIL_SHIFT, np.uint8)


def colour_of(look: int) -> str:
    """The name of a look's colour."""
    kind, detail = look & KIND_MASK, look >> DETAIL_SHIFT
    return "direction" if kind == FLOOR and detail else KIND_COLOURS[kind]


def place_labels(names: dict[int, str], stride: int) -> dict[int, tuple[str, list[str]]]:
    """By cell, the kind of a named place ("station P3") and what may be written there, the longest first.

    That is its name without the kind, and the number in it if no other place of this kind has it.
    Adjacent cells of one place have only one name.
    """
    numbers = Counter(_kind_and_number(name) for name in set(names.values()))
    labels = {}
    for cell, name in names.items():
        kind, number = _kind_and_number(name)
        is_first = kind != "closing" and name not in (names.get(cell - 1), names.get(cell - stride))
        own = [number] if number and numbers[kind, number] == 1 else []
        labels[cell] = kind, [name.partition(" ")[2], *own] if is_first else []
    return labels


def _kind_and_number(name: str) -> tuple[str, str]:
    return name.partition(" ")[0], name[len(name.rstrip("0123456789")) :]


def box_of(floor_plan: FloorPlan) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of the floor with parking bays, which may be in the border.

    Columns and rows are counted as users see them; right and bottom are excluded.
    """
    height, width = floor_plan.kind.shape
    rows, columns = np.nonzero(floor_plan.kind == BAY)
    left, top = min(1, *columns, 1), min(1, *rows, 1)
    right, bottom = max(width - 1, *(columns + 1), 1), max(height - 1, *(rows + 1), 1)
    return int(left) - 1, int(top) - 1, int(right) - 1, int(bottom) - 1


def _exits_into(cells: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The exits into some cells. Exits into storage do not count: the aisle is still one-way."""
    sides = np.zeros(cells.shape, np.uint8)
    for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
        sides |= np.where(np.roll(cells, (-dy, -dx), (0, 1)), np.uint8(1 << direction), np.uint8(0))
    return sides


def _one_way(exits: NDArray[np.uint8], direction: int) -> NDArray[np.bool_]:
    """Cells with only this exit and no way back through it, so that dead ends do not count."""
    bit = 1 << direction
    dx, dy = DIRECTION_VECTORS[direction]
    ahead = np.roll(exits, (-dy, -dx), (0, 1))
    one_way: NDArray[np.bool_] = (exits == bit) & (ahead & opposite_exits(bit) & ALL_EXITS == 0)
    return one_way


def beside(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The cells that are one of these or touch one, also at a corner."""
    some = np.pad(cells, 1)
    height, width = cells.shape
    near = np.zeros(cells.shape, bool)
    for dy in range(3):
        for dx in range(3):
            near |= some[dy : dy + height, dx : dx + width]
    return near


# Robots.


class RobotLooks(NamedTuple):
    """The looks of robots, all (n,) uint8."""

    state: NDArray[np.uint8]
    shape: NDArray[np.uint8]
    direction: NDArray[np.uint8]  # 0 to 3: facing or driving direction


def robot_looks(
    robots: Any, headings: Sequence[int], battery: bool, may_be_down: bool
) -> RobotLooks:
    """The looks by the fields of robots and the observation's `cause` and `wait_cycle_ticks`.

    `robots`: an object with these (n,) arrays; `headings`: number of headings by type; `battery`:
    robots run on batteries; `may_be_down`: they may break down on the floor.
    """
    loaded, parked = robots.load != NIL, robots.parked != 0
    state = np.where(loaded, np.uint8(DRAW_LOADED), np.uint8(DRAW_EMPTY))
    idle = robots.cause == CAUSE_NO_ORDER
    state[idle] = DRAW_IDLE
    state[is_waiting(robots.cause)] = DRAW_WAITING
    state[parked] = DRAW_PARKED
    state[robots.wait_cycle_ticks != 0] = DRAW_FAULT
    shape = np.where(idle, np.uint8(SHAPE_RING), loaded.astype(np.uint8))
    shape[parked] = SHAPE_SQUARE
    if battery:
        plugged = is_charging(robots)
        state[plugged], shape[plugged] = DRAW_CHARGING, SHAPE_PLUG
        low = (robots.charge < LOW_CHARGE) & ~plugged
        state[low] = np.maximum(state[low], DRAW_LOW_BATTERY)
        shape[low] = np.where(loaded[low], SHAPE_BOXED, SHAPE_THIN)
    if battery or may_be_down:
        for code, sign in ((STATUS_DEPLETED, SHAPE_VOID), (STATUS_FAILED, SHAPE_CROSS)):
            state[robots.status == code], shape[robots.status == code] = DRAW_FAULT, sign
        towed = robots.status >= STATUS_TOWED  # visible only in a parking bay
        state[towed], shape[towed] = DRAW_PARKED, SHAPE_CROSS
    return RobotLooks(state, shape, directions(robots, headings))


def cell_of(robots: Any) -> NDArray[np.int32]:
    """(n,) the cell in which each robot is drawn, maybe its parking bay; or NIL."""
    return np.asarray(np.where(robots.cell == NIL, robots.bay, robots.cell), np.int32)


def directions(robots: Any, headings: Sequence[int]) -> NDArray[np.uint8]:
    """(n,) 0 to 3: the direction in which each robot faces or, without a heading, drives.

    `headings`: number of headings by type.
    """
    own = np.array(headings)[robots.type % len(headings)]  # types with a load follow
    # Omni robots: the last driving direction. On rails: the same, or the new axis after a turn.
    came = (own == 1) | ((own == 2) & (robots.travel & 1 == robots.heading))
    return np.asarray(np.where(came, robots.travel & 3, robots.heading & 3), np.uint8)
