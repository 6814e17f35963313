"""A floor plan made ready for kernels, with its cached distance fields; shared by all its runs."""

from __future__ import annotations

import weakref
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from automaton.engine.facilities import MAY_TURN
from automaton.engine.state import NIL, Array, Grid, Workspace
from automaton.floor.cells import CELL_KINDS
from automaton.floor.floor_plan import CAN_TURN, DRIVABLE, FloorPlan
from automaton.floor.reachability import slot_access
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.scenario.robot_types import RobotType, floor_by_type

HEADING_COUNTS = {"omni": 1, "rail": 2, "differential": 4}
IS_UNBOUNDED = np.array([kind.is_sink or kind.is_source for kind in CELL_KINDS])  # (kinds,) bool
FIELDS_BYTES = 64 * 1024 * 1024  # memory for distance fields; the oldest are overwritten


class Floor(NamedTuple):
    """What runs on the same floor with the same kinematics and durations share."""

    grid: Grid
    slot_cell: Array  # (s,) int32
    slot_endless: Array  # (s,) uint8
    slot_access: Array  # (s, 4) int32
    occupancy: Array  # (C,) uint16: the empty floor
    spaces: list[Workspace]  # those that no simulation uses now
    longest_route: int

    def borrow_space(self, user: object) -> Workspace:
        """A workspace of its own until `user` is gone; distance fields stay for the next one.

        Simulations may run in threads side by side, so no two share one.
        """
        workspace = (
            self.spaces.pop() if self.spaces else make_workspace(self.grid, self.longest_route)
        )
        workspace.stop[0] = 0
        weakref.finalize(user, self.spaces.append, workspace)
        return workspace


@lru_cache(maxsize=16)
def floor_for(
    floor_plan: FloorPlan,
    kinematics: str,
    move: int,
    turn: int,
    mode: str,
    types: tuple[RobotType, ...] = (RobotType(),),
) -> Floor:
    """Build a floor once for each plan, kinematics, cost of driving, mode of zones and types."""
    headings = HEADING_COUNTS[kinematics]
    kind = floor_plan.kind.reshape(-1)
    cells = floor_plan.slots
    slot = np.full(kind.size, NIL, np.int32)
    slot[cells] = np.arange(len(cells), dtype=np.int32)
    rule, by_type = cell_flags_of(floor_plan, kinematics), floor_by_type(floor_plan, types)
    traffic_zones = traffic_zones_of(floor_plan, mode)
    grid = Grid(
        width=floor_plan.stride,
        headings=headings,
        kind=frozen(kind.copy()),
        cell_flags=frozen(rule),
        type_cell_flags=frozen(
            np.stack([cell_flags_of(of_type, kinematics) for of_type in by_type.floor_plans])
        ),
        offset=frozen(np.array(floor_plan.offsets, np.int64)),
        slot=frozen(slot),
        traffic_zone=traffic_zones.of,
        traffic_zone_count=traffic_zones.count,
    )
    room = np.where(DRIVABLE[kind], 96, 0).astype(np.uint16)
    drivable = int(np.count_nonzero(DRIVABLE[kind]))
    longest_route = min(drivable, 8 * (floor_plan.width + floor_plan.height)) + 8
    return Floor(
        grid=grid,
        slot_cell=frozen(cells.astype(np.int32)),
        slot_endless=frozen(IS_UNBOUNDED[kind[cells]].astype(np.uint8)),
        slot_access=slot_access(floor_plan),
        occupancy=frozen(room | (rule.astype(np.uint16) << np.uint16(8))),
        spaces=[],
        longest_route=longest_route,
    )


def cell_flags_of(floor_plan: FloorPlan, kinematics: str) -> Array:
    """(C,) uint8: exits, where robots of these kinematics may turn, and the class of capacity."""
    kind = floor_plan.kind.reshape(-1)
    turns = CAN_TURN[kind] if kinematics == "rail" else DRIVABLE[kind]
    turning = np.where(turns, MAY_TURN, 0).astype(np.uint8)
    capacity = np.where(DRIVABLE[kind], floor_plan.capacity.reshape(-1), 1).astype(np.uint8)
    rule: Array = floor_plan.exits.reshape(-1) | turning | (capacity << np.uint8(5))
    return rule


def make_workspace(grid: Grid, longest_route: int) -> Workspace:
    """Scratch for the searches, and room for as many distance fields as fit the budget."""
    cells = grid.kind.size
    poses = cells * grid.headings
    types = len(grid.type_cell_flags)
    fields = max(1, min(types * cells, FIELDS_BYTES // (4 * poses)))
    sizes = {"P": poses, "C": cells, "H": 6 * poses + 16, "R": longest_route}
    return Workspace.sized(
        sizes | {"K C": types * cells, "F": fields},
        distances=np.empty((fields, poses), np.int32),
    )


def frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array
