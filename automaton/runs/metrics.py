"""The metrics of a run, computed from its counters, for the fleet, each robot and each robot type.

Operations are those of Grzejszczak & Nocon: moves, turns, picks, drops, tries and waits (one for a
wait of any length). Their share of empty runs, E_U, can be read in three ways: by moves, by
operations, and by ticks (MOVE, TURN and WAIT without load over all active ticks).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from automaton.engine.state import (
    ACTION_BAY_BLOCKED,
    ACTION_BLOCKED,
    ACTION_CHARGE,
    ACTION_DELAYED,
    ACTION_DOWN,
    ACTION_DROP,
    ACTION_FOLLOWING,
    ACTION_GATE,
    ACTION_HELD_BACK,
    ACTION_IDLE,
    ACTION_ILLEGAL,
    ACTION_MOVE,
    ACTION_NAMES,
    ACTION_PICK,
    ACTION_QUEUE,
    ACTION_RETREAT,
    ACTION_SERVE,
    ACTION_STATION_QUEUE,
    ACTION_TRY_DROP,
    ACTION_TURN,
    ACTION_WAIT,
    BATTERY_FULL,
    FAILURE_DEPLETED,
    FAILURE_FAULT,
    FAILURE_TOWED,
    FOLLOWING_CONVOY,
    LAYER_NAMES,
    NIL,
    ORDER_DELIVERED,
    PURPOSE_ASIDE,
    PURPOSE_CHARGER,
    PURPOSE_MAKING_WAY,
    PURPOSE_ORDER,
    STOP_ON_TARGETS,
    Array,
    World,
)
from automaton.runs.metric_catalogue import METRIC_CATALOGUE as METRIC_CATALOGUE
from automaton.runs.metric_catalogue import time_shares as time_shares
from automaton.runs.metric_sums import LOST_TICK_SUMS, metric
from automaton.runs.progress import asked_orders, has_lines, oldest_order, starved_robots
from automaton.runs.task_metrics import (
    FinishedTasks,
    Measured,
    lead_times,
    quantile,
    summed,
    sums_of_detours,
    sums_of_due_times,
    tardiness_quantiles,
    tasks_after,
)

OPERATION_STATES = [
    *(ACTION_MOVE, ACTION_TURN, ACTION_PICK, ACTION_DROP, ACTION_TRY_DROP, ACTION_WAIT),
    ACTION_SERVE,
]
ACTIVE = [*range(ACTION_IDLE + 1, ACTION_DOWN), ACTION_SERVE]  # a stop is work, like a pick
DRIVING = [ACTION_MOVE, ACTION_TURN, ACTION_WAIT]  # operations that an empty run consists of
LOST_IN = {  # metric: action
    "lost_waiting": ACTION_WAIT,
    "lost_refused": ACTION_BLOCKED,
    "lost_retreating": ACTION_RETREAT,
    "lost_leaving_bay": ACTION_BAY_BLOCKED,
    "lost_held_back": ACTION_HELD_BACK,
    "lost_at_gates": ACTION_GATE,
    "lost_following": ACTION_FOLLOWING,
    "lost_station_queue": ACTION_STATION_QUEUE,
    "lost_illegal": ACTION_ILLEGAL,
}
LOST_TO_CHARGERS = [*LOST_IN.values(), ACTION_QUEUE]
ENGAGED = [*ACTIVE, ACTION_STATION_QUEUE, ACTION_HELD_BACK, ACTION_GATE, ACTION_FOLLOWING]
WORK = [ACTION_PICK, ACTION_DROP, ACTION_TRY_DROP, ACTION_SERVE]
DRIVES = [ACTION_MOVE, ACTION_TURN]
SHARES = (
    "empty_moves_share",
    "empty_operations_share",
    "empty_ticks_share",
    "ticks_per_operation",
    "blocked_share",
)
BALANCE = ("ticks_in_balance", "ticks_watched")  # counted by zoning, reported as balanced_share


class Counted(NamedTuple):
    """The counters of a run up to a tick."""

    tick: int
    sums: dict[
        str, int
    ]  # by the names of automaton.runs.metric_sums, without the sums of orders and parts
    actions: Array  # (A,) int64: robot ticks spent in each action
    # By station and by charger, int64: ticks of work, and robot ticks lost in the queue.
    station_busy: Array
    station_queue: Array
    charger_busy: Array  # robot ticks: several robots may charge at once
    charger_queue: Array
    undone: int  # robot ticks of moves that were undone by now
    undone_late: int  # of these, moves from the last period on whose undone moves are counted apart
    period: int  # time_use.period

    def none(self) -> Counted:
        """What had been counted at the start."""
        nothing = {name: np.zeros_like(getattr(self, name)) for name in self._fields[2:-3]}
        return self._replace(tick=0, sums={}, undone=0, undone_late=0, period=-1, **nothing)


def executed_ticks(world: World) -> Array:
    """(n, A, 2): ticks spent in each action, without the remaining ticks of unfinished operations."""
    ticks: Array = world.tally.ticks.copy()
    for robots, actions, loads, remaining in under_way(world):
        ticks[robots, actions, loads] -= remaining
    return ticks


def fleet_ticks(world: World) -> Array:
    """(A, 2): the same ticks as `executed_ticks`, summed over all robots."""
    ticks: Array = world.tally.ticks.sum(0)
    for _, actions, loads, remaining in under_way(world):
        np.subtract.at(ticks, (actions, loads), remaining)
    return ticks


class Uses(NamedTuple):
    """What robots used ticks for besides orders; of each robot, or of all together."""

    to_charger: Array  # (..., A): on the way to a charger, by action
    aside: Array  # moves and turns without an order or a charger
    making_way: Array  # moves and turns for an order that were undone


def uses_of_time(world: World) -> Uses:
    """What each robot used ticks for, without what the operations under way still need."""
    use = world.time_use
    uses = Uses(use.to_charger.copy(), use.aside.copy(), use.making_way.copy())
    turned = use.turned.astype(np.int64)
    for robots, actions, _, remaining in under_way(world):
        purpose = use.purpose[robots]
        for number, total in (
            (PURPOSE_ASIDE, uses.aside),
            (PURPOSE_MAKING_WAY, uses.making_way),
        ):
            mine = (purpose == number) & np.isin(actions, DRIVES)
            total[robots[mine]] -= remaining[mine]
        turning = (purpose == PURPOSE_ORDER) & (actions == ACTION_TURN)
        turned[robots[turning]] -= remaining[turning]
        mine = purpose == PURPOSE_CHARGER
        uses.to_charger[robots[mine], actions[mine]] -= remaining[mine]
    uses.making_way[:] += np.maximum(turned - needed_turns(world), 0)
    return uses


def needed_turns(world: World) -> Array:
    """(n,) ticks in which each robot can turn to its heading from that after its last move."""
    robots = world.robots
    headings = world.grid.type_headings[robots.type].astype(np.int64)
    change = (robots.heading.astype(np.int64) - world.time_use.turned_from) & (headings - 1)
    ticks = world.rules.duration[robots.type, ACTION_TURN].astype(np.int64)
    needed: Array = np.minimum(change, headings - change) * ticks
    return needed


def under_way(world: World) -> list[tuple[Array, Array, Array, Array]]:
    """The robots with an unfinished operation, its action, whether they are loaded, and its ticks left.

    Under convoy a second row holds the ticks that moves still lose to the robot ahead.
    """
    robots = world.robots
    busy = np.flatnonzero(robots.busy > 0)
    actions, loads = robots.action[busy], (robots.load[busy] != NIL).astype(np.int64)
    left = robots.busy[busy].astype(np.int64)
    if not _follows(world):
        return [(busy, actions, loads, left)]
    own = np.where(actions == ACTION_MOVE, np.minimum(left, world.traffic.own_ticks[busy]), left)
    following = np.full_like(actions, ACTION_FOLLOWING)
    return [(busy, actions, loads, own), (busy, following, loads, left - own)]


def _follows(world: World) -> bool:
    """Whether moves may last longer because of the robot ahead, or did before a change of rules."""
    is_convoy = world.rules.following == FOLLOWING_CONVOY
    return bool(is_convoy or world.tally.ticks[:, ACTION_FOLLOWING].any())


def counted(run: Measured) -> Counted:
    """The counters of a run so far, without those that it does not measure."""
    world = run.world
    tally, rules, out = world.tally, world.rules, world.tally.failures.sum(0)
    times, ticks = tally.operations.sum(0), fleet_ticks(world)
    uses = uses_of_time(world)
    sums = _of_actions(times, ticks, Uses(*(use.sum(0) for use in uses)))
    sums |= {
        "deadlocks": int(world.deadlocks.count.total),
        "deadlock_time": int(world.deadlocks.count.robot_ticks),
    }
    for name in _not_lost(world):
        del sums[name]
    sums |= {
        "retreats": int(times[ACTION_RETREAT].sum()),
        "illegal_answers": int(tally.illegal.sum()),
    }
    if may_slow(world):
        sums["slowdown_ticks"] = int(tally.slowdown_ticks.sum())
    if run.resolved.scenario.units.cell is not None:
        sums["distance"] = sums["moves"]
    if rules.battery:
        sums |= {
            "charge": int(tally.energy_used.sum()),
            "charging": int(ticks[ACTION_CHARGE].sum()),
        }
        sums |= {
            "battery_depletions": int(out[FAILURE_DEPLETED]),
            "repaired": int(tally.repaired.sum()),
        }
    if rules.may_fail:
        sums |= {"breakdowns": int(out[FAILURE_FAULT]), "towed": int(out[FAILURE_TOWED])}
        sums["downtime"] = int(ticks[ACTION_DOWN].sum())
    if len(world.delays.until):
        sums["delayed"] = int(world.delays.lasted.sum())
    found = {**dict(run.counted), **sums}
    pods, jobs = world.pod_stations, busy_ticks(world)
    has_parts = len(world.stations.part) > 0
    chargers = len(world.chargers.cell) if rules.battery else 0
    return Counted(
        int(world.clock.tick),
        found,
        ticks.sum(1),
        jobs if has_parts else pods.served_ticks.copy(),
        np.zeros_like(jobs) if has_parts else pods.queue_ticks.copy(),
        world.chargers.busy_ticks[:chargers].copy(),
        world.chargers.queue_ticks[:chargers].copy(),
        int(world.time_use.undone.sum()),
        int(world.time_use.undone[-1]),
        int(world.time_use.period[0]),
    )


def metrics_of(run: Measured, since: Counted | None = None) -> dict[str, float | int]:
    """All metrics of the fleet by the names of METRIC_CATALOGUE; all but makespan count from `since`.

    Metrics that were not measured are absent, not 0: task metrics unless the scenario measures
    tasks, `slowdown_ticks` unless moves may take longer, and times of tasks, orders and parts until
    one has ended. Counters of strategies have the names that strategies give them; names that are
    not in METRIC_CATALOGUE come last.
    """
    world, now = run.world, counted(run)
    begin = 0 if since is None else since.tick
    before = {} if since is None else since.sums
    n = len(world.robots.cell)
    sums = {name: value - before.get(name, 0) for name, value in now.sums.items()}
    sums |= _of_stretch(n, now.tick - begin)
    borders = np.array([begin, now.tick])
    of_parts = sums_of_parts(world, borders)
    for found in (sums_of_orders(world, borders), sums_of_detours(run, borders), of_parts):
        sums |= {name: int(value[0]) for name, value in found.items()}
    figures: dict[str, float | int] = {"makespan": now.tick} if world.clock.finished else {}
    if world.clock.finished and world.rules.stop == STOP_ON_TARGETS:
        arrivals = world.tally.settled
        figures |= {"makespan": int(arrivals.max()), "sum_of_costs": int(arrivals.sum())}
    measure = run.resolved.scenario.measure
    if measure is not None:
        tasks = tasks_after(run, measure.warm_up)
        sums |= _of_tasks(world, tasks, n, measure.warm_up)
        if len(tasks.begun):
            figures["delay_p95"] = quantile(tasks.delays, 95)
    if "timed" in sums:
        figures |= lead_times(world, begin)
    if "due_orders" in sums:
        figures |= tardiness_quantiles(world, begin)
    if world.deadlocks.count.longest:
        figures["longest_standstill"] = int(world.deadlocks.count.longest)
    figures["oldest_order"] = oldest_order(world)
    figures["starved_robots"] = len(starved_robots(world))
    if world.rules.battery:
        figures["min_charge"] = float(world.robots.charge.min() / BATTERY_FULL)
    if len(world.stations.part):
        busy = now.station_busy - (0 if since is None else since.station_busy)
        figures["busiest_station"] = (most := int(np.argmax(busy))) + 1
        figures["busiest_station_utilization"] = float(busy[most]) / max(1, now.tick - begin)
    others = [name for name in now.sums if name in run.counted and name not in METRIC_CATALOGUE]
    if set(BALANCE) <= set(others):
        others = [name for name in others if name not in BALANCE]
    for name in (*METRIC_CATALOGUE, *others):
        value = metric(name, sums)
        if value is not None:
            figures[name] = value
    listed = (name for name in (*METRIC_CATALOGUE, *others) if name in figures)
    return named_for(run, {name: figures[name] for name in listed})


def named_for(run: Measured, figures: dict[str, Any]) -> dict[str, Any]:
    """Figures by the names of metrics; why robots of an observed run stand is not known."""
    if run.resolved.observed and "lost_refused" in figures:
        figures["lost_standing"] = figures.pop("lost_refused")
    return figures


def _of_stretch(robots: int, ticks: int) -> dict[str, int]:
    return {"robots": robots, "ticks": ticks, "robot_ticks": robots * ticks}


def _of_tasks(world: World, tasks: FinishedTasks, robots: int, warm_up: int) -> dict[str, int]:
    """The sums of tasks taken after the warm-up, and of orders delivered after it."""
    orders, after = world.orders, max(0, int(world.clock.tick) - warm_up)
    completed = (orders.state == ORDER_DELIVERED) & (orders.delivered > warm_up)
    return {
        **{name: int(value.sum()) for name, value in tasks.sums.items()},
        "completed": int(np.count_nonzero(completed)),
        "watched_robot_ticks": robots * after,
    }


def sums_of_orders(world: World, borders: Array) -> dict[str, Array]:
    """Sums of the orders delivered in each stretch between ascending borders in ticks.

    Each array is (borders - 1,): number of orders, legs, lead times if orders arrive over time, and
    late orders and tardiness if they have due times.
    """
    orders = asked_orders(world)
    done = np.flatnonzero(orders.done != NIL)
    at = np.maximum(orders.done[done], 1)  # ticks count from 1
    sums = {"delivered": summed(at, np.ones(len(done)), borders)}
    if has_lines(world):
        sums |= sums_of_lines(world, borders)
    else:
        sums["legs"] = summed(at, world.orders.legs[done], borders)
    if orders.release.any():
        times = orders.done[done] - orders.release[done]
        sums |= {"timed": sums["delivered"], "lead_times": summed(at, times, borders)}
    return sums | sums_of_due_times(world, borders)


def sums_of_lines(world: World, borders: Array) -> dict[str, Array]:
    """Numbers of lines, pod visits and trips done in each stretch between borders.

    Also the number of times that a pod was stored in another cell than the one it was lifted from.
    """
    lines, orders, visits = world.lines, world.orders, world.stops
    ticks = lines.done[lines.done != NIL], visits.done[visits.done != NIL]
    stored = orders.state == ORDER_DELIVERED
    moved = stored & (orders.current_slot != orders.source)
    ends = (*ticks, orders.delivered[stored], orders.delivered[moved])
    names = ("lines_done", "visits", "trips", "pod_moves")
    return {
        name: summed(np.maximum(at, 1), np.ones(len(at)), borders)
        for name, at in zip(names, ends, strict=True)
    }


def may_slow(world: World) -> bool:
    """Whether moves may take longer than their duration, or did so before a change of rules."""
    rules, is_limited = world.rules, len(world.grid.min_move_ticks) > 0
    slows = rules.slowdown or rules.extra_tick or is_limited
    return bool(slows or world.tally.slowdown_ticks.any())


def _not_lost(world: World) -> list[str]:
    """The metrics of lost ticks that do not apply to a run."""
    absent = {
        "lost_charger_queue": not world.rules.battery,
        "lost_station_queue": not (has_lines(world) or _has_queues(world)),
        "lost_held_back": not world.rules.steered[0],
        "lost_at_gates": not len(world.gates.kind),
        "lost_following": not _follows(world),
    }
    return [name for name, is_absent in absent.items() if is_absent]


def _has_queues(world: World) -> bool:
    """Whether stations for pods have queues."""
    return bool((world.pod_stations.queue_at != NIL).any())


# What robot time is used for, beside LOST_TICK_SUMS: sums, and what they are.
def uses_of_run(run: Measured) -> dict[str, int]:
    """Robot ticks by what they were used for (names of TIME_USES), which add up to those of the run."""
    now, world = counted(run), run.world
    ticks, to_charger = fleet_ticks(world), uses_of_time(world).to_charger.sum(0)
    turns = int(ticks[ACTION_TURN].sum() - to_charger[ACTION_TURN])
    empty = int(ticks[ACTION_MOVE, 0] - to_charger[ACTION_MOVE])
    handling = int(ticks[WORK].sum())
    # Undone and aimless ways are counted without their actions: they are taken from all in proportion.
    without_order = scaled((empty, turns), empty + turns - now.sums["driving_aside"])
    ways = scaled((int(ticks[ACTION_MOVE, 1]), *without_order), now.sums["on_orders"] - handling)
    uses = dict(zip(("driving_loaded", "driving_empty", "turning"), ways, strict=True))
    uses["handling"] = handling
    uses |= {name: now.sums[name] for name in LOST_TICK_SUMS if name in now.sums}
    uses["charging"] = int(now.actions[ACTION_CHARGE])
    uses |= {name: now.sums[name] for name in ("driving_to_chargers", "driving_aside")}
    uses |= {"down": int(now.actions[ACTION_DOWN]), "delayed": int(now.actions[ACTION_DELAYED])}
    uses["idle"] = now.tick * len(world.robots.cell) - sum(uses.values())
    return named_for(run, uses)


def scaled(parts: Sequence[int], total: int) -> list[int]:
    """Whole numbers in the proportion of `parts` that add up to a total."""
    all_parts = max(sum(parts), 1)
    sums = [round(total * sum(parts[: at + 1]) / all_parts) for at in range(len(parts))]
    return [after - before for before, after in pairwise((0, *sums))]


def metrics_by_robot(run: Measured) -> list[dict[str, Any]]:
    """Operations, lost ticks and utilization of each robot, in the order of identities.

    A row has `slowdown_ticks` if moves may take longer, `lost_charger_queue` if robots have batteries,
    `lost_station_queue` if they carry pods for lines or to queues, `lost_held_back` if right of way
    steers them, `lost_at_gates` if the floor has gates, and `lost_following` if robots follow each
    other in moves of several ticks.
    """
    world = run.world
    elapsed = int(world.clock.tick)
    ticks, uses = executed_ticks(world), uses_of_time(world)
    slows, names = may_slow(world), type_names(run)
    rows = []
    for identity, i in enumerate(world.robots.at_index):
        figures = _shares(world.tally.operations[i], ticks[i], Uses(*(use[i] for use in uses)))
        on_orders = figures.pop("on_orders")
        for name in _not_lost(world):
            del figures[name]
        figures = named_for(run, figures)
        actions = {
            ACTION_NAMES[a] + "s": int(world.tally.operations[i, a].sum())
            for a in OPERATION_STATES
            if a != ACTION_SERVE or world.stops.ticks.any() or len(world.pods.slot)
        }
        row: dict[str, Any] = {"robot": identity}
        if names:
            row["type"] = names[run.resolved.fleet.type_of[identity]]
        row |= {"operations": figures.pop("operations")}
        row |= actions | {"utilization": _ratio(on_orders, elapsed)} | figures
        rows.append(row | ({"slowdown_ticks": int(world.tally.slowdown_ticks[i])} if slows else {}))
    return rows


def type_names(run: Measured) -> list[str]:
    """The names of the robot types; none if all robots are alike."""
    return [kind.name for kind in run.resolved.scenario.fleet.types]


def metrics_by_type(run: Measured) -> list[dict[str, Any]]:
    """Number of robots, deliveries, ticks by action and utilization of each robot type.

    A delivery counts for the type of the robot that last took the order.
    """
    world, ticks = run.world, executed_ticks(run.world)
    uses = uses_of_time(world)
    done = world.orders.dispatched_type[world.orders.state == ORDER_DELIVERED]
    rows = []
    for number, kind in enumerate(run.resolved.scenario.fleet.types):
        mine = run.resolved.fleet.type_of[world.robots.identity] == number
        spent = {
            ACTION_NAMES[a]: int(ticks[mine, a].sum())
            for a in (ACTION_MOVE, ACTION_TURN, ACTION_PICK, ACTION_DROP)
        }
        on_orders = on_orders_of(ticks[mine].sum(0), Uses(*(use[mine].sum(0) for use in uses)))
        row = {
            "type": kind.name,
            "robots": int(mine.sum()),
            "move_time_factor": kind.move_time_factor,
        }
        row |= {"payload": kind.payload, "delivered": int((done == number).sum())}
        row |= {f"{name}_ticks": total for name, total in spent.items()}
        share = _ratio(on_orders, mine.sum() * int(world.clock.tick))
        rows.append(row | {"utilization": share})
    return rows


def illegal_by_layer(run: Measured) -> dict[str, int]:
    """Number of illegal decisions of each layer's strategy."""
    return dict(zip(LAYER_NAMES, (int(count) for count in run.world.tally.illegal), strict=True))


