"""A small floor on which two robots serve a zone each, as a scene for pictures."""

from __future__ import annotations

import numpy as np
from render_scenes import make_scene
from zoning_scenes import drawn

from automaton.engine.state import NIL
from automaton.world.building import service_zones_of
from strategies.zoning.design_files import read_design
from tui.render.scene import Scene

FLOOR = """
1...2...3
.#######.
4.......5
"""
ZONES = {
    "zones": [
        {"stations": [1, 2, 4], "segments": [[[0, 0], [4, 0]], [[0, 0], [0, 2]]]},
        {"stations": [3, 5], "segments": [[[8, 0], [8, 2]]]},
    ],
    "transfers": [{"zones": [1, 2], "stations": [2]}],
}


def two_zones(layer: str = "service-zones") -> Scene:
    floor_plan, roads = drawn(FLOOR)
    design = read_design(floor_plan, roads, ZONES)
    slots = floor_plan.slots
    station_of = np.full(len(slots), NIL, np.int32)
    for station, cell in enumerate(roads.cell[roads.point].tolist()):
        station_of[slots.tolist().index(cell)] = station
    service_zones = service_zones_of(roads, 2, station_of, 0, 2).replaced(design=design)
    return make_scene(floor_plan, zoning=service_zones, layer=layer)
