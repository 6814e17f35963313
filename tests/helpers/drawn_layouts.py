"""Random layouts that are whole: grids with some nodes and edges missing, in LIF and openTCS."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Iterator

Spot = tuple[int, int]


def drawn_lif(seed: int) -> str:
    """Return a layout of VDMA LIF."""
    draw = random.Random(seed)
    step, angle = draw.choice((1, 2, 1.5, 0.5)), math.radians(draw.choice((0, 0, 10, 33.3, 45, 80)))
    spots = _spots(draw)
    nodes = []
    for name, (x, y) in spots.items():
        u, v = x * step + draw.choice((0, 0, 0.02)), y * step
        turned = (
            math.cos(angle) * u - math.sin(angle) * v,
            math.sin(angle) * u + math.cos(angle) * v,
        )
        charges = [{"actionType": "startCharging"}] if draw.random() < 0.1 else []
        properties = [{"vehicleTypeId": "tug", "actions": charges}]
        place = dict(zip("xy", turned, strict=True))
        nodes.append(
            {"nodeId": name, "nodePosition": place, "vehicleTypeNodeProperties": properties}
        )
    edges = []
    for start, end in _pairs(draw, spots):
        drive: dict[str, object] = {"vehicleTypeId": "tug"}
        if draw.random() < 0.9:
            drive["maxSpeed"] = draw.choice((1, 1, 1, 0.5, 0.3, 1.7))
        if draw.random() < 0.1:
            loads = {"loaded": draw.random() < 0.5, "unloaded": draw.random() < 0.7}
            drive["loadRestriction"] = loads
        ends = {"startNodeId": start, "endNodeId": end}
        edges.append({"edgeId": f"{start}-{end}", **ends, "vehicleTypeEdgeProperties": [drive]})
    stations = [
        {"stationId": f"S{k}", "interactionNodeIds": draw.sample(sorted(spots), draw.randint(1, 2))}
        for k in range(draw.randint(0, 4))
    ]
    layout = {"layoutId": "ground", "nodes": nodes, "edges": edges, "stations": stations}
    return json.dumps({"metaInformation": {"lifVersion": "1.0.0"}, "layouts": [layout]})


def drawn_opentcs(seed: int) -> str:
    """Return a plant model of openTCS."""
    draw = random.Random(seed)
    step, spots = draw.choice((1000, 2000, 1500)), _spots(draw)
    lines, paths = [], []
    for name, (x, y) in spots.items():
        kind = draw.choice(("HALT_POSITION", "PARK_POSITION"))
        place = f'positionX="{x * step}" positionY="{y * step}"'
        lines.append(f'<point name="{name}" {place} type="{kind}"/>')
    for start, end in _pairs(draw, spots):
        paths.append(f"{start}-{end}")
        metres = draw.choice((0, 0, math.dist(spots[start], spots[end]) * step + 20))
        lines.append(
            f'<path name="{paths[-1]}" sourcePoint="{start}" destinationPoint="{end}" '
            f'length="{round(metres)}" maxVelocity="{draw.choice((1000, 1000, 500, 0))}" '
            f'maxReverseVelocity="{draw.choice((0, 0, 300, 1000))}" '
            f'locked="{draw.choice(("false",) * 9 + ("true",))}"/>'
        )
    for k in range(draw.randint(0, 3)):
        lines.append(f'<vehicle name="v{k}" maxVelocity="{draw.choice((1000, 1000, 700))}"/>')
    for k in range(draw.randint(0, 4)):
        links = "".join(f'<link point="{p}"/>' for p in draw.sample(sorted(spots), 2))
        lines.append(f'<location name="L{k}" type="k" locked="false">{links}</location>')
    for k in range(draw.randint(0, 3) if paths else 0):
        path = draw.choice(paths)
        names = (path, path.split("-")[0], *draw.sample(paths, min(len(paths), draw.randint(0, 2))))
        members = "".join(f'<member name="{name}"/>' for name in names)
        kind = draw.choice(("SINGLE_VEHICLE_ONLY", "SAME_DIRECTION_ONLY"))
        lines.append(f'<block name="b{k}" type="{kind}">{members}</block>')
    return "\n".join(['<model version="6.0.0" name="drawn">', *lines, "</model>"])


def _spots(draw: random.Random) -> dict[str, Spot]:
    """Return the names of some places of a grid, at least two."""
    width, height = draw.randint(2, 6), draw.randint(2, 6)
    places = [(x, y) for x in range(width) for y in range(height)]
    chosen = [place for place in places if draw.random() < 0.8]
    return {f"n{x}{y}": (x, y) for x, y in (chosen if len(chosen) > 1 else places)}


def _pairs(draw: random.Random, spots: dict[str, Spot]) -> Iterator[tuple[str, str]]:
    """Yield between which places there are edges: neighbours, some farther ones, few diagonals."""
    for start, (x, y) in spots.items():
        for end, (u, v) in spots.items():
            far = abs(x - u) + abs(y - v)
            chance = 0.5 if far == 1 else 0.02 if far == 2 else 0
            if draw.random() < chance:
                yield start, end
