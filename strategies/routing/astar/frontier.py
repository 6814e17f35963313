"""The open list of A*: which of the poses of least f = g + h is expanded next.

A *level* is the poses of one f. Those that are found while their level is expanded wait in a lane,
a plain array; those of later levels wait in a binary heap. With a consistent estimate no pose is
ever found below the level, so the order is that of one heap over everything:

    fifo       the pose that was found first        lane = queue, after what the heap has
    larger_g   the pose farthest from the start     lane = stack, before what the heap has; first found
    random     any, by a draw                       no lane
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import splitmix64

FIFO = 0
LARGER_G = 1
RANDOM = 2
# As LARGER_G without its lane, which cannot tell equal g apart: turns of no ticks.
LARGER_G_HEAP = 3
TIES = ("fifo", "larger_g", "random")  # names of the rules, by their numbers

# Entries of RouteSpace.state.
OPEN_STAMP = 0  # counts down: marks what earlier searches left as worse than anything
OPEN_LEVEL = 1  # the f that is expanded
OPEN_HEAP = 2  # items in the heap
OPEN_HEAD = 3  # the lane's first item: queues only
OPEN_TAIL = 4  # one past its last item
OPEN_FOUND = 5  # poses found in this search
OPEN_EXPANDED = 6  # poses expanded in all searches
OPEN_COST = 7  # of the path found last

POSE_MASK = (1 << 32) - 1  # an item of the lane: row << 32 | pose; of the heap: number << 32 | pose


@kernel
def begin(workspace):
    """Empty the open list for a new search; returns the label of its poses at cost 0."""
    state = workspace.state
    if state[OPEN_STAMP] == 0:
        workspace.label[:] = np.iinfo(np.int64).max
        state[OPEN_STAMP] = (1 << 31) - 1
    state[OPEN_STAMP] -= 1
    state[OPEN_LEVEL] = NIL
    state[OPEN_HEAP] = 0
    state[OPEN_HEAD] = 0
    state[OPEN_TAIL] = 0
    state[OPEN_FOUND] = 0
    return state[OPEN_STAMP] << 32


@kernel
def put(workspace, ties, salt, pose, row, f, h):
    """Enter a pose of that f and h; `row` is its y, `salt` (uint64) addresses the draws of ties."""
    state = workspace.state
    if f == state[OPEN_LEVEL] and ties < RANDOM:
        workspace.lane[state[OPEN_TAIL]] = (row << 32) | pose
        state[OPEN_TAIL] += 1
        return
    number = state[OPEN_FOUND]
    state[OPEN_FOUND] = number + 1
    tie = number
    if ties == LARGER_G or ties == LARGER_G_HEAP:
        tie = h
    elif ties == RANDOM:
        tie = np.int64(splitmix64(salt + np.uint64(number)) >> np.uint64(33))
    sift_up(workspace, state[OPEN_HEAP], (f << 32) | tie, (number << 32) | pose)
    state[OPEN_HEAP] += 1


@kernel
def take(workspace, ties, width, shift):
    """Remove the next item, row << 32 | pose; NIL if there is none. Sets the level."""
    state = workspace.state
    waiting = state[OPEN_TAIL] > state[OPEN_HEAD]
    if waiting and ties == LARGER_G:
        state[OPEN_TAIL] -= 1
        return workspace.lane[state[OPEN_TAIL]]
    if waiting and (state[OPEN_HEAP] == 0 or workspace.key[0] >> 32 > state[OPEN_LEVEL]):
        state[OPEN_HEAD] += 1
        return workspace.lane[state[OPEN_HEAD] - 1]
    if state[OPEN_HEAP] == 0:
        return np.int64(NIL)
    f = workspace.key[0] >> 32
    if f > state[OPEN_LEVEL]:
        state[OPEN_LEVEL] = f
        state[OPEN_HEAD] = 0
        state[OPEN_TAIL] = 0
    pose = workspace.item[0] & POSE_MASK
    state[OPEN_HEAP] -= 1
    sift_down(workspace, state[OPEN_HEAP])
    return (((pose >> shift) // width) << 32) | pose


@kernel
def sift_up(workspace, at, key, item):
    """Put (key, item) into the heap of `at` items, ordered by key, then by item."""
    keys, items = workspace.key, workspace.item
    while at > 0:
        above = (at - 1) >> 1
        if keys[above] < key or (keys[above] == key and items[above] < item):
            break
        keys[at] = keys[above]
        items[at] = items[above]
        at = above
    keys[at] = key
    items[at] = item


@kernel
def sift_down(workspace, size):
    """Fill the heap's first place with what lies behind its last one; `size` items remain."""
    keys, items = workspace.key, workspace.item
    key, item = keys[size], items[size]
    at = 0
    below = 1
    while below < size:
        other = below + 1
        if other < size and (
            keys[other] < keys[below]
            or (keys[other] == keys[below] and items[other] < items[below])
        ):
            below = other
        if keys[below] > key or (keys[below] == key and items[below] > item):
            break
        keys[at] = keys[below]
        items[at] = items[below]
        at = below
        below = 2 * at + 1
    keys[at] = key
    items[at] = item
