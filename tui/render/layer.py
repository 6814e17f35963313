"""A layer of the map: numbers or tints of cells, and the words for them.

Each layer is registered as an entry point of the group `automaton.layers`; the name of the entry is
that of the layer. The player's thread calls `numbers`, the screen's thread all other methods.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from tui.render.cell_looks import TINT_CODES, TINTS, flow_codes, heat_codes
from tui.render.scene import HEAT_LEVELS, Scene, levels_of
from tui.render.styles import GlyphSet, code, style

if TYPE_CHECKING:
    from automaton.runs.simulation import Simulation
    from automaton.world.resolved import Resolved
    from tui.render.cell_looks import Canvas, Pixels
    from tui.render.scene import Choice
    from tui.render.styles import Codes, Entries


ScaleLine = list[str | tuple[int, ...]]  # words and signs (codes), from the left


class Layer:
    """Shows `numbers` as heat or arrows or, if `tints` returns any, cells in tints of zones."""

    name: str = ""  # that of its entry point
    key: str = ""  # as Textual names keys, separated by commas; "": only L reaches it
    label: str = ""  # in the palette and the help
    meaning: str = ""  # in the help
    action: str = ""  # "layer_..." in the table of bindings; layers with the same action alternate
    position: int = 1000  # in the order of L; ours are below 100
    unit: str = ""  # of its numbers, in the legend
    counted: str = ""  # unit in the inspector: "ticks lost here"
    words: str = ""  # its title in the status line; "": its name
    empty: str = ""  # shown while all its numbers are 0; "": "no UNIT yet"
    heat: bool = True  # it has numbers, even before they are computed; False: tints or nothing
    arrows: bool = False  # numbers are (C, 4), by direction, and drawn as arrows
    compares: bool = False  # its numbers compare two recordings side by side
    ranked: bool = False  # list the cells with the greatest numbers beside the legend
    whole_floor: bool = False  # letters of tints replace the marks of one-way floor, too
    absent: str = ""  # message where it has nothing to show
    pause_s: float = 0.0  # between two computations of its numbers during playback

    def is_there(self, scene: Scene) -> bool:
        """Whether the layer has anything to show on this floor."""
        return True

    def numbers(self, simulation: Simulation, selected: int) -> NDArray[Any] | None:
        """(C,) int32, or (C, 4) with `arrows`: a number for each cell of an observed simulation.

        selected: a robot, or NIL.
        """
        return None

    def levels(self, scene: Scene, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        """The heat level of each value, 0 to 8."""
        return levels_of(values, scene.scale)

    def tints(self, scene: Scene) -> NDArray[np.int8] | None:
        """(C,) the tint of each cell, an index of tui.render.cell_looks.TINTS, or NIL."""
        return None

    def signs(
        self,
        scene: Scene,
        cells: tuple[int, int, int, int],
        across: int,
        down: int,
        glyphs: GlyphSet,
    ) -> Codes | None:
        """(rows, columns) codes for blocks of across x down cells, drawn over the floor.

        `cells`: top, left, bottom and right of a rectangle, as tui.render.camera.CellRectangle. A code of
        0: what stands there stays; None: the layer has no signs.
        """
        return None

    def draw_signs(self, canvas: Canvas, tints: NDArray[np.int8], looks: NDArray[np.uint8]) -> None:
        """Draw over the tints, where a cell has one or more characters."""

    def paint_pixels(self, pixels: Pixels, scene: Scene) -> bool:
        """Paint over the tints, where cells are pixels; returns whether to draw signs instead."""
        return False

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries | None:
        """Signs and meanings for the legend; None: the heat levels with their numbers."""
        return None

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine | None:
        """The scale in one line; None: the least and greatest number with the heat levels."""
        return None

    def key_words(self, scene: Scene, resolved: Resolved, glyphs: GlyphSet) -> list[str]:
        """Short explanations for a picture without a legend."""
        return []

    def value_words(self, value: int) -> list[str]:
        """The number of a cell in words, for the line about the cell."""
        return [f"{self.name} {value}"]

    def title(self, choice: Choice) -> str:
        """The layer's words in the status line."""
        return self.words or self.name

    def shown(self, choice: Choice, again: bool) -> str:
        """React to its key, pressed `again` while shown; returns a message or ""."""
        return ""

    # Asked of every layer, shown or not.

    def cell_words(self, scene: Scene, cell: int) -> list[str]:
        """Facts about a cell, for the line about the cell."""
        return []

    def zone_cells(self, scene: Scene, zone: int) -> NDArray[np.int32] | None:
        """(k,) the cells of a selected zone, if the zone belongs to this layer."""
        return None


class SwitchedOff(Layer):
    """The behaviour of another package's layer after it has raised."""

    def is_there(self, scene: Scene) -> bool:
        return False


class NoLayer(Layer):
    """The plain floor."""

    heat = False

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        return []


NO_LAYER = NoLayer()


def check_numbers(layer: Layer, numbers: Any, simulation: Simulation, selected: int) -> None:
    """Raise ValueError or TypeError for numbers of the wrong shape or type."""
    cells = simulation.world.grid.cell_flags.size
    _check("numbers", numbers, (cells, 4) if layer.arrows else (cells,))


def check_tints(layer: Layer, tints: Any, scene: Scene) -> None:
    """Raise ValueError or TypeError for tints of the wrong shape or type."""
    _check("tints", tints, (scene.floor.floor_plan.kind.size,))


def _check(method: str, array: Any, shape: tuple[int, ...]) -> None:
    if array is None:
        return
    if not isinstance(array, np.ndarray):
        raise TypeError(f"{method}() gave a {type(array).__name__}, not an array")
    if array.shape != shape or not np.issubdtype(array.dtype, np.integer):
        gave = f"{array.dtype} of shape {array.shape}"
        raise ValueError(f"{method}() gave {gave}, not integers of shape {shape}")


CHECKS: Final = {"numbers": check_numbers, "tints": check_tints}


def scale_line(scene: Scene, glyphs: GlyphSet) -> ScaleLine:
    """The scale of the layer in words and signs, from the left: visits 1 ▪▪▪▪▪▪▪▪ 120.

    [] if no layer is shown or its numbers have not been computed yet.
    """
    layer = scene.map_layer
    own: ScaleLine | None = layer.scale(scene, glyphs)
    if own is not None:
        return own
    if scene.values is None:
        return []
    if not scene.values.any():
        return [nothing_yet(scene)]
    codes = flow_codes(glyphs)[:, 0] if layer.arrows else heat_codes(glyphs)
    signs = tuple(codes[1:HEAT_LEVELS].tolist())
    least = int(scene.values[scene.values > 0].min(initial=scene.scale.end))
    return [f"{layer.unit or layer.name} {least:,}", signs, f"{int(np.max(scene.values)):,}"]


def tint_sign(tint: int) -> int:
    """A tint as the code of a sign."""
    return int(code(style(TINTS[tint], TINTS[tint]), TINT_CODES[tint]))


def tint_letter(tint: int) -> str:
    """The letter that shows a tint without colours."""
    return chr(TINT_CODES[tint])


def nothing_yet(scene: Scene) -> str:
    """The message for a layer whose numbers are all 0."""
    layer = scene.map_layer
    return str(layer.empty or f"no {layer.unit or layer.name} yet")
