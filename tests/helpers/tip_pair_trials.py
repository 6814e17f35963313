"""Annealing on random floors, by the last tip in reach and by all of them; run by hand.

From the root of the repository, `PYTHONPATH=. python tests/helpers/tip_pair_trials.py` prints on how
many floors which of the two leaves the smaller balance.
"""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
from zoning_scenes import FEET_PER_MINUTE, scratch
from zoning_trials import ANNEALED

from automaton.engine.facilities import Roads
from automaton.floor.drawn_floors import draw_floor
from automaton.world.building import roads_of
from strategies.zoning import annealing
from strategies.zoning.design_files import design_arrays
from strategies.zoning.designs import first_design, random_design
from strategies.zoning.zone_workspace import typical_distance, zone_rules

WIDTH, HEIGHT, STATIONS, ZONES, SEEDS = 13, 9, 16, 3, 12
ROUTES, LENGTH, QUANTITIES = 5, 5, (10, 15, 20, 25, 30)
FLOORS = range(100, 200)
HOLES, STREETS = "holes", "streets"
ALIKE = 0.01  # balances that differ by less


def random_cells(random: Random, kind: str) -> list[list[str]]:
    """Cells with holes, or streets of a grid some of which are closed."""
    rows = [["."] * WIDTH for _ in range(HEIGHT)]
    if kind == STREETS:
        for y in range(1, HEIGHT, 2):
            rows[y][1::2] = "#" * len(rows[y][1::2])
    for y in range(HEIGHT):
        for x in range(WIDTH):
            if kind == HOLES and random.random() < 0.3:
                rows[y][x] = "#"
            if kind == STREETS and (x + y) % 2 and random.random() < 0.35:
                rows[y][x] = "#"
    return rows


def joined_cells(rows: list[list[str]]) -> set[tuple[int, int]]:
    """The free cells that the first one is joined with."""
    free = [(x, y) for y in range(HEIGHT) for x in range(WIDTH) if rows[y][x] == "."]
    found, ahead = {free[0]}, [free[0]]
    while ahead:
        x, y = ahead.pop()
        for cell in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if cell in free and cell not in found:
                found.add(cell)
                ahead.append(cell)
    return found


def random_floor(seed: int, kind: str) -> tuple[Roads, Any]:
    """The roads between random stations, and the flow of random routes."""
    random = Random(seed)
    cells: set[tuple[int, int]] = set()
    while len(cells) < 0.5 * WIDTH * HEIGHT:
        rows = random_cells(random, kind)
        cells = joined_cells(rows)
    stations = random.sample(sorted(cells), STATIONS)
    picture = "\n".join(
        "".join(
            "t" if (x, y) in stations else "." if (x, y) in cells else "#" for x in range(WIDTH)
        )
        for y in range(HEIGHT)
    )
    floor_plan = draw_floor(picture)
    flow = np.zeros((STATIONS, STATIONS))
    for _ in range(ROUTES):
        quantity = random.choice(QUANTITIES)
        route = random.sample(range(STATIONS), LENGTH)
        flow[route[:-1], route[1:]] += quantity
    return roads_of(floor_plan, [floor_plan.cell(x, y) for x, y in stations]).read_only(), flow


def balances(roads: Roads, flow: Any, all_pairs: bool) -> Any:
    """(SEEDS,) balance of the best zones that annealing alone finds; NaN where it has no first ones."""
    rules = zone_rules(FEET_PER_MINUTE / 2.5, typical_distance(roads.between), all_pairs=all_pairs)
    found = np.full(SEEDS, np.nan)
    for k in range(SEEDS):
        design, workspace, seed = design_arrays(roads, ZONES), scratch(roads, ZONES), np.uint64(k)
        if first_design(roads, flow, design, workspace) or random_design(
            roads, rules, design, workspace, seed, 0
        ):
            found[k] = annealing.improve(roads, rules, flow, *ANNEALED, design, workspace, seed, 0)
    return found


def compare(kind: str) -> str:
    """A line of figures for the floors of a kind; certain: by more than ALIKE and two errors."""
    means, gains, certain = [], [], []
    for floor in FLOORS:
        roads, flow = random_floor(floor, kind)
        last, every = (balances(roads, flow, all_pairs) for all_pairs in (False, True))
        if np.isnan(last).any() or np.isnan(every).any():
            continue
        means.append((last.mean(), every.mean()))
        gains.append(last.mean() - every.mean())
        error = np.sqrt((last.var(ddof=1) + every.var(ddof=1)) / SEEDS)
        certain.append(np.sign(gains[-1]) * (abs(gains[-1]) > max(ALIKE, 2.1 * error)))
    last_mean, every_mean = np.mean(means, axis=0)
    error = np.std(gains, ddof=1) / np.sqrt(len(gains))
    return (
        f"{kind}: {len(gains)} floors, last {last_mean:.4f}, all {every_mean:.4f}, "
        f"gain {np.mean(gains):.4f} +- {error:.4f}; all is better on {certain.count(1)} "
        f"(by up to {max(gains):.2f}), worse on {certain.count(-1)} (by up to {-min(gains):.2f})"
    )


if __name__ == "__main__":
    for kind in (HOLES, STREETS):
        print(compare(kind), flush=True)
