"""The layers of zones: service zones, which robots serve, and traffic zones of the floor.

Service zones: their ways as tints, or as letters without colours.

    fffT+++ddt     T a transfer station, t another station; ways without a zone stay plain
    f       d

Zones that a way connects have different tints. Up to six zones have one tint each, by number. With
more zones, each keeps the tint of its number where possible. Zones are coloured in smallest-last
order (Matula & Beck), so that six tints suffice on floors without bridges.

Traffic zones: stretches between intersections, each in one of six tints.

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

from automaton.engine.facilities import ServiceZones
from automaton.engine.state import NIL
from automaton.floor.floor_plan import FLOOR, FloorPlan
from automaton.floor.traffic_zones import TrafficZones
from automaton.strategy.lookup import NO_STRATEGY
from strategies.zoning.service_zone_lines import stations_of, ways_of
from tui.render import styles
from tui.render.cell_looks import (
    TINT_CODES,
    TINT_COLOURS,
    TINT_LETTERS,
    TINTS,
    TRANSFER_COLOUR,
    Canvas,
    Pixels,
)
from tui.render.layer import Layer, ScaleLine
from tui.render.scene import Scene, ShownFloor
from tui.render.styles import Entries, GlyphSet, code, style

if TYPE_CHECKING:
    from automaton.world.resolved import Resolved


NO_ZONES_TEXT: Final = "zones: robots serve none here, or none yet"
SHARED_TINTS_TEXT: Final = "zones may share a tint; touching ones differ"
STATION_DIGITS: Final = 2  # of a station's number, beside its sign


class ServiceZoneLayer(Layer):
    """The zones that robots serve, if any."""

    key, label, position, action = "f7", "Zones", 50, "layer_zones"
    meaning = "zones of robots; again: of the floor"
    words = "service zones"
    absent = "robots serve no zones here, or none yet"
    heat, whole_floor = False, True

    def is_there(self, scene: Scene) -> bool:
        return scene.service_zones is not None

    def tints(self, scene: Scene) -> NDArray[np.int8] | None:
        if scene.service_zones is None:
            return None
        return design_tints(scene.floor.floor_plan, scene.floor.slots_cell, scene.service_zones)

    def draw_signs(self, canvas: Canvas, tints: NDArray[np.int8], looks: NDArray[np.uint8]) -> None:
        if canvas.scene.service_zones is not None:
            draw_stations(canvas, canvas.scene.service_zones)

    def paint_pixels(self, pixels: Pixels, scene: Scene) -> bool:
        if scene.service_zones is None:
            return False
        cells, _, shared = stations_of(scene.service_zones.roads, scene.service_zones.design)
        pixels.paint(cells[~shared].astype(np.int32), styles.COLOUR_DIM)
        pixels.paint(cells[shared].astype(np.int32), TRANSFER_COLOUR)
        return True

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        service_zones = scene.service_zones
        if service_zones is None:
            return [((), NO_ZONES_TEXT)]
        entries: Entries = []
        if tints_shared(len(service_zones.server)):
            entries.append(((), SHARED_TINTS_TEXT))
        for zone, tint in enumerate(service_zone_tints(service_zones).tolist()):
            sign = int(code(style(TINTS[tint], TINTS[tint]), TINT_CODES[tint]))
            entries.append(((sign,), f"zone {zone + 1}: {_served(service_zones, zone)}"))
        shared = int(code(style(TRANSFER_COLOUR, styles.COLOUR_FLOOR), glyphs.transfer))
        entries.append(((shared,), "transfer station: parts change robots"))
        return entries

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        if scene.service_zones is None:
            return [NO_ZONES_TEXT]
        tints = np.array(TINTS)[np.unique(service_zone_tints(scene.service_zones))]
        codes = code(style(tints, tints), np.array(TINT_CODES)[: len(tints)])
        zones = len(scene.service_zones.server)
        shared = "; touching ones differ" if tints_shared(zones) else ""
        return ["zone 1", tuple(codes.tolist()), f"{zones}{shared}"]

    def key_words(self, scene: Scene, resolved: Resolved, glyphs: GlyphSet) -> list[str]:
        zones = 0 if scene.service_zones is None else len(scene.service_zones.server)
        if scene.snapshot is None and resolved.strategies["zoning"].name != NO_STRATEGY:
            zones = resolved.scenario.fleet.robots
        return design_key(zones, glyphs)

    def cell_words(self, scene: Scene, cell: int) -> list[str]:
        """Number and zone of the station in a cell, or the zone of a way."""
        service_zones = scene.service_zones
        if service_zones is None:
            return []
        station = station_in(scene, service_zones, cell)
        if station == NIL:
            cells, zones = ways_of(
                service_zones.roads, service_zones.design, scene.floor.floor_plan.stride
            )
            return [f"zone {zone + 1}" for zone in np.unique(zones[cells == cell]).tolist()]
        zone = int(service_zones.design.zone[station])
        words = [f"station {station + 1}", *([f"zone {zone + 1}"] if zone != NIL else [])]
        pairs = np.argwhere(np.triu(service_zones.design.transfer[:, :, station], 1)).tolist()
        return words + [f"transfers between zones {a + 1} and {b + 1}" for a, b in pairs]

    def zone_cells(self, scene: Scene, zone: int) -> NDArray[np.int32] | None:
        service_zones = scene.service_zones
        if service_zones is None:
            return None
        ways, ways_zone = ways_of(
            service_zones.roads, service_zones.design, scene.floor.floor_plan.stride
        )
        cells, cells_zone, _ = stations_of(service_zones.roads, service_zones.design)
        found = np.concatenate((ways[ways_zone == zone], cells[cells_zone == zone]))
        return np.unique(found).astype(np.int32)


def draw_stations(canvas: Canvas, service_zones: ServiceZones) -> None:
    """Draw stations that robots serve, with their numbers where these fit."""
    cells, zones, shared = stations_of(service_zones.roads, service_zones.design)
    served = np.flatnonzero(zones != NIL)
    index, seen = canvas.at(cells[served].astype(np.int32))
    which = served[seen]
    bg = np.array(TINTS)[service_zone_tints(service_zones)[zones[which]]]
    fg = np.where(shared[which], TRANSFER_COLOUR, styles.COLOUR_STATION)
    sign = np.where(shared[which], canvas.glyphs.transfer, canvas.glyphs.station)
    row, column = divmod(canvas.sign, canvas.width)
    numbered = canvas.width > STATION_DIGITS
    # The sign moves to the left if its number needs the room.
    first = row * canvas.width + (
        min(column, canvas.width - 1 - STATION_DIGITS) if numbered else column
    )
    canvas.flat[index, first] = code(style(fg, bg), sign)
    if numbered:
        numbers = np.char.ljust((which + 1).astype(str), STATION_DIGITS)
        for place in range(STATION_DIGITS):
            digit = np.array([ord(number[place]) for number in numbers], np.uint32)
            digit[digit == ord(" ")] = canvas.glyphs.blank
            canvas.flat[index, first + 1 + place] = code(style(fg, bg), digit)


def _served(service_zones: ServiceZones, zone: int) -> str:
    who = "no robot" if service_zones.server[zone] == NIL else f"robot {service_zones.server[zone]}"
    many = int(np.count_nonzero(service_zones.design.zone == zone))
    return f"{who}, {many} station{'s' * (many != 1)}"


def design_key(zones: int, glyphs: GlyphSet) -> list[str]:
    """Short explanations of the zones for a picture without a legend."""
    if not zones:
        return [NO_ZONES_TEXT]
    letters = [f"{chr(TINT_CODES[zone])} zone {zone + 1}" for zone in range(min(zones, len(TINTS)))]
    if tints_shared(zones):
        letters = [
            f"{chr(TINT_CODES[0])} to {chr(TINT_CODES[len(TINTS) - 1])} zones; {SHARED_TINTS_TEXT}"
        ]
    return [*letters, f"{glyphs.characters[glyphs.transfer]} transfer station"]


def station_in(scene: Scene, service_zones: ServiceZones, cell: int) -> int:
    """The station in a cell, or the one to which its slot belongs, or NIL."""
    points = np.flatnonzero(service_zones.roads.cell[service_zones.roads.point] == cell)
    if len(points):
        return int(points[0])
    slot = int(scene.floor.slot_in[cell])
    return NIL if slot == NIL else int(service_zones.station_of[slot])


# The zone of each cell, and the tint of each zone.


def design_tints(
    floor_plan: FloorPlan, slots_cell: NDArray[np.int32], service_zones: ServiceZones
) -> NDArray[np.int8]:
    """(C,) the tint of each cell: of ways, of stations, and of slots that belong to one."""
    tints = np.full(floor_plan.kind.size, NIL, np.int8)
    tint = service_zone_tints(service_zones)
    cells, zones = ways_of(service_zones.roads, service_zones.design, floor_plan.stride)
    tints[cells] = tint[zones]
    for cells, zones in (
        _slots(slots_cell, service_zones),
        stations_of(service_zones.roads, service_zones.design)[:2],
    ):
        tints[cells[zones != NIL]] = tint[zones[zones != NIL]]
    return tints


def _slots(
    cells: NDArray[np.int32], service_zones: ServiceZones
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Cells of slots that belong to a station, and the zones of these stations."""
    station = service_zones.station_of[: len(cells)]
    there = station != NIL
    return cells[there], service_zones.design.zone[station[there]]


