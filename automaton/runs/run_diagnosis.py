"""Why a run is not finished: undelivered orders, robots that are down, and robots that wait.

Wait cycles are named. Jams are reported during the run.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Final

import numpy as np

from automaton.engine.blockers import walk_to_cycle
from automaton.engine.observation import DEADLOCK_TICKS
from automaton.engine.state import (
    GOAL_NONE,
    NIL,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_REMOVED,
    STOP_ON_TARGETS,
    Array,
    World,
)
from automaton.runs.metrics import illegal_by_layer
from automaton.runs.progress import (
    Jam,
    asked_orders,
    jams,
    largest_jam,
    starved_ticks,
    stuck_robots,
)
from automaton.runs.simulation import RECORD_TICKS, Simulation
from automaton.units import count, listed
from automaton.vocabulary import CONDITION_WORDS

MAX_NAMED_BLOCKERS = 3  # robots that block others


def stalled_robots(simulation: Simulation, last_worked: Array) -> Array:
    """Storage indices of the robots on the floor that have not worked for DEADLOCK_TICKS.

    `last_worked`: (n,) the last tick in which each stored robot worked. Robots that are down are not
    stalled.
    """
    robots = simulation.world.robots
    on_floor = np.flatnonzero((robots.parked == 0) & (robots.status < STATUS_DEPLETED))
    found: Array = on_floor[last_worked[on_floor] <= simulation.tick - DEADLOCK_TICKS]
    return found


def describe_wait_cycles(found: list[tuple[int, ...]]) -> list[str]:
    """Return a phrase about wait cycles, if any."""
    if not found:
        return []
    others = f", and there are {count(len(found) - 1, 'more wait cycle')}" if found[1:] else ""
    return [f"deadlock: robots {listed(list(found[0]))} form a wait cycle{others}"]


def describe_unfinished_run(simulation: Simulation, last_worked: Array) -> str:
    """Return phrases that explain why a run is not finished; `last_worked` as for `stalled_robots`."""
    world = simulation.world
    illegal = {layer: n for layer, n in illegal_by_layer(simulation).items() if n}
    on_floor = int((world.robots.parked == 0).sum())
    orders = asked_orders(world)
    undelivered = int((orders.done == NIL).sum())
    phrases = [f"{undelivered:,} of {count(len(orders.done), 'order')} undelivered"]
    if world.rules.stop == STOP_ON_TARGETS:
        away = int((world.tally.settled == NIL).sum())
        phrases = [
            f"unsolved: {away:,} of {count(len(world.robots.cell), 'robot')} not on their targets"
        ]
    elif not undelivered:
        phrases = [f"all orders delivered, but {count(on_floor, 'robot')} not parked"]
    phrases += [f"{layer} gave {count(n, 'illegal decision')}" for layer, n in illegal.items()]
    phrases += describe_robots_down(simulation)
    phrases += describe_jam(largest_jam(world, simulation.resolved.floor_plan))
    waiting = stalled_robots(simulation, last_worked)
    if len(waiting):
        since = int(last_worked[waiting].max())
        phrases.append(
            f"{robot_names(simulation, waiting)} only waited since tick {since:,} or earlier"
        )
        phrases += describe_blockers(simulation, waiting)
        phrases += describe_wait_cycles(find_wait_cycles(world, waiting))
    elif undelivered:
        last = int(world.orders.delivered.max(initial=0))
        phrases.append(f"last delivery at tick {last:,}" if last > 0 else "nothing was delivered")
    return ", ".join(phrases)


def describe_jam(jam: Jam | None) -> list[str]:
    """Return a phrase about a jam, if any."""
    if jam is None:
        return []
    (left, top), (right, bottom) = jam.first, jam.last
    robots = f"{len(jam.robots)} robots between [{left}, {top}] and [{right}, {bottom}]"
    return [f"jam: {robots} have finished nothing for the last {jam.ticks:,} ticks"]


def robot_names(simulation: Simulation, stored: Array) -> str:
    """Robots by their identities, followed by "has" or "have": "robot 2 has"."""
    names = sorted(int(identity) for identity in simulation.world.robots.identity[stored])
    return f"robot {names[0]} has" if len(names) == 1 else f"robots {listed(names)} have"


def describe_robots_down(simulation: Simulation) -> list[str]:
    """Describe the robots that are down: failed, or without charge, and not repaired."""
    status = simulation.world.robots.status
    kinds = (
        (STATUS_FAILED, CONDITION_WORDS[STATUS_FAILED]),
        (STATUS_DEPLETED, f"an {CONDITION_WORDS[STATUS_DEPLETED]}"),
        (STATUS_REMOVED, "been towed for good"),
    )
    found = [(np.flatnonzero(status == code), what) for code, what in kinds]
    return [f"{robot_names(simulation, stored)} {what}" for stored, what in found if len(stored)]


def describe_blockers(simulation: Simulation, waiting: Array) -> list[str]:
    """Describe the robots that hold a cell for which waiting robots wait, and do not wait themselves."""
    robots, floor_plan = simulation.world.robots, simulation.resolved.floor_plan
    blocker = blockers_of(simulation.world, waiting)
    phrases = []
    for j in sorted(set(blocker.values()) - set(blocker), key=lambda j: int(robots.identity[j])):
        kept = sorted(int(robots.identity[i]) for i, other in blocker.items() if other == j)
        who = f"robot {kept[0]} waits" if len(kept) == 1 else f"robots {listed(kept)} wait"
        if robots.status[j] >= STATUS_DEPLETED:
            why = "is down"
        elif robots.goal_type[j] == GOAL_NONE and robots.load[j] == NIL:
            why = "is idle"
        else:
            why = "has work to do"
        cell = floor_plan.xy(int(robots.cell[j]))
        phrases.append(f"{who} for robot {robots.identity[j]}, which holds {cell} and {why}")
    return phrases[:MAX_NAMED_BLOCKERS]


def find_wait_cycles(world: World, last_worked: Array) -> list[tuple[int, ...]]:
    """Identities of the robots of each wait cycle, each waiting for the next, lowest identity first.

    `last_worked`: storage indices of stalled robots. A robot whose next cell has room for one robot
    waits for the robot that occupies or enters it.
    """
    blockers = blockers_of(world, last_worked)
    robots, cycles = world.robots, []
    identity, color = np.full(len(robots.cell), NIL, np.int32), np.zeros(len(robots.cell), np.int32)
    for i, blocker in blockers.items():
        identity[i] = robots.identity[blocker]
    for start in blockers:
        first = NIL if color[start] else int(walk_to_cycle(identity, robots.at_index, color, start))
        if first != NIL:
            cycle = [first]
            while blockers[cycle[-1]] != first:
                cycle.append(blockers[cycle[-1]])
            cycles.append(_identities(world, cycle))
    return sorted(cycles)


def blockers_of(world: World, last_worked: Array) -> dict[int, int]:
    """Map each of these robots to the robot that blocks its next cell, by storage indices."""
    robots, grid = world.robots, world.grid
    holder: dict[int, int] = {}
    for place in (robots.cell, robots.claim):
        held = np.flatnonzero(place != NIL)
        holder |= dict(zip(place[held].tolist(), held.tolist(), strict=True))
    blocker = {}
    for i in last_worked.tolist():
        if robots.cell[i] == NIL or robots.route_index[i] >= robots.route_length[i]:
            continue
        wanted = int(robots.cell[i] + grid.offset[robots.route[i, robots.route_index[i]]])
        if int(grid.cell_flags[wanted]) >> 5 & 3 == 1 and holder.get(wanted, i) != i:
            blocker[i] = holder[wanted]
    return blocker


def _identities(world: World, cycle: list[int]) -> tuple[int, ...]:
    names = [int(world.robots.identity[i]) for i in cycle]
    least = names.index(min(names))
    return (*names[least:], *names[:least])


class DeadlockWatch:
    """Tells whether a run can only repeat a deadlock.

    No robot has been active for `starved_ticks`, and nothing is to come that could free one: no order,
    break, gate, fault or empty battery. A strategy may count ticks until it acts, in its state or
    elsewhere; so no strategy may have been asked during that time, nor ask to be asked every few ticks.
    """

    def __init__(self) -> None:
        self._batches = b""  # of each layer
        self._asked_at = 0  # the tick of the first look with these

    def begun(self, simulation: Simulation) -> int | None:
        """Return the tick in which such a deadlock began, else None; look often."""
        world, tick, scenario = simulation.world, simulation.tick, simulation.resolved.scenario
        batches = world.tally.batches.tobytes()
        if batches != self._batches or tick < self._asked_at:
            self._batches, self._asked_at = batches, tick
        quiet_since = max(int(world.tally.active.max()), self._asked_at)
        inside = world.deadlocks.number > 0
        if not inside.any() or quiet_since > tick - starved_ticks(world):
            return None
        breaks = world.pod_stations.breaks
        may_fail = scenario.battery is not None or scenario.faults != type(scenario.faults)()
        may_open = len(world.gates.kind) > 0 or bool((breaks[:, 2] > tick).any())
        may_act = may_fail or may_open or world.rules.period.any()
        if may_act or not asked_orders(world).is_known.all():
            return None
        return int(world.deadlocks.since[inside].min())


# Detection of jams during a run. Each jam is reported once.


LOOK_TICKS: Final = RECORD_TICKS  # ticks between two checks; pauses there change no recording


class JamWatch:
    """Call `on_jam` with the tick and the jam when a jam is detected.

    A jam is detected when its robots have made no progress for `starved_ticks` (at least 500), and at
    most LOOK_TICKS later; robots that are served, or queue before a place that serves, are in none. It
    counts as the same jam as long as one of its robots makes no progress. No jam is reported while a
    robot is down on the floor and for `starved_ticks` after, since other robots wait behind it.
    """

    def __init__(self, on_jam: Callable[[int, Jam], object]) -> None:
        self._on_jam = on_jam
        self._known: set[int] = set()  # robots of jams that have been reported
        self._down_at = NIL  # tick of the last check at which a robot was down on the floor
        self._ticks = 0  # ticks without progress after which a robot counts

    def run(self, simulation: Simulation, until: int, advance: Callable[[int], None]) -> None:
        """Advance a run to tick `until` or to its end, and check for jams on the way."""
        while simulation.tick < until and not simulation.finished:
            advance(min(until, self._next_look(simulation)))
            self._look(simulation)

    def _next_look(self, simulation: Simulation) -> int:
        """Return the next multiple of LOOK_TICKS at which a robot may count as starved."""
        self._ticks = self._ticks or starved_ticks(simulation.world)
        return -(-max(self._ticks, simulation.tick + 1) // LOOK_TICKS) * LOOK_TICKS

    def _look(self, simulation: Simulation) -> None:
        world = simulation.world
        if ((world.robots.status >= STATUS_DEPLETED) & (world.robots.cell != NIL)).any():
            self._down_at = simulation.tick
        if self._down_at != NIL and simulation.tick - self._down_at < self._ticks:
            return
        stored = stuck_robots(world, self._ticks)
        starved = set(world.robots.identity[stored].tolist())
        self._known &= starved
        for jam in jams(world, simulation.resolved.floor_plan) if starved else ():
            if not self._known & set(jam.robots):
                self._on_jam(simulation.tick, jam)
            self._known |= set(jam.robots)


def note_jam(where: str, tick: int, jam: Jam) -> str:
    """Print on stderr that a run has jammed, and return it; `where`: the scenario, the run of a study."""
    sys.stdout.flush()  # keeps the order of lines if both streams go to one file
    words = f"tick {tick:,}: {describe_jam(jam)[0]}"
    print(f"automaton: {where}: {words}\n", end="", file=sys.stderr, flush=True)
    return words
