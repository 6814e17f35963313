"""What a robot does not see cannot be found anywhere in its strategy's view, not even as a remnant.

S1 = what robot B sees;  everything that is hidden from B changes;  who is hidden looks;
S2 = what robot B sees;  S1 = S2
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from automaton.kernels.sight import is_seen, look, zone_is_seen, zone_of_order
from automaton.scenario.resolve import resolve
from automaton.simulation import Simulation
from automaton.struct import Struct
from automaton.world.state import NIL

# What everybody knows: the floor and the rules, the calendar, the order list with the slots in it, how
# the parts are made, and the types of robots.
KNOWN = {"grid", "rules", "clock", "orders", "slots", "stations", "robots.type"}
KNOWN |= {"robots.identity", "robots.at_index", "zoning.roads", "zoning.station_of"}
KNOWN |= {"zoning.serves", "zoning.first"}
ZONES = {f"zoning.{name}" for name in ("design", "server", "queue", "stop", "direct", "leg")}
LISTS = {"orders", "stations"}  # with orders: zones these are known in part

# What says where a robot is; only among cells out of sight may that change.
PLACES = {"cell", "claim", "home", "bay"}


def contents(view: Struct, known: set[str], path: str = "") -> dict[str, bytes]:
    """All arrays of a view by their paths, what is known aside."""
    found = {}
    for name in view._fields:
        value, here = getattr(view, name), path + name
        if here in known:
            continue
        if isinstance(value, Struct):
            found |= contents(value, known, f"{here}.")
        elif isinstance(value, np.ndarray):
            found[here] = value.tobytes()
    return found


def poison(rows: Any, draws: Any) -> None:
    """Other numbers, whatever there is."""
    rows[...] = draws.integers(1, 100, rows.shape).astype(rows.dtype)


def poison_robot(world: Any, j: int, draws: Any) -> None:
    robots = world.robots
    for name in robots._fields:
        if f"robots.{name}" not in KNOWN and name not in PLACES:
            poison(getattr(robots, name)[j : j + 1], draws)
    robots.length[j], robots.planned[j] = robots.route.shape[1], robots.plan.shape[1]
    for name in ("times", "ticks", "slowed", "spent", "charged", "out"):
        poison(getattr(world.tally, name)[j : j + 1], draws)
    if len(world.zoning.wake):
        for name in ("halt", "wake", "said"):
            poison(getattr(world.zoning, name)[j : j + 1], draws)
    poison(world.chargers.way_out, draws)
    poison(world.chargers.first, draws)


def poison_zones(world: Any, b: int, draws: Any) -> int:
    """Change what robot b may not know of zones, orders and stations; how many orders those are."""
    zoning, design, orders = world.zoning, world.zoning.design, world.orders
    hidden = [z for z in range(len(zoning.server)) if not zone_is_seen(world, b, z)]
    changed = 0
    for order in range(len(orders.state)):
        by = orders.by[order]
        if by != NIL or zone_of_order(world, order) not in (NIL, *hidden):
            continue
        changed += 1
        for name in orders._fields:
            if name not in ("state", "by", "place", "coming"):  # these say in which zone it is
                poison(getattr(orders, name)[order : order + 1], draws)
        for name in ("stop", "direct", "leg"):
            poison(getattr(zoning, name)[order : order + 1], draws)
    for segment in range(int(design.segments[0])):
        if design.owner[segment] in hidden:
            poison(design.ends[segment], draws)
            design.points[segment] = design.path.shape[1]
            poison(design.path[segment], draws)
    for x in hidden:
        poison(design.transfer[x], draws)
        poison(design.transfer[:, x], draws)
    lines = world.stations
    for k in range(len(lines.slot)):
        if design.zone[k] in hidden:
            for name in ("first", "last", "until"):
                poison(getattr(lines, name)[k : k + 1], draws)
    for work in range(len(lines.done)):
        if design.zone[lines.station[work]] in hidden:
            for name in ("behind", "came", "done"):
                poison(getattr(lines, name)[work : work + 1], draws)
    return changed


@pytest.mark.parametrize(
    ("floor", "information", "ticks"),
    [
        ("tabletop-1", "orders", 40),
        ("tabletop-1", "{radius: 1}", 40),
        ("tabletop-1", "{radius: 3, shape: circle}", 60),
        ("factory-ddz", "{radius: 20}", 200),
        ("factory-ddz", "{radius: 20, shape: circle, orders: zones}", 200),
    ],
)
def test_nothing_that_is_hidden_changes_what_a_robot_sees(
    floor: str, information: str, ticks: int
) -> None:
    run = Simulation(resolve(floor, [f"information={information}"]))
    run.run(until=ticks)
    world, seen, draws = run.world, run.seen, np.random.default_rng(1)
    robots = range(len(world.robots.cell))
    b, hidden = max(
        ((b, [j for j in robots if not is_seen(world, b, j)]) for b in robots),
        key=lambda pair: len(pair[1]),
    )
    assert hidden
    for j in robots:
        look(world, seen, j)  # they have seen what they may
    look(world, seen, b)
    in_zones = bool(world.rules.own_zones)
    fixed = {"identity", "station", "ticks", "part", "frees", "arrives", "entering", "at", "slot"}
    known = KNOWN - LISTS | {f"stations.{name}" for name in fixed} if in_zones else KNOWN | ZONES
    before = contents(run.view, known)
    for j in hidden:
        poison_robot(world, j, draws)
    if in_zones:
        assert poison_zones(world, b, draws) > 10
    for j in hidden:
        look(world, seen, j)
    look(world, seen, b)
    after = contents(run.view, known)
    assert [name for name in before if after[name] != before[name]] == []
    assert len(before) > 50
    look(world, seen, hidden[0])
    assert contents(run.view, known) != before  # the poison is there for those who may see it
