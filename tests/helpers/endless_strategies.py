"""Strategies whose decision in one tick never ends, in compiled code."""

from automaton.strategy.api import (
    NIL,
    Array,
    Struct,
    field,
    find_path,
    kernel,
    position,
)
from strategies.allocation.independent import IndependentPython
from strategies.routing import shortest

LONG_TICK = 5


class Told(IndependentPython):
    """Says which tick is being computed, before routing is asked."""

    period = 1

    def decide(self, view, batch, decisions, memory, workspace):
        print(f"tick {view.clock.tick}", flush=True)
        super().decide(view, batch, decisions, memory, workspace)


@kernel
def search_on(view, batch, decisions, memory, workspace):
    shortest.decide(view, batch, decisions, memory, workspace)
    here = position(view, 0)
    while view.clock.tick == LONG_TICK:
        if find_path(view, workspace, 0, here, 0, here, False, workspace.steps) == NIL:
            break


class Count(Struct):
    """One number."""

    count: Array = field("(1,) int64")


@kernel
def count_on(view, batch, decisions, memory, workspace):
    shortest.decide(view, batch, decisions, memory, workspace)
    state = Count.of(memory)
    while view.clock.tick == LONG_TICK:
        state.count[0] += 1


class Searches(shortest.Shortest):
    """Searches the way from a cell to itself until that is not found any more."""

    period = 1
    compiled = search_on


class Counts(Searches):
    """Looks at nothing that could end it."""

    compiled = count_on

    def reset(self, view):
        return Count.sized()
