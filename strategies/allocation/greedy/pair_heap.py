"""A binary heap of pairs (key, tag): the least key first, of equal keys the least tag."""

from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import Array
from automaton.strategy.kernels import kernel


class PairHeap(Struct, role=SCRATCH):
    """The pairs; the first one is the least."""

    key: Array = field("(h,) int64")
    tag: Array = field("(h,) int64")
    size: Array = field("(1,) int64")


@kernel
def is_less(heap, a, b):
    """Whether the pair at a comes before the one at b."""
    return heap.key[a] < heap.key[b] or (heap.key[a] == heap.key[b] and heap.tag[a] < heap.tag[b])


@kernel
def swap(heap, a, b):
    heap.key[a], heap.key[b] = heap.key[b], heap.key[a]
    heap.tag[a], heap.tag[b] = heap.tag[b], heap.tag[a]


@kernel
def push_pair(heap, key, tag):
    at = heap.size[0]
    heap.size[0] = at + 1
    heap.key[at] = key
    heap.tag[at] = tag
    while at > 0 and is_less(heap, at, (at - 1) >> 1):
        swap(heap, at, (at - 1) >> 1)
        at = (at - 1) >> 1


@kernel
def drop_least(heap):
    """Take the least pair out."""
    last = heap.size[0] - 1
    heap.size[0] = last
    swap(heap, 0, last)
    at = 0
    while 2 * at + 1 < last:
        below = 2 * at + 1
        if below + 1 < last and is_less(heap, below + 1, below):
            below += 1
        if not is_less(heap, below, at):
            return
        swap(heap, at, below)
        at = below
