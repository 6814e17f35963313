"""The figures of a run, read off its counters: the paper's, and general ones.

Operations are what Grzejszczak & Nocon count: moves, turns, picks, drops, tries and waits (one for a
wait of any length). E_U, the share of empty runs, has three readings: by moves, by operations, and
by cycles (MOVE, TURN and WAIT without load over all active cycles).
"""

from __future__ import annotations

from typing import Any

from automaton.glossary import GLOSSARY as GLOSSARY
from automaton.station_figures import balance_figures, station_figures
from automaton.tasks import Measured, quantile_95, task_figures
from automaton.world.condition import BROKE_DOWN, FULL, RAN_EMPTY, WAS_TOWED
from automaton.world.state import (
    ACTION_NAMES,
    BAY_BLOCKED,
    BLOCKED,
    CHARGE,
    DELIVERED,
    DROP,
    ILLEGAL,
    IN_LINE,
    LAYERS,
    MOVE,
    NIL,
    OUT_OF_ORDER,
    PICK,
    TICK,
    TRY_DROP,
    TURN,
    WAIT,
    WITHDRAW,
    Array,
    World,
)

OPERATIONS = [MOVE, TURN, PICK, DROP, TRY_DROP, WAIT]
DRIVING = [MOVE, TURN, WAIT]  # what can be an empty run
LOST = {
    "waiting": WAIT,
    "refused": BLOCKED,
    "withdrawing": WITHDRAW,
    "bay": BAY_BLOCKED,
    "in_line": IN_LINE,
    "illegal": ILLEGAL,
}


def executed_ticks(world: World) -> Array:
    """(n, A, 2): ticks spent in each action, without what the operations under way still need."""
    ticks: Array = world.tally.ticks.copy()
    robots = world.robots
    for i in (robots.busy > 0).nonzero()[0]:
        ticks[i, robots.action[i], int(robots.load[i] != NIL)] -= robots.busy[i]
    return ticks


def metrics_of(run: Measured) -> dict[str, float | int]:
    """All metrics of the fleet, by the names of GLOSSARY.

    Those of tasks are there if the scenario measures tasks, `slowed` if moves may take longer; times
    of tasks, orders and parts are there once one has ended: what was not measured is not 0. What
    strategies count themselves comes under the names that they give it, those unknown here last.
    """
    world = run.world
    elapsed = int(world.clock[TICK])
    figures = _shares(world.tally.times.sum(0), executed_ticks(world).sum(0))
    n = len(world.robots.cell)
    done = world.orders.state == DELIVERED
    delivered = int(done.sum())
    active = figures.pop("active")
    if not world.rules.battery:
        del figures["lost_in_line"]
    figures |= {
        "T_total": elapsed,
        "T_R": figures["T_Rtotal"] / n,
        "delivered": delivered,
        "throughput": _ratio(1000 * delivered, elapsed),
        "utilization": _ratio(active, n * elapsed),
        "withdrawals": int(world.tally.times[:, WITHDRAW].sum()),
        "illegal_answers": int(world.tally.illegal.sum()),
    }
    if may_slow(world):
        figures["slowed"] = int(world.tally.slowed.sum())
    if delivered:
        figures["legs_per_order"] = int(world.orders.legs[done].sum()) / delivered
    if delivered and world.orders.released.any():
        times = (world.orders.delivered - world.orders.released)[done]
        figures["lead_time"] = float(times.mean())
        figures["lead_time_p95"] = quantile_95(times)
    figures |= energy_figures(world, elapsed)
    figures |= task_figures(run)
    figures |= station_figures(world)
    if run.resolved.scenario.units.cell is not None:
        figures["travel"] = int(world.tally.times[:, MOVE].sum())
    counted = balance_figures(dict(run.counted))
    figures = {**counted, **figures}
    others = [name for name in counted if name not in GLOSSARY]
    return {name: figures[name] for name in (*GLOSSARY, *others) if name in figures}


