"""Small layouts of VDMA LIF, as text, for one type of robots."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from automaton.commands import main

LAYOUTS = Path(__file__).resolve().parent.parent / "exchange" / "layouts"


def lif(
    nodes: dict[str, tuple[float, float]],
    edges: list[str],
    stations: dict[str, list[str]] | None = None,
    **properties: dict[str, Any],
) -> dict[str, Any]:
    """Return a layout: nodes with x and y, edges such as "A-B" (one way) or "A=B" (both ways).

    `properties`: of edges, by the name with "_" in place of "-".
    """
    ways = [one.replace("=", "-") for one in edges]
    ways += ["-".join(reversed(one.split("="))) for one in edges if "=" in one]
    return {
        "metaInformation": {"lifVersion": "1.0.0"},
        "layouts": [
            {
                "layoutId": "ground",
                "nodes": [
                    {"nodeId": name, "nodePosition": {"x": x, "y": y}}
                    for name, (x, y) in nodes.items()
                ],
                "edges": [
                    {
                        "edgeId": way,
                        "startNodeId": way.split("-")[0],
                        "endNodeId": way.split("-")[1],
                        "vehicleTypeEdgeProperties": [
                            {
                                "vehicleTypeId": "tug",
                                "maxSpeed": 1.0,
                                **properties.get(way.replace("-", "_"), {}),
                            }
                        ],
                    }
                    for way in ways
                ],
                "stations": [
                    {"stationId": name, "interactionNodeIds": at}
                    for name, at in (stations or {}).items()
                ],
            }
        ],
    }


def write(folder: Path, layout: dict[str, Any]) -> Path:
    """Write a layout; return its path."""
    path = folder / "site.lif"
    path.write_text(json.dumps(layout))
    return path


def imported(path: Path, *options: str) -> tuple[int, Path]:
    """Import a layout; return the exit code and the scenario."""
    out = path.parent / "floor.yaml"
    return main(["import", str(path), "--out", str(out), "--force", *options]), out
