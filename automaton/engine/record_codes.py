"""The codes of a recording: the action of a robot in a tick (two bytes), and changes (rows)."""

from typing import Final

# record.executed: the committed action; MOVE_EAST + direction for the four moves.
EXECUTED_NOTHING: Final = 0  # idle, or busy with an operation that began earlier
MOVE_EAST: Final = 1
MOVE_SOUTH: Final = 2
MOVE_WEST: Final = 3
MOVE_NORTH: Final = 4
TURN_LEFT: Final = 5  # counter-clockwise by 90 degrees
TURN_RIGHT: Final = 6  # clockwise; on rails, onto the other axis
EXECUTED_PICK: Final = 7
EXECUTED_DROP: Final = 8
EXECUTED_TRY_DROP: Final = 9
EXECUTED_WAIT: Final = 10  # its duration is in a CHANGE_DURATION row
EXECUTED_BLOCKED: Final = 11  # a refused move that lost this tick
EXECUTED_RETREAT: Final = 12  # a retreat was decided; nothing else happens
EXECUTED_BAY_BLOCKED: Final = 13  # the home cell was held
EXECUTED_ILLEGAL: Final = 14  # an illegal decision cost this tick
EXECUTED_CHARGE: Final = 15  # a tick at a charger
EXECUTED_SERVE: Final = 16  # at a stop; its duration is in a CHANGE_DURATION row
EXECUTED_CODES: Final = 17  # number of codes
ACTION_MASK: Final = 63
LEFT_PARKING_BAY: Final = 256  # flag: it was placed on its home cell before the motion of this tick
ENTERED_PARKING_BAY: Final = 512  # flag: at the end of this tick it is parked
PICKED_ON_ARRIVAL: Final = 1024  # flag: on arrival, at the end of this tick, it picked up its load
DROPPED_ON_ARRIVAL: Final = 2048  # flag: on arrival, at the end of this tick, it dropped its load
EXECUTED_VALUES: Final = 4096  # all values are below

# record.changes: rows (tick, code, subject, value).
CHANGE_ORDER_RESERVED: Final = 1  # order, identity of the robot that now has it, or NIL
CHANGE_SLOT_RESERVED: Final = 2  # slot, identity of the robot that reserved it, or NIL
CHANGE_DURATION: Final = 3  # identity, ticks of the action begun in this tick
CHANGE_PICKED: Final = 4  # identity, order
CHANGE_DROPPED: Final = 5  # identity, slot
CHANGE_ZONE: Final = 6  # identity, zone
CHANGE_LOAD_LEFT: Final = 7  # identity, spare slot in its cell that now holds its load
CHANGE_STATUS: Final = 8  # identity, status of the robot: STATUS_*
CHANGE_VISITED: Final = 9  # identity, order of which it did the next stop
CHANGE_DELAYED: Final = 10  # identity, ticks of the delay that begins in this tick
# Only in observed runs (automaton.engine.observed_ticks): what the messages of a real robot say.
CHANGE_SEEN_CELL: Final = (
    11  # identity, the cell in which it is without a move; NIL: not on the floor
)
CHANGE_SEEN_HEADING: Final = 12  # identity, heading
CHANGE_SEEN_CHARGE: Final = 13  # identity, units of charge
CHANGE_SEEN_ORDER: Final = 14  # identity, order that it now works on, or NIL
CHANGE_SEEN_LOAD: Final = 15  # identity, order of the load that it now carries, or NIL
CHANGE_SEEN_GOAL: Final = 16  # identity, cell of its next operation, or NIL
WAY_SHIFT: Final = 6  # EXECUTED_BLOCKED of an observed run: the direction in which it goes next
WAY_MASK: Final = 3 << WAY_SHIFT

KEYFRAME_TICKS: Final = 2048  # ticks between recorded states; the last state is recorded too
