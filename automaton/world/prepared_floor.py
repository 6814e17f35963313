"""A floor plan prepared for kernels, with its distance tables; shared by all its runs."""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from automaton.engine.distance_tables import WEIGHT_UNIT
from automaton.engine.state import MAY_TURN, NIL, NO_WAY_THROUGH, Array, Grid, Workspace
from automaton.engine.table_building import (
    Costs,
    build_tables,
    bytes_taken,
    empty_tables,
    renew,
)
from automaton.errors import InputError
from automaton.floor.floor_plan import DRIVABLE, STORAGE, UNBOUNDED, FloorPlan, may_turn
from automaton.floor.reachability import has_storage, slot_access
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.scenario.robot_types import RobotType, floor_by_type, rows_of
from automaton.units import memory

KEPT_BYTES = 64 * 1024 * 1024  # of distance tables that are kept for the next run


class PreparedFloor(NamedTuple):
    """The shared data of runs on the same floor with robots that drive alike."""

    grid: Grid
    slot_cell: Array  # (s,) int32
    slot_endless: Array  # (s,) uint8
    slot_access: Array  # (s, 4) int32
    occupancy: Array  # (C,) uint16: the empty floor
    move: Array  # (K,) ticks of a move, by type of robot; with a load: rules.loaded_types more
    turn: Array  # (K,) ticks of a turn
    spaces: dict[int, list[Workspace]]  # unused workspaces, by table_bytes
    longest_route: int

    def borrow_space(self, user: object, table_bytes: int) -> Workspace:
        """An exclusive workspace until `user` is deleted; its distance tables are kept for the next
        user.

        `table_bytes`: memory for them. Simulations may run in threads side by side, so no two share one.
        """
        unused = self.spaces.setdefault(table_bytes, [])
        workspace = unused.pop() if unused else make_workspace(self, table_bytes)
        workspace.stop[0] = 0
        renew(workspace.tables)
        renew(workspace.streets)
        weakref.finalize(user, give_back, unused, workspace)
        return workspace


def give_back(unused: list[Workspace], workspace: Workspace) -> None:
    """Keep a workspace for the next run on this floor, unless its tables take much memory."""
    if bytes_taken(workspace.tables) + bytes_taken(workspace.streets) <= KEPT_BYTES:
        unused.append(workspace)


def floor_for(
    floor_plan: FloorPlan,
    mode: str,
    types: tuple[RobotType, ...] = (RobotType(),),
) -> PreparedFloor:
    """The floor for a plan, mode of zones and types; built once for all that drive alike.

    Other weights of streets need other distance tables, but not another floor.
    """
    driving = tuple(one.driving for one in types)
    if not len(floor_plan.move_weights):
        return _floor_for(floor_plan, mode, driving)
    return _weighted_floor(floor_plan, mode, driving)


@lru_cache(maxsize=4)
def _weighted_floor(
    floor_plan: FloorPlan, mode: str, types: tuple[RobotType, ...]
) -> PreparedFloor:
    """The floor with the weights of streets, and with workspaces of its own."""
    floor = _floor_for(floor_plan.without_weights(), mode, types)
    grid = floor.grid.replaced(
        move_weight=floor_plan.move_weights.reshape(-1),
        least_weight=int(floor_plan.move_weights.min()),
        wait_weight=floor_plan.wait_weights,
    )
    return floor._replace(grid=grid, spaces={})


@lru_cache(maxsize=16)
def _floor_for(
    floor_plan: FloorPlan,
    mode: str,
    types: tuple[RobotType, ...],
) -> PreparedFloor:
    rows = rows_of(types, loads_differ(floor_plan, types))
    kind = floor_plan.kind.reshape(-1)
    cells = floor_plan.slots
    slot = np.full(kind.size, NIL, np.int32)
    slot[cells] = np.arange(len(cells), dtype=np.int32)
    rule, by_type = cell_flags_of(floor_plan, are_on_rails(types)), floor_by_type(floor_plan, rows)
    ticks = [
        (one.moves.loaded, one.turns.loaded)
        if row >= len(types)
        else (one.moves.empty, one.turns.empty)
        for row, one in enumerate(rows)
    ]
    move, turn = np.array(ticks, np.int64).T
    traffic_zones = traffic_zones_of(floor_plan, mode)
    grid = Grid(
        width=floor_plan.stride,
        headings=max(one.headings for one in types),
        kind=frozen(kind.copy()),
        cell_flags=frozen(rule),
        type_cell_flags=frozen(flags_by_type(by_type.floor_plans, rows)),
        drivable=frozen(np.flatnonzero(DRIVABLE[kind]).astype(np.int32)),
        offset=frozen(np.array(floor_plan.offsets, np.int64)),
        slot=frozen(slot),
        traffic_zone=traffic_zones.of,
        traffic_zone_count=traffic_zones.count,
        move_weight=frozen(np.zeros(0, np.int32)),
        least_weight=WEIGHT_UNIT,
        wait_weight=frozen(np.zeros(0, np.int32)),
        min_move_ticks=frozen(floor_plan.min_move_ticks.reshape(-1).copy()),
        type_headings=frozen(np.array([one.headings for one in rows], np.int64)),
    )
    room = np.where(DRIVABLE[kind], 96, 0).astype(np.uint16)
    longest_route = min(len(grid.drivable), 8 * (floor_plan.width + floor_plan.height)) + 8
    return PreparedFloor(
        grid=grid,
        slot_cell=frozen(cells.astype(np.int32)),
        slot_endless=frozen(UNBOUNDED[kind[cells]].astype(np.uint8)),
        slot_access=slot_access(floor_plan),
        occupancy=frozen(room | (rule.astype(np.uint16) << np.uint16(8))),
        move=frozen(move.copy()),
        turn=frozen(turn.copy()),
        spaces={},
        longest_route=longest_route,
    )


