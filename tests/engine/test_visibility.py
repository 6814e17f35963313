"""What a robot does not see cannot be found anywhere in its strategy's view, not even as a remnant.

S1 = what robot B sees;  everything that is hidden from B changes;  who is hidden looks;
S2 = what robot B sees;  S1 = S2
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from automaton.engine.jit.structs import Struct
from automaton.engine.state import NIL, ORDER_DELIVERED
from automaton.engine.visibility import is_visible, is_zone_visible, mask_world, zone_of_order
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

# What everybody knows: the floor and the rules, the calendar, the order list with the slots in it, how
# the parts are made, and the types of robots.
KNOWN = {"grid", "rules", "clock", "orders", "slots", "stations", "robots.type"}
KNOWN |= {"robots.identity", "robots.at_index", "service_zones.roads", "service_zones.station_of"}
KNOWN |= {"service_zones.accessible", "service_zones.has_priority"}
ZONES = {
    f"service_zones.{name}"
    for name in ("design", "server", "queue", "next_slot", "skips_transfer", "picked_from")
}
LISTS = {"orders", "stations"}  # with orders: zones these are known in part

# What says where a robot is; only among cells out of sight may that change.
PLACES = {"cell", "claim", "home", "bay"}


def contents(view: Struct, known: set[str], path: str = "") -> dict[str, bytes]:
    """All arrays of a view by their paths, what is known aside."""
    found = {}
    for name in view._fields:
        value, here = view.array(name), path + name
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
    robots.route_length[j], robots.order_queue_length[j] = (
        robots.route.shape[1],
        robots.order_queue.shape[1],
    )
    for name in ("operations", "ticks", "slowdown_ticks", "energy_used", "charged", "failures"):
        poison(getattr(world.tally, name)[j : j + 1], draws)
    if len(world.service_zones.wake):
        for name in ("halt", "wake", "messages"):
            poison(getattr(world.service_zones, name)[j : j + 1], draws)
    poison(world.chargers.exit_cell, draws)
    poison(world.chargers.first_ticket, draws)


def poison_zones(world: Any, b: int, draws: Any) -> int:
    """Change what robot b may not know of zones, orders and stations; how many orders those are."""
    service_zones, design, orders = world.service_zones, world.service_zones.design, world.orders
    hidden = [z for z in range(len(service_zones.server)) if not is_zone_visible(world, b, z)]
    changed = 0
    for order in range(len(orders.state)):
        reserved_by = orders.reserved_by[order]
        if reserved_by != NIL or zone_of_order(world, order) not in (NIL, *hidden):
            continue
        changed += 1
        for name in orders._fields:
            if name not in (
                "state",
                "reserved_by",
                "current_slot",
                "release_sequence",
            ):  # these say in which zone it is
                poison(getattr(orders, name)[order : order + 1], draws)
        for name in ("next_slot", "skips_transfer", "picked_from"):
            poison(getattr(service_zones, name)[order : order + 1], draws)
    for segment in range(int(design.segments)):
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
            for name in ("in_service", "queue_tail", "job_done_tick"):
                poison(getattr(lines, name)[k : k + 1], draws)
    for work in range(len(lines.completion_tick)):
        if design.zone[lines.station[work]] in hidden:
            for name in ("next_in_queue", "arrival_tick", "completion_tick"):
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
    world, visible_world, draws = run.world, run.visible_world, np.random.default_rng(1)
    robots = range(len(world.robots.cell))
    b, hidden = max(
        ((b, [j for j in robots if not is_visible(world, b, j)]) for b in robots),
        key=lambda pair: len(pair[1]),
    )
    assert hidden
    for j in robots:
        mask_world(world, visible_world, j)  # they have seen what they may
    mask_world(world, visible_world, b)
    in_zones = bool(world.rules.own_zones)
    fixed = {
        "identity",
        "station",
        "processing_time",
        "part",
        "releases_order",
        "job_of_order",
        "part_arrivals",
        "at",
        "slot",
    }
    known = KNOWN - LISTS | {f"stations.{name}" for name in fixed} if in_zones else KNOWN | ZONES
    before = contents(run.view, known)
    for j in hidden:
        poison_robot(world, j, draws)
    if in_zones:
        assert poison_zones(world, b, draws) > 10
    for j in hidden:
        mask_world(world, visible_world, j)
    mask_world(world, visible_world, b)
    after = contents(run.view, known)
    assert [name for name in before if after[name] != before[name]] == []
    assert len(before) > 50
    mask_world(world, visible_world, hidden[0])
    assert contents(run.view, known) != before  # the poison is there for those who may see it


def test_who_knows_only_his_own_zones_sees_of_orders_what_decides_not_what_is_measured() -> None:
    settings = ["strategy.zoning={name: decentralized, design: factory-ddz, adjacency: 300}"]
    settings.append("information={radius: 131, shape: circle, orders: zones}")
    run = Simulation(resolve("factory", settings))
    run.run(until=3000)
    seen, orders = run.visible_world.orders, run.world.orders
    shown = seen.state == ORDER_DELIVERED
    assert shown.any() and (orders.picked[shown] != NIL).all()
    assert (seen.dispatched[shown] == orders.dispatched[shown]).all()
    assert (seen.picked == NIL).all() and not seen.moves.any()
