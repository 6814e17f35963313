"""Illegal decisions: the rule that each one breaks, what is allowed, and the first and latest of a run.

A check in the kernels returns the rule that a decision breaks, or NIL; `note_refusal`
(automaton.engine.operations) counts it. The
number of a rule is 32 * its layer + its place among the rules of the layer.
"""

from typing import Final, NamedTuple

from automaton.engine.jit.structs import MEASURED, Array, NamedNumbers, Struct, field, number

RULE_BITS: Final = 5
RULE_COUNT: Final = 5 << RULE_BITS  # numbers in use and free ones
FIRST_REFUSALS: Final = 16  # illegal decisions that are kept from the beginning of a run
LATEST_REFUSALS: Final = 256  # and of the present
STEP_BITS: Final = 8  # the value of a step of a route: its place << STEP_BITS | its direction

# Columns of the rows.
REFUSED_TICK: Final = 0
REFUSED_ROBOT: Final = 1  # identity or NIL
REFUSED_RULE: Final = 2
REFUSED_VALUE: Final = 3  # what the strategy gave
REFUSED_LOST: Final = 4  # 1 = the robot lost a tick

# zoning
RULE_ZONING: Final = 0  # in a recording that does not name it
RULE_ZONE: Final = 1
RULE_HALT: Final = 2
RULE_AGAIN: Final = 3
RULE_SERVER: Final = 4
RULE_QUEUED: Final = 5
RULE_QUEUE_ORDER: Final = 6
RULE_QUEUE_ZONE: Final = 7
RULE_QUEUE_TAKEN: Final = 8
RULE_QUEUE_SLOT: Final = 9
RULE_QUEUE_DROP: Final = 10
RULE_SEGMENTS: Final = 11
RULE_POINTS: Final = 12
RULE_STATION_ZONE: Final = 13
RULE_STATION_ACCESS: Final = 14
RULE_PATH: Final = 15
RULE_OVERLAP: Final = 16
RULE_TRANSFER: Final = 17
RULE_SIGHT: Final = 18
# charging
RULE_CHARGER: Final = 32
RULE_CHARGER_REACH: Final = 33
RULE_CHARGE_LOAD: Final = 34
RULE_CHARGE_ORDER: Final = 35
RULE_CHARGE_TARGET: Final = 36
RULE_CHARGE_STOP: Final = 37
# allocation
RULE_ALLOCATION: Final = 64
RULE_PARK: Final = 65
RULE_TAKE_LOADED: Final = 66
RULE_TAKE_ORDER: Final = 67
RULE_TAKE_WAITING: Final = 68
RULE_TAKE_STARTED: Final = 69
RULE_TAKE_WEIGHT: Final = 70
RULE_TAKE_ASSIGNED: Final = 71
RULE_TAKE_RESERVED: Final = 72
RULE_TAKE_GOAL: Final = 73
RULE_TAKE_REACH: Final = 74
RULE_DROP_EMPTY: Final = 75
RULE_DROP_SLOT: Final = 76
RULE_DROP_GOAL: Final = 77
RULE_DROP_REACH: Final = 78
RULE_DROP_STOPS: Final = 79
RULE_DROP_PLACE: Final = 80
RULE_DROP_TARGET: Final = 81
RULE_DROP_FULL: Final = 82
RULE_DROP_RESERVED: Final = 83
RULE_PLAN_LENGTH: Final = 84
RULE_PLAN_ORDER: Final = 85
RULE_PLAN_WAITING: Final = 86
# routing
RULE_ROUTE_LENGTH: Final = 96
RULE_ROUTE_DIRECTION: Final = 97
RULE_ROUTE_EXIT: Final = 98
RULE_ROUTE_TURN: Final = 99
# right of way
RULE_RIGHT_OF_WAY: Final = 128
RULE_STEERING: Final = 129
RULE_PRIORITY: Final = 130
RULE_PARKED: Final = 131
RULE_STEP_BAY: Final = 132
RULE_STEP_DIRECTION: Final = 133
RULE_STEP_EXIT: Final = 134
RULE_STEP_TURN: Final = 135
RULE_WAIT: Final = 136
RULE_RETREAT: Final = 137
RULE_GO_BAY: Final = 138
RULE_GO_DIRECTION: Final = 139
RULE_GO_EXIT: Final = 140
RULE_GO_TURN: Final = 141
RULE_HOLD: Final = 142
RULE_WAIT_PARKED: Final = 143
RULE_TURN: Final = 144
RULE_TURN_CELL: Final = 145


