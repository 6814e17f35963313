"""Import a layout that is a graph: fit it to cells, draw it, and report on every edge."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Final

from automaton.exchange.graphs.fit import Fit, fit_graph
from automaton.exchange.graphs.graph import Graph
from automaton.exchange.graphs.graph_sections import GraphScenario
from automaton.exchange.graphs.lif import read_lif
from automaton.exchange.graphs.opentcs import read_opentcs
from automaton.exchange.graphs.roads import Cell, Roads
from automaton.exchange.graphs.speeds import Speeds, speeds_of
from automaton.exchange.import_report import EdgeRow, ImportReport
from automaton.exchange.imported_floor import ImportedFloor, ImportOptions, check_values
from automaton.floor.cells import STATION
from automaton.units import count

MAX_MARKS: Final = 9  # edges that are marked in the picture, by a digit each
MAX_SHOWN: Final = 10  # cells in a note
EXACT: Final = 0.001  # an error up to this is not marked


def import_lif(path: Path, options: ImportOptions) -> ImportedFloor:
    """Import a layout of VDMA LIF. Raises InputError."""
    return import_graph(read_lif(path, options.layout, options.type), options)


def import_opentcs(path: Path, options: ImportOptions) -> ImportedFloor:
    """Import a plant model of openTCS. Raises InputError."""
    return import_graph(read_opentcs(path), options)


def import_graph(graph: Graph, options: ImportOptions) -> ImportedFloor:
    """Return a graph as a floor; with a refusal in its report, it has none. Raises InputError."""
    fit = fit_graph(graph, options.cell, options.accept)
    speeds = speeds_of(graph, fit.cell, options)
    if fit.layout is None:
        rows = edge_rows(graph, fit, speeds, speeds.of_edge)
        refusal = f"{graph.file}: {fit.refusal}"
        facts, lost = facts_of(graph, fit, speeds), dict(graph.lost.most_common())
        report = ImportReport(graph.format, facts, rows, lost, refusal=refusal)
        return ImportedFloor("", {}, {}, report)
    roads, kinds, drawing = fit.layout
    scenario = GraphScenario(graph, fit.layout, speeds, options)
    sections = scenario.sections()
    check_values(sections, graph.file)
    facts = facts_of(graph, fit, speeds) | {
        "stations": sum(kind == STATION for kind in kinds.values()),
        "chargers": len(graph.chargers),
        "robots": sections["fleet"]["robots"],
    }
    rows = edge_rows(graph, fit, speeds, speeds_of_edges(roads, scenario.of_road))
    report = ImportReport(
        graph.format,
        facts,
        rows,
        dict(graph.lost.most_common()),
        (*graph.notes, *crossing_notes(roads), *scenario.notes),
        drawing.picture,
        marks_of(graph, roads, rows),
    )
    comments = (f"Imported from {Path(graph.file).name}: {graph.format}.",)
    names = scenario.places.locations
    return ImportedFloor(drawing.picture, drawing.entries, sections, report, names, comments)


def facts_of(graph: Graph, fit: Fit, speeds: Speeds) -> dict[str, str | int | float]:
    """Return what a graph has become."""
    return {
        "cell_m": float(fit.cell),
        "tick_s": float(speeds.tick),
        "columns": fit.width,
        "rows": fit.height,
        "turned_degrees": fit.placement.degrees,
        "nodes": len(graph.nodes),
        "edges": len(graph.edges),
    }


def speeds_of_edges(roads: Roads, of_road: list[Fraction]) -> tuple[Fraction, ...]:
    """Return the speed at which each edge is driven on the floor, from that of each road."""
    pairs = zip(roads.roads, of_road, strict=True)
    of_edge = {edge: speed for road, speed in pairs for edge in road.edges}
    return tuple(of_edge[edge] for edge in range(len(of_edge)))


def edge_rows(
    graph: Graph, fit: Fit, speeds: Speeds, drawn: tuple[Fraction, ...]
) -> tuple[EdgeRow, ...]:
    """Return a row for each edge, the worst first; `drawn`: the speed of each on the floor."""
    ticks = {speed: speeds.ticks(speed) for speed in set(drawn)}
    cell = float(fit.cell)
    rows = [
        EdgeRow(
            edge.name,
            edge.metres,
            int(fit.cells[number]),
            int(fit.cells[number]) * cell,
            speeds.wanted(graph, number),
            int(fit.cells[number]) * ticks[drawn[number]],
        )
        for number, edge in enumerate(graph.edges)
    ]
    return tuple(sorted(rows, key=lambda row: -round(abs(row.error), 9)))


def marks_of(graph: Graph, roads: Roads, rows: tuple[EdgeRow, ...]) -> dict[Cell, str]:
    """Return digits for the worst edges, in the middle of each: their lines in the report."""
    middle = {
        graph.edges[road.edges[0]].name: road.between[len(road.between) // 2]
        for road in roads.roads
        if road.between
    }
    return {
        middle[row.name]: str(place)
        for place, row in enumerate(rows[:MAX_MARKS], 1)
        if abs(row.error) > EXACT and row.name in middle
    }


def crossing_notes(roads: Roads) -> list[str]:
    """Return a sentence where roads cross without a node."""
    if not roads.crossings:
        return []
    cells = roads.crossings
    shown = ", ".join(f"[{x}, {y}]" for x, y in cells[:MAX_SHOWN])
    more = ", ..." if len(cells) > MAX_SHOWN else ""
    where = count(len(cells), "cell")
    return [f"edges cross without a node in {where}: robots may turn there ({shown}{more})"]
