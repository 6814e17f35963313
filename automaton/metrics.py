"""The figures of a run, read off its counters: the paper's, and general ones.

Operations are what Grzejszczak & Nocon count: moves, turns, picks, drops, tries and waits (one for a
wait of any length). E_U, the share of empty runs, has three readings: by moves, by operations, and
by cycles (MOVE, TURN and WAIT without load over all active cycles).
"""

from __future__ import annotations

from typing import Any

from automaton.station_figures import balance_figures, station_figures
from automaton.tasks import Measured, task_figures
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


# Name, unit and meaning of every metric of a run, in the order in which they are shown.
GLOSSARY: dict[str, tuple[str, str]] = {
    "T_total": (
        "ticks",
        "ticks of the run: until all is delivered and every robot is parked, or until it stops",
    ),
    "T_R": ("operations", "operations per robot"),
    "T_Rtotal": ("operations", "operations of all robots"),
    "E_U_moves": ("share", "moves without load / moves"),
    "E_U_operations": ("share", "moves, turns and waits without load / operations"),
    "E_U_cycles": ("share", "ticks of moves, turns and waits without load / active ticks"),
    "delivered": ("orders", "orders at their targets"),
    "throughput": ("orders/1000 ticks", "deliveries by time"),
    "ticks_per_operation": ("ticks", "active ticks per operation"),
    "legs_per_order": ("pick-ups", "times that a delivered load was picked up"),
    "utilization": ("share", "active ticks / all robot ticks"),
    "blocked": ("share", "robot ticks lost to other robots and to illegal answers / active ticks"),
    "task_time": ("ticks", "from taking an order to its delivery, both ticks included"),
    "delay": ("ticks", "by how much the same task is shorter on an empty floor"),
    "completions": ("orders/1000 ticks", "deliveries by time and robot, after the warm-up"),
    "lost_waiting": ("ticks", "in waits before a held cell"),
    "lost_refused": ("ticks", "in retries and steps that were refused"),
    "lost_withdrawing": ("ticks", "in which a withdrawal was decided"),
    "lost_bay": ("ticks", "in the bay because the home cell was held"),
    "lost_in_line": ("ticks", "in line before a charger"),
    "lost_illegal": ("ticks", "after illegal answers of a strategy"),
    "slowed": (
        "ticks",
        "driving slowly, not waiting: what moves begun take longer, by slow zones "
        "and by chance; no part of blocked",
    ),
    "withdrawals": ("times", "withdrawals begun"),
    "lead_time": ("ticks", "from an order's becoming known to its delivery"),
    "energy": ("batteries", "energy used, in full batteries"),
    "charging": ("share", "ticks at chargers / all robot ticks"),
    "least_charge": ("share", "the emptiest battery at the end"),
    "ran_empty": ("times", "a robot stood still for want of energy"),
    "breakdowns": ("times", "a robot broke down"),
    "towed": ("times", "a robot was towed"),
    "out_of_order": ("ticks", "robots stood out of order on the floor"),
    "travel": ("cells", "driven by all robots"),
    "parts": ("parts", "worked on at the last station of their routes"),
    "part_time": ("ticks", "from a part's coming to its first station until it is finished"),
    "busiest_station": ("number", "of the station that works most"),
    "busiest": ("share", "ticks in which that station works / ticks of the run"),
    "redesigns": ("times", "new zones took effect"),
    "in_balance": ("share", "time in which zones counted as balanced / time that was watched"),
    "load_shares": (
        "orders",
        "given to the robot of another zone because zones were out of balance",
    ),
    "messages": ("messages", "that robots sent each other: bids, loads, turns"),
    "alternatives": ("times", "traffic avoidance chose another plan than that of plain A*"),
    "illegal_answers": ("times", "answers of strategies that broke a rule"),
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

    Those of tasks are there if the scenario measures tasks, `slowed` if moves may take longer. What
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
        "legs_per_order": _ratio(int(world.orders.legs[done].sum()), delivered),
        "utilization": _ratio(active, n * elapsed),
        "withdrawals": int(world.tally.times[:, WITHDRAW].sum()),
        "illegal_answers": int(world.tally.illegal.sum()),
    }
    if may_slow(world):
        figures["slowed"] = int(world.tally.slowed.sum())
    if world.orders.released.any():
        times = (world.orders.delivered - world.orders.released)[done]
        figures["lead_time"] = float(times.mean()) if delivered else 0.0
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
    slows = may_slow(world)
    rows = []
    for identity, i in enumerate(world.robots.at_index):
        figures = _shares(world.tally.times[i], ticks[i])
        active = figures.pop("active")
        if not world.rules.battery:
            del figures["lost_in_line"]
        actions = {ACTION_NAMES[a] + "s": int(world.tally.times[i, a].sum()) for a in OPERATIONS}
        row: dict[str, Any] = {"robot": identity, "operations": figures.pop("T_Rtotal")}
        row |= actions | {"utilization": _ratio(active, elapsed)} | figures
        rows.append(row | ({"slowed": int(world.tally.slowed[i])} if slows else {}))
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