def service_zone_tints(service_zones: ServiceZones) -> NDArray[np.int8]:
    """(Z,) the tint of each zone, an index of TINTS."""
    zones = len(service_zones.server)
    if not tints_shared(zones):
        return np.arange(zones, dtype=np.int8)
    ways = np.ascontiguousarray(service_zones.roads.next, np.int32).tobytes()
    held = np.ascontiguousarray(service_zones.design.held, np.int32).tobytes()
    return _tints_of(ways, held, zones)


def tints_shared(zones: int) -> bool:
    """Whether zones share tints."""
    return zones > len(TINTS)


@lru_cache(maxsize=8)  # a design lasts for many frames
def _tints_of(ways: bytes, held: bytes, zones: int) -> NDArray[np.int8]:
    ahead = np.frombuffer(ways, np.int32).reshape(-1, 4)
    near = neighbours(ahead, np.frombuffer(held, np.int32), zones)
    tint = np.full(zones, NIL, np.int8)
    for zone in reversed(sparest_first(near)):
        taken = {int(tint[other]) for other in near[zone]}
        own = zone % len(TINTS)
        wanted = [own, *range(len(TINTS))]
        tint[zone] = next((one for one in wanted if one not in taken), own)
    tint.setflags(write=False)
    return tint


def neighbours(ahead: NDArray[np.int32], held: NDArray[np.int32], zones: int) -> list[set[int]]:
    """By zone, the zones that a way reaches from it without passing through a third zone.

    ahead: (P, 4) the next points; held: (P,) the zone of each point, or NIL. A point without a zone
    counts as part of the nearest zone.
    """
    nearest = held.copy()
    while True:
        grown = nearest.copy()
        for there in ahead.T:
            free = (nearest == NIL) & (there != NIL)
            grown[free] = np.where(grown[free] == NIL, nearest[there[free]], grown[free])
        if np.array_equal(grown, nearest):
            break
        nearest = grown
    near: list[set[int]] = [set() for _ in range(zones)]
    for there in ahead.T:
        a, b = nearest[there != NIL], nearest[there[there != NIL]]
        apart = (a != NIL) & (b != NIL) & (a != b)
        for one, other in np.unique(np.column_stack((a[apart], b[apart])), axis=0).tolist():
            near[one].add(other)
            near[other].add(one)
    return near


def sparest_first(near: list[set[int]]) -> list[int]:
    """All zones, each with the fewest neighbours among the rest (ties: the last zone)."""
    left, order = set(range(len(near))), []
    while left:
        zone = min(left, key=lambda one: (len(near[one] & left), -one))
        left.remove(zone)
        order.append(zone)
    return order


# Traffic zones.


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
