"""Delays of robots: how often they begin, how long they last, and who is delayed.

d robots where a scenario has delays, else 0.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from automaton.engine.jit.fields import MEASURED, SCRATCH, STATIC, field
from automaton.engine.jit.structs import Struct

Array = NDArray[Any]


class Delays(Struct, role=STATIC):
    """A delayed robot begins nothing; a move or a turn under way may take longer by its delay."""

    probability: int = field("int64", "of 2**32 robots, how many begin a delay in a tick")
    poisson: int = field(
        "int64", "1: a Poisson number of robots begin one, those with the least hashes"
    )
    ticks: Array = field("(t,) int32", "how long delays last: all entries are alike probable")
    counts: Array = field(
        "(c,) int64", "of 2**32 robots, how many make at most 0, 1, ... robots begin one"
    )
    lengthens: Array = field(
        "(A,) uint8", "1 = such an operation takes longer by a delay that begins in it"
    )
    until: Array = field(
        "(d,) int64", "by identity: the last tick of its delay, or 0", digest=74, recorded=False
    )
    lasted: Array = field("(d,) int64", "by identity: ticks in which it was delayed", role=MEASURED)
    hash: Array = field("(h,) uint64", "of those that may begin one", role=SCRATCH)
