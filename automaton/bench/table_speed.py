"""The cost of distance tables: computation, look-ups and other weights of streets, on floors of
shelves like large warehouses.

........................      Rows of shelves, ten by one, with aisles one cell wide
.##########.##########.       between them and around them.
........................
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from automaton.bench.measured_kernels import compute, rank_options
from automaton.bench.measurement import MS, Measurement, Sample, cpu_seconds
from automaton.engine.distance_tables import DistanceTables
from automaton.engine.state import Array, Grid
from automaton.engine.table_building import Costs, build_tables
from automaton.floor.floor_plan import (
    ALL_EXITS,
    FLOOR,
    WEIGHT_UNIT,
    FloorPlan,
    bordered,
    make_floor_plan,
)
from automaton.scenario.robot_types import RobotType
from automaton.world.prepared_floor import cell_flags_of, floor_for, make_workspace

NS_PER_CELL = "ns per drivable cell"
NS_PER_ROBOT = "ns per robot"
NS_PER_POSE = "ns per pose"
FLOOR_SIZES = {(161, 63): 40, (500, 140): 10}  # columns, rows: number of tables in a sample
SHELF, MARGIN = 10, 5  # cells in a row without a gap; free columns on both sides
ASKING_ROBOTS = 1000
STREET_FLOOR = (46, 33)  # columns, rows: 990 drivable cells
STREET_TABLES = 100
ROUNDS = 100
TABLE_BYTES = 256 * 2**20


def measurements() -> list[Measurement]:
    """A table for each set of costs and floor; look-ups of five options in many tables."""
    parts = []
    for size, tables in FLOOR_SIZES.items():
        floor = "x".join(map(str, size))
        for name, turn, weighted in (
            ("moves and turns of 1 tick", 1, False),
            ("turns of 2 ticks", 2, False),
            ("lattice weights", 2, True),
        ):
            prepare = partial(prepare_tables, size, turn, weighted, tables)
            parts.append(Measurement(f"table on {floor}, {name}", NS_PER_CELL, prepare))
    columns, rows = STREET_FLOOR
    for robot_type in (RobotType(kinematics="omni"), RobotType()):
        name = f"table on {columns}x{rows}, weights of streets, {robot_type.kinematics}"
        parts.append(Measurement(name, NS_PER_POSE, partial(prepare_streets, robot_type)))
    name = f"other weights of streets on {columns}x{rows}, tables excluded"
    parts.append(Measurement(name, MS, prepare_other_weights))
    columns, rows = next(iter(FLOOR_SIZES))
    name = f"five options of {ASKING_ROBOTS:,} robots on {columns}x{rows}, a goal each"
    return [*parts, Measurement(name, NS_PER_ROBOT, prepare_options)]


@cache
def shelves(columns: int, rows: int) -> FloorPlan:
    """The floor of shelves drawn above, without slots, since no loads are handled."""
    kind, leave = bordered(rows, columns), bordered(rows, columns)
    y, x = np.mgrid[:rows, :columns]
    inside = (x >= MARGIN) & (x < columns - MARGIN) & (y % 2 == 1) & (y < rows - 1)
    free = ~(inside & ((x - MARGIN) % (SHELF + 1) < SHELF))
    kind[1:-1, 1:-1][free] = FLOOR
    leave[1:-1, 1:-1][free] = ALL_EXITS
    return make_floor_plan(kind, leave)


def tables_for(size: tuple[int, int], turn: int, weighted: bool = False) -> DistanceTables:
    """Empty tables for robots with four headings."""
    floor_plan = shelves(*size)
    grid = floor_for(floor_plan, "undirected").grid
    step = lattice(grid)[None] if weighted else np.ones(1, np.int64)
    costs = Costs(cell_flags_of(floor_plan, rail=False)[None], step, np.array([turn]))
    return build_tables(grid, costs, TABLE_BYTES, np.zeros(1, np.int64))


def lattice(grid: Grid) -> Array:
    """(C, 4) 6 for a step against the direction of its row or column, these alternate; else 2."""
    y, x = np.divmod(np.arange(len(grid.kind)), grid.width)
    against = np.stack([y % 2 == 0, x % 2 == 1, y % 2 == 1, x % 2 == 0], axis=1)
    return np.where(against, 6, 2)


def prepare_tables(size: tuple[int, int], turn: int, weighted: bool, many: int) -> Sample:
    """A sampler: ns to compute a table, per drivable cell."""
    tables = tables_for(size, turn, weighted)
    goals = np.random.default_rng(1).choice(tables.drivable, many, replace=False).astype(np.int64)
    seconds = partial(cpu_seconds, partial(compute, tables, goals))
    return lambda: 1e9 * seconds() / (many * len(tables.drivable))


def weighted(random: np.random.Generator) -> FloorPlan:
    """The floor of streets with weights like those of a search, nearly all of them different."""
    floor_plan = shelves(*STREET_FLOOR)
    cells = floor_plan.kind.size
    weights = np.floor(WEIGHT_UNIT * np.exp(random.normal(0, 0.5, (cells, 4))) + 0.5)
    return floor_plan.with_weights(weights, np.full(cells, WEIGHT_UNIT))


def prepare_streets(robot_type: RobotType, many: int = STREET_TABLES) -> Sample:
    """A sampler: ns to compute a table of weighted ways and their ticks, per pose."""
    random = np.random.default_rng(1)
    floor = floor_for(weighted(random), "undirected", (robot_type,))
    tables = make_workspace(floor, TABLE_BYTES).streets
    goals = random.choice(tables.drivable, many, replace=False).astype(np.int64)
    poses = many * len(tables.drivable) * floor.grid.headings
    return lambda: 1e9 * cpu_seconds(partial(compute, tables, goals)) / poses


def prepare_other_weights() -> Sample:
    """A sampler: ms until a floor is prepared for runs with other weights."""
    random = np.random.default_rng(1)

    def sample() -> float:
        floor_plan = weighted(random)
        return 1e3 * cpu_seconds(lambda: floor_for(floor_plan, "undirected"))

    return sample


def prepare_options(robots: int = ASKING_ROBOTS) -> Sample:
    """A sampler: ns to look up the costs of five options of a robot, including its table."""
    tables, random = tables_for(next(iter(FLOOR_SIZES)), 1), np.random.default_rng(1)
    goals, cells = (random.choice(tables.drivable, robots).astype(np.int64) for _ in range(2))
    headings = random.integers(0, 4, robots)
    seconds = partial(cpu_seconds, partial(rank_options, tables, goals, cells, headings, ROUNDS))
    return lambda: 1e9 * seconds() / (ROUNDS * robots)
