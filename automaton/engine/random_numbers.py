"""Random draws by address, not from a sequence: draw(seed, stream, tick, robot).

A draw depends only on its address, so orders do not change when a router draws more often, and two
strategies face the same demand (common random numbers). The mixer is SplitMix64's finalizer
(Steele, Lea & Flood 2014).
"""

import numpy as np

from automaton.engine.jit.kernel import kernel

# Streams of the world; strategies declare their own, using the remaining numbers.
STREAM_ORDERS = 1
STREAM_WAITS = 2
STREAM_RETREATS = 3
STREAM_ABORTS = 4
STREAM_STARTS = 5
STREAM_EXTRA_TICKS = 6
STREAM_CHARGES = 7
STREAM_RELEASES = 8
STREAM_BREAKDOWNS = 9
STREAM_HANDLING = 16
STREAM_PROCESSING_TIMES = 17
STREAM_LINES = 18  # handling time of a line at a station
STREAM_LINE_DEMAND = 19  # which lines are sampled
STREAM_STORAGE = 20  # the storage cell of a pod
STREAM_DELAYS = 22  # which robots begin a delay
STREAM_DELAY_TICKS = 23  # duration of a delay
STREAM_DELAY_COUNTS = 24  # number of delays
STREAM_REPAIRS = 25  # duration of a repair in place
STREAM_CLOSINGS = 21  # start and duration of closings
STREAM_PROFILE = 26  # arrivals at the rates of a profile
STREAM_DAYS = 27  # the file of orders of a run, out of several
STREAM_VISITS = 28  # the stops of tours that belong to a robot
STREAM_EPISODES = 29  # seeds of the episodes of an environment
STREAM_STRATEGY = 32  # plug-ins use numbers from here on

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_A = np.uint64(0xBF58476D1CE4E5B9)
_B = np.uint64(0x94D049BB133111EB)
_30 = np.uint64(30)
_27 = np.uint64(27)
_31 = np.uint64(31)
_32 = np.uint64(32)


@kernel
def splitmix64(value):
    """A bijection of 64-bit integers."""
    value = (value ^ (value >> _30)) * _A
    value = (value ^ (value >> _27)) * _B
    return value ^ (value >> _31)


@kernel
def random_bits(seed, stream, tick, robot):
    """64 random bits at an address; `seed` is uint64, the others any integers."""
    state = splitmix64(np.uint64(seed) + _GOLDEN * np.uint64(stream))
    state = splitmix64(state ^ (np.uint64(tick) + _GOLDEN))
    return splitmix64(state ^ (np.uint64(robot) * _GOLDEN + _A))


@kernel
def random_between(low, high, seed, stream, tick, robot):
    """A uniform integer from low to high, inclusive."""
    bits = random_bits(seed, stream, tick, robot) >> _32
    return low + np.int64((bits * np.uint64(high - low + 1)) >> _32)


@kernel
def random_integers(out, count, seed, stream, tick):
    """out[i] = a uniform integer below `count`, addressed by (stream, tick, i)."""
    for i in range(out.shape[0]):
        out[i] = random_between(0, count - 1, seed, stream, tick, i)


@kernel
def random_bits_of_each(out, seed, stream, ticks, robots):
    """out[i] = 64 random bits, addressed by (stream, ticks[i], robots[i])."""
    for i in range(out.shape[0]):
        out[i] = random_bits(seed, stream, ticks[i], robots[i])


@kernel
def draw_releases(out, chance, seed, last):
    """out[k] = tick of order k: each tick after order k-1 is chosen with probability `chance` /
    2**32.

    Later ticks than `last` become `last`.
    """
    tick = 0
    for k in range(1, out.shape[0]):
        tick = min(tick + 1, last)
        while (
            tick < last
            and np.int64(random_bits(seed, STREAM_RELEASES, tick, 0) >> np.uint64(32)) >= chance
        ):
            tick += 1
        out[k] = tick


# Fine ticks of a refined scenario: where a coarse tick begins and ends.
#
# A coarse tick has K fine ticks. Strategies decide and robots begin operations only in the first;
# in the others, operations continue. Then rules.stride is K; if strategies decide in every tick, it
# is 1. Random draws use the coarse tick in both cases, and take effect in its first fine tick.


@kernel
def next_tick(world):
    """Advance the clock by a tick."""
    clock = world.clock
    clock.tick += 1
    clock.coarse_tick = (clock.tick - 1) // world.rules.refinement + 1


@kernel
def is_begin(world):
    """Whether strategies decide and robots begin operations in this tick."""
    return (world.clock.tick - 1) % world.rules.stride == 0


@kernel
def is_end(world):
    """Whether strategies decide in the next tick."""
    return world.clock.tick % world.rules.stride == 0


@kernel
def is_due(world, strategy):
    """Whether a periodic call of a strategy is due in this coarse tick."""
    period = world.rules.period[strategy]
    return period > 0 and (world.clock.tick + world.rules.stride - 1) % period == 0


@kernel
def chance_decides(world):
    """Whether a coarse tick begins: breakdowns and delays are drawn."""
    return (world.clock.tick - 1) % world.rules.refinement == 0


@kernel
def random_ticks(view, low, high, stream, identity):
    """Uniformly random ticks from low to high, in whole coarse ticks."""
    refinement = view.rules.refinement
    return refinement * random_between(
        low // refinement,
        high // refinement,
        view.rules.seed,
        stream,
        view.clock.coarse_tick,
        identity,
    )