def _shares(times: Array, ticks: Array, uses: Uses) -> dict[str, float | int]:
    """Metrics from (A, 2) counts of operations and of ticks; [:, 0] is without load."""
    sums = _of_actions(times, ticks, uses)
    figures: dict[str, float | int] = {"operations": sums["operations"]}
    figures |= {name: float(metric(name, sums) or 0.0) for name in SHARES}
    return figures | {name: sums[name] for name in ("on_orders", *LOST_TICK_SUMS)}


def _of_actions(times: Array, ticks: Array, uses: Uses) -> dict[str, int]:
    """Sum (A, 2) counts of operations and of ticks, as metric_sums names them; [:, 0] is without load."""
    lost = {
        name: int(ticks[action].sum() - uses.to_charger[action]) for name, action in LOST_IN.items()
    }
    return {
        "operations": int(times[OPERATION_STATES].sum()),
        "moves": int(times[ACTION_MOVE].sum()),
        "empty_moves": int(times[ACTION_MOVE, 0]),
        "empty_driving": int(times[DRIVING, 0].sum()),
        "empty_driving_ticks": int(ticks[DRIVING, 0].sum()),
        "active": int(ticks[ACTIVE].sum()),
        "engaged": int(ticks[ENGAGED].sum()),
        "on_orders": on_orders_of(ticks, uses),
        "driving_to_chargers": int(uses.to_charger[DRIVES].sum()),
        "driving_aside": int(uses.aside),
        **lost,
        "lost_charger_queue": int(uses.to_charger[LOST_TO_CHARGERS].sum()),
        "lost_making_way": int(uses.making_way),
    }


