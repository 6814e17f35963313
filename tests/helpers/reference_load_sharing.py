"""A model of load sharing between two robots with unequal queues, as SA and GA share out of balance.

For each pair of zones the first part in the longer queue that is bound for the other zone changes
robots, and the first one in the shorter queue that is bound for the busy zone keeps its robot; both
are then delivered past the transfer stations. The authors' scan skips every other part; this one
goes by score.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL


@kernel
def share(design, queue, to, waiting, score, direct, length):
    """One round; changes queue and direct, returns how many parts it touched.

    For K parts: queue, to (K,) int32: zone and next station of the route; waiting, direct (K,)
    uint8 flags; score (K,): the highest comes first, then the lowest part. length (Z,)
    int32: scratch.
    """
    length[:] = 0
    for k in range(queue.shape[0]):
        if waiting[k] == 1 and queue[k] != NIL:
            length[queue[k]] += 1
    touched = np.int64(0)
    for a in range(length.shape[0]):
        for b in range(a + 1, length.shape[0]):
            if length[a] == length[b]:
                continue
            busy, other = (a, b) if length[a] > length[b] else (b, a)
            moved = first_bound(design, queue, to, waiting, score, direct, busy, other, 1)
            stays = first_bound(design, queue, to, waiting, score, direct, other, busy, 0)
            if moved != NIL:
                queue[moved] = other
                direct[moved] = 1
                length[busy] -= 1
                length[other] += 1
                touched += 1
            if stays != NIL:
                direct[stays] = 1
                touched += 1
    return touched


@kernel
def first_bound(design, queue, to, waiting, score, direct, zone, target, again):
    """The part of a queue with the highest score whose next station lies in zone `target`, or NIL.

    again: 1 = also parts that are delivered directly already.
    """
    found = np.int64(NIL)
    for k in range(queue.shape[0]):
        if waiting[k] == 0 or queue[k] != zone or design.zone[to[k]] != target:
            continue
        if direct[k] == 1 and again == 0:
            continue
        if found == NIL or score[k] > score[found]:
            found = np.int64(k)
    return found
