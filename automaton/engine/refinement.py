"""A tick that is finer than the scenario counts: where a coarse tick begins and ends.

Of K fine ticks that make a coarse one, strategies decide and robots begin something in the first
alone; in the others they go on. So rules.stride is K; where strategies decide in every tick, it is 1.
What chance decides goes by the coarse tick in both cases, and happens in its first fine one.
"""

from automaton.engine.jit.kernel import kernel
from automaton.engine.random_numbers import random_between
from automaton.engine.state import CLOCK_COARSE_TICK, CLOCK_TICK


@kernel
def next_tick(world):
    """The clock goes on by a tick."""
    clock = world.clock
    clock[CLOCK_TICK] += 1
    clock[CLOCK_COARSE_TICK] = (clock[CLOCK_TICK] - 1) // world.rules.refinement + 1


@kernel
def is_begin(world):
    """Whether strategies decide in this tick, and robots begin something."""
    return (world.clock[CLOCK_TICK] - 1) % world.rules.stride == 0


@kernel
def is_end(world):
    """Whether they do in the next one."""
    return world.clock[CLOCK_TICK] % world.rules.stride == 0


@kernel
def is_due(world, strategy):
    """Whether a strategy asked for this tick, or for one that ends in this coarse tick."""
    period = world.rules.period[strategy]
    return period > 0 and (world.clock[CLOCK_TICK] + world.rules.stride - 1) % period == 0


@kernel
def chance_decides(world):
    """Whether a coarse tick begins: breakdowns and delays are drawn."""
    return (world.clock[CLOCK_TICK] - 1) % world.rules.refinement == 0


@kernel
def random_ticks(view, low, high, stream, identity):
    """Uniformly random ticks from low to high, in whole coarse ticks."""
    refinement = view.rules.refinement
    return refinement * random_between(
        low // refinement,
        high // refinement,
        view.rules.seed,
        stream,
        view.clock[CLOCK_COARSE_TICK],
        identity,
    )
