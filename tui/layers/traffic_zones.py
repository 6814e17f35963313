"""The layer of traffic zones: stretches between intersections, each in one of six tints.

    aaa+bbb     + an intersection, in no zone

Touching zones have different tints, also across a crossing:

    a a + b b      a, b and c meet at the crossing
        c
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from automaton.floor.floor_plan import FLOOR
from automaton.floor.traffic_zones import TrafficZones
from tui.render import styles
from tui.render.cell_looks import TINT_COLOURS, TINT_LETTERS, TINTS, Canvas
from tui.render.layer import Layer, ScaleLine
from tui.render.scene import Scene, ShownFloor
from tui.render.styles import Entries, GlyphSet, code, style

if TYPE_CHECKING:
    from automaton.world.resolved import Resolved


# up to this number of zones, touching ones differ; else tints go by number
MAX_TINTED_ZONES: Final = 50_000

# half of the neighbours, to count pairs once
NEIGHBOUR_OFFSETS: Final = ((0, 1), (1, 0), (1, 1), (1, -1))

CROSSING_OFFSETS: Final = ((0, 2), (2, 0))  # across a cell


class TrafficZoneLayer(Layer):
    """The traffic zones of the floor, if any."""

    key, label, position, action = "f7", "Zones", 60, "layer_zones"
    meaning = "zones of robots; again: of the floor"
    words = "traffic zones"
    absent = "this floor has no zones: all of it is intersections"
    heat = False

    def is_there(self, scene: Scene) -> bool:
        return _zones(scene) is not None

    def tints(self, scene: Scene) -> NDArray[np.int8] | None:
        return None if scene.floor.traffic_zones is None else floor_tints(scene.floor)

    def draw_signs(self, canvas: Canvas, tints: NDArray[np.int8], looks: NDArray[np.uint8]) -> None:
        traffic_zones = canvas.scene.floor.traffic_zones
        if traffic_zones is not None:
            crossing = canvas.cells(traffic_zones.intersection).reshape(-1)
            index = np.flatnonzero(crossing & (tints == NIL) & (looks == FLOOR))
            canvas.flat[index, canvas.sign] = crossing_sign(canvas.glyphs)

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        traffic_zones = _zones(scene)
        if traffic_zones is None:
            return [((), "zones: this floor has none, all of it is intersections")]
        used = _used(scene.floor)
        foregrounds = TINT_COLOURS[used]
        signs = code(style(foregrounds, foregrounds), TINT_LETTERS[used]).tolist()
        said = f"{traffic_zones.count:,} zones, {traffic_zones.mode}; those that touch differ"
        entries = [(tuple(signs[:4]), said)]
        entries += [(tuple(signs[4:]), "more of them")] if signs[4:] else []
        if traffic_zones.mode != "with-intersections" and traffic_zones.intersection.any():
            entries.append(((crossing_sign(glyphs),), "intersection, in no zone"))
        return entries

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        traffic_zones = _zones(scene)
        if traffic_zones is None:
            return [self.absent]
        tints = TINT_COLOURS[_used(scene.floor)]
        codes = code(style(tints, tints), TINT_LETTERS[_used(scene.floor)])
        return [f"{traffic_zones.count:,} zones", tuple(codes.tolist()), "touching ones differ"]

    def key_words(self, scene: Scene, resolved: Resolved, glyphs: GlyphSet) -> list[str]:
        traffic_zones, floor = _zones(scene), scene.floor
        if traffic_zones is None:
            return ["this floor has no zones"]
        letters = " ".join(chr(letter) for letter in TINT_LETTERS[_used(floor)])
        said = [f"a tint or letter ({letters}) for each zone", "touching ones differ"]
        # Only plain floor loses its signs.
        signed = floor.floor_plan.kind.reshape(-1)[traffic_zones.intersection] == FLOOR
        if traffic_zones.mode != "with-intersections" and signed.any():
            said.append(f"{glyphs.characters[glyphs.crossing]} intersection")
        return said

    def cell_words(self, scene: Scene, cell: int) -> list[str]:
        """The zone of a cell, or two by direction; [] where robots serve zones."""
        traffic_zones = scene.floor.traffic_zones
        if scene.service_zones is not None or traffic_zones is None:
            return []
        if not scene.floor.drivable[cell]:
            return []
        numbers = sorted({int(zone) for zone in traffic_zones.of[cell] if zone != NIL})
        if not numbers:
            return ["intersection"]
        return [f"zone{'s' * (len(numbers) > 1)} {' and '.join(map(str, numbers))}"]

    def zone_cells(self, scene: Scene, zone: int) -> NDArray[np.int32] | None:
        traffic_zones = scene.floor.traffic_zones
        if scene.service_zones is not None or traffic_zones is None:
            return None
        return np.flatnonzero((traffic_zones.of == zone).any(axis=1)).astype(np.int32)


def _zones(scene: Scene) -> TrafficZones | None:
    """The traffic zones of the scene's floor, or None."""
    traffic_zones = scene.floor.traffic_zones
    return traffic_zones if traffic_zones is not None and traffic_zones.count else None


