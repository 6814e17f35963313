"""The content of a picture: the static floor, a snapshot of the run, and the user's choices.

A layer shows its numbers in nine levels, on a scale that changes in steps while the numbers grow.
Traffic is uneven: main aisles carry many times the traffic of side aisles. The levels therefore grow
quadratically: level n of a scale that ends at 1000 begins at 1000 ((n - 1) / 8)^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import DETAIL_SHIFT, Looks, looks_of
from automaton.engine.state import GOAL_STOP, NIL
from automaton.floor.floor_plan import DRIVABLE, FLOOR, UNLIMITED, FloorPlan
from automaton.floor.traffic_zones import TrafficZones, traffic_zones_of
from automaton.history.snapshot import shut_cells
from tui.registration import layer_named, layers

if TYPE_CHECKING:
    from automaton.engine.facilities import ServiceZones
    from automaton.history.snapshot import Snapshot
    from automaton.world.resolved import Resolved

# Details that drawings do not distinguish, see automaton.drawings.looks.
DETAIL_PASSING: Final = 5
DETAIL_UNLIMITED: Final = 6  # any number of robots
DETAIL_FULL_SHELF: Final = 1  # detail of a shelf: it holds a load
DETAIL_POD: Final = 1  # detail of a storage cell: a pod stands there
NO_CELLS: Final = np.zeros(0, np.int32)
HEAT_LEVELS: Final = 9  # level 0 means none
SCALE_ENDS: Final = (10, 12, 15, 20, 25, 30, 40, 50, 60, 80)  # times a power of ten


@dataclass(frozen=True, eq=False)
class ShownFloor:
    """The constants of a run; compared by identity, so that pictures can be cached."""

    floor_plan: FloorPlan
    slots_cell: NDArray[np.int32]  # (s,)
    headings: tuple[int, ...] = (4,)  # by type: 1 omni, 2 rail (axes), 4 differential
    traffic_zones: TrafficZones | None = None
    battery: bool = False  # robots run on batteries
    faults: bool = False  # robots may break down
    routing: str = ""  # the strategy; "": unknown
    type_names: tuple[str, ...] = ()  # of robots; (): all are alike
    # Of stations, chargers, doors, lifts and closings, such as "door 1", by cell.
    place_names: dict[int, str] = field(default_factory=dict)
    levels: tuple[tuple[str, int], ...] = ()  # names of levels, and their first cells

    @cached_property
    def looks(self) -> Looks:
        return looks_with_capacity(self.floor_plan)

    @cached_property
    def drivable(self) -> NDArray[np.bool_]:
        """(C,)"""
        return DRIVABLE[self.floor_plan.kind].reshape(-1)

    @cached_property
    def slot_in(self) -> NDArray[np.int32]:
        """(C,) the slot in a cell, or NIL."""
        slots = np.full(self.floor_plan.kind.size, NIL, np.int32)
        slots[self.slots_cell] = np.arange(len(self.slots_cell))
        return slots

    @property
    def loads_may_lie(self) -> bool:
        """Whether robots may have to leave their loads on the floor."""
        return self.battery or self.faults


def floor_of(resolved: Resolved) -> ShownFloor:
    """The floor of a scenario, for pictures."""
    traffic_zones = traffic_zones_of(resolved.floor_plan, resolved.scenario.world.traffic_zones)
    scenario = resolved.scenario
    routing = scenario.strategy.routing
    return ShownFloor(
        resolved.floor_plan,
        resolved.floor_plan.slots,
        tuple(one.headings for one in resolved.fleet.types),
        traffic_zones,
        battery=scenario.battery is not None,
        faults=bool(scenario.faults.listed or scenario.faults.probability),
        routing=routing if isinstance(routing, str) else str(routing.get("name", "")),
        type_names=tuple(kind.name for kind in scenario.fleet.types),
        place_names=resolved.place_names,
        levels=resolved.level_corners,
    )


def looks_with_capacity(floor_plan: FloorPlan) -> Looks:
    """(height + 2, width + 2) kind and detail of each cell; shelves are empty.

    The capacity of a floor cell is a detail only if capacities differ.
    """
    looks = looks_of(floor_plan)
    plain, capacity = looks == FLOOR, floor_plan.capacity
    if len(np.unique(capacity[floor_plan.kind == FLOOR])) > 1:
        looks[plain & (capacity == 2)] |= DETAIL_PASSING << DETAIL_SHIFT
        looks[plain & (capacity == UNLIMITED)] |= DETAIL_UNLIMITED << DETAIL_SHIFT
    return looks


@dataclass(frozen=True, eq=False)
class Scene:
    """One moment of a run, and the user's choices about it."""

    floor: ShownFloor
    snapshot: Snapshot | None = None  # None: only the floor
    selected: int = NIL  # robot
    route: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # its cells, the stand last
    cursor: int | None = None  # cell
    layer: str = ""  # name of a registered layer, or ""
    marked: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # robots
    # Cells marked like a zone.
    marked_cells: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)
    # Cells of robots that are elsewhere in the run beside this one.
    ghosts: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)
    is_compared: bool = False  # with a second recording, shown beside this one
    slow_places: tuple[int, ...] = ()  # cells, numbered from 1
    zone: int = NIL  # its cells are marked
    colouring: str = "state"  # a key of tui.render.drawn_robots.COLOURINGS
    trails: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # (n, k) cells, or NIL
    lines: str = ""  # lines to goals of "selected" or "all" robots; "": none
    least: int = 2  # minimum number of paths in the layer "predicted"

    def with_(self, **changes: Any) -> Scene:
        """A copy with these fields changed."""
        return replace(self, **changes)

    @property
    def map_layer(self) -> Any:
        """The tui.render.layer.Layer that is shown."""
        return layer_named(self.layer)

    @cached_property
    def values(self) -> NDArray[np.int32] | None:
        """(C,) the layer's numbers in the snapshot, for arrows the greatest; None: not there."""
        if self.snapshot is None or not self.map_layer.heat:
            return None
        if not self.map_layer.arrows:
            return self.snapshot.heat
        if self.snapshot.flow is None:
            return None
        east, south, west, north = self.snapshot.flow.T
        strongest = np.maximum(np.maximum(east, south), np.maximum(west, north))
        return np.asarray(strongest, np.int32)

    @property
    def shaded(self) -> bool:
        """Whether the layer colours the floor: by heat or tints, not by arrows."""
        layer = self.map_layer
        return (layer.heat and not layer.arrows) or self.tints is not None

    @cached_property
    def scale(self) -> HeatScale:
        """The scale for the present numbers of the layer."""
        return scale_for(0 if self.values is None else int(self.values.max(initial=0)))

    def levels(self, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Levels 0 to 8 on the scale of the layer."""
        levels: NDArray[np.uint8] = self.map_layer.levels(self, values)
        return levels

    @property
    def goal_cell(self) -> int:
        """The cell of the selected robot's shelf, destination or stop, or NIL."""
        if self.snapshot is None or self.selected == NIL:
            return NIL
        robots, orders = self.snapshot.robots, self.snapshot.orders
        if robots.goal_type[self.selected] == GOAL_STOP:
            return int(robots.goal_cell[self.selected])
        order, slot = int(robots.order[self.selected]), int(robots.slot[self.selected])
        if int(robots.load[self.selected]) == NIL and order != NIL:
            slot = int(orders.current_slot[order])
        return NIL if slot == NIL else int(self.snapshot.slots.cell[slot])

    @cached_property
    def left_loads(self) -> NDArray[np.int32]:
        """(k,) the cells with loads that robots had to leave there."""
        if self.snapshot is None:
            return NO_CELLS
        slots = self.snapshot.slots
        first = len(self.floor.slots_cell)  # spare slots follow those of the floor
        cells: NDArray[np.int32] = slots.cell[first:][slots.content[first:] != NIL]
        return cells

    @cached_property
    def shut_cells(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Closed cells, and the cells of shut doors."""
        return (NO_CELLS, NO_CELLS) if self.snapshot is None else shut_cells(self.snapshot)

    @property
    def service_zones(self) -> ServiceZones | None:
        """The zones that robots serve, if there are any."""
        service_zones = None if self.snapshot is None else self.snapshot.service_zones
        return (
            service_zones if service_zones is not None and len(service_zones.roads.cell) else None
        )

    @cached_property
    def tints(self) -> NDArray[np.int8] | None:
        """(C,) the tint of each cell, an index of tui.render.cell_looks.TINTS, or NIL; None: no tints."""
        tints: NDArray[np.int8] | None = self.map_layer.tints(self)
        return tints

    @property
    def zone_name(self) -> str:
        """The name of the marked zone; service zones are counted from 1, others from 0."""
        return f"zone {self.zone + (self.service_zones is not None)}"

    @cached_property
    def zone_cells(self) -> NDArray[np.int32]:
        """(k,) the marked cells: those of a zone, or of a search."""
        if self.zone == NIL:
            return self.marked_cells
        of_layers = (layer.zone_cells(self, self.zone) for layer in layers().by_name.values())
        return next((cells for cells in of_layers if cells is not None), NO_CELLS)


@dataclass
class Choice:
    """The user's choices."""

    robot: int = NIL
    cell: int = NIL
    zone: int = NIL
    layer: str = ""
    least: int = 2  # minimum number of paths in the layer "predicted"
    side: int = 0  # index of the run that the panels show
    slow_places: tuple[tuple[int, ...], ...] = ()  # of each run: cells, numbered from 1 on its map
    following: bool = False
    route: bool = True
    minimap: bool = True
    matches: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # found robots,
    match_cells: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # or found cells
    colouring: str = "state"  # a key of tui.render.drawn_robots.COLOURINGS
    trails: bool = False
    lines: str = ""  # lines to goals of "selected" or "all" robots; "": none
    card: bool = True  # at the end of a run: its result

    def keep_what_is_there(self, robots: int, is_same_size: bool) -> None:
        """After a reload, keep a cell of a floor of the same size and a robot of the new fleet."""
        self.robot = self.robot if self.robot < robots else NIL
        self.cell = self.cell if is_same_size else NIL
        self.zone, self.slow_places = NIL, ()
        self.matches = self.match_cells = NO_CELLS

    @property
    def laid(self) -> str:
        """The layer's words in the status line."""
        return str(layer_named(self.layer).title(self))


# The scale of a layer's numbers.


class HeatScale(NamedTuple):
    """The numbers at which levels 1 to 8 begin, and the end of the scale."""

    begins: tuple[int, ...]
    end: int

    def words(self, first: int, last: int) -> str:
        """The range of numbers from level `first` to `last`, for a legend."""
        low = self.begins[first - 1]
        high = self.end if last == HEAT_LEVELS - 1 else self.begins[last] - 1
        return f"{low}" if high <= low else f"{low} to {high}"


def scale_for(largest: int) -> HeatScale:
    """The scale that ends at the next of SCALE_ENDS from `largest` on."""
    power = 1
    while SCALE_ENDS[-1] * power < largest and 10 * SCALE_ENDS[0] * power < largest:
        power *= 10
    end = next(
        (end * power for end in SCALE_ENDS if end * power >= largest), 10 * SCALE_ENDS[0] * power
    )
    begins = [
        max(n, _rounded(end * ((n - 1) / (HEAT_LEVELS - 1)) ** 2)) for n in range(1, HEAT_LEVELS)
    ]
    return HeatScale(tuple(begins), end)


def levels_of(values: NDArray[np.int32], scale: HeatScale) -> NDArray[np.uint8]:
    """The level of each value."""
    begins = np.array(scale.begins, values.dtype)
    return (
        np.searchsorted(begins, values.reshape(-1), "right").astype(np.uint8).reshape(values.shape)
    )


def _rounded(number: float) -> int:
    """Round to two digits, which a reader can remember."""
    digits = len(str(int(number)))
    unit: int = 10 ** max(digits - 2, 0)
    return round(number / unit) * unit
