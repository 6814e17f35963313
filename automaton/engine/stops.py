"""The stops of orders: cells in which a robot has to stand, one after another."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from automaton.engine.jit.fields import DERIVED, MEASURED, NIL, STATIC, field
from automaton.engine.jit.structs import Struct

Array = NDArray[Any]


class Stops(Struct, role=STATIC):
    """The stops of all orders, one order after another; v of them.

    Those of order k are `orders.first_stop[k]` to `orders.first_stop[k + 1]`, without the end; of a trip
    up to the first without a cell.
    """

    cell: Array = field(
        "(v,) int32", "where a robot has to stand, NIL: none yet", role=DERIVED, header=True
    )
    ticks: Array = field(
        "(v,) int32",
        "for how long; 0: it is enough that it stands there",
        role=DERIVED,
        header=True,
    )
    done: Array = field(
        "(v,) int32",
        "tick at whose end a robot stood there for its order, or NIL",
        default=NIL,
        digest=60,
    )
    arrived: Array = field(
        "(v,) int32",
        "tick at whose end the robot that last came for it stood there, or NIL",
        default=NIL,
        role=MEASURED,
    )
