"""Samples of legs for training: drives between racks and docks, and the zones on their A* routes.

A network learns to predict the zones that a leg touches from the zones of its start and its end. A leg
touches the zone of every cell that its moves leave; A* breaks ties first in, first out. A study consists
of training legs, test legs and the trained network. This module does not need torch, so trained networks
can be judged and reported without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.floor.floor_plan import DOCK, RACK
from automaton.papers.training_settings import measured
from automaton.scenario.robot_types import RobotType, types_of
from automaton.world.prepared_floor import PreparedFloor, floor_for, frozen
from automaton.world.resolved import Resolved
from automaton.world.rules import duration_table
from automaton.world.starts import first_headings
from strategies.routing import predicted_paths
from strategies.routing.astar import FIFO, route_space
from strategies.routing.routing_parameters import ZoneNetwork, floor_fingerprint, predicted_zones

TRAINING: Final = "training"
UNUSED: Final = "unused seed"
UNSEEN: Final = "unseen pairs"
Cells = npt.NDArray[np.int32]


class Legs(NamedTuple):
    """n legs on a floor of Z zones."""

    start: Cells  # (n,) flat cells
    end: Cells  # (n,)
    start_zone: npt.NDArray[np.int64]  # (n,) NIL on an intersection
    end_zone: npt.NDArray[np.int64]  # (n,)
    touched: npt.NDArray[np.bool_]  # (n, Z)

    def some(self, mask: npt.NDArray[np.bool_]) -> Legs:
        """The legs of a mask (n,)."""
        return Legs(
            self.start[mask],
            self.end[mask],
            self.start_zone[mask],
            self.end_zone[mask],
            self.touched[mask],
        )


class Site(NamedTuple):
    """A site of legs: a floor, the durations of its robots, and the end cells of legs."""

    floor: PreparedFloor
    duration: npt.NDArray[np.int32]  # ticks of each action
    racks: Cells  # (r,) flat cells, one for each rack, from which it is served
    docks: Cells  # (d,)


def site_of(resolved: Resolved) -> Site:
    """The site of a scenario: racks and docks, or else storage slots and destinations.

    On a floor without them, legs lead from any cell to any other. Raises InputError if the floor has no
    zones to learn.
    """
    kinematics = types_of(resolved.scenario)[0].kinematics
    all_alike = RobotType(durations=resolved.scenario.durations, kinematics=kinematics)
    floor = floor_for(resolved.floor_plan, resolved.scenario.world.traffic_zones, (all_alike,))
    if floor.grid.traffic_zone_count == 0:
        raise InputError(f"{resolved.scenario.name}: this floor has no zones to learn")
    kind = floor.grid.kind[floor.slot_cell]
    outer, inner = kind == DOCK, kind == RACK
    if not outer.any() or not inner.any():
        outer, inner = floor.slot_endless == 1, floor.slot_endless == 0
    racks, docks = _access(floor, inner), _access(floor, outer)
    if not racks.size or not docks.size:
        racks = docks = np.flatnonzero(resolved.floor_plan.drivable).astype(np.int32)
    duration = frozen(duration_table(all_alike))  # read-only as in strategies: same compiled search
    return Site(floor, duration, racks, docks)


def _access(floor: PreparedFloor, mask: npt.NDArray[np.bool_]) -> Cells:
    """The first access cell of each slot in a mask, without slots that have none."""
    access = floor.slot_access[mask]
    served = access[(access != NIL).any(axis=1)]
    first: Cells = served[np.arange(len(served)), (served != NIL).argmax(axis=1)]
    return first


def legs_of(site: Site, count: int, seed: int) -> Legs:
    """`count` random legs, alternately rack to dock and dock to rack, uniform by (seed, leg).

    Raises InputError if robots cannot drive one of the legs.
    """
    start, end = np.zeros(count, np.int32), np.zeros(count, np.int32)
    grid = site.floor.grid
    used = np.zeros((count, predicted_paths.words(grid.traffic_zone_count)), np.int64)
    workspace = route_space(grid)
    with np.errstate(over="ignore"):
        predicted_paths.draw_legs(site.racks, site.docks, np.uint64(seed), start, end)
        poses = start.astype(np.int64) * grid.headings + first_headings(grid, start)
        driven = predicted_paths.trace_legs(grid, site.duration, workspace, FIFO, poses, end, used)
    if driven < count:
        raise InputError("robots cannot drive between all cells of this floor")
    zone = grid.traffic_zone[:, 0].astype(np.int64)
    return Legs(start, end, zone[start], zone[end], members(used, grid.traffic_zone_count))


def members(used: npt.NDArray[np.int64], zones: int) -> npt.NDArray[np.bool_]:
    """(n, zones) bool from bit sets (n, words) with a bit for each zone."""
    octets: Any = used.astype("<i8").view(np.uint8)
    return np.unpackbits(octets, axis=1, count=zones, bitorder="little").astype(np.bool_)


def unseen(new: Legs, known: Legs) -> npt.NDArray[np.bool_]:
    """(n,) mask of legs whose pair of zones (with direction) does not occur in the known legs."""
    zones = np.int64(new.touched.shape[1] + 1)

    def pair(some: Legs) -> npt.NDArray[np.int64]:
        return (some.start_zone + 1) * zones + some.end_zone + 1

    mask: npt.NDArray[np.bool_] = ~np.isin(pair(new), pair(known))
    return mask


class Data(NamedTuple):
    """The legs of a study by purpose."""

    training: Legs
    unused: Legs  # equally many test legs, drawn with the next seed
    unseen: Legs  # test legs between pairs of zones that do not occur in training

    def by_name(self) -> Mapping[str, Legs]:
        return {TRAINING: self.training, UNUSED: self.unused, UNSEEN: self.unseen}


def data_of(site: Site, legs: int, seed: int) -> Data:
    """Training legs from `seed`, and test legs from `seed + 1`. Raises InputError."""
    training, unused = legs_of(site, legs, seed), legs_of(site, legs, seed + 1)
    return Data(training, unused, unused.some(unseen(unused, training)))


def network_of(layers: Any, site: Site, scenario: str, mode: str, about: Any) -> ZoneNetwork:
    """A network in the form of files: float16, with its scenario, floor and training."""
    kept = tuple((weights.astype(np.float16), bias.astype(np.float16)) for weights, bias in layers)
    origin = {
        "scenario": scenario,
        "mode": mode,
        "floor": floor_fingerprint(site.floor.grid, site.duration),
    }
    return ZoneNetwork(kept, origin | dict(about))


def judged(network: ZoneNetwork, data: Data) -> dict[str, dict[str, float]]:
    """All measures of a network's answers on each kind of legs; empty kinds are omitted."""
    return {
        name: measured(predicted_zones(network, legs.start_zone, legs.end_zone), legs.touched)
        for name, legs in data.by_name().items()
        if len(legs.touched)
    }
