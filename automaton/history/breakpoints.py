"""Breakpoints: conditions on the state after a tick at which a run stops.

deadlock           a wait cycle has lasted 64 ticks
wait cycle         a wait cycle has closed
delivered [7]      a load (load 7) was delivered
zones redesigned   stations moved to another service zone
stalled > 50       a robot has waited for more than 50 ticks
loaded and x > 3   any condition on one robot, with the names in FIELDS
battery < 20       likewise; also queueing, charging, empty, broken
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.engine.observation import (
    CAUSE_REDUCED_SPEED,
    CAUSES,
    DEADLOCK_TICKS,
    Observation,
    is_waiting,
    waited_ticks,
)
from automaton.engine.robot_states import is_charging, is_queueing
from automaton.engine.state import (
    ACTION_NAMES,
    BATTERY_PERCENT,
    NIL,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_TOWED,
    Array,
    Robots,
)
from automaton.errors import InputError, nearest
from automaton.floor.floor_plan import FloorPlan
from automaton.history.snapshot import FleetSnapshot, Snapshot
from automaton.runs.simulation import Simulation

WAIT_CAUSE_CODES: Final = {
    cause.name: code for code, cause in enumerate(CAUSES) if code != CAUSE_REDUCED_SPEED
}
FIELDS: Final = {  # name: meaning for a robot
    "robot": "number of the robot",
    "x": "column of the robot's cell",
    "y": "row of the robot's cell",
    "loaded": "whether the robot carries a load",
    "load": "load that the robot carries, or -1",
    "order": "order that the robot works on, or -1",
    "waiting": "ticks that the robot has waited; 0 if it does not wait",
    "slowdown_ticks": "extra ticks of the moves so far, in slow zones and by chance",
    "cause": "why the robot waits: " + ", ".join(f"'{name}'" for name in WAIT_CAUSE_CODES),
    "action": "what the robot does: " + ", ".join(f"'{name}'" for name in ACTION_NAMES),
    "busy": "ticks until the robot is free",
    "parked": "whether the robot is parked",
    "zone": "zone that the robot serves, counted from 1; 0: none",
    "priority": "priority of the robot",
    "steps": "remaining cells of the route",
    "battery": "battery charge in percent; 100 without batteries",
    "charging": "whether the robot charges",
    "queueing": "whether the robot queues for a charger",
    "empty": "whether the robot is down without charge",
    "broken": "whether the robot is down because of a fault",
    "towed": "whether the robot was towed and is not back yet",
    "ahead": "number of orders in the announced plan",
}
CONDITION_NAMES: Final = (*FIELDS, "deadlock", "delivered", "stalled", "zones redesigned")
MAX_CONDITION_LENGTH: Final = 200  # characters
NAMED_VALUES: Final = {
    "cause": WAIT_CAUSE_CODES,
    "action": {name: code for code, name in enumerate(ACTION_NAMES)},
}
COMPARISONS: Final[Mapping[type[ast.cmpop], Callable[[Any, Any], Any]]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}


class Breakpoint(NamedTuple):
    """One condition; `test` returns the robots for which it holds now."""

    text: str
    test: Callable[[Simulation, FloorPlan], Array]  # identities; empty if it does not hold


def breakpoint_of(text: str) -> Breakpoint:
    """Read a breakpoint. Raises InputError that states what is allowed."""
    words = " ".join(text.split())
    if len(words) > MAX_CONDITION_LENGTH:
        raise InputError(_too_long(words))
    if words == "deadlock":
        return Breakpoint(words, lambda run, plan: _members(run, _new_deadlocks(run)))
    if words == "wait cycle":
        return Breakpoint(
            words, lambda run, plan: _members(run, run.observation.wait_cycle_ticks == 1)
        )
    if words == "zones redesigned":
        return Breakpoint(words, lambda run, plan: _redesigned(run))
    delivered = re.fullmatch(r"delivered(?: (\d+))?", words)
    if delivered:
        load = None if delivered[1] is None else int(delivered[1])
        return Breakpoint(words, lambda run, plan: _delivering(run, load))
    stalled = re.fullmatch(r"stalled ?> ?(\d+)", words)
    return Breakpoint(words, _predicate(f"waiting > {stalled[1]}" if stalled else words))


def _members(run: Simulation, mask: Array) -> Array:
    identities: Array = run.world.robots.identity[np.flatnonzero(mask)]
    return identities


def _new_deadlocks(run: Simulation) -> Array:
    """(n,) bool: robots whose deadlock was found in the last tick."""
    deadlocks = run.world.deadlocks
    is_new: Array = (deadlocks.number > 0) & (deadlocks.found_at == run.world.clock.tick)
    return is_new


def _redesigned(run: Simulation) -> Array:
    """Robots whose zones gained or lost stations in the last tick."""
    zones = np.flatnonzero(run.observation.reshaped == run.world.clock.tick)
    servers: Array = run.world.service_zones.server[zones]
    return np.unique(servers[servers != NIL])


def _delivering(run: Simulation, load: int | None) -> Array:
    """Robots that delivered in the last tick."""
    orders, given = run.world.orders, run.observation.dropped
    done = (given != NIL) & (orders.delivered[given] == run.world.clock.tick)
    return _members(run, done if load is None else done & (given == load))


def _predicate(text: str) -> Callable[[Simulation, FloorPlan], Array]:
    evaluate = _condition(text)

    def test(run: Simulation, floor_plan: FloorPlan) -> Array:
        holds = np.broadcast_to(evaluate(fields_of(run, floor_plan)), run.world.robots.cell.shape)
        return _members(run, holds)

    return test


def robots_where(text: str, snapshot: Snapshot, floor_plan: FloorPlan) -> Array:
    """Identities of the robots for which a condition of this language holds. Raises InputError."""
    words = " ".join(text.split())
    fleet = snapshot.robots
    if words in ("deadlock", "wait cycle"):
        ticks = DEADLOCK_TICKS if words == "deadlock" else 1
        return np.flatnonzero(fleet.wait_cycle_ticks >= ticks)
    stalled = re.fullmatch(r"stalled ?> ?(\d+)", words)
    evaluate = _condition(f"waiting > {stalled[1]}" if stalled else words)
    fields = _fields(
        fleet, np.arange(len(fleet)), fleet, snapshot.tick, floor_plan, fleet.route_length
    )
    return np.flatnonzero(np.broadcast_to(evaluate(fields), fleet.cell.shape))


def _too_long(text: str) -> str:
    return f"a condition has at most {MAX_CONDITION_LENGTH} characters; this one has {len(text):,}"


def _condition(text: str) -> Callable[[Fields], Any]:
    if len(text) > MAX_CONDITION_LENGTH:
        raise InputError(_too_long(text))
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError):
        raise InputError(
            f"'{text}' is not a condition; valid are, for example, deadlock, delivered 7, "
            "stalled > 50, and waiting > 20 and loaded"
        ) from None
    return _compiled(tree)


Fields = Mapping[str, Array]


def _compiled(node: ast.expr) -> Callable[[Fields], Any]:
    """Compile an expression to a function of the robots' fields; rejects everything else."""
    if isinstance(node, ast.BoolOp):
        parts = [_compiled(value) for value in node.values]
        combine = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
        return lambda fields: combine.reduce([part(fields) for part in parts])
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        inner = _compiled(node.operand)
        return lambda fields: np.logical_not(inner(fields))
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARISONS:
        compare = COMPARISONS[type(node.ops[0])]
        left, right = _operand(node.left, node), _operand(node.comparators[0], node)
        return lambda fields: compare(left(fields), right(fields))
    if isinstance(node, ast.Name):
        return _operand(node, None)
    raise InputError(
        f"'{ast.unparse(node)}' is not a condition on a robot; allowed are comparisons of "
        f"{', '.join(FIELDS)} with numbers, joined by and, or, not"
    )