def energy_figures(world: World, elapsed: int) -> dict[str, float | int]:
    """What batteries and faults add to the metrics: nothing where there are none."""
    tally, out = world.tally, world.tally.out.sum(0)
    figures: dict[str, float | int] = {}
    if world.rules.battery:
        figures |= {
            "energy": float(tally.spent.sum() / FULL),
            "charging": _ratio(tally.ticks[:, CHARGE].sum(), len(tally.spent) * elapsed),
            "least_charge": float(world.robots.charge.min() / FULL),
            "ran_empty": int(out[RAN_EMPTY]),
        }
    if world.rules.may_fail:
        figures |= {
            "breakdowns": int(out[BROKE_DOWN]),
            "towed": int(out[WAS_TOWED]),
            "out_of_order": int(tally.ticks[:, OUT_OF_ORDER].sum()),
        }
    return figures


def may_slow(world: World) -> bool:
    """Whether moves may take longer than their duration, or did so before the rules were changed."""
    rules = world.rules
    return bool(rules.slowdown or rules.extra_tick or world.tally.slowed.any())


def metrics_by_robot(run: Measured) -> list[dict[str, Any]]:
    """For each robot, in the order of identities: operations, lost ticks, utilization.

    `slowed` is there if moves may take longer, `lost_in_line` if robots run on batteries.
    """
    world = run.world
    elapsed = int(world.clock[TICK])
    ticks = executed_ticks(world)
    slows, names = may_slow(world), type_names(run)
    rows = []
    for identity, i in enumerate(world.robots.at_index):
        figures = _shares(world.tally.times[i], ticks[i])
        active = figures.pop("active")
        if not world.rules.battery:
            del figures["lost_in_line"]
        actions = {ACTION_NAMES[a] + "s": int(world.tally.times[i, a].sum()) for a in OPERATIONS}
        row: dict[str, Any] = {"robot": identity}
        if names:
            row["type"] = names[world.robots.type[i]]
        row |= {"operations": figures.pop("T_Rtotal")}
        row |= actions | {"utilization": _ratio(active, elapsed)} | figures
        rows.append(row | ({"slowed": int(world.tally.slowed[i])} if slows else {}))
    return rows


def type_names(run: Measured) -> list[str]:
    """The names of the types of robots; none where all are alike."""
    return [kind.name for kind in run.resolved.scenario.fleet.types]


def metrics_by_type(run: Measured) -> list[dict[str, Any]]:
    """For each type of robots: how many, what they delivered, and the ticks of what they did.

    A delivery counts for the type of the robot that took the order last.
    """
    world, ticks = run.world, executed_ticks(run.world)
    done = world.orders.dispatched_type[world.orders.state == DELIVERED]
    rows = []
    for number, kind in enumerate(run.resolved.scenario.fleet.types):
        mine = world.robots.type == number
        spent = {ACTION_NAMES[a]: int(ticks[mine, a].sum()) for a in (MOVE, TURN, PICK, DROP)}
        active = int(ticks[mine, 1:OUT_OF_ORDER].sum())
        row = {"type": kind.name, "robots": int(mine.sum()), "pace": kind.pace}
        row |= {"payload": kind.payload, "delivered": int((done == number).sum())}
        row |= {f"{name}_ticks": total for name, total in spent.items()}
        share = _ratio(active, mine.sum() * int(world.clock[TICK]))
        rows.append(row | {"utilization": share})
    return rows


def illegal_by_layer(run: Measured) -> dict[str, int]:
    """Illegal answers that each layer's strategy gave."""
    return dict(zip(LAYERS, (int(count) for count in run.world.tally.illegal), strict=True))


def _shares(times: Array, ticks: Array) -> dict[str, float | int]:
    """Figures from (A, 2) counts of operations and of ticks; [:, 0] is without load."""
    operations = int(times[OPERATIONS].sum())
    active = int(ticks[1:OUT_OF_ORDER].sum())
    lost = {f"lost_{cause}": int(ticks[action].sum()) for cause, action in LOST.items()}
    return {
        "T_Rtotal": operations,
        "E_U_moves": _ratio(times[MOVE, 0], times[MOVE].sum()),
        "E_U_operations": _ratio(times[DRIVING, 0].sum(), operations),
        "E_U_cycles": _ratio(ticks[DRIVING, 0].sum(), active),
        "ticks_per_operation": _ratio(active, operations),
        "blocked": _ratio(sum(lost.values()), active),
        "active": active,
        **lost,
    }


def _ratio(part: Any, whole: Any) -> float:
    return float(part) / float(whole) if whole else 0.0
