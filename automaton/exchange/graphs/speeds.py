"""Ticks for the edges of a graph: how long a move is on each, and which have a speed limit."""

from __future__ import annotations

from fractions import Fraction
from typing import Final, NamedTuple

from automaton.errors import InputError
from automaton.exchange.graphs.graph import Graph
from automaton.exchange.graphs.roads import Road
from automaton.exchange.imported_floor import ImportOptions

MAX_MOVE: Final = 10_000  # ticks
MAX_LIMITS: Final = 14  # different speed limits that a floor may have
DECIMALS: Final = 12


class Speeds(NamedTuple):
    """The speeds of robots and edges, in m/s, and the ticks of a move at each."""

    cell: Fraction  # metres
    tick: Fraction  # seconds
    fastest: Fraction
    of_edge: tuple[Fraction, ...]  # (edges,) at most the fastest

    def ticks(self, speed: Fraction) -> int:
        """Ticks of a move at a speed, rounded."""
        return int(self.cell / (speed * self.tick) + Fraction(1, 2))

    def wanted(self, graph: Graph, edge: int) -> float:
        """Ticks that an edge takes as it is in the file."""
        return float(graph.edges[edge].metres / (float(self.of_edge[edge]) * float(self.tick)))


def speeds_of(graph: Graph, cell: Fraction, options: ImportOptions) -> Speeds:
    """Return the speeds on a graph. Raises InputError without a speed, or a tick that suits."""
    known = [edge.speed for edge in graph.edges if edge.speed]
    robots = [robot.speed for robot in graph.vehicles if robot.speed]
    default = options.speed
    if default is None and (known or robots):
        default = exact(max(known or robots))
    if default is None:
        raise InputError("gives no speed: set --speed, such as 1m/s", graph.file)
    as_written = {speed: exact(speed) for speed in set(known)}
    of_edge = [as_written[edge.speed] if edge.speed else default for edge in graph.edges]
    fastest = max(of_edge)
    if robots and len(robots) == len(graph.vehicles):
        fastest = min(fastest, exact(max(robots)))
    tick = rounded(options.tick or cell / fastest)
    speeds = Speeds(cell, tick, fastest, tuple(min(speed, fastest) for speed in of_edge))
    _check_ticks(graph, speeds)
    return speeds


def _check_ticks(graph: Graph, speeds: Speeds) -> None:
    """Raises InputError where a move would take no tick, or too many."""
    if not speeds.tick or speeds.ticks(speeds.fastest) < 1:
        text = f"a move at {text_of(speeds.fastest)} m/s would be less than half a tick of "
        raise InputError(f"{text}{float(speeds.tick):g} s: give a smaller --tick", graph.file)
    slowest = min(speeds.of_edge)
    robots = [(exact(one.speed), f"robot {one.name}") for one in graph.vehicles if one.speed]
    edge = graph.edges[speeds.of_edge.index(slowest)].name
    for speed, what in (*robots, (slowest, f"the edge {edge}")):
        if speeds.ticks(speed) > MAX_MOVE:
            text = f"{what} has a speed of {float(speed):.3g} m/s: a move would take more than "
            raise InputError(f"{text}{MAX_MOVE:,} ticks; give a larger --tick", graph.file)


def limits_of(roads: list[Road], speeds: Speeds) -> tuple[list[Fraction], int]:
    """Return the speed on each road, and how many different limits were put together.

    On a road it is that of its slowest edge. Of more than MAX_LIMITS different limits, neighbours
    become one, the lower of them.
    """
    of_road = [min(speeds.of_edge[edge] for edge in road.edges) for road in roads]
    slow = sorted({speed for speed in of_road if speed < speeds.fastest})
    if len(slow) <= MAX_LIMITS:
        return of_road, 0
    lowest: dict[int, Fraction] = {}
    together = {}
    for place, speed in enumerate(slow):
        together[speed] = lowest.setdefault(place * MAX_LIMITS // len(slow), speed)
    return [together.get(speed, speed) for speed in of_road], len(slow)


def exact(value: float) -> Fraction:
    """Return a number as it is written, not as it is stored: 0.1 is a tenth."""
    return rounded(Fraction(repr(value)))


def rounded(value: Fraction) -> Fraction:
    """Return a number with no more decimals than a scenario may have."""
    return Fraction(round(value * 10**DECIMALS), 10**DECIMALS)


def text_of(value: Fraction) -> str:
    """Return a number as a scenario writes it: no exponent, no needless zeros."""
    integer, part = divmod(round(value * 10**DECIMALS), 10**DECIMALS)
    return f"{integer}.{part:0{DECIMALS}d}".rstrip("0").rstrip(".")