def _used(floor: ShownFloor) -> NDArray[np.int8]:
    tints = floor_tints(floor)
    return np.unique(tints[tints != NIL])


def crossing_sign(glyphs: GlyphSet) -> int:
    """Look of an intersection while zones are shown."""
    return int(code(style(styles.COLOUR_DIM, styles.COLOUR_FLOOR), glyphs.crossing))


@lru_cache(maxsize=4)
def floor_tints(floor: ShownFloor) -> NDArray[np.int8]:
    """(C,) the tint of each cell's zone, or NIL. The floor must have traffic zones."""
    assert floor.traffic_zones is not None
    return tints_of(floor.traffic_zones, *floor.floor_plan.kind.shape)


def tints_of(traffic_zones: TrafficZones, height: int, width: int) -> NDArray[np.int8]:
    """(C,) the tint of each cell, an index of TINTS, or NIL; height and width include the border.

    The two zones of a stretch with directions share a tint. The colouring is greedy, in a fixed
    random order: it takes few rounds. Floors of aisles need at most six tints; if more are needed,
    tints repeat.
    """
    number = traffic_zones.of[:, 0].reshape(height, width)
    tint = np.arange(max(traffic_zones.count, 1))
    if traffic_zones.count <= MAX_TINTED_ZONES:
        tint = _coloured(
            len(tint), *_touching(number, traffic_zones.intersection.reshape(height, width))
        )
    return np.where(number == NIL, NIL, tint[number] % len(TINTS)).astype(np.int8).reshape(-1)


def _touching(
    number: NDArray[Any], crossing: NDArray[np.bool_]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Pairs of touching zones, each in both orders."""
    pairs = []
    for dy, dx in (*NEIGHBOUR_OFFSETS, *CROSSING_OFFSETS):
        there = np.roll(number, (-dy, -dx), (0, 1))  # the border, in no zone, prevents wrapping
        apart = (number != NIL) & (there != NIL) & (number != there)
        if (dy, dx) in CROSSING_OFFSETS:
            apart &= np.roll(crossing, (-dy // 2, -dx // 2), (0, 1))
        pairs.append(np.column_stack((number[apart], there[apart])))
    found = np.unique(np.concatenate(pairs), axis=0)
    both = np.concatenate((found, found[:, ::-1]))
    return both[:, 0], both[:, 1]


def _coloured(count: int, one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.int64]:
    """(count,) the lowest tint free among touching zones (rounds of Jones & Plassmann)."""
    turn = np.random.default_rng(1).permutation(count)
    turn = turn - count * np.bincount(one, minlength=count)  # zones with many neighbours go first
    tint = np.full(count, NIL)
    while (tint == NIL).any():
        open_ = tint[one] == NIL
        one, other = one[open_], other[open_]
        waits = np.zeros(count, bool)
        waits[one[(tint[other] == NIL) & (turn[other] < turn[one])]] = True
        taken = np.zeros(count, np.int64)
        settled = tint[other] != NIL
        np.bitwise_or.at(taken, one[settled], 1 << np.minimum(tint[other[settled]], 62))
        now = (tint == NIL) & ~waits
        free = ~taken[now]
        tint[now] = np.round(np.log2((free & -free).astype(float))).astype(np.int64)
    return tint