def _operand(node: ast.expr, comparison: ast.Compare | None) -> Callable[[Fields], Any]:
    if isinstance(node, ast.Name):
        if node.id not in FIELDS:
            raise InputError(
                f"a robot has no '{node.id}'{nearest(node.id, CONDITION_NAMES)}; "
                f"there are {', '.join(FIELDS)}"
            )
        name = node.id
        return lambda fields: fields[name]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = _operand(node.operand, comparison)
        return lambda fields: -inner(fields)
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        number = node.value
        return lambda fields: number
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        code = _code_of(node.value, comparison)
        return lambda fields: code
    raise InputError(f"'{ast.unparse(node)}' is neither a number nor one of {', '.join(FIELDS)}")


def _code_of(word: str, comparison: ast.Compare | None) -> int:
    """The code of a quoted cause or action."""
    sides = [] if comparison is None else [comparison.left, *comparison.comparators]
    for side in sides:
        if isinstance(side, ast.Name) and side.id in NAMED_VALUES:
            codes = NAMED_VALUES[side.id]
            if word not in codes:
                raise InputError(
                    f"'{word}' is not a known {side.id}{nearest(word, codes)}; there are "
                    f"{', '.join(codes)}"
                )
            return codes[word]
    raise InputError(f"'{word}' can only be compared with cause and action")


def fields_of(run: Simulation, floor_plan: FloorPlan) -> Fields:
    """The FIELDS of all robots, by storage index."""
    robots = run.world.robots
    return _fields(
        robots,
        robots.identity,
        run.observation,
        run.tick,
        floor_plan,
        robots.route_length - robots.route_index,
    )


def _fields(
    robots: Robots | FleetSnapshot,
    number: Array,
    observation: Observation | FleetSnapshot,
    tick: int,
    floor_plan: FloorPlan,
    steps: Array,
) -> Fields:
    off = np.where(robots.bay == NIL, robots.home, robots.bay)
    cell = np.where(robots.cell == NIL, off, robots.cell)
    return {
        "robot": number,
        "x": cell % floor_plan.stride - 1,
        "y": cell // floor_plan.stride - 1,
        "loaded": (robots.load != NIL).astype(np.int64),
        "load": robots.load,
        "order": robots.order,
        "waiting": np.where(
            is_waiting(observation.cause),
            waited_ticks(observation.cause, observation.since, tick),
            0,
        ),
        "slowdown_ticks": observation.lost[:, CAUSE_REDUCED_SPEED],
        "cause": observation.cause.astype(np.int64),
        "action": robots.action.astype(np.int64),
        "busy": robots.busy.astype(np.int64),
        "parked": robots.parked.astype(np.int64),
        "zone": robots.service_zone + 1,
        "priority": robots.priority,
        "steps": steps,
        "battery": robots.charge / BATTERY_PERCENT,
        "charging": is_charging(robots).astype(np.int64),
        "queueing": is_queueing(robots).astype(np.int64),
        "empty": (robots.status == STATUS_DEPLETED).astype(np.int64),
        "broken": (robots.status == STATUS_FAILED).astype(np.int64),
        "towed": (robots.status >= STATUS_TOWED).astype(np.int64),
        "ahead": robots.order_queue_length,
    }
