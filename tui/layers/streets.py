"""The layers of streets: the cheaper direction of each cell as an arrow, and weights of waiting as heat.

    r = log2(weight of the move back / weight of the move), at most 3; a move back that is closed: 3

    ⇢⇣.↠      a cell shows the axis of larger r, from a factor of 1.25 on: an arrow in five colours,
    eswn.>    with another head where the move back is closed

Where crossing streets are equally strong, cells show one and the other in turn, as on a chessboard.
Where a character has many cells, it shows their mean.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import FloorPlan
from tui.render import styles
from tui.render.camera import CellRectangle, blocks
from tui.render.cell_looks import heat_codes
from tui.render.layer import Layer, ScaleLine
from tui.render.styles import Codes, GlyphSet, code, style

if TYPE_CHECKING:
    from automaton.runs.simulation import Simulation
    from automaton.world.resolved import Resolved
    from tui.render.scene import Scene
    from tui.render.styles import Entries

FACTORS: Final = (1.25, 2, 3, 5, 8)  # at which the colours of arrows begin
FIRST_OF_MEANS: Final = 0.1  # log2: a mean below it is no direction
STRONGEST: Final = np.log2(FACTORS[-1])
NO_WAY: Final = np.inf  # weight of a move that the floor does not have
UNIT: Final = 100  # weights of a floor are in 1 / UNIT
# Weights of waiting at which levels of heat begin; 1 has none.
WAIT_BEGINS: Final = (0, 0.5, 0.8, *FACTORS)
WAIT_LEVELS: Final = np.array([1, 2, 0, 4, 5, 6, 7, 8], np.int32)


class Arrows(NamedTuple):
    """The streets of a floor of C cells."""

    pull: NDArray[np.float64]  # (C, 2) r along each axis, positive to the east and to the south
    one_way: NDArray[np.bool_]  # (C, 2) whether the move against the pull is closed
    drivable: NDArray[np.bool_]  # (C,)


@lru_cache(maxsize=8)
def arrows_of(floor_plan: FloorPlan) -> Arrows:
    """The streets of a floor, one-way moves of its picture included."""
    exits = (floor_plan.exits.reshape(-1)[:, None] >> np.arange(4)) & 1 > 0
    weights = np.where(exits, UNIT, NO_WAY)
    if len(floor_plan.move_weights):
        weights = np.where(exits, floor_plan.move_weights, NO_WAY)
    strength = np.zeros(weights.shape)
    one_way = np.zeros(weights.shape, np.bool_)
    for direction, offset in enumerate(floor_plan.offsets):
        back = np.roll(weights[:, direction ^ 2], -offset)
        out = exits[:, direction]
        ratio = np.divide(back, weights[:, direction], where=out, out=np.ones(len(back)))
        strength[:, direction] = np.log2(np.clip(ratio, 1, FACTORS[-1]))
        one_way[:, direction] = out & np.isinf(back)
    pull = strength[:, :2] - strength[:, 2:]
    ahead = np.where(pull > 0, one_way[:, :2], (pull < 0) & one_way[:, 2:])
    return Arrows(pull, ahead, floor_plan.drivable.reshape(-1))


@lru_cache(maxsize=8)
def arrow_codes(
    floor_plan: FloorPlan, cells: CellRectangle, across: int, down: int, glyphs: GlyphSet
) -> Codes:
    """(rows, columns) codes of blocks of cells in a rectangle; 0: what stands there stays."""

    def summed(values: NDArray[Any]) -> NDArray[np.float64]:
        whole = values.reshape(*floor_plan.kind.shape, *values.shape[1:])
        part = whole[cells.top : cells.bottom, cells.left : cells.right]
        return np.asarray(blocks(part.astype(np.float64), across, down))

    arrows, is_cell = arrows_of(floor_plan), across == down == 1
    driven = summed(arrows.drivable)
    many = np.maximum(driven, 1)[..., None]
    pull = summed(arrows.pull) / many
    one_way = summed(arrows.one_way) / many > 0.5
    axis = np.abs(pull[..., 1]) > np.abs(pull[..., 0])
    rows, columns = np.indices(axis.shape)
    odd = (rows + columns + cells.top + cells.left) % 2 == 1
    axis = np.where(np.abs(pull[..., 1]) == np.abs(pull[..., 0]), odd, axis).astype(np.intp)
    along = np.take_along_axis(pull, axis[..., None], 2)[..., 0]
    heads = np.take_along_axis(one_way, axis[..., None], 2)[..., 0]
    direction = np.where(along < 0, axis + 2, axis)
    strength = np.abs(along) + 1e-9  # so that rounding hides no factor
    step = np.searchsorted(np.log2(FACTORS), strength, "right") - 1
    first = np.log2(FACTORS[0]) if is_cell else FIRST_OF_MEANS
    signs = np.where(
        heads, *(np.array(one)[direction] for one in (glyphs.one_way_head, glyphs.way))
    )
    codes = step_code(np.maximum(step, 0), signs)
    area = summed(np.ones_like(arrows.drivable))
    rest = 0 if is_cell else np.where((driven > 0) & (driven == area), dot(glyphs), 0)
    return np.where(strength >= first, codes, rest).astype(np.uint32)


def step_code(step: int | NDArray[Any], sign: Any) -> Any:
    """The code of a sign in the colour of a step."""
    return code(style(styles.COLOUR_LEVEL_0 + np.asarray(step), styles.COLOUR_FLOOR), sign)


def dot(glyphs: GlyphSet) -> int:
    """A place without a direction."""
    return int(code(style(styles.COLOUR_FLOOR_MARK, styles.COLOUR_FLOOR), glyphs.floor))


def between(begins: tuple[float, ...], step: int) -> str:
    """The factors of a step in words."""
    if step == len(begins) - 1:
        return f"{begins[step]:g} or more"
    return f"{begins[step]:g} to {begins[step + 1]:g}"


class Streets(Layer):
    """In which direction moves are cheaper than back, and where the move back is closed."""

    key, label, position, action = "W", "Streets", 44, "layer_streets"
    meaning = "streets: the cheaper direction; again: weights of waiting"
    absent = "this floor has no streets: every move costs as much as the one back"
    heat, arrows = False, True  # `numbers` are for the inspector

    def is_there(self, scene: Scene) -> bool:
        return bool(arrows_of(scene.floor.floor_plan).pull.any())

    def numbers(self, simulation: Simulation, selected: int) -> NDArray[np.int32]:
        """(C, 4) moves out of each cell so far."""
        return simulation.observation.flow.copy()

    def signs(
        self, scene: Scene, cells: CellRectangle, across: int, down: int, glyphs: GlyphSet
    ) -> Codes:
        return arrow_codes(scene.floor.floor_plan, cells, across, down, glyphs)

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        if not self.is_there(scene):
            return [((), self.absent)]
        ways, heads = np.array(glyphs.way), np.array(glyphs.one_way_head)
        entries = [
            (
                tuple(step_code(step, ways).tolist()),
                f"back costs {between(FACTORS, step)} times",
            )
            for step in range(len(FACTORS))
        ]
        if arrows_of(scene.floor.floor_plan).one_way.any():
            closed = tuple(step_code(len(FACTORS) - 1, heads).tolist())
            entries.append((closed, "the move back is closed"))
        return [*entries, ((dot(glyphs),), "no direction is cheaper")]

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        if not self.is_there(scene):
            return [self.absent]
        steps = tuple(step_code(np.arange(len(FACTORS)), glyphs.way[0]).tolist())
        line: ScaleLine = [f"back costs {FACTORS[0]:g}", steps, f"{FACTORS[-1]:g} times"]
        if arrows_of(scene.floor.floor_plan).one_way.any():
            line += [(int(step_code(len(FACTORS) - 1, glyphs.one_way_head[0])),), "closed"]
        return line

    def key_words(self, scene: Scene, resolved: Resolved, glyphs: GlyphSet) -> list[str]:
        if not self.is_there(scene):
            return [self.absent]
        ways, heads = (
            "".join(glyphs.characters[sign] for sign in signs)
            for signs in (glyphs.way, glyphs.one_way_head)
        )
        closed = arrows_of(scene.floor.floor_plan).one_way.any()
        return [
            f"{ways} cheaper this way",
            *([f"{heads} the move back is closed"] if closed else []),
        ]


class StreetWaits(Layer):
    """The weights of waiting, which right of way pibt and epibt read."""

    key, label, position, action = "W", "Streets", 45, "layer_streets"
    meaning = "streets: the cheaper direction; again: weights of waiting"
    words = "weights of waiting"
    absent = "no streets here, or none with weights of waiting"

    def is_there(self, scene: Scene) -> bool:
        return bool(wait_levels(scene.floor.floor_plan).any())

    def numbers(self, simulation: Simulation, selected: int) -> NDArray[np.int32]:
        return wait_levels(simulation.resolved.floor_plan)

    def levels(self, scene: Scene, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        return values.astype(np.uint8)

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        heat, found = heat_codes(glyphs), wait_levels(scene.floor.floor_plan)
        levels = [level for level in WAIT_LEVELS.tolist() if level and (found == level).any()]
        return [((int(heat[level]),), wait_words(level)) for level in levels] or [((), self.absent)]

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        if not self.is_there(scene):
            return [self.absent]
        signs = [int(heat_codes(glyphs)[level]) for level in WAIT_LEVELS.tolist() if level]
        low, high = tuple(signs[:2]), tuple(signs[2:])
        return ["a tick of waiting counts 0", low, f"{WAIT_BEGINS[2]:g}, {FACTORS[0]:g}", high, "8"]

    def value_words(self, value: int) -> list[str]:
        return [wait_words(value)] if value else []


@lru_cache(maxsize=8)
def wait_levels(floor_plan: FloorPlan) -> NDArray[np.int32]:
    """(C,) the level of the weight of waiting in each cell; 0 near 1."""
    if not len(floor_plan.wait_weights):
        return np.zeros(floor_plan.kind.size, np.int32)
    weights = floor_plan.wait_weights / UNIT
    found = WAIT_LEVELS[np.searchsorted(WAIT_BEGINS, weights, "right") - 1]
    return np.where(floor_plan.drivable.reshape(-1), found, 0).astype(np.int32)


def wait_words(level: int) -> str:
    """The weights of a level in words."""
    step = WAIT_LEVELS.tolist().index(level)
    return f"a tick of waiting counts {between(WAIT_BEGINS, step)}"
