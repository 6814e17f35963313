"""Strategies whose decision in one tick never ends, in compiled code."""

from automaton.compiled import kernel
from automaton.strategy.kernels import find_path, position
from automaton.world.state import NIL, TICK
from strategies.allocation.independent_python import IndependentPython
from strategies.routing import shortest

LONG_TICK = 5


class Told(IndependentPython):
    """Says which tick is being computed, before routing is asked."""

    every = 1

    def decide(self, view, asked, answers, memory, space):
        print(f"tick {view.clock[TICK]}", flush=True)
        super().decide(view, asked, answers, memory, space)


@kernel
def search_on(view, asked, answers, memory, space):
    shortest.decide(view, asked, answers, memory, space)
    here = position(view, 0)
    while view.clock[TICK] == LONG_TICK:
        if find_path(view, space, 0, here, 0, here, False, space.steps) == NIL:
            break


@kernel
def count_on(view, asked, answers, memory, space):
    shortest.decide(view, asked, answers, memory, space)
    while view.clock[TICK] == LONG_TICK:
        memory.shared[0] += 1


class Searches(shortest.Shortest):
    """Searches the way from a cell to itself until that is not found any more."""

    every = 1
    compiled = search_on


class Counts(Searches):
    """Looks at nothing that could end it."""

    compiled = count_on

    def reset(self, view):
        from automaton.strategy.layer import memory_of

        return memory_of(view, shared=1)
