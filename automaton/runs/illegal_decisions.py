"""Illegal decisions of strategies in words: layer, robot, tick, what was decided, what is allowed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from automaton.engine.refusals import (
    DECISION_RULES,
    FIRST_REFUSALS,
    LATEST_REFUSALS,
    RULE_BITS,
    RULE_COUNT,
    STEP_BITS,
)
from automaton.engine.right_of_way import MAX_COMMAND_TICKS
from automaton.engine.state import BATTERY_FULL, LAYER_NAMES, NIL, World
from automaton.engine.zoning import MAX_HALT_TICKS
from automaton.floor.floor_plan import DIRECTIONS, FloorPlan
from automaton.units import count

SHOWN: Final = 3  # illegal decisions that a report names
RULE_NAMES: Final = tuple(  # layer and name of each rule, by its number
    f"{LAYER_NAMES[rule >> RULE_BITS]}: {DECISION_RULES[rule].name}"
    if rule in DECISION_RULES
    else ""
    for rule in range(RULE_COUNT)
)


class IllegalDecision(NamedTuple):
    """One illegal decision."""

    layer: str
    robot: int | None
    tick: int
    rule: str  # name of the rule
    decision: str  # what the strategy gave
    allowed: str
    value: int

    @property
    def words(self) -> str:
        """What was decided, and what is allowed."""
        return f"{self.decision}: {self.allowed}"

    def __str__(self) -> str:
        who = "" if self.robot is None else f"robot {self.robot}, "
        return f"{self.layer}: {who}tick {self.tick:,}: {self.words}"

    def as_json(self) -> dict[str, Any]:
        """The decision as one object."""
        return {**self._asdict(), "sentence": str(self)}


class IllegalDecisions(NamedTuple):
    """The illegal decisions of a run."""

    total: int
    by_rule: tuple[tuple[str, str, int], ...]  # layer, name of the rule, number; most first
    first: tuple[IllegalDecision, ...]  # at most FIRST_REFUSALS

    def lines(self) -> list[str]:
        """The numbers by rule, and the first decisions; [] without any."""
        if not self.total:
            return []
        rules = ", ".join(f"{layer} ({rule}) {many:,}" for layer, rule, many in self.by_rule)
        shown = [str(one) for one in self.first[:SHOWN]]
        left = self.total - len(shown)
        more = [f"and {left:,} more"] if left else []
        return [f"{count(self.total, 'illegal decision')}: {rules}", *shown, *more]

    def as_json(self) -> dict[str, Any]:
        """The decisions as one object."""
        by_rule = [{"layer": a, "rule": rule, "count": many} for a, rule, many in self.by_rule]
        first = [one.as_json() for one in self.first]
        return {"total": self.total, "by_rule": by_rule, "first": first}


NO_ILLEGAL_DECISIONS: Final = IllegalDecisions(0, (), ())


def illegal_decisions(world: World, floor_plan: FloorPlan) -> IllegalDecisions:
    """The illegal decisions of a run so far: numbers by rule, and the first ones in words."""
    refusals = world.refusals
    total = int(refusals.count.total)
    broken = [
        (rule, int(refusals.by_rule[rule])) for rule in refusals.by_rule.nonzero()[0].tolist()
    ]
    by_rule = tuple(
        (LAYER_NAMES[rule >> RULE_BITS], DECISION_RULES[rule].name, many)
        for rule, many in sorted(broken, key=lambda pair: (-pair[1], pair[0]))
    )
    explain = explainer(world, floor_plan) if total else None
    rows = refusals.first[: min(total, FIRST_REFUSALS)].tolist()
    first = tuple(explain(*row[:4]) for row in rows) if explain else ()
    return IllegalDecisions(total, by_rule, first)


def latest_illegal_decision(
    world: World, floor_plan: FloorPlan, robot: int
) -> IllegalDecision | None:
    """The latest illegal decision that cost a robot a tick, or None if it is no longer known."""
    total = int(world.refusals.count.total)
    for k in range(total - 1, max(0, total - LATEST_REFUSALS) - 1, -1):
        tick, who, rule, value, lost = world.refusals.latest[k % LATEST_REFUSALS].tolist()
        if who == robot and lost:
            return explainer(world, floor_plan)(tick, who, rule, value)
    return None


def explainer(
    world: World, floor_plan: FloorPlan
) -> Callable[[int, int, int, int], IllegalDecision]:
    """A function that puts tick, robot, rule and value of an illegal decision into words."""
    limits = limits_of(world)

    def explain(tick: int, robot: int, rule: int, value: int) -> IllegalDecision:
        at = floor_plan.xy(value) if 0 <= value < floor_plan.kind.size else value
        way = value & ((1 << STEP_BITS) - 1)
        words = {
            "value": "NIL" if value == NIL else f"{value:,}",
            "cell": "NIL" if value == NIL else str(at),
            "step": f"{value >> STEP_BITS:,}",
            "direction": f"{way} ({DIRECTIONS[way]})" if 0 <= way < 4 else f"{way}",
            **limits,
        }
        name, decision, allowed = DECISION_RULES[rule]
        return IllegalDecision(
            LAYER_NAMES[rule >> RULE_BITS],
            None if robot == NIL else robot,
            tick,
            name,
            decision.format(**words),
            allowed.format(**words),
            value,
        )

    return explain


def limits_of(world: World) -> dict[str, str]:
    """The largest numbers that are allowed, by their names in the texts of the rules."""
    design = world.service_zones.design
    designed = len(world.service_zones.queue) > 0
    zones = len(world.service_zones.server) if designed else len(world.grid.cell_flags)
    limits = {
        "last_zone": zones - 1,
        "last_robot": len(world.robots.cell) - 1,
        "orders": len(world.orders.state),
        "last_order": len(world.orders.state) - 1,
        "last_slot": len(world.slots.cell) - 1,
        "segments": len(design.owner),
        "points": design.path.shape[1],
        "plan": world.robots.order_queue.shape[1],
        "route": world.robots.route.shape[1],
        "full": BATTERY_FULL,
        "longest_halt": MAX_HALT_TICKS,
        "longest_command": MAX_COMMAND_TICKS,
    }
    return {name: f"{number:,}" for name, number in limits.items()}
