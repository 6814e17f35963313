"""Who will be where: predicted robots in each zone, tick by tick, from now to a horizon.

Counts of the zones are four ticks to a word. What a robot adds to them are its visits to zones. A
count goes up to 65,535; one that would go beyond stays there until all are forgotten.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import DERIVED, SCRATCH, Struct, field
from automaton.engine.state import NIL, Array, World
from strategies.routing.astar.route_workspace import RouteSpace, route_space

if TYPE_CHECKING:
    from strategies.routing.congestion.congestion_parameters import SharedPlans

LANES = 4  # counts in a word
LANE = 16  # bits of a count
MASK = (1 << LANE) - 1
EVERY_LANE = 0x0001000100010001
WHOLE = 1_000_000  # a robot that is in a zone all the time, where shares are predicted


class CongestionState(Struct):
    """Parameters, detours, and what a call predicts of n robots in Z zones for h ticks from now."""

    beta: int = field("int64", "what another robot in its zone costs, in thousandths of a move")
    horizon: int = field("int64", "h, at most 65,535")
    tasks_alone: int = field("int64", "1: nothing is known of the others but their tasks")
    shares: int = field("int64", "1: predicted is a share of all ticks, the same for each of them")
    detour: Array = field("(n,) int64", "1 + the goal cell to which a detour leads, or 0")
    # Plans of whole tasks stay until the task is over.
    task: Array = field("(n,) int64", "dispatched << 32 | 1 + the order that the plan is of, or 0")
    step_count: Array = field("(n,) int64", "steps of the plan")
    steps: Array = field("(n, h + 2) uint8", "one for each tick, and for work that takes none")
    # The replay of a plan:
    step: Array = field("(n,) int64", "steps begun", role=SCRATCH)
    place: Array = field("(n,) int64", "the cell in which the next step begins", role=SCRATCH)
    travel: Array = field("(n,) int64", "direction in which it comes there", role=SCRATCH)
    heading: Array = field("(n,) int64", role=SCRATCH)
    free: Array = field("(n,) int64", "tick in which the next step begins", role=SCRATCH)
    robot_type: Array = field("(n,) int64", "its type then, with a load or not", role=SCRATCH)
    in_bay: Array = field(
        "(n,) int64",
        "1: its first step begins in a parking bay; k > 1: it has left it, its step ends in k ticks",
        role=SCRATCH,
    )
    zone: Array = field("(n,) int64", "where it is counted, or NIL", role=SCRATCH)
    since: Array = field("(n,) int64", "the tick in which it came there", role=SCRATCH)
    visit_count: Array = field("(n,) int64", "visits that are counted", role=SCRATCH)
    visit_zone: Array = field("(n, h + 2) int32", role=SCRATCH)
    visit_begin: Array = field("(n, h + 2) uint16", "the first tick", role=SCRATCH)
    visit_end: Array = field("(n, h + 2) uint16", "the tick in which it is over", role=SCRATCH)
    # Of all robots; these are zero between two calls:
    counts: Array = field("(Z, words) int64", "robots in a zone, tick by tick", role=DERIVED)
    overflowed: Array = field("(1,) int64", "1: a count has overflowed", role=DERIVED)
    zone_share: Array = field("(Z,) int64", "shares of a zone, in 1 / WHOLE", role=DERIVED)
    crowd: Array = field("(Z,) int64", "robots in a zone at the tick of a replay", role=DERIVED)
    calendar: Array = field("(h,) int64", "1 + a robot whose step begins in a tick", role=DERIVED)
    link: Array = field("(n,) int64", "1 + the robot after it in the same tick", role=SCRATCH)
    # Of searches:
    arrival: Array = field("(P,) int32", "tick in which a pose is reached", role=SCRATCH)
    routes: RouteSpace


def congestion_state(view: World, parameters: SharedPlans) -> CongestionState:
    """That of a run's beginning."""
    zones = view.grid.traffic_zone_count
    return empty_state(len(view.robots.cell), zones, parameters, route_space(view.grid))


def empty_state(
    robots: int, zones: int, parameters: SharedPlans, routes: RouteSpace
) -> CongestionState:
    """The state for so many robots and zones, of which nothing is predicted."""
    horizon, poses = parameters.horizon, len(routes.came)
    return CongestionState.sized(
        {"n": robots, "Z": zones, "h": horizon, "words": -(-horizon // LANES), "P": poses},
        routes=routes,
        beta=round(1000 * parameters.beta),
        horizon=horizon,
        tasks_alone=int(parameters.forecast != "plans"),
        shares=int(parameters.forecast == "task-averages"),
    )


@kernel
def present(state, zone, tick):
    """Robots predicted in a zone at a tick; none where there is no zone, and beyond the horizon."""
    if zone == NIL or tick >= state.horizon:
        return 0
    return (state.counts[zone, tick // LANES] >> (tick % LANES * LANE)) & MASK


@kernel
def occupancy(state, zone, tick):
    """Thousandths of robots that are expected in a zone at a tick."""
    if zone != NIL and state.shares:
        return state.zone_share[zone] // (WHOLE // 1000)
    return 1000 * present(state, zone, tick)


@kernel
def add(state, zone, begin, end, sign):
    """Add `sign` to the counts of a zone from tick `begin` to before tick `end`."""
    counts = state.counts[zone]
    if state.zone.shape[0] > MASK:
        add_within_bounds(state, counts, begin, end, sign)
        return
    tick = begin
    while tick < end:
        if tick % LANES == 0 and tick + LANES <= end:
            counts[tick // LANES] += sign * EVERY_LANE
            tick += LANES
        else:
            counts[tick // LANES] += sign << (tick % LANES * LANE)
            tick += 1


@kernel
def add_within_bounds(state, counts, begin, end, sign):
    """The same with more robots than a count can hold: it must not carry into its neighbour."""
    for tick in range(begin, end):
        word, shift = tick // LANES, tick % LANES * LANE
        count = (counts[word] >> shift) & MASK
        if count == MASK or count + sign > MASK:
            counts[word] |= MASK << shift
            state.overflowed[0] = 1
        else:
            counts[word] += sign << shift


@kernel
def enter_zone(state, i, zone, tick):
    """Robot i is in `zone` from `tick` on: its visit to the zone before is over, and counted."""
    before, since = state.zone[i], state.since[i]
    if zone == before:
        return
    if before != NIL and tick > since:
        visit = state.visit_count[i]
        state.visit_zone[i, visit] = before
        state.visit_begin[i, visit] = since
        state.visit_end[i, visit] = tick
        state.visit_count[i] += 1
        add(state, before, since, tick, 1)
    state.zone[i] = zone
    state.since[i] = tick


@kernel
def forget(state, i):
    """Take robot i out of the counts."""
    for visit in range(state.visit_count[i]):
        begin, end = np.int64(state.visit_begin[i, visit]), np.int64(state.visit_end[i, visit])
        add(state, np.int64(state.visit_zone[i, visit]), begin, end, -1)
    state.visit_count[i] = 0


@kernel
def forget_all(state):
    """Leave the counts as they are found: all zero."""
    for i in range(state.zone.shape[0]):
        forget(state, i)
    if state.overflowed[0]:
        state.counts[:] = 0
        state.overflowed[0] = 0
    if state.shares:
        state.zone_share[:] = 0
