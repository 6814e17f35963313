"""Random draws that are addressed, not consumed: draw(seed, stream, tick, robot).

A draw depends on nothing but its address, so orders do not change when a router draws more often,
and two strategies face the same demand (common random numbers). The mixer is SplitMix64's
finalizer (Steele, Lea & Flood 2014).
"""

import numpy as np

from automaton.compiled import kernel

# Streams.
ZONES = 0
ORDERS = 1
WAITS = 2
WITHDRAWALS = 3
ABORTS = 4
STARTS = 5
EXTRA_TICKS = 6
CHARGES = 7
RELEASES = 8
BREAKDOWNS = 9
ROUTE_TIES = 10
PREDICTIONS = 11
TRIALS = 12
LEGS = 13
TASK_SETS = 14
GENES = 15
HANDLING = 16
WORKS = 17
STRATEGY = 32  # plug-ins use this one and above

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_A = np.uint64(0xBF58476D1CE4E5B9)
_B = np.uint64(0x94D049BB133111EB)
_30 = np.uint64(30)
_27 = np.uint64(27)
_31 = np.uint64(31)
_32 = np.uint64(32)


@kernel
def mix(value):
    """A bijection of the 64-bit integers."""
    value = (value ^ (value >> _30)) * _A
    value = (value ^ (value >> _27)) * _B
    return value ^ (value >> _31)


@kernel
def draw(seed, stream, tick, robot):
    """64 random bits at an address; `seed` is uint64, the others any integers."""
    state = mix(np.uint64(seed) + _GOLDEN * np.uint64(stream))
    state = mix(state ^ (np.uint64(tick) + _GOLDEN))
    return mix(state ^ (np.uint64(robot) * _GOLDEN + _A))


@kernel
def draw_between(low, high, seed, stream, tick, robot):
    """A uniform integer from low to high, both included."""
    bits = draw(seed, stream, tick, robot) >> _32
    return low + np.int64((bits * np.uint64(high - low + 1)) >> _32)


@kernel
def draw_many(out, count, seed, stream, tick):
    """out[i] = a uniform integer below `count`, addressed by (stream, tick, i)."""
    for i in range(out.shape[0]):
        out[i] = draw_between(0, count - 1, seed, stream, tick, i)


@kernel
def draw_each(out, seed, stream, ticks, robots):
    """out[i] = 64 random bits, addressed by (stream, ticks[i], robots[i])."""
    for i in range(out.shape[0]):
        out[i] = draw(seed, stream, ticks[i], robots[i])
