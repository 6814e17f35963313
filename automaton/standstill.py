"""Why a run is not finished: what is undelivered, who is down, who waits and for whom."""

from __future__ import annotations

import numpy as np

from automaton.circles import circles, keepers
from automaton.metrics import illegal_by_layer
from automaton.simulation import Simulation
from automaton.units import count, listed
from automaton.world.observation import DEADLOCK_TICKS
from automaton.world.robot_status import STATUS_DEPLETED, STATUS_FAILED, STATUS_REMOVED
from automaton.world.state import GOAL_NONE, NIL, ORDER_DELIVERED, Array

NAMED = 3  # robots that keep others


def stuck(simulation: Simulation, still: Array) -> Array:
    """Storage indices of the robots on the floor that have not worked for long.

    still: (n,) the tick up to which each stored robot has worked. Who is down is none of them.
    """
    robots = simulation.world.robots
    abroad = np.flatnonzero((robots.parked == 0) & (robots.status < STATUS_DEPLETED))
    found: Array = abroad[still[abroad] <= simulation.tick - DEADLOCK_TICKS]
    return found


def deadlocks(found: list[tuple[int, ...]]) -> list[str]:
    """Return a phrase about wait cycles, or none."""
    if not found:
        return []
    others = f", and there are {count(len(found) - 1, 'more wait cycle')}" if found[1:] else ""
    return [f"deadlock: robots {listed(list(found[0]))} form a wait cycle{others}"]


def trouble(simulation: Simulation, still: Array) -> str:
    """Why a run is not finished, as phrases; `still` as of `stuck`."""
    world = simulation.world
    illegal = {layer: n for layer, n in illegal_by_layer(simulation).items() if n}
    abroad = int((world.robots.parked == 0).sum())
    undelivered = int((world.orders.state != ORDER_DELIVERED).sum())
    phrases = [f"{undelivered:,} of {count(len(world.orders.state), 'order')} undelivered"]
    if not undelivered:
        phrases = [f"all orders delivered, but {count(abroad, 'robot')} not parked"]
    phrases += [f"{layer} gave {count(n, 'illegal answer')}" for layer, n in illegal.items()]
    phrases += out_of_order(simulation)
    waiting = stuck(simulation, still)
    if len(waiting):
        since = int(still[waiting].max())
        phrases.append(
            f"{named(simulation, waiting)} done nothing but wait since tick {since:,} or before"
        )
        phrases += in_the_way(simulation, waiting)
        phrases += deadlocks(circles(world, waiting))
    elif undelivered:
        last = int(world.orders.delivered.max(initial=0))
        phrases.append(f"last delivery at tick {last:,}" if last > 0 else "nothing was delivered")
    return ", ".join(phrases)


def named(simulation: Simulation, stored: Array) -> str:
    """Robots by their identities, with a verb: "robot 2 has"."""
    names = sorted(int(identity) for identity in simulation.world.robots.identity[stored])
    return f"robot {names[0]} has" if len(names) == 1 else f"robots {listed(names)} have"


def out_of_order(simulation: Simulation) -> list[str]:
    """Who has broken down, or has an empty battery, and is not repaired."""
    status = simulation.world.robots.status
    kinds = (
        (STATUS_FAILED, "broken down"),
        (STATUS_DEPLETED, "run empty"),
        (STATUS_REMOVED, "been towed away for good"),
    )
    found = [(np.flatnonzero(status == code), what) for code, what in kinds]
    return [f"{named(simulation, stored)} {what}" for stored, what in found if len(stored)]


def in_the_way(simulation: Simulation, waiting: Array) -> list[str]:
    """Who holds a cell that some of these robots wait for, and waits for no robot itself."""
    robots, floor_plan = simulation.world.robots, simulation.resolved.floor_plan
    keeper = keepers(simulation.world, waiting)
    phrases = []
    for j in sorted(set(keeper.values()) - set(keeper), key=lambda j: int(robots.identity[j])):
        kept = sorted(int(robots.identity[i]) for i, other in keeper.items() if other == j)
        who = f"robot {kept[0]} waits" if len(kept) == 1 else f"robots {listed(kept)} wait"
        if robots.status[j] >= STATUS_DEPLETED:
            why = "is down"
        elif robots.goal_type[j] == GOAL_NONE and robots.load[j] == NIL:
            why = "has nothing to do"
        else:
            why = "has work to do"
        cell = floor_plan.xy(int(robots.cell[j]))
        phrases.append(f"{who} for robot {robots.identity[j]}, which holds {cell} and {why}")
    return phrases[:NAMED]
