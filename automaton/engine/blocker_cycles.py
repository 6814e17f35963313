"""Find wait cycles: robots of which each waits for the next one, and the last for the first.

Each robot has one blocker at most, so every walk along blockers ends, or comes to one cycle.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import U
from automaton.engine.state import NIL


@kernel
def walk_to_cycle(blocker, at_index, color, start):
    """Walk along blockers from robot `start`; a robot of the cycle that the walk closes, or NIL.

    blocker: (n,) identity of the robot that each robot waits for, or NIL. at_index: (n,) where each
    identity is stored. color: (n,) 0 = no walk has come there yet; modified: start + 1 on this walk.
    """
    i = start
    while blocker[U(i)] != NIL and color[U(i)] == 0:
        color[U(i)] = start + 1
        i = np.int64(at_index[U(blocker[U(i)])])
    if blocker[U(i)] != NIL and color[U(i)] == start + 1:
        return i
    return np.int64(NIL)
