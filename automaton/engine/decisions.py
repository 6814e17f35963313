"""What the strategies of each layer decide: preallocated arrays, indexed like the batch, and commands."""

from __future__ import annotations

from typing import Any, Final

from automaton.engine.facilities import MESSAGE_WORDS, Design
from automaton.engine.jit.structs import CALL, DECISION, NIL, SCRATCH, Array, Struct, field
from automaton.engine.state import KEEP

CMD_TAKE_ORDER: Final = 1  # commands of allocation
CMD_DROP_AT: Final = 2
CMD_PARK: Final = 3
CMD_STEP: Final = 1  # commands of right of way
CMD_WAIT: Final = 2
CMD_RETREAT: Final = 3
CMD_HOLD: Final = 4  # from a steering right of way: wait for this tick
# From a steering right of way: turn towards a direction or move in it; leave a parking bay.
CMD_GO: Final = 5
CMD_TURN: Final = 6  # a quarter turn, whatever lies ahead: 1 = clockwise, 3 = to the left


def decided(meaning: str, default: int = 0, dtype: str = "int32") -> Any:
    """A field of the decision about each robot."""
    return field(f"(n,) {dtype}", meaning, default=default, role=DECISION)


class ZoningDecisions(Struct):
    service_zone: Array = decided("service zone of the robot", KEEP)
    halt: Array = decided("ticks for which the robot is halted from now on", KEEP)
    again: Array = decided(
        "ticks after which zoning is asked about the robot again; NIL: on events only", KEEP
    )
    sends_message: Array = decided(
        "1 = the robot's message becomes its row of `messages`", dtype="uint8"
    )
    messages: Array = field(f"(n, {MESSAGE_WORDS}) int64", "new message of each robot")
    server: Array = field(
        "(Z,) int32", "identity of the robot that serves a zone, or KEEP", default=KEEP, role=CALL
    )
    redesigned: int = field("() int64", "1 = decisions.zoning.design takes effect", role=CALL)
    design: Design
    queued: int = field("() int64", "number of entries in use in the next four arrays", role=CALL)
    order: Array = field("(m,) int32", "order that enters a queue")
    queue: Array = field("(m,) int32", "zone whose queue the order enters")
    next_slot: Array = field("(m,) int32", "slot where the load of the order is dropped next")
    skips_transfer: Array = field("(m,) uint8", "1 = the load goes without transfer stations")
    refused: int = field(
        "() int64", "number of illegal decisions in a recording; not set by strategies", role=CALL
    )
    refusals: Array = field("(2n, 3) int64", "robot, rule and value of each of them", role=SCRATCH)


class ChargingDecisions(Struct):
    goal_cell: Array = decided("cell of the charger to drive to, KEEP, or NIL: stop charging", KEEP)
    charge_target: Array = decided("charge at which the robot leaves the charger")
    charging_interruptible: Array = decided("1 = the robot may get an order while it charges")


class AllocationDecisions(Struct):
    command: Array = decided("command: KEEP, CMD_TAKE_ORDER, CMD_DROP_AT or CMD_PARK", KEEP)
    order: Array = decided("CMD_TAKE_ORDER: order that the robot takes", NIL)
    slot: Array = decided("CMD_DROP_AT: slot for the load", NIL)
    goal_cell: Array = decided("cell of the pick-up or drop-off, or of the next stop", NIL)
    try_drop: Array = decided("CMD_DROP_AT: 1 = a TRY_DROP operation follows the pick")
    ask_again: Array = decided("1 = ask again in the next tick in any case", dtype="uint8")
    order_queue_length: Array = field(
        "(n,) int32", "number of planned orders, or KEEP; by storage index", default=KEEP, role=CALL
    )
    order_queue: Array = field("(n, L) int32", "planned orders of a robot; by storage index")
    order_taken: Array = field(
        "(m,) uint8",
        "1 = reserved earlier in this batch; 0 for released orders when a call begins",
        role=SCRATCH,
    )
    slot_taken: Array = field("(s,) uint8", "1 = reserved earlier in this batch", role=CALL)


class RoutingDecisions(Struct):
    route_length: Array = decided("number of steps of the route, or KEEP", KEEP)
    steps: Array = field("(n, R) uint8", "directions of the steps")


class RightOfWayDecisions(Struct):
    command: Array = decided(
        "KEEP, CMD_STEP, CMD_WAIT, CMD_RETREAT, CMD_HOLD, CMD_GO or CMD_TURN", KEEP
    )
    value: Array = decided(
        "direction, ticks, moves or quarter turns; CMD_HOLD: preferred direction, or NIL"
    )
    return_order: Array = decided("1 = a robot without a load returns its order")
    priority: Array = decided("new priority of the robot, or KEEP", KEEP)


class Decisions(Struct):
    """Preallocated outputs, indexed like the batch."""

    zoning: ZoningDecisions
    charging: ChargingDecisions
    allocation: AllocationDecisions
    routing: RoutingDecisions
    right_of_way: RightOfWayDecisions
