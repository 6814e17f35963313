"""The checks of positions, loads and charges find what they look for, in worlds altered by hand."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from physical_checks import PhysicalChecks

from automaton.engine.state import (
    BATTERY_FULL,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    STATUS_FAILED,
    World,
)
from automaton.runs.pictures import Story
from automaton.world.building import build_world
from automaton.world.resolve import resolve

BATTERY = ("battery={drain: {move: 1.0}, charge_rate: 1}",)


def floor() -> tuple[World, int]:
    """Robots 0 and 1 side by side on the table-top floor, full of energy, the first cell's index."""
    world, _ = build_world(resolve("tabletop-mini", BATTERY), 1)
    start = int(world.robots.home[0])
    step = next(s for s in (1, -1) if world.grid.cell_flags[start + s] & 15)
    world.robots.cell[:2] = start, start + step
    world.robots.bay[:2] = NIL
    return world, step


def found(change: Callable[[World, int], None]) -> set[str]:
    """What a change within one tick is called."""
    world, step = floor()
    checks = PhysicalChecks(world)
    checks.tick()
    assert not checks.found
    change(world, step)
    checks.tick()
    return set(checks.found)


def swap(world: World, step: int) -> None:
    world.robots.cell[:2] = world.robots.cell[:2][::-1].copy()
    world.robots.charge[:2] -= BATTERY_FULL // 100


def run_over(world: World, step: int) -> None:
    world.robots.cell[0] += step
    world.robots.charge[0] -= BATTERY_FULL // 100


def leap(world: World, step: int) -> None:
    world.robots.cell[0] += 2 * step + int(world.grid.offset[1])
    world.robots.charge[0] -= BATTERY_FULL // 100


def carry_twice(world: World, step: int) -> None:
    world.robots.load[:2] = 0
    world.orders.state[0], world.orders.current_slot[0] = ORDER_CARRIED, NIL


def lose(world: World, step: int) -> None:
    world.orders.current_slot[0] = NIL


def reach_far(world: World, step: int) -> None:
    order = int(world.orders.current_slot.argmax())
    world.robots.load[0] = order
    world.orders.state[order], world.orders.current_slot[order] = ORDER_CARRIED, NIL


def drive_for_nothing(world: World, step: int) -> None:
    world.robots.cell[1] += step


def overdraw(world: World, step: int) -> None:
    world.robots.charge[0] = -1


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (swap, "swap"),
        (run_over, "collision"),
        (leap, "jump"),
        (carry_twice, "load"),
        (lose, "load"),
        (reach_far, "load"),
        (drive_for_nothing, "battery"),
        (overdraw, "battery"),
    ],
)
def test_what_is_wrong_is_found(change: Callable[[World, int], None], kind: str) -> None:
    assert kind in found(change)


def test_a_delivered_order_stays_delivered_and_gains_are_for_chargers() -> None:
    world, _ = floor()
    world.orders.state[0], world.orders.current_slot[0] = ORDER_DELIVERED, world.orders.target[0]
    world.robots.charge[0] = BATTERY_FULL // 2
    checks = PhysicalChecks(world)
    world.orders.state[0] = 0
    world.robots.charge[0] = BATTERY_FULL
    checks.tick()
    assert set(checks.found) == {"load", "battery"}


def test_who_is_out_of_order_stands_still() -> None:
    world, step = floor()
    world.robots.status[1] = STATUS_FAILED
    checks = PhysicalChecks(world)
    world.robots.cell[1] += step
    checks.tick()
    assert "down" in checks.found


def test_two_robots_meet_on_an_edge() -> None:
    """A ends its move over the edge in the tick in which B begins one the other way."""
    story = Story("A~B", move=2)
    robots = story.world.robots
    a = int(robots.cell[0])
    robots.cell[:], robots.claim[:] = (a, a + 1), (a + 1, NIL)
    checks = PhysicalChecks(story.world)
    robots.cell[:], robots.claim[:] = (a + 1, a + 1), (NIL, a)
    checks.tick()
    assert checks.found == {"overlap on an edge": 1}
