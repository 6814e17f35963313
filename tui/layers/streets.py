"""The layers of streets: the cheaper direction of each cell as an arrow, and weights of waiting as heat.

    ⇢⇣.↠      an arrow in five colours, with another head where the move back is closed
    eswn.E

Where crossing streets are equally strong, cells show one and the other in turn, as on a chessboard.
Where a character has many cells, it shows their mean; closed ways keep their head and colour.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.street_arrows import (
    FACTORS,
    LEAST_MEAN,
    NEAR_1,
    WAIT_BEGINS,
    arrows_of,
    directions_of,
    range_words,
    wait_steps,
)
from tui.render import styles
from tui.render.camera import blocks
from tui.render.cell_looks import heat_codes
from tui.render.layer import Layer, ScaleLine
from tui.render.styles import Codes, GlyphSet, code, style

if TYPE_CHECKING:
    from automaton.runs.simulation import Simulation
    from tui.render.scene import Scene, ShownFloor
    from tui.render.styles import Entries

WAIT_LEVELS: Final = np.array(
    [1, 2, 0, 4, 5, 6, 7, 8], np.int32
)  # of heat, by step; NEAR_1 has none


@lru_cache(maxsize=8)
def arrow_codes(
    floor: ShownFloor, cells: tuple[int, int, int, int], across: int, down: int, glyphs: GlyphSet
) -> Codes:
    """(rows, columns) codes of blocks of cells in a rectangle; 0: what stands there stays."""
    top, left, bottom, right = cells

    def summed(values: NDArray[Any]) -> NDArray[np.float64]:
        by_cell = values.reshape(*floor.looks.shape, *values.shape[1:])[top:bottom, left:right]
        return np.asarray(blocks(by_cell.astype(np.float64), across, down))

    arrows, is_cell = arrows_of(floor.floor_plan), across == down == 1
    driven = summed(floor.drivable)
    many = np.maximum(driven, 1)[..., None]
    rows, columns = np.indices(driven.shape)
    is_odd = (rows + columns + top + left) % 2 == 1
    size = np.abs(arrows.pull)
    one_way = summed(size * arrows.one_way) > summed(size) / 2  # closed if most of the pull is
    pull = summed(arrows.pull) / many
    # Closed ways of opposite directions cancel out: the block then shows its first ones.
    first = (arrows.pull * arrows.one_way).reshape(*floor.looks.shape, 2)
    first = first[top:bottom:down, left:right:across]
    pull = np.where((np.abs(pull).max(-1) < LEAST_MEAN)[..., None] & one_way, first, pull)
    shown = directions_of(pull, one_way, is_odd)
    kinds = np.array([glyphs.way, glyphs.one_way_head])
    signs = kinds[shown.one_way.astype(np.intp), shown.direction]
    step = np.where(shown.one_way, len(FACTORS) - 1, np.maximum(shown.step, 0))
    codes = step_code(step, signs)
    if is_cell:
        return np.where(shown.step >= 0, codes, 0).astype(np.uint32)
    is_free = (driven > 0) & (driven == summed(np.ones_like(floor.drivable)))
    rest = np.where(is_free, dot(glyphs), 0)
    return np.where(shown.strength >= LEAST_MEAN, codes, rest).astype(np.uint32)


def step_code(step: int | NDArray[Any], sign: Any) -> Any:
    """The code of a sign in the colour of a step."""
    return code(style(styles.COLOUR_LEVEL_0 + np.asarray(step), styles.COLOUR_FLOOR), sign)


def dot(glyphs: GlyphSet) -> int:
    """A place without a direction."""
    return int(code(style(styles.COLOUR_FLOOR_MARK, styles.COLOUR_FLOOR), glyphs.floor))


class Streets(Layer):
    """In which direction moves are cheaper than back, and where the move back is closed."""

    key, label, position, action = "W", "Streets", 44, "layer_streets"
    meaning = "streets; again: weights of waiting"
    absent = "this floor has no streets: every move costs as much as the one back"
    heat, arrows = False, True  # `numbers` are for the inspector

    def is_there(self, scene: Scene) -> bool:
        return bool(arrows_of(scene.floor.floor_plan).pull.any())

    def numbers(self, simulation: Simulation, selected: int) -> NDArray[np.int32]:
        """(C, 4) moves out of each cell so far."""
        return simulation.observation.flow.copy()

    def signs(
        self,
        scene: Scene,
        cells: tuple[int, int, int, int],
        across: int,
        down: int,
        glyphs: GlyphSet,
    ) -> Codes:
        return arrow_codes(scene.floor, cells, across, down, glyphs)

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        if not self.is_there(scene):
            return [((), self.absent)]
        ways, heads = np.array(glyphs.way), np.array(glyphs.one_way_head)
        entries = [
            (
                tuple(step_code(step, ways).tolist()),
                f"back costs {range_words(FACTORS, step)} times",
            )
            for step in range(len(FACTORS))
        ]
        if arrows_of(scene.floor.floor_plan).one_way.any():
            closed = tuple(step_code(len(FACTORS) - 1, heads).tolist())
            entries.append((closed, "the move back is closed"))
        return [*entries, ((dot(glyphs),), "both ways cost as much")]

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        if not self.is_there(scene):
            return [self.absent]
        steps = tuple(step_code(np.arange(len(FACTORS)), glyphs.way[0]).tolist())
        line: ScaleLine = [f"back costs {FACTORS[0]:g}", steps, f"{FACTORS[-1]:g} times"]
        if arrows_of(scene.floor.floor_plan).one_way.any():
            line += [(int(step_code(len(FACTORS) - 1, glyphs.one_way_head[0])),), "closed"]
        return line

    def key_words(self, scene: Scene, resolved: object, glyphs: GlyphSet) -> list[str]:
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
    meaning = "streets; again: weights of waiting"
    words = "weights of waiting"
    absent = "no streets here, or none with weights of waiting"

    def is_there(self, scene: Scene) -> bool:
        return bool((wait_steps(scene.floor.floor_plan) != NEAR_1).any())

    def numbers(self, simulation: Simulation, selected: int) -> NDArray[np.int32]:
        """(C,) the level of heat of each cell."""
        levels: NDArray[np.int32] = WAIT_LEVELS[wait_steps(simulation.resolved.floor_plan)]
        return levels

    def levels(self, scene: Scene, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        return values.astype(np.uint8)

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        if not self.is_there(scene):
            return [((), self.absent)]
        heat, steps = heat_codes(glyphs), np.unique(wait_steps(scene.floor.floor_plan)).tolist()
        return [
            ((int(heat[WAIT_LEVELS[step]]),), f"waiting counts {range_words(WAIT_BEGINS, step)}")
            for step in steps
            if step != NEAR_1
        ]

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        if not self.is_there(scene):
            return [self.absent]
        low, _, high = np.split(heat_codes(glyphs)[WAIT_LEVELS], [NEAR_1, NEAR_1 + 1])
        ends = f"{WAIT_BEGINS[NEAR_1]:g}, {FACTORS[0]:g}"
        return ["waiting counts 0", tuple(low.tolist()), ends, tuple(high.tolist()), "8"]

    def value_words(self, value: int) -> list[str]:
        step = WAIT_LEVELS.tolist().index(value)
        return [f"waiting counts {range_words(WAIT_BEGINS, step)}"] if value else []
