"""The charging curve, a step function: units per tick by the level at the start of the tick.

A curve is (K, 2) int32: the level from which each piece holds (the first one from 0), and its rate. One
piece is the linear curve. Further pieces make a taper; the time to charge from a to b is then the sum
over the pieces in between, each in whole ticks.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel

# Columns of a curve.
CURVE_FROM = 0
CURVE_RATE = 1


@kernel
def rate_at(curve, level):
    """Units that a tick of charging gives at this level."""
    k = curve.shape[0] - 1
    while k > 0 and curve[k, CURVE_FROM] > level:
        k -= 1
    return np.int64(curve[k, CURVE_RATE])


@kernel
def charging_ticks(curve, low, high):
    """Ticks of charging from level `low` until the level is at least `high`."""
    ticks = np.int64(0)
    level = np.int64(low)
    last = curve.shape[0] - 1
    for k in range(last + 1):
        until = high if k == last else min(high, np.int64(curve[k + 1, CURVE_FROM]))
        if level < until:
            rate = np.int64(curve[k, CURVE_RATE])
            needed = (until - level + rate - 1) // rate
            level += needed * rate
            ticks += needed
    return ticks


@kernel
def level_after(curve, low, ticks, full):
    """The level after so many ticks of charging; never above `full`."""
    level = np.int64(low)
    left = np.int64(ticks)
    last = curve.shape[0] - 1
    for k in range(last + 1):
        rate = np.int64(curve[k, CURVE_RATE])
        if k < last:
            until = np.int64(curve[k + 1, CURVE_FROM])
            used = min(left, max((until - level + rate - 1) // rate, np.int64(0)))
        else:
            used = left
        level += used * rate
        left -= used
    return min(level, np.int64(full))