class DecisionRule(NamedTuple):
    """A rule of decisions in words; {value}, {cell} and others stand for numbers of the run."""

    name: str
    decision: str  # what the strategy gave
    allowed: str


DECISION_RULES: Final[dict[int, DecisionRule]] = {
    RULE_ZONING: DecisionRule("unknown", "a decision", "the recording does not name the rule"),
    RULE_ZONE: DecisionRule(
        "service zone", "service_zone {value}", "a zone is 0 to {last_zone}, or NIL for none"
    ),
    RULE_HALT: DecisionRule("halt", "halt {value}", "a halt lasts 0 to {longest_halt} ticks"),
    RULE_AGAIN: DecisionRule("again", "again {value}", "again is 0 or more ticks, or NIL"),
    RULE_SERVER: DecisionRule("server", "server {value}", "a robot is 0 to {last_robot}"),
    RULE_QUEUED: DecisionRule(
        "queued orders", "queued {value}", "a call queues 0 to {orders} orders"
    ),
    RULE_QUEUE_ORDER: DecisionRule(
        "order of a queue", "order {value}", "an order is 0 to {last_order}"
    ),
    RULE_QUEUE_ZONE: DecisionRule("zone of a queue", "queue {value}", "a zone is 0 to {last_zone}"),
    RULE_QUEUE_TAKEN: DecisionRule(
        "queued order waits", "order {value}", "only orders that wait for a robot enter a queue"
    ),
    RULE_QUEUE_SLOT: DecisionRule("next slot", "next_slot {value}", "a slot is 0 to {last_slot}"),
    RULE_QUEUE_DROP: DecisionRule(
        "next drop-off",
        "next_slot {value}",
        "a load goes to its target, or elsewhere: to a station or a slot that holds one load",
    ),
    RULE_SEGMENTS: DecisionRule(
        "segments", "design.segments {value}", "a design has 0 to {segments} segments"
    ),
    RULE_POINTS: DecisionRule(
        "points", "design.points {value}", "a segment has 2 to {points} points"
    ),
    RULE_STATION_ZONE: DecisionRule(
        "zone of a station", "design.zone {value}", "a zone is 0 to {last_zone}"
    ),
    RULE_STATION_ACCESS: DecisionRule(
        "access to a station",
        "design.zone of station {value}",
        "the robot of its zone must be able to serve a station",
    ),
    RULE_PATH: DecisionRule(
        "path of a segment",
        "design.path of segment {value}",
        "a segment follows roads from one station of its zone to another",
    ),
    RULE_OVERLAP: DecisionRule(
        "overlap", "design.path at point {value}", "a point is in one zone only"
    ),
    RULE_TRANSFER: DecisionRule(
        "transfer station",
        "design.transfer of station {value}",
        "a transfer station is in one of its two zones, and robots of both can serve it",
    ),
    RULE_SIGHT: DecisionRule(
        "sight",
        "design.zone of station {value}",
        "with limited sight, stations change zones only between robots in sight",
    ),
    RULE_CHARGER: DecisionRule("charger", "goal_cell {cell}", "a goal is the cell of a charger"),
    RULE_CHARGER_REACH: DecisionRule(
        "way to a charger", "goal_cell {cell}", "the robot needs a way to the charger"
    ),
    RULE_CHARGE_LOAD: DecisionRule(
        "charging with a load", "goal_cell {cell}", "only a robot without a load is sent to charge"
    ),
    RULE_CHARGE_ORDER: DecisionRule(
        "charging with an order",
        "goal_cell {cell}",
        "only a robot that has not begun its order is sent to charge",
    ),
    RULE_CHARGE_TARGET: DecisionRule(
        "charge target", "charge_target {value}", "a charge is 1 to {full} (a full battery)"
    ),
    RULE_CHARGE_STOP: DecisionRule(
        "end of charging",
        "goal_cell NIL",
        "only a robot that charges, or drives to a charger, can stop",
    ),
    RULE_ALLOCATION: DecisionRule(
        "command of allocation",
        "command {value}",
        "a command is KEEP, CMD_TAKE_ORDER (1), CMD_DROP_AT (2) or CMD_PARK (3)",
    ),
    RULE_PARK: DecisionRule(
        "parking with work", "CMD_PARK", "only a robot without an order or a load parks"
    ),
    RULE_TAKE_LOADED: DecisionRule(
        "order with a load", "CMD_TAKE_ORDER {value}", "only a robot without a load takes an order"
    ),
    RULE_TAKE_ORDER: DecisionRule(
        "order", "CMD_TAKE_ORDER {value}", "an order is 0 to {last_order}"
    ),
    RULE_TAKE_WAITING: DecisionRule(
        "order waits",
        "CMD_TAKE_ORDER {value}",
        "an order must be released, and neither carried nor delivered",
    ),
    RULE_TAKE_STARTED: DecisionRule(
        "order begun", "CMD_TAKE_ORDER {value}", "a robot that has begun an order completes it"
    ),
    RULE_TAKE_WEIGHT: DecisionRule(
        "payload", "CMD_TAKE_ORDER {value}", "a robot takes no more than its payload"
    ),
    RULE_TAKE_ASSIGNED: DecisionRule(
        "assigned order", "CMD_TAKE_ORDER {value}", "an assigned order is for its own robot only"
    ),
    RULE_TAKE_RESERVED: DecisionRule(
        "reserved order",
        "CMD_TAKE_ORDER {value}",
        "a reserved order changes robots only if it has no load, and once in a batch",
    ),
    RULE_TAKE_GOAL: DecisionRule(
        "first goal",
        "CMD_TAKE_ORDER with goal_cell {cell}",
        "an order begins at its next stop, or at a cell from which its load is picked up",
    ),
    RULE_TAKE_REACH: DecisionRule(
        "way to an order",
        "CMD_TAKE_ORDER with goal_cell {cell}",
        "the robot needs a way to this cell",
    ),
    RULE_DROP_EMPTY: DecisionRule(
        "drop-off without a load", "CMD_DROP_AT {value}", "only a robot with a load drops one"
    ),
    RULE_DROP_SLOT: DecisionRule("slot", "CMD_DROP_AT {value}", "a slot is 0 to {last_slot}"),
    RULE_DROP_GOAL: DecisionRule(
        "cell of a drop-off",
        "CMD_DROP_AT with goal_cell {cell}",
        "a load is dropped from a cell beside its slot",
    ),
    RULE_DROP_REACH: DecisionRule(
        "way to a slot", "CMD_DROP_AT with goal_cell {cell}", "the robot needs a way to this cell"
    ),
    RULE_DROP_STOPS: DecisionRule(
        "open stops", "CMD_DROP_AT {value}", "the stops of an order come before its drop-off"
    ),
    RULE_DROP_PLACE: DecisionRule(
        "place of a pod", "CMD_DROP_AT {value}", "a pod is stored at a storage place"
    ),
    RULE_DROP_TARGET: DecisionRule(
        "target",
        "CMD_DROP_AT {value}",
        "a load goes to its target, to a station, or to a slot that holds one load",
    ),
    RULE_DROP_FULL: DecisionRule(
        "full slot", "CMD_DROP_AT {value}", "a slot of one load must be empty"
    ),
    RULE_DROP_RESERVED: DecisionRule(
        "reserved slot", "CMD_DROP_AT {value}", "a reserved slot is for the robot that reserved it"
    ),
    RULE_PLAN_LENGTH: DecisionRule(
        "length of a plan", "order_queue_length {value}", "a plan has 0 to {plan} orders"
    ),
    RULE_PLAN_ORDER: DecisionRule(
        "order of a plan", "order {value}", "an order is 0 to {last_order}"
    ),
    RULE_PLAN_WAITING: DecisionRule(
        "planned order waits", "order {value}", "a planned order is neither carried nor delivered"
    ),
    RULE_ROUTE_LENGTH: DecisionRule(
        "length of a route", "route_length {value}", "a route has 0 to {route} steps"
    ),
    RULE_ROUTE_DIRECTION: DecisionRule(
        "direction of a route", "step {step} goes {direction}", "a direction is 0 to 3"
    ),
    RULE_ROUTE_EXIT: DecisionRule(
        "exit of a route",
        "step {step} goes {direction}",
        "a step needs an exit that is open to the robot",
    ),
    RULE_ROUTE_TURN: DecisionRule(
        "turn of a route", "step {step} goes {direction}", "a turn needs a cell that allows it"
    ),
    RULE_RIGHT_OF_WAY: DecisionRule(
        "command of right of way",
        "command {value}",
        "a command is KEEP, CMD_STEP (1), CMD_WAIT (2), CMD_RETREAT (3) or CMD_TURN (6)",
    ),
    RULE_STEERING: DecisionRule(
        "command of steering",
        "command {value}",
        "a steering command is KEEP, CMD_WAIT (2), CMD_HOLD (4), CMD_GO (5) or CMD_TURN (6)",
    ),
    RULE_PRIORITY: DecisionRule("priority", "priority {value}", "a priority is -32,768 to 32,767"),
    RULE_PARKED: DecisionRule(
        "parked robot", "command {value}", "a parked robot gets only CMD_STEP (1)"
    ),
    RULE_STEP_BAY: DecisionRule(
        "step from a parking bay", "CMD_STEP {value}", "only a robot on the floor takes a step"
    ),
    RULE_STEP_DIRECTION: DecisionRule(
        "direction of a step", "CMD_STEP {value}", "a direction is 0 to 3"
    ),
    RULE_STEP_EXIT: DecisionRule(
        "exit of a step", "CMD_STEP {direction}", "a step needs an exit that is open to the robot"
    ),
    RULE_STEP_TURN: DecisionRule(
        "turn of a step", "CMD_STEP {direction}", "a turn needs a cell that allows it"
    ),
    RULE_WAIT: DecisionRule(
        "wait", "CMD_WAIT {value}", "a wait lasts 1 to {longest_command} ticks"
    ),
    RULE_RETREAT: DecisionRule(
        "retreat", "CMD_RETREAT {value}", "a retreat has 0 to {longest_command} moves"
    ),
    RULE_GO_BAY: DecisionRule(
        "leaving a parking bay",
        "CMD_GO {value}",
        "a robot leaves its parking bay only for an order or a charger",
    ),
    RULE_GO_DIRECTION: DecisionRule("direction", "CMD_GO {value}", "a direction is 0 to 3"),
    RULE_GO_EXIT: DecisionRule(
        "exit", "CMD_GO {direction}", "a move needs an exit that is open to the robot"
    ),
    RULE_GO_TURN: DecisionRule("turn", "CMD_GO {direction}", "a turn needs a cell that allows it"),
    RULE_HOLD: DecisionRule("hold", "CMD_HOLD {value}", "a preferred direction is 0 to 3, or NIL"),
    RULE_WAIT_PARKED: DecisionRule(
        "waiting while parked", "CMD_WAIT {value}", "only a robot that is not parked waits"
    ),
    RULE_TURN: DecisionRule(
        "quarter turn", "CMD_TURN {value}", "a quarter turn is 1 (clockwise) or 3 (to the left)"
    ),
    RULE_TURN_CELL: DecisionRule(
        "place of a turn",
        "CMD_TURN {value}",
        "only a robot with a heading turns, on the floor, in a cell that allows it",
    ),
}


class RefusalCounts(NamedNumbers):
    """How many illegal decisions there were."""

    total: int = number("illegal decisions so far")


class Refusals(Struct, role=MEASURED):
    """Illegal decisions: counts by rule, the first and the latest ones (automaton.engine.refusals)."""

    count: RefusalCounts = field(RefusalCounts)
    by_rule: Array = field(f"({RULE_COUNT},) int64", "illegal decisions by rule")
    first: Array = field(
        f"({FIRST_REFUSALS}, 5) int64", "the first ones: tick, robot, rule, value, lost a tick"
    )
    latest: Array = field(f"({LATEST_REFUSALS}, 5) int64", "the latest ones, as a ring")
