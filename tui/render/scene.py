"""What a picture is made of: the static floor, a snapshot of the run, and what is laid over it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import DETAIL_SHIFT, Looks, looks_of
from automaton.engine.state import GOAL_STOP, NIL
from automaton.floor.cells import FLOOR, UNLIMITED
from automaton.floor.floor_plan import DRIVABLE, FloorPlan
from automaton.floor.traffic_zones import TrafficZones
from automaton.history.explanation import shut_cells
from tui.registration import layer_named, layers
from tui.render.field import Scale, scale_for

if TYPE_CHECKING:  # it needs Numba, pictures do not
    from automaton.engine.facilities import ServiceZones
    from automaton.history.snapshot import Snapshot

# Details of cells that drawings do not tell apart, see automaton.drawings.cell_looks.
DETAIL_PASSING: Final = 5
DETAIL_UNLIMITED: Final = 6  # any number of robots
DETAIL_FULL_SHELF: Final = 1  # detail of a shelf: it holds a load
DETAIL_POD: Final = 1  # detail of a storage cell: a pod stands there
NO_CELLS: Final = np.zeros(0, np.int32)


def looks_with_capacity(floor_plan: FloorPlan) -> Looks:
    """(height + 2, width + 2) kind and detail of each cell; shelves are empty.

    How many robots a cell of floor holds is a detail only where cells differ in it.
    """
    looks = looks_of(floor_plan)
    plain, capacity = looks == FLOOR, floor_plan.capacity
    if len(np.unique(capacity[floor_plan.kind == FLOOR])) > 1:
        looks[plain & (capacity == 2)] |= DETAIL_PASSING << DETAIL_SHIFT
        looks[plain & (capacity == UNLIMITED)] |= DETAIL_UNLIMITED << DETAIL_SHIFT
    return looks


@dataclass(frozen=True, eq=False)
class Floor:
    """What does not change during a run; compared by identity, so that pictures can be kept."""

    floor_plan: FloorPlan
    slots_cell: NDArray[np.int32]  # (s,)
    headings: tuple[int, ...] = (4,)  # of each type: 1 omni, 2 rail (axes), 4 differential
    traffic_zones: TrafficZones | None = None
    battery: bool = False  # robots run on batteries
    faults: bool = False  # robots may go down
    routing: str = ""  # the strategy; "" is unknown
    type_names: tuple[str, ...] = ()  # of robots; () where all are alike

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


@dataclass(frozen=True, eq=False)
class Scene:
    """One moment of a run, and what the user wants to see of it."""

    floor: Floor
    snapshot: Snapshot | None = None  # None: the floor alone
    selected: int = NIL  # robot
    route: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # its cells, stand last
    cursor: int | None = None  # cell
    layer: str = ""  # the name of one that is registered, or none
    marked: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # robots
    # Cells, marked like a zone.
    marked_cells: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)
    zone: int = NIL  # whose cells are marked
    colouring: str = "state"  # of robots, of tui.render.colouring.COLOURINGS
    trails: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # (n, k) cells, or NIL
    lines: str = ""  # whose goals lines lead to, of tui.render.trails.LINES
    least: int = 2  # paths that lead through a cell of the overlay "predicted"

    def with_(self, **changes: Any) -> Scene:
        """The same scene but for these fields."""
        return replace(self, **changes)

    @property
    def map_layer(self) -> Any:
        """The tui.render.layer.Layer that is shown."""
        return layer_named(self.layer)

    @cached_property
    def values(self) -> NDArray[np.int32] | None:
        """(C,) what the layer counts, as far as the snapshot brings it; of arrows the strongest."""
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
    def scale(self) -> Scale:
        """From which number on each level of the layer begins."""
        return scale_for(0 if self.values is None else int(self.values.max(initial=0)))

    def levels(self, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        """0 to 8 on the scale of the layer."""
        levels: NDArray[np.uint8] = self.map_layer.levels(self, values)
        return levels

    @property
    def goal_cell(self) -> int:
        """The shelf, destination or stop that the selected robot works for, or NIL."""
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
        """(k,) the cells in which loads lie that robots had to leave."""
        if self.snapshot is None:
            return NO_CELLS
        slots = self.snapshot.slots
        first = len(self.floor.slots_cell)  # the spare slots come behind those of the floor
        cells: NDArray[np.int32] = slots.cell[first:][slots.content[first:] != NIL]
        return cells

    @cached_property
    def shut_cells(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Cells that are closed now, and those of doors that are shut."""
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
        """(C,) the tint of each cell, an index of tui.render.tints.TINTS, or NIL; None: no tints."""
        tints: NDArray[np.int8] | None = self.map_layer.tints(self)
        return tints

    @property
    def zone_name(self) -> str:
        """What the zone that is marked is called: those that robots serve are counted from 1."""
        return f"zone {self.zone + (self.service_zones is not None)}"

    @cached_property
    def zone_cells(self) -> NDArray[np.int32]:
        """(k,) the cells that are marked: of a zone, which robots may serve, or of a search."""
        if self.zone == NIL:
            return self.marked_cells
        of_layers = (layer.zone_cells(self, self.zone) for layer in layers().by_name.values())
        return next((cells for cells in of_layers if cells is not None), NO_CELLS)
