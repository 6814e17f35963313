"""Random draws of the methods of zoning, addressed by (seed, tick, method and how many came before)."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.strategy.kernels import random_between, random_bits

STREAM_ZONES = 0  # of random draws; each stream has a number of its own

# Where the counter of each method begins.
DRAWS_ANNEALING = 1 << 40
DRAWS_GENETIC = 2 << 40
DRAWS_NEGOTIATION = 3 << 40

_11 = np.uint64(11)


@kernel
def below(workspace, count, seed, tick):
    """A uniform integer from 0 to count - 1."""
    workspace.drawn[0] += 1
    return random_between(0, count - 1, seed, STREAM_ZONES, tick, workspace.drawn[0])


@kernel
def chance(workspace, seed, tick):
    """A uniform number from 0 to below 1."""
    workspace.drawn[0] += 1
    bits = random_bits(seed, STREAM_ZONES, tick, workspace.drawn[0]) >> _11
    return np.float64(np.int64(bits)) / 9007199254740992.0
