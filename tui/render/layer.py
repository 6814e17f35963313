"""What a layer of the map is: numbers or tints of cells, and how they are said in words.

Each layer is registered as an entry point of the group `automaton.layers`; the name of the entry is
that of the layer. The methods of a layer are called in two threads: `numbers` in that of the player,
all others in that of the screen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from tui.render.cell_looks import flow_codes, heat_codes
from tui.render.scene import HEAT_LEVELS, Scene, levels_of
from tui.render.styles import GlyphSet

if TYPE_CHECKING:
    from automaton.runs.simulation import Simulation
    from automaton.world.resolved import Resolved
    from tui.render.cell_looks import Canvas, Pixels
    from tui.render.scene import Choice
    from tui.render.styles import Entries


ScaleLine = list[str | tuple[int, ...]]  # words, and signs, which are codes, from the left


class Layer:
    """Shows `numbers` as heat, or as arrows; or, if `tints` gives any, cells in the tints of zones."""

    name: str = ""  # that of its entry point
    key: str = ""  # as Textual names keys, several separated by commas; "": only L goes there
    label: str = ""  # in the palette and the help
    meaning: str = ""  # in the help
    action: str = ""  # "layer_..." in the table of bindings; layers that give the same take turns
    position: int = 1000  # where L comes to it: ours are below 100
    unit: str = ""  # of its numbers, in the legend
    counted: str = ""  # the same in the inspector: "ticks lost here"
    words: str = ""  # what it is called in the status line; "": its name
    empty: str = ""  # said while all its numbers are 0; "": no ... yet, with its unit
    heat: bool = True  # it has numbers, even before they are computed; False: tints or nothing
    arrows: bool = False  # numbers are (C, 4), by direction, and drawn as arrows
    ranked: bool = False  # the cells with the greatest numbers are listed beside the legend
    whole_floor: bool = False  # letters of tints stand in place of the marks of one-way floor, too
    absent: str = ""  # said in place of it, where it has nothing to show
    pause_s: float = 0.0  # between two computations of its numbers while ticks go by

    def is_there(self, scene: Scene) -> bool:
        """Whether it has anything to show on this floor."""
        return True

    def numbers(self, simulation: Simulation, selected: int) -> NDArray[Any] | None:
        """(C,) int32, or (C, 4) with `arrows`: a number for each cell, of an observed simulation.

        selected: a robot, or NIL.
        """
        return None

    def levels(self, scene: Scene, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        """The level of heat of each value, 0 to 8."""
        return levels_of(values, scene.scale)

    def tints(self, scene: Scene) -> NDArray[np.int8] | None:
        """(C,) the tint of each cell, an index of tui.render.cell_looks.TINTS, or NIL."""
        return None

    def draw_signs(self, canvas: Canvas, tints: NDArray[np.int8], looks: NDArray[np.uint8]) -> None:
        """Draw over the tints, where each cell has characters of its own."""

    def paint_pixels(self, pixels: Pixels, scene: Scene) -> bool:
        """Paint over the tints, where cells are pixels; whether signs have to stand for them."""
        return False

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries | None:
        """Signs and meanings for the legend; None: the levels of heat with their numbers."""
        return None

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine | None:
        """Its scale in one line; None: the least and the greatest number with the levels of heat."""
        return None

    def key_words(self, scene: Scene, resolved: Resolved, glyphs: GlyphSet) -> list[str]:
        """What a picture without a legend beside it has to say, in a few words each."""
        return []

    def value_words(self, value: int) -> list[str]:
        """What the number of a cell means, in the line about the cell."""
        return [f"{self.name} {value}"]

    def title(self, choice: Choice) -> str:
        """What the status line says while it is shown."""
        return self.words or self.name

    def shown(self, choice: Choice, again: bool) -> str:
        """Its key was pressed, `again` while it was shown; what there is to be said, or ""."""
        return ""

    # What is said and shown of cells whatever the layer is.

    def cell_words(self, scene: Scene, cell: int) -> list[str]:
        """What it knows of a cell, for the line about the cell."""
        return []

    def zone_cells(self, scene: Scene, zone: int) -> NDArray[np.int32] | None:
        """(k,) the cells of a selected zone, if it is one of this layer's."""
        return None


class SwitchedOff(Layer):
    """What a layer of another package that raised does from then on."""

    def is_there(self, scene: Scene) -> bool:
        return False


class NoLayer(Layer):
    """The plain floor."""

    heat = False

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        return []


NO_LAYER = NoLayer()


def check_numbers(layer: Layer, numbers: Any, simulation: Simulation, selected: int) -> None:
    """Raises ValueError for numbers of another shape or type than the map can show."""
    cells = simulation.world.grid.cell_flags.size
    _check("numbers", numbers, (cells, 4) if layer.arrows else (cells,))


def check_tints(layer: Layer, tints: Any, scene: Scene) -> None:
    """Raises ValueError for tints of another shape or type than the map can show."""
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

    [] where no layer is shown, or its numbers are not there yet.
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


def nothing_yet(scene: Scene) -> str:
    """What is said of a layer all of whose numbers are 0."""
    layer = scene.map_layer
    return str(layer.empty or f"no {layer.unit or layer.name} yet")
