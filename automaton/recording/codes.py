"""What a recording says of a robot in a tick (a byte), and of orders and slots (rows)."""

from typing import Final

# record.did: the committed action; MOVE_EAST + direction for the four moves.
NOTHING: Final = 0  # idle, or busy with what began earlier
MOVE_EAST: Final = 1
MOVE_SOUTH: Final = 2
MOVE_WEST: Final = 3
MOVE_NORTH: Final = 4
TURN_LEFT: Final = 5  # counter-clockwise by 90 degrees
TURN_RIGHT: Final = 6  # clockwise; on rails, onto the other axis
DID_PICK: Final = 7
DID_DROP: Final = 8
DID_TRY_DROP: Final = 9
DID_WAIT: Final = 10  # its length stands in a DURATION row
DID_BLOCKED: Final = 11  # a refused move that lost this tick
DID_WITHDRAW: Final = 12  # a withdrawal was decided; nothing else happens
DID_BAY_BLOCKED: Final = 13  # the home cell was held
DID_ILLEGAL: Final = 14  # an illegal answer lost this tick
DID_CHARGE: Final = 15  # a tick at a charger
ACTION_MASK: Final = 15
LEFT_BAY: Final = 16  # flag: it was placed on its home cell before the motion of this tick
INTO_BAY: Final = 32  # flag: at the end of this tick it is parked
PICKED_AT_ONCE: Final = 64  # flag: as it arrived, at the end of this tick, it took its load
DROPPED_AT_ONCE: Final = 128  # flag: likewise, it set its load down

# record.changes: rows (tick, code, subject, value).
ORDER_BY: Final = 1  # order, identity of the robot that has it now or NIL
SLOT_BY: Final = 2  # slot, identity of the robot that reserved it or NIL
DURATION: Final = 3  # identity, ticks of the action begun in this tick
PICKED_UP: Final = 4  # identity, order
SET_AT: Final = 5  # identity, slot
ZONE: Final = 6  # identity, zone
LEFT_LOAD: Final = 7  # identity, spare slot in its cell where its load lies now
STATUS: Final = 8  # identity, status of the robot (automaton.world.condition)