def loads_differ(floor_plan: FloorPlan, types: Iterable[RobotType]) -> bool:
    """Whether robots drive differently with a load: not through storage, for example."""
    return has_storage(floor_plan) or any(one.loads_differ for one in types)


def are_on_rails(types: Iterable[RobotType]) -> bool:
    """Whether robots of all types turn only on turntables."""
    return all(one.rail for one in types)


def flags_by_type(floor_plans: Sequence[FloorPlan], rows: Sequence[RobotType]) -> Array:
    """(K, C) uint8: the flags of cells for robots of each type, then for each type with a load.

    No way leads through storage: robots with a load cannot pass under pods, and robots without one would
    meet others that come out with pods.
    """
    pairs = zip(floor_plans, rows, strict=True)
    by_type: Array = np.stack([cell_flags_of(plan, row.rail) for plan, row in pairs])
    storage = floor_plans[0].kind.reshape(-1) == STORAGE
    by_type[:, storage] |= np.uint8(NO_WAY_THROUGH)
    return by_type


def cell_flags_of(floor_plan: FloorPlan, rail: bool) -> Array:
    """(C,) uint8: exits, whether robots may turn (on rails or not), and the class of capacity."""
    kind = floor_plan.kind.reshape(-1)
    turning = np.where(may_turn(kind, rail), MAY_TURN, 0).astype(np.uint8)
    capacity = np.where(DRIVABLE[kind], floor_plan.capacity.reshape(-1), 1).astype(np.uint8)
    rule: Array = floor_plan.exits.reshape(-1) | turning | (capacity << np.uint8(5))
    return rule


def make_workspace(floor: PreparedFloor, table_bytes: int) -> Workspace:
    """Scratch for the searches, and distance tables for each type of robots. Raises InputError."""
    grid = floor.grid
    cells = grid.kind.size
    poses = cells * grid.headings
    stop = np.zeros(1, np.int64)
    costs = Costs(
        grid.type_cell_flags, step_ticks(grid, floor.move), floor.turn, grid.type_headings
    )
    try:
        tables = build_tables(grid, costs, table_bytes, stop)
        streets = empty_tables()
        if len(grid.move_weight):
            streets = build_tables(grid, weighted(grid, costs), table_bytes, stop)
    except ValueError as error:
        raise InputError(f"streets has weights that are too large: {error}") from None
    except MemoryError:
        raise InputError(
            f"world.distance_tables is {memory(table_bytes)}, more than this machine can give; "
            "set it lower"
        ) from None
    sizes = {"P": poses, "C": cells, "H": 6 * poses + 16, "R": floor.longest_route}
    return Workspace.sized(sizes, stop=stop, tables=tables, streets=streets)


def weighted(grid: Grid, costs: Costs) -> Costs:
    """Ticks as costs with the weights of streets, in 1/100 tick."""
    ticks = costs.step if costs.step.ndim > 1 else costs.step[:, None, None]
    weights = grid.move_weight.reshape(1, -1, 4).astype(np.int64)
    return costs._replace(
        step=ticks * weights,
        turn=WEIGHT_UNIT * costs.turn,
        step_ticks=np.broadcast_to(ticks, (len(costs.flags), *weights.shape[1:])),
        turn_ticks=costs.turn,
    )


def step_ticks(grid: Grid, move: Array) -> Array:
    """(K,) ticks of a move of each type; (K, C, 4) where the floor has speed limits."""
    if not len(grid.min_move_ticks):
        return move
    limits = grid.min_move_ticks.reshape(1, -1, 4)
    ticks: Array = np.maximum(limits, move[:, None, None])
    return ticks


def frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array