def on_orders_of(ticks: Array, uses: Uses) -> int:
    """Of (A, 2) ticks those spent on orders: work, and ways that are not undone."""
    ways = ticks[DRIVES].sum() - uses.to_charger[DRIVES].sum() - uses.aside - uses.making_way
    return int(ticks[WORK].sum() + ways)


def _ratio(part: Any, whole: Any) -> float:
    return float(part) / float(whole) if whole else 0.0


def sums_of_parts(world: World, borders: Array) -> dict[str, Array]:
    """Number and flow times of the parts finished in each stretch between borders.

    Empty without parts.
    """
    stations = world.stations
    if not len(stations.part):
        return {}
    ended = np.flatnonzero((stations.releases_order == NIL) & (stations.completion_tick != NIL))
    begun = np.full(int(stations.part.max()) + 1, NIL, np.int64)
    begun[stations.part[stations.part_arrivals]] = stations.arrival_tick[stations.part_arrivals]
    at = stations.completion_tick[ended]
    took = at - begun[stations.part[ended]]
    return {
        "parts_finished": summed(at, np.ones(len(at)), borders),
        "part_flow_times": summed(at, took, borders),
    }


def busy_ticks(world: World) -> Array:
    """(k,) ticks in which each station worked, including its current job."""
    stations, now = world.stations, int(world.clock.tick)
    ended = np.flatnonzero(stations.completion_tick != NIL)
    count = len(stations.slot)
    busy = np.bincount(stations.station[ended], stations.processing_time[ended], count).astype(
        np.int64
    )
    working = np.flatnonzero(stations.in_service != NIL)
    since = stations.job_done_tick[working] - stations.processing_time[stations.in_service[working]]
    busy[working] += np.maximum(0, now - since)
    return busy
