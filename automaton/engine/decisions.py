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


def decided(meaning: str, default: int = 0, dtype: str = "int32") -> Any:
    """A field of the decision about each robot."""
    return field(f"(n,) {dtype}", meaning, default=default, role=DECISION)


class ZoningDecisions(Struct):
    service_zone: Array = decided("the service zone of the robot", KEEP)
    halt: Array = decided("ticks for which it is halted from now on", KEEP)
    again: Array = decided(
        "ticks after which zoning is asked about it again; NIL: on events only", KEEP
    )
    sends_message: Array = decided("1 = its message changes, to this row of", dtype="uint8")
    messages: Array = field(f"(n, {MESSAGE_WORDS}) int64")
    server: Array = field(
        "(Z,) int32",
        "by zone: KEEP, or the identity of the robot that serves it",
        default=KEEP,
        role=CALL,
    )
    redesigned: int = field("() int64", "1 = the design changes, to", role=CALL)
    design: Design
    queued: int = field("() int64", "number of entries in use in the next four arrays", role=CALL)
    order: Array = field("(m,) int32", "this order")
    queue: Array = field("(m,) int32", "enters the queue of this zone")
    next_slot: Array = field("(m,) int32", "and is to be dropped at this slot")
    skips_transfer: Array = field("(m,) uint8", "1 = past transfer stations")
    refused: int = field(
        "() int64", "number of illegal decisions in a recording; not set by strategies", role=CALL
    )
    refusals: Array = field("(2n, 3) int64", "robot, rule and value of each of them", role=SCRATCH)


class ChargingDecisions(Struct):
    goal_cell: Array = decided("KEEP; the charger cell to drive to; or NIL: stop charging", KEEP)
    charge_target: Array = decided("charge at which it leaves the charger")
    charging_interruptible: Array = decided("1 = it may get an order while it charges")


class AllocationDecisions(Struct):
    command: Array = decided("KEEP, CMD_TAKE_ORDER, CMD_DROP_AT or CMD_PARK", KEEP)
    order: Array = decided("CMD_TAKE_ORDER: the order to pick up", NIL)
    slot: Array = decided("CMD_DROP_AT: the slot for the load", NIL)
    goal_cell: Array = decided("the cell from which to pick up or drop", NIL)
    try_drop: Array = decided("CMD_DROP_AT: 1 = a TRY_DROP operation follows the pick")
    ask_again: Array = decided("1 = ask again in the next tick in any case", dtype="uint8")
    order_queue_length: Array = field(
        "(n,) int32",
        "by storage index: KEEP, or the number of planned orders",
        default=KEEP,
        role=CALL,
    )
    order_queue: Array = field("(n, L) int32", "by storage index: the planned orders of a robot")
    order_taken: Array = field(
        "(m,) uint8",
        "1 = reserved by an earlier decision of this batch; zero for all released orders when "
        "a call begins",
        role=SCRATCH,
    )
    slot_taken: Array = field("(s,) uint8", "likewise", role=CALL)


class RoutingDecisions(Struct):
    route_length: Array = decided("KEEP or the number of steps", KEEP)
    steps: Array = field("(n, R) uint8", "directions")


class RightOfWayDecisions(Struct):
    command: Array = decided("KEEP, CMD_STEP, CMD_WAIT, CMD_RETREAT, CMD_HOLD or CMD_GO", KEEP)
    value: Array = decided("direction, ticks, or moves; CMD_HOLD: its preferred direction, or NIL")
    return_order: Array = decided("1 = an empty robot returns its order")
    priority: Array = decided("KEEP or the robot's new priority", KEEP)


class Decisions(Struct):
    """Preallocated outputs, indexed like the batch."""

    zoning: ZoningDecisions
    charging: ChargingDecisions
    allocation: AllocationDecisions
    routing: RoutingDecisions
    right_of_way: RightOfWayDecisions
