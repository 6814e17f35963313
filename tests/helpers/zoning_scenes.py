"""Facts about the factory of Keith & La, and floors with stations for tests of zoning."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
import yaml

from automaton.engine.facilities import Design, Roads
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.text_files import SHIPPED_FOLDER
from automaton.world.building import roads_of
from layouts.factory import Factory
from strategies.zoning.design_files import read_design
from strategies.zoning.zone_workspace import (
    ZoneSpace,
    space_for,
    typical_distance,
    zone_rules,
)

# The authors' table of distances between WS1 to WS18, in units of 2.5 ft.
TABLE = """
  0  39  78  89  94 108 120 124 138 150 152 168 184 184 168 191 207 207
 39   0  39  80 103 101  81 133 131 111 161 177 161 145 129 200 184 168
 78  39   0 109  64  78  90  94 108 120 122 138 154 154 138 161 177 177
 89  80 109   0 161  99  79 171 129 109 191 175 159 143 127 198 182 166
 94 103  64 161   0  62  82  30  92 112 106 122 138 154 170 145 161 177
108 101  78  99  62   0  20  72  78  90  92 108 124 124 108 131 147 147
120  81  90  79  82  20   0  92  90  70 112 128 120 104  88 151 143 127
124 133  94 171  30  72  92   0  74  94  76  92 108 124 140 115 131 147
138 131 108 129  92  78  90  74   0  20  62  78  94  94  78 101 117 117
150 111 120 109 112  90  70  94  20   0  82  98  90  74  58 121 113  97
152 161 122 191 106  92 112  76  62  82   0  52  68  84 100  39  55  71
168 177 138 175 122 108 128  92  78  98  52   0  52  68  84  23  39  55
184 161 154 159 138 124 120 108  94  90  68  52   0  52  68  39  23  39
184 145 154 143 154 124 104 124  94  74  84  68  52   0  52  55  39  23
168 129 138 127 170 108  88 140  78  58 100  84  68  52   0  71  55  39
191 200 161 198 145 131 151 115 101 121  39  23  39  55  71   0  26  42
207 184 177 182 161 147 143 131 117 113  55  39  23  39  55  26   0  26
207 168 177 166 177 147 127 147 117  97  71  55  39  23  39  42  26   0
"""
DISTANCES = np.array(TABLE.split(), np.int64).reshape(18, 18)

# Loads of the authors' training set, station to station.
TRAINING = """
1-3:17 1-5:22 1-9:23 2-1:62 3-12:17 4-6:26 5-9:34 6-7:26 7-13:26 8-9:20 9-10:77 10-11:23
10-12:20 10-14:22 10-15:12 11-16:23 12-13:17 12-16:20 13-17:26 14-18:22
"""
FEET_PER_MINUTE = 236.2


def factory(cell: float = 2.5) -> tuple[Factory, FloorPlan, Roads]:
    """The floor and its roads, read-only as strategies see them: kernels then compile once for both."""
    floor = Factory(cell=cell)
    floor_plan = floor.build()
    roads = roads_of(floor_plan, [floor_plan.cell(x, y) for x, y in floor.stations().values()])
    return floor, floor_plan, roads.read_only()


def training_flow() -> Any:
    """(18, 18) loads."""
    flow = np.zeros((18, 18))
    for entry in TRAINING.split():
        pair, loads = entry.split(":")
        a, b = (int(number) - 1 for number in pair.split("-"))
        flow[a, b] = float(loads)
    return flow


def shipped(name: str) -> Design:
    """A design of layouts/zones."""
    floor, floor_plan, roads = factory()
    data = yaml.safe_load((SHIPPED_FOLDER / "zones" / f"{name}.yaml").read_text())
    return read_design(floor_plan, roads, data, floor.points())


def factory_rules(roads: Roads) -> Any:
    """What SA and GA judge by, for cells of 2.5 ft."""
    return zone_rules(FEET_PER_MINUTE / 2.5, typical_distance(roads.between))


def ddz_rules() -> Any:
    """What DDZ judges by, for cells of 2.5 ft: 300 ft, primary segments, no base flow."""
    far = 300 / 2.5
    return zone_rules(FEET_PER_MINUTE / 2.5, far, base=0, limit=far, blocks=False, shared=True)


def drawn(picture: str) -> tuple[FloorPlan, Roads]:
    """A floor whose stations are its digits, from 1."""
    rows = picture.split()
    digits = sorted(set(picture) & set("0123456789"))
    floor_plan = draw_floor(
        "\n".join("".join("t" if c in digits else c for c in row) for row in rows)
    )
    cells = [
        floor_plan.cell(row.index(digit), y)
        for digit in digits
        for y, row in enumerate(rows)
        if digit in row
    ]
    return floor_plan, roads_of(floor_plan, cells).read_only()


def scratch(roads: Roads, zones: int) -> ZoneSpace:
    """Scratch for so many zones, with a robot each."""
    return space_for(roads, zones)


def everyone(zones: int) -> Any:
    """All zones are in reach."""
    return np.ones(zones, np.uint8)


def transfers(design: Design, a: int, b: int) -> set[int]:
    """Transfer stations of two zones, as users count them."""
    return set((np.flatnonzero(design.transfer[a, b]) + 1).tolist())


def stations(design: Design) -> list[set[int]]:
    """The stations of each zone, as users count them."""
    zones = range(len(design.transfer))
    return [set((np.flatnonzero(design.zone == z) + 1).tolist()) for z in zones]


def segments(floor_plan: FloorPlan, roads: Roads, design: Design, zone: int) -> list[list[Any]]:
    """The segments of a zone as lists of (x, y)."""
    return [
        [floor_plan.xy(roads.cell[p]) for p in design.path[m, : design.points[m]]]
        for m in range(int(design.segments))
        if design.owner[m] == zone
    ]


def check_partition(roads: Roads, design: Design) -> None:
    """Every station is in one zone, no point in two, and the segments of each zone are a tree."""
    zones, held = len(design.transfer), {}
    assert set(design.zone.tolist()) == set(range(zones))
    for s, zone in enumerate(design.zone.tolist()):
        held[int(roads.point[s])] = zone
    parts = {s: s for s in range(len(design.zone))}
    for m in range(int(design.segments)):
        zone, path = int(design.owner[m]), design.path[m, : design.points[m]].tolist()
        a, b = design.ends[m].tolist()
        assert [roads.point[a], roads.point[b]] == [path[0], path[-1]]
        assert design.zone[a] == design.zone[b] == zone
        assert all(q in roads.next[p] for p, q in pairwise(path))
        assert all(held.setdefault(p, zone) == zone for p in path)
        assert parts[a] != parts[b], "a ring"
        parts = {s: parts[a] if part == parts[b] else part for s, part in parts.items()}
    assert len(set(parts.values())) == zones
    assert {p: z for p, z in enumerate(design.held.tolist()) if z >= 0} == held


def near_of(count: int, pairs: Iterable[tuple[int, int]]) -> Any:
    """(n, n) uint8 neighbours."""
    near = np.zeros((count, count), np.uint8)
    for a, b in pairs:
        near[a, b] = near[b, a] = 1
    return near
